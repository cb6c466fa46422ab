//! Plans: what a scene lacks is absent from its plan, and saves what it would have moved.

use drystone::stages::plan::Kernel;
use drystone::stages::plan::StepPlan;
use drystone::stages::problem::ContactSummary;
use drystone::{Backend, Body, Joint, Reference, Shape, Simulation, SolverConfig, World};
use drystone_scenes::Scene;
use glam::Vec3;

/// The plan of a world's next step and the bytes that its kernels move, and the simulation for what else is of interest.
fn planned(world: World, config: SolverConfig) -> (StepPlan, u64, Simulation) {
    let backend = Box::new(Reference::<f32>::new());
    let mut simulation = Simulation::with(world, config, backend).expect("good settings");
    let (problem, plan) = simulation.next_problem(1.0 / 60.0).expect("a step");
    let bytes = plan.bytes_moved(&problem, &ContactSummary::of(&problem));
    (plan, bytes, simulation)
}

/// A row of eight of `shape`, each on the ground and nothing on another.
fn row(shape: &Shape, friction: f32, restitution: f32) -> World {
    let mut world = World::new();
    let surface = |body: Body| body.friction(friction).restitution(restitution);
    world.insert(surface(Body::fixed().shape(Shape::half_space(Vec3::Y))));
    for k in 0..8 {
        world.insert(surface(Body::dynamic().shape(shape.clone()).position(2.0 * k as f32, 0.5, 0.0)));
    }
    world
}

fn cube() -> Shape {
    Shape::cuboid(0.5, 0.5, 0.5)
}

fn brick() -> Shape {
    Shape::cuboid(0.8, 0.5, 0.4)
}

/// A row under the default settings.
fn plan_of(shape: &Shape, friction: f32, restitution: f32) -> (StepPlan, u64) {
    let (plan, bytes, _) = planned(row(shape, friction, restitution), SolverConfig::default().without_sleep());
    (plan, bytes)
}

/// Whether any line of the printed plan contains `word`.
fn says(plan: &StepPlan, word: &str) -> bool {
    plan.to_string().contains(word)
}

#[test]
fn the_plan_of_a_tower_reads_as_the_step_is_told() {
    let scene = Scene::find("tower", &[]).expect("the scene");
    let (plan, ..) = planned(scene.world, SolverConfig::default().without_sleep());
    // Three colors between boxes: two would do for a chain, if its contacts did not choose in an order without a pattern. One for
    // the floor. All are small, so that one workgroup sweeps them.
    let first = "integrate_velocities\nwarm_start(disc friction, isotropic) over colors 0..4\n";
    let later = "integrate_velocities(warm start)\n";
    let sweeps = "\
solve_contacts(biased, isotropic) over colors 0..4
integrate_positions
solve_contacts(disc friction, isotropic) over colors 0..4
";
    assert_eq!(plan.to_string(), [first, sweeps, &[later, sweeps].concat().repeat(7)].concat());
}

#[test]
fn settings_are_in_the_plan() {
    let scene = Scene::find("tower", &[]).expect("the scene");
    let config = SolverConfig::default().without_sleep().with(|c| {
        (c.substeps, c.max_substeps) = (1, 1);
        c.iterations = 2;
        c.relax = 0;
        c.fuse_colors_below = 0;
    });
    let (plan, ..) = planned(scene.world, config);
    let expected = "\
integrate_velocities
warm_start(disc friction, isotropic) over colors 0, 1, 2, 3
solve_contacts(biased, disc friction, isotropic) over colors 0, 1, 2, 3, 0, 1, 2, 3
integrate_positions
";
    assert_eq!(plan.to_string(), expected);
}

#[test]
fn a_world_without_friction_has_none_in_its_plan() {
    let (with, more) = plan_of(&cube(), 0.5, 0.0);
    let (without, fewer) = plan_of(&cube(), 0.0, 0.0);
    assert!(says(&with, "friction") && !says(&without, "friction"), "{without}");
    assert_eq!(with.passes.len(), without.passes.len());
    println!("{more} B with friction, {fewer} B without");
    assert!(fewer < more);
}

#[test]
fn a_world_that_does_not_bounce_has_no_pass_for_it() {
    let plan_at = |speed: f32, restitution: f32| {
        let mut world = row(&cube(), 0.5, restitution);
        let first = world.bodies.handle(1).expect("a cube");
        world.bodies[first].linear_velocity = -speed * Vec3::Y;
        let (plan, bytes, _) = planned(world, SolverConfig::default().without_sleep());
        (plan, bytes)
    };
    let ((with, more), (without, fewer)) = (plan_at(2.0, 0.5), plan_at(2.0, 0.0));
    assert!(!says(&plan_at(0.0, 0.5).0, "apply_restitution"), "nothing meets at speed");
    assert!(says(&with, "apply_restitution") && !says(&without, "apply_restitution"), "{without}");
    assert_eq!(with.passes.len(), without.passes.len() + 8, "one a substep");
    println!("{more} B with restitution, {fewer} B without");
    assert!(fewer < more);
}

#[test]
fn cubes_and_balls_have_no_gyroscopic_pass_and_bricks_have() {
    let (of_bricks, more) = plan_of(&brick(), 0.5, 0.0);
    let (of_cubes, fewer) = plan_of(&cube(), 0.5, 0.0);
    let (of_balls, fewest) = plan_of(&Shape::ball(0.5), 0.5, 0.0);
    assert!(says(&of_bricks, "gyroscopic") && !says(&of_cubes, "gyroscopic") && !says(&of_balls, "gyroscopic"));
    assert_eq!(of_bricks.passes.len(), of_cubes.passes.len() + 8, "one a substep");
    assert_eq!(of_balls.passes.len(), of_cubes.passes.len());
    println!("{more} B for bricks, {fewer} B for cubes, {fewest} B for balls");
    assert!(fewest < fewer && fewer < more);
}

#[test]
fn only_round_surfaces_are_solved_as_round() {
    assert!(says(&plan_of(&Shape::ball(0.5), 0.5, 0.0).0, "round"));
    assert!(!says(&plan_of(&cube(), 0.5, 0.0).0, "round"));
}

#[test]
fn a_world_that_touches_nothing_is_only_integrated() {
    let mut world = row(&cube(), 0.5, 0.5);
    world.remove(world.bodies.handle(0).expect("the ground"));
    let (plan, ..) = planned(world, SolverConfig::default().without_sleep().with(|c| c.substeps = 2));
    assert_eq!(
        plan.to_string(),
        "integrate_velocities\nintegrate_positions\nintegrate_velocities(warm start)\nintegrate_positions\n"
    );
}

/// Measured: 197 of 265 manifolds find no color; the pile is 0.31 mm deep and moves by 5e-7 m/s.
#[test]
fn contacts_that_find_no_color_are_counted_and_solved_all_the_same() {
    let scene = Scene::find("pile", &["n=100".into()]).expect("the scene");
    let config = SolverConfig::default().without_sleep().with(|c| c.max_colors = 1);
    let (_, _, mut simulation) = planned(scene.world.clone(), config);
    let mut stats = drystone::StepStats::default();
    for _ in 0..600 {
        stats = simulation.step(scene.dt).expect("a step");
    }
    assert!(stats.overflow > 0 && stats.colors >= stats.overflow, "{stats:?}");
    let touching = simulation.manifolds().count();
    assert_eq!(touching, stats.manifolds, "a manifold was dropped");
    assert_eq!(scene.escaped(&simulation.world), 0);
    let (deepest, speed) = (simulation.penetration().max, drystone::metrics::rms_speed(&simulation.world));
    println!("{} of {} manifolds overflow; {deepest:.1e} m deep, {speed:.1e} m/s", stats.overflow, stats.manifolds);
    assert!(deepest < 1e-3 && speed < 1e-3, "{deepest} m, {speed} m/s");
}

/// The comparison with the default: no overflow.
#[test]
fn a_pile_needs_no_more_colors_than_there_are() {
    let scene = Scene::find("pile", &["n=100".into()]).expect("the scene");
    let (_, _, mut simulation) = planned(scene.world, SolverConfig::default().without_sleep());
    for _ in 0..120 {
        assert_eq!(simulation.step(scene.dt).expect("a step").overflow, 0);
    }
}

/// Swept joints come before contacts: contacts push a body out of the ground again into which a joint pushed it. Joint
/// systems are exact and come after the contacts: a light body that is hit opens no joint.
#[test]
fn joints_are_swept_before_contacts_and_solved_after_them() {
    use drystone::config::JointSolver;
    let mut world = row(&cube(), 0.5, 0.0);
    let [a, b] = [1, 2].map(|i| world.bodies.handle(i).expect("a cube"));
    world.insert_joint(drystone::Joint::new(a, Vec3::X, b, -Vec3::X));
    let config = SolverConfig::default().with(|c| {
        c.substeps = 1;
        c.iterations = 2;
        c.relax = 1;
    });
    let solved_by = |solver| planned(world.clone(), config.clone().with(|c| c.joint_solver = solver)).0.to_string();
    let expected = "\
integrate_velocities
warm_start_joints over colors 1
warm_start(disc friction, isotropic) over colors 0
solve_joints(biased) over colors 1
solve_contacts(biased, isotropic) over colors 0
solve_joints(biased) over colors 1
solve_contacts(biased, isotropic) over colors 0
integrate_positions
solve_joints() over colors 1
solve_contacts(disc friction, isotropic) over colors 0
";
    assert_eq!(solved_by(JointSolver::Sweeps), expected);
    // At once, they come after the contacts.
    let at_once = |rules: &str, contacts: &str| {
        format!(
            "{contacts}measure_joints({rules}) over colors 1\nsolve_joint_systems({rules})\n\
             apply_joint_changes({rules}) over colors 1\n"
        )
    };
    let [biased, relax] = ["biased, isotropic", "disc friction, isotropic"]
        .map(|rules| format!("solve_contacts({rules}) over colors 0\n"));
    let expected = expected
        .replace(&format!("solve_joints(biased) over colors 1\n{biased}"), &at_once("biased", &biased))
        .replace(&format!("solve_joints() over colors 1\n{relax}"), &at_once("", &relax))
        .replace("integrate_positions\n", "integrate_positions\nturn_inertias\nbegin_systems\n");
    assert_eq!(solved_by(JointSolver::Direct), format!("begin_systems\n{expected}"));
}

/// The first sweep of the contacts that is not biased, as the plan prints it.
fn relax_sweep(config: SolverConfig) -> String {
    let (plan, ..) = planned(row(&cube(), 0.5, 0.0), config);
    let text = plan.to_string();
    let line = text.lines().find(|l| l.starts_with("solve_contacts") && !l.contains("biased"));
    line.unwrap_or_else(|| panic!("{text}")).to_owned()
}

#[test]
fn every_setting_of_a_sweep_is_in_the_plan() {
    use drystone::config::{Clamping, Friction, FrictionAt, FrictionOrder, Stabilization};
    let default = SolverConfig::default;
    assert_eq!(relax_sweep(default()), "solve_contacts(disc friction, isotropic) over colors 0");
    for (config, expected) in [
        (default().with(|c| c.rules.manifold_passes = 2), "disc friction, repeated"),
        (default().with(|c| c.rules.friction_order = FrictionOrder::FrictionFirst), "disc friction, first"),
        (default().with(|c| c.friction_at = FrictionAt::Manifold), "disc friction, per manifold"),
        (default().with(|c| c.tolerance = 1e-3), "disc friction, measured"),
        (default().with(|c| c.rules.slip_friction = true), "slip friction"),
        (default().with(|c| c.friction = Friction::Box), "box friction"),
    ] {
        assert_eq!(relax_sweep(config), format!("solve_contacts({expected}, isotropic) over colors 0"));
    }
    // Impulses that begin at zero are cleared, not carried over.
    let config = default().with(|c| {
        c.rules.clamping = Clamping::PerCorrection;
        c.stabilization = Stabilization::Baumgarte;
        c.relax = 0;
        c.substeps = 2;
    });
    let (plan, ..) = planned(row(&cube(), 0.5, 0.0), config);
    let substep = "\
integrate_velocities
clear_impulses over colors 0
solve_contacts(biased, disc friction, clamped per correction, isotropic) over colors 0
integrate_positions
";
    assert_eq!(plan.to_string(), substep.repeat(2));
}

#[test]
fn momentum_begins_with_the_third_sweep_and_ends_before_the_last_is_measured() {
    use drystone::config::Method;
    let of = |iterations| {
        let config = SolverConfig::default().with(|c| {
            c.substeps = 1;
            c.iterations = iterations;
            c.relax = 0;
            c.method = Method::Accelerated;
        });
        planned(row(&cube(), 0.5, 0.0), config).0.to_string()
    };
    let sweep = "solve_contacts(biased, disc friction, isotropic) over colors 0\n";
    let around = |sweeps: &str| {
        format!(
            "integrate_velocities\nwarm_start(disc friction, isotropic) over colors 0\n{sweeps}integrate_positions\n"
        )
    };
    let twice = sweep.replace("colors 0", "colors 0, 0");
    assert_eq!(of(2), around(&twice));
    let measured = format!("extrapolate\n{sweep}measure_step\nupdate_momentum\n");
    assert_eq!(of(3), around(&[&measured.repeat(2), "extrapolate\n", sweep].concat()));
}

/// Sizes of the rows [bytes]: a body 64, a mass 48, a contact 64, a point 48, an impulse 16. A contact reads two bodies and their
/// masses and writes their velocities, half of a body.
#[test]
fn bytes_moved_are_those_of_the_rows_that_a_pass_names() {
    let contact = 64 + 2 * (64 + 48 + 32);
    // Eight cubes of four points: an impulse is read, or read and written; friction goes over the points again.
    for (name, expected) in [
        ("warm_start(disc friction, isotropic)", 8 * (contact + 4 * (48 + 16))),
        ("solve_contacts(biased, isotropic)", 8 * (contact + 4 * (48 + 2 * 16))),
        ("solve_contacts(disc friction, isotropic)", 8 * (contact + 2 * 4 * (48 + 2 * 16))),
        ("integrate_positions", 9 * (64 + 32)),
    ] {
        let mut simulation = planned(row(&cube(), 0.5, 0.0), SolverConfig::default().without_sleep()).2;
        let (problem, plan) = simulation.next_problem(1.0 / 60.0).expect("a step");
        let mut passes = plan.passes.iter().zip(plan.bytes_of_passes(&problem));
        let (_, bytes) = passes.find(|(p, _)| p.kernel.to_string() == name).unwrap_or_else(|| panic!("{name}: {plan}"));
        assert_eq!(bytes, expected, "{name}");
    }
}

/// One number stands for the inverse inertia of a cube, and nine for that of a brick.
#[test]
fn bodies_with_equal_moments_of_inertia_need_no_tensor_and_move_the_same() {
    assert!(says(&plan_of(&cube(), 0.5, 0.0).0, "isotropic"));
    assert!(!says(&plan_of(&brick(), 0.5, 0.0).0, "isotropic"));
    let scene = Scene::find("pile", &["n=60".into()]).expect("the scene");
    let backend = Box::new(Reference::<f32>::new());
    let mut simulation =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), backend).expect("good settings");
    for _ in 0..80 {
        simulation.step(1.0 / 60.0).expect("a step");
    }
    let (mut problem, mut plan) = simulation.next_problem(1.0 / 60.0).expect("a step");
    let mut with_tensors = problem.clone();
    Reference::<f32>::new().run(&mut problem, &plan.passes).expect("a step");
    let before = plan.passes.clone();
    for pass in &mut plan.passes {
        if let Kernel::SolveContacts(rules) | Kernel::WarmStart(rules) = &mut pass.kernel {
            rules.isotropic = false;
        }
    }
    assert_ne!(before, plan.passes);
    Reference::<f32>::new().run(&mut with_tensors, &plan.passes).expect("a step");
    assert!(problem.impulses.iter().filter(|impulse| impulse.normal > 0.0).count() > 100);
    assert_eq!(problem, with_tensors);
}

/// A cube that lies, and one that hangs on a joint and bears a heavy ball: from the second step on the joints add inertia to the second cube
/// across their arms.
fn one_lies_and_one_hangs() -> World {
    let mut world = row(&cube(), 0.5, 0.0);
    let hung = world.insert(Body::dynamic().shape(cube()).position(0.0, 20.0, 0.0));
    let load = world.insert(Body::dynamic().shape(Shape::ball(0.1)).total_mass(1e8).position(0.0, 17.0, 0.0));
    world.insert_joint(Joint::to_world(hung, Vec3::new(0.0, 0.5, 0.0), Vec3::new(0.0, 20.5, 0.0)));
    world.insert_joint(Joint::new(hung, Vec3::new(0.0, -0.5, 0.0), load, Vec3::new(0.0, 2.5, 0.0)));
    world
}

#[test]
fn a_plan_is_kept_only_while_it_is_that_of_its_problem() {
    // All islands are in one block.
    let config = SolverConfig::default().without_sleep().with(|c| c.max_substeps = c.substeps);
    let backend = Box::new(Reference::<f32>::new());
    let mut simulation = Simulation::with(one_lies_and_one_hangs(), config.clone(), backend).expect("good settings");
    let mut isotropic = [0; 2];
    for step in 0..6 {
        let (problem, plan) = simulation.next_problem(1.0 / 60.0).expect("a step");
        assert_eq!(plan, StepPlan::new(&config, &problem), "step {step}");
        isotropic[usize::from(says(&plan, "isotropic"))] += 1;
        simulation.step(1.0 / 60.0).expect("a step");
    }
    assert!(isotropic.iter().all(|&steps| steps > 0), "{isotropic:?} steps without and with equal moments of inertia");
}

//! Rows that stay on a device from step to step: the reference's to the last bit when somebody asks, and hardly anything
//! travels.

use crate::common::gpu;
use drystone::config::FrictionAt;
use drystone::glam::{Quat, Vec3};
use drystone::stages::backend::CheckedStep;
use drystone::stages::backend::shader::WrittenContact;
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{Carry, Written};
use drystone::stages::problem::{ContactRow, ConvergenceRow, MomentumRow};
use drystone::stats::Traffic;
use drystone::{Backend, Body, Gpu, Reference, Result, Shape, Simulation, SolverConfig, World};
use drystone_conform::compare::Difference;
use drystone_scenes::Scene;

tests! {
    exact_gpu {
        what_is_asked_for_has_the_bits_of_the_reference,
        what_somebody_changes_between_two_steps_reaches_the_device,
        islands_fall_asleep_and_wake_with_their_impulses,
        an_island_with_another_class_begins_from_the_rows_of_the_device,
        a_backend_that_takes_over_goes_on_from_the_rows_of_the_device,
        a_run_that_is_saved_or_goes_back_takes_the_rows_of_the_device_along,
        impulses_at_the_wrong_points_are_found,
        rows_that_are_not_there_are_refused,
        a_device_carries_the_friction_of_patches_to_manifolds_that_are_computed_anew,
        a_device_carries_no_friction_that_a_surface_lost,
        a_device_takes_rows_of_another_layout,
        a_device_takes_the_points_that_are_sent,
        a_device_bounces_with_the_bits_of_the_reference,
        a_body_that_is_placed_on_a_tower_begins_on_a_device_with_what_it_rests_with,
    }
    any_gpu {
        the_first_step_sends_everything_and_a_settled_one_how_far_points_are_apart,
        a_small_world_is_one_dispatch_after_those_that_carry_its_rows,
        a_falling_pile_sends_what_was_computed_and_the_order,
    }
}

fn simulation(scene: &Scene, config: &SolverConfig, backend: Box<dyn Backend>) -> Simulation {
    Simulation::with(scene.world.clone(), config.clone(), backend).expect("good settings")
}

fn pile(n: usize) -> Scene {
    Scene::find("pile", &[format!("n={n}")]).expect("a scene of the catalogue")
}

/// Everything that a step leaves behind, as bytes: of the contacts those that take part, in the order of the sweeps.
fn rows(problem: &StepProblem) -> [Vec<u8>; 5] {
    let patch = problem.params.patches;
    let own = |c: &ContactRow| c.first_point as usize..(c.first_point + c.point_count + patch) as usize;
    let contacts: Vec<_> = problem.swept_contacts().copied().collect();
    let points: Vec<_> = contacts.iter().flat_map(|c| problem.points[own(c)].iter().copied()).collect();
    let impulses: Vec<_> = contacts.iter().flat_map(|c| problem.impulses[own(c)].iter().copied()).collect();
    [
        bytemuck::cast_slice(&problem.bodies).to_vec(),
        bytemuck::cast_slice(&contacts).to_vec(),
        bytemuck::cast_slice(&points).to_vec(),
        bytemuck::cast_slice(&impulses).to_vec(),
        bytemuck::cast_slice(&problem.joint_impulses).to_vec(),
    ]
}

/// The reference and a GPU in exact mode on the same scene.
fn both(scene: &Scene, config: &SolverConfig) -> [Simulation; 2] {
    [Box::new(Reference::<f32>::new()) as Box<dyn Backend>, Box::new(gpu::exact())]
        .map(|b| simulation(scene, config, b))
}

fn assert_together([ours, theirs]: &[Simulation; 2], what: &str) {
    let apart = Difference::between(&ours.world, &theirs.world);
    assert_eq!(apart.bodies, 0, "{what}: {apart:?}");
}

fn assert_same(both: &mut [Simulation; 2], what: &str) {
    assert_together(both, what);
    let [ours, theirs] = both;
    for (name, (ours, theirs)) in ["bodies", "contacts", "points", "impulses", "joint impulses"]
        .iter()
        .zip(rows(ours.problem()).iter().zip(&rows(theirs.problem())))
    {
        let first = ours.iter().zip(theirs).position(|(a, b)| a != b);
        assert!(ours.len() == theirs.len() && first.is_none(), "{what}: {name} differ from byte {first:?} on");
    }
}

fn what_is_asked_for_has_the_bits_of_the_reference() {
    let scene = pile(100);
    let mut both = both(&scene, &SolverConfig::default().without_sleep());
    let (mut computed, mut reused) = (0, 0);
    for step in 1..=120 {
        let stats = both.each_mut().map(|s| s.step(scene.dt).expect("a step"));
        computed += stats[1].computed;
        reused += stats[1].pairs - stats[1].computed;
        let what = format!("step {step}");
        // Asked for seldom, so that rows stay for several steps.
        match step % 12 {
            0 => assert_same(&mut both, &what),
            4 => {
                let manifolds =
                    both.each_mut().map(|s| s.manifolds().map(|manifold| format!("{manifold:?}")).collect::<Vec<_>>());
                assert_eq!(manifolds[0], manifolds[1], "{what}");
            }
            // Detections between two steps.
            7 => {
                let deepest = both.each_mut().map(|s| s.penetration().max);
                assert_eq!(deepest[0].to_bits(), deepest[1].to_bits(), "{what}");
            }
            // A step that is assembled and not run.
            9 => drop(both.each_mut().map(|s| s.next_problem(scene.dt).expect("a step").0.contacts.len())),
            _ => {}
        }
    }
    assert!(computed > 100 && reused > 1000, "{computed} computed, {reused} reused: hardly a test");
}

/// A ball that bounces so low that its contact stays.
fn a_device_bounces_with_the_bits_of_the_reference() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).restitution(0.95));
    world.insert(Body::dynamic().shape(Shape::ball(0.5)).restitution(0.95).position(0.0, 0.504, 0.0));
    let config = SolverConfig::default().without_sleep().with(|c| c.restitution_threshold = 0.1);
    let mut both = [Box::new(Reference::<f32>::new()) as Box<dyn Backend>, Box::new(gpu::exact())]
        .map(|backend| Simulation::with(world.clone(), config.clone(), backend).expect("a good world"));
    let (mut bounces, mut before) = (0, 0.0);
    for step in 1..=60 {
        let stats = both.each_mut().map(|simulation| simulation.step(1.0 / 60.0).expect("a step"));
        assert_eq!(stats[0].manifolds, 1, "step {step}");
        assert_together(&both, &format!("step {step}"));
        let speed = both[0].world.bodies[1].linear_velocity.y;
        // Gravity takes 0.16 m/s a step.
        bounces += u32::from(speed > before + 0.1);
        before = speed;
    }
    assert!(bounces > 5, "{bounces} bounces");
}

fn what_somebody_changes_between_two_steps_reaches_the_device() {
    let scene = pile(60);
    let mut both = both(&scene, &SolverConfig::default().without_sleep());
    for step in 1..=100 {
        for simulation in &mut both {
            match step {
                40 => simulation.world.bodies[30].linear_velocity.y += 3.0,
                45 => simulation.world.bodies[25].mass.mass *= 3.0,
                50 => simulation.world.bodies[40].position.y += 0.01,
                60 => simulation.world.bodies[20].force.x = 1e4,
                70 => simulation.world.gravity.x = 2.0,
                80 => simulation
                    .set_config(SolverConfig::default().without_sleep().with(|c| c.substeps = 4))
                    .expect("good"),
                90 => simulation
                    .set_config(SolverConfig::default().without_sleep().with(|c| c.warm_start = false))
                    .expect("good"),
                _ => {}
            }
            let dt = if (53..57).contains(&step) { 0.5 * scene.dt } else { scene.dt };
            simulation.step(dt).expect("a step");
        }
        if step % 10 == 3 || [45, 46, 54, 57].contains(&step) {
            assert_same(&mut both, &format!("step {step}"));
        }
    }
}

/// A load comes on a stack, stays and is taken away.
fn an_island_with_another_class_begins_from_the_rows_of_the_device() {
    let mut scene = Scene::find("stack", &["n=3".into()]).expect("a scene of the catalogue");
    let load = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).density(3e5).position(9.0, 0.5, 0.0);
    let load = scene.world.insert(load);
    let lowest = scene.world.bodies.handle(1).expect("a cube");
    let mut both = both(&scene, &SolverConfig::default().without_sleep());
    let mut substeps = Vec::new();
    for step in 1..=160 {
        for simulation in &mut both {
            match step {
                20 => simulation.world.bodies[load].position = Vec3::new(0.0, 3.5, 0.0),
                50 => simulation.world.bodies[load].position = Vec3::new(9.0, 0.5, 0.0),
                _ => {}
            }
            simulation.step(scene.dt).expect("a step");
        }
        assert_together(&both, &format!("step {step}"));
        substeps.push(both.each_ref().map(|s| s.substeps_of(lowest)));
    }
    assert_same(&mut both, "the last step");
    substeps.dedup();
    let ours: Vec<u32> = substeps.iter().map(|s| s[0]).collect();
    assert!(substeps.iter().all(|s| s[0] == s[1]) && ours.len() > 2 && ours.iter().max() > ours.last(), "{substeps:?}");
}

fn islands_fall_asleep_and_wake_with_their_impulses() {
    let mut scene = pile(60);
    // Touches nothing, so that there is something to do while all others sleep.
    scene.world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(1e3, 1e3, 0.0));
    let config = SolverConfig::default().with(|c| c.sleep_after = 0.5);
    let mut both = both(&scene, &config);
    let mut fewest = [usize::MAX; 2];
    for step in 1..=420 {
        for simulation in &mut both {
            if step == 400 {
                simulation.world.bodies[30].linear_velocity.y += 2.0;
            }
            let stats = simulation.step(scene.dt).expect("a step");
            let phase = usize::from(step >= 400);
            fewest[phase] = fewest[phase].min(if step > 200 { stats.manifolds } else { usize::MAX });
        }
        assert_together(&both, &format!("step {step}"));
    }
    measured!("{fewest:?} manifolds at least, before and after something is pushed");
    assert!(fewest[0] < fewest[1], "nothing slept, or nothing woke: {fewest:?}");
    assert_same(&mut both, "at the end");
}

fn a_backend_that_takes_over_goes_on_from_the_rows_of_the_device() {
    let scene = pile(60);
    let mut both = both(&scene, &SolverConfig::default().without_sleep());
    for step in 1..=60 {
        if step == 40 {
            both[1].set_backend(Box::new(Reference::<f32>::new()));
        }
        both.iter_mut().for_each(|s| drop(s.step(scene.dt).expect("a step")));
    }
    assert_same(&mut both, "at the end");
}

fn a_run_that_is_saved_or_goes_back_takes_the_rows_of_the_device_along() {
    let scene = pile(60);
    let [mut ours, mut theirs] = both(&scene, &SolverConfig::default());
    for _ in 0..40 {
        [&mut ours, &mut theirs].into_iter().for_each(|s| drop(s.step(scene.dt).expect("a step")));
    }
    let bytes = theirs.save();
    assert!(bytes == ours.save(), "the device has another state");
    let snapshot = theirs.snapshot();
    let on_device = Simulation::load(&bytes, Box::new(gpu::exact())).expect("the bytes of a run");
    let at_home = Simulation::load(&bytes, Box::new(Reference::<f32>::new())).expect("the bytes of a run");
    let forked = theirs.fork(Box::new(gpu::exact()));
    (0..5).for_each(|_| drop(theirs.step(scene.dt).expect("a step")));
    theirs.restore(&snapshot);
    let mut all = [theirs, on_device, at_home, forked];
    for step in 0..30 {
        ours.step(scene.dt).expect("a step");
        for (which, simulation) in all.iter_mut().enumerate() {
            simulation.step(scene.dt).expect("a step");
            assert_eq!(simulation.hash(), ours.hash(), "run {which}, step {step}");
        }
    }
}

/// A GPU that is told wrong things of the rows that were written again.
struct Confused(gpu::Lent, fn(&mut Carry));

impl Backend for Confused {
    fn name(&self) -> &'static str {
        "confused"
    }
    fn adapter(&self) -> String {
        self.0.adapter()
    }
    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        self.0.run_checked(step)
    }
    fn step(&mut self, step: CheckedStep, carry: &Carry) -> Result<()> {
        let mut carry = carry.clone();
        if carry.written.len() > 1 {
            (self.1)(&mut carry);
        }
        self.0.step(step, &carry)
    }
    fn keeps_rows(&self) -> bool {
        self.0.keeps_rows()
    }
}

fn impulses_at_the_wrong_points_are_found() {
    let scene = pile(60);
    let [mut ours, _] = both(&scene, &SolverConfig::default().without_sleep());
    let reverse = |carry: &mut Carry| carry.written.iter_mut().for_each(|written| written.points_before.reverse());
    let confused = Confused(gpu::exact(), reverse);
    let mut theirs = simulation(&scene, &SolverConfig::default().without_sleep(), Box::new(confused));
    for _ in 0..80 {
        ours.step(scene.dt).expect("a step");
        theirs.step(scene.dt).expect("a step");
    }
    assert!(rows(ours.problem()) != rows(theirs.problem()), "no impulse was missed");
}

/// Kernels would write other rows in their place.
fn rows_that_are_not_there_are_refused() {
    let scene = pile(60);
    let spoil = |carry: &mut Carry| carry.written.iter_mut().take(1).for_each(|written| written.row = 1 << 20);
    let confused = Box::new(Confused(gpu::exact(), spoil));
    let mut simulation = simulation(&scene, &SolverConfig::default().without_sleep(), confused);
    let line = (0..80).find_map(|_| simulation.step(scene.dt).err()).expect("the row is refused");
    assert!(line.to_string().starts_with("contacts written again: a row does not exist"), "{line}");
}

/// The traffic to the device and back in each of the last steps of a scene, and the simulation.
fn traffic_of(scene: &Scene, steps: u32, last: u32) -> (Vec<Traffic>, Simulation) {
    traffic_on(gpu::own_plain(), scene, steps, last)
}

fn traffic_on(gpu: Gpu, scene: &Scene, steps: u32, last: u32) -> (Vec<Traffic>, Simulation) {
    let mut simulation = simulation(scene, &SolverConfig::default().without_sleep(), Box::new(gpu));
    let mut all: Vec<_> = (0..steps).map(|_| simulation.step(scene.dt).expect("a step").traffic).collect();
    (all.split_off((steps - last) as usize), simulation)
}

/// Bytes of all rows of a problem.
fn all_rows(problem: &StepProblem) -> usize {
    rows(problem).iter().map(Vec::len).sum::<usize>() + size_of_val(&problem.masses[..])
}

/// The bytes that come back from every step.
fn moved(problem: &StepProblem) -> u64 {
    let of_contacts = size_of_val(&problem.impulses[..]);
    (size_of_val(&problem.bodies[..]) + of_contacts + size_of::<ConvergenceRow>() + size_of::<MomentumRow>()) as u64
}

fn the_first_step_sends_everything_and_a_settled_one_how_far_points_are_apart() {
    let scene = pile(200);
    let (first, simulation) = traffic_of(&scene, 1, 1);
    assert!(first[0].up as usize >= all_rows(simulation.problem()), "{first:?}");
    let (settled, simulation) = traffic_of(&scene, 400, 10);
    let problem = simulation.problem();
    let separations = 4 * size_of::<f32>() * problem.swept_contacts().count();
    let least = settled.iter().map(|t| t.up).min().expect("ten steps") as usize;
    let (all, contacts) = (all_rows(problem), problem.swept_contacts().count());
    measured!("{contacts} manifolds: {least} B up of {all} B of rows, {separations} B of them separations");
    // Nothing but separations and the words of the carry itself.
    assert!((separations..separations + 512).contains(&least), "{settled:?}");
    assert!(settled.iter().all(|t| t.down == moved(problem)), "{settled:?}");
    assert!(least * 20 < all);
}

fn a_small_world_is_one_dispatch_after_those_that_carry_its_rows() {
    let scene = Scene::find("tower", &[]).expect("a scene of the catalogue");
    let (settled, simulation) = traffic_of(&scene, 100, 1);
    assert!(simulation.plan().passes.len() > 20);
    // begin_bodies and begin_contacts; write_contacts where a manifold was computed.
    assert!((3..=4).contains(&settled[0].dispatches), "{settled:?}");
    // Hardware runs four times as many bodies in one dispatch as a software adapter.
    for (as_hardware, fit, too_many) in [(false, 230, 280), (true, 1000, 1050)] {
        if gpu::own_plain().summary().hardware && !as_hardware {
            continue;
        }
        let dispatches = [fit, too_many].map(|n| {
            let gpu = gpu::own_plain();
            let gpu = if as_hardware { gpu.cut_as_hardware() } else { gpu };
            let (falling, simulation) = traffic_on(gpu, &pile(n), 2, 1);
            (falling[0].dispatches, simulation.plan().passes.len())
        });
        assert!(dispatches[0].0 <= 3 && dispatches[1].0 > dispatches[1].1, "{as_hardware}: {dispatches:?}");
    }
}

fn a_falling_pile_sends_what_was_computed_and_the_order() {
    let scene = pile(200);
    let mut steps = 0;
    let (_, mut simulation) = traffic_of(&scene, 60, 1);
    for _ in 0..30 {
        let stats = simulation.step(scene.dt).expect("a step");
        // Four separations and a place in the order for all, manifolds and up to four pairs of arms for those that were computed.
        let computed =
            stats.computed * (size_of::<WrittenContact>() + 4 * size_of::<[[f32; 3]; 2]>() + size_of::<Written>());
        let most = stats.manifolds * (16 + 4) + computed + 2048;
        assert!(stats.traffic.up as usize <= most, "{:?} of {most}: {stats:?}", stats.traffic);
        assert_eq!(stats.traffic.down, moved(simulation.problem()));
        steps += usize::from(stats.computed > 0 && stats.computed < stats.pairs);
    }
    assert!(steps > 10, "in {steps} steps only some were computed");
}

/// Steps of the reference and of a device that keeps its rows: the same bits in every one of them.
fn same_on_a_device(world: World, config: &SolverConfig, steps: u32, change: impl Fn(u32, &mut World)) {
    let backends: [Box<dyn Backend>; 2] = [Box::new(Reference::<f32>::new()), Box::new(gpu::exact())];
    let mut both =
        backends.map(|backend| Simulation::with(world.clone(), config.clone(), backend).expect("good settings"));
    for step in 0..steps {
        for simulation in &mut both {
            change(step, &mut simulation.world);
            simulation.step(1.0 / 60.0).expect("a step");
        }
        let apart = Difference::between(&both[0].world, &both[1].world);
        assert_eq!(apart, Difference::default(), "step {step}");
    }
}

/// Cubes that slide down a slope, so that what holds them is carried over to manifolds that are computed anew.
fn sliding() -> World {
    let mut world = World::new();
    world.gravity =
        Quat::from_rotation_y(0.4) * Quat::from_rotation_z(std::f32::consts::FRAC_PI_6) * Vec3::NEG_Y * 9.81;
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(0.5));
    for x in [0.0, 3.0, 6.0] {
        world.insert(
            Body::dynamic()
                .shape(Shape::cuboid(0.5, 0.5, 0.5))
                .friction(0.5)
                .position(x, 0.5, 0.0)
                .velocity(Vec3::ZERO, Vec3::Y * x),
        );
    }
    world
}

fn a_device_carries_the_friction_of_patches_to_manifolds_that_are_computed_anew() {
    let config = SolverConfig::default().without_sleep().with(|c| c.friction_at = FrictionAt::Manifold);
    same_on_a_device(sliding(), &config, 40, |_, _| ());
}

fn a_device_carries_no_friction_that_a_surface_lost() {
    same_on_a_device(sliding(), &SolverConfig::default().without_sleep(), 40, |step, world| {
        if step == 20 {
            // The others keep theirs, so that friction is in the plan.
            world.bodies[1].material.friction = 0.0;
            world.bodies[1].position.x += 0.02;
        }
    });
}

/// With rolling or spinning friction, each manifold gets one more row, which means something else with rolling friction.
fn a_device_takes_rows_of_another_layout() {
    for spinning_friction in [0.0, 0.02] {
        same_on_a_device(sliding(), &SolverConfig::default().without_sleep(), 40, |step, world| {
            let material = &mut world.bodies[0].material;
            material.spinning_friction = spinning_friction;
            material.rolling_friction = if (10..25).contains(&step) { 0.02 } else { 0.0 };
        });
        // A body that comes and goes brings the rolling friction: no other row is written again because of it.
        same_on_a_device(sliding(), &SolverConfig::default().without_sleep(), 40, |step, world| {
            world.bodies[0].material.spinning_friction = spinning_friction;
            if step == 10 {
                let mut ball = Body::dynamic().shape(Shape::ball(0.5)).position(-3.0, 0.5, 0.0);
                ball.material.rolling_friction = 0.02;
                world.insert(ball);
            } else if step == 25 {
                let ball = world.bodies.handles().last().expect("the ball");
                world.remove(ball);
            }
        });
    }
}

/// Where surfaces bounce, or friction has the direction of a slip, points change from step to step, and are sent.
fn a_device_takes_the_points_that_are_sent() {
    let mut bouncing = sliding();
    bouncing.bodies.iter_mut().for_each(|body| body.material.restitution = 0.7);
    bouncing.bodies[1].position.y += 1.0;
    same_on_a_device(bouncing, &SolverConfig::default().without_sleep(), 40, |_, _| ());
    let config = SolverConfig::default().without_sleep().with(|c| c.rules.slip_friction = true);
    same_on_a_device(sliding(), &config, 40, |_, _| ());
}

/// The impulses and preloads of such a body, and what they add to those below, are made by the processor.
fn a_body_that_is_placed_on_a_tower_begins_on_a_device_with_what_it_rests_with() {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let cube = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
    for k in 0..4 {
        world.insert(cube.clone().position(0.0, 0.5 + k as f32, 0.0));
    }
    let late = world.insert(cube.position(5.0, 0.5, 0.0));
    for config in [SolverConfig::default(), SolverConfig::default().without_sleep()] {
        same_on_a_device(world.clone(), &config, 80, |step, world| {
            if step == 60 {
                let body = &mut world.bodies[late];
                (body.position, body.linear_velocity, body.angular_velocity) =
                    (Vec3::new(0.2, 4.5, 0.0), Vec3::ZERO, Vec3::ZERO);
            }
        });
    }
}

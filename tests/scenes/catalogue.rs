//! The claims of the catalogue's entries, with default settings and small sizes.

use drystone::glam::Vec3;
use drystone::metrics::{in_place, rms_speed};
use drystone::{Backend, Body, BodyKind, Bounds, ColliderOf, Cpu, Event, Reference, Simulation, SolverConfig};
use drystone_scenes::{CATALOGUE, Scene, Spawners};

/// A scene of the catalogue, and its simulation after some steps.
fn run(name: &str, parameters: &[&str], steps: u32) -> (Scene, Simulation) {
    let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
    let scene = Scene::find(name, &parameters).expect(name);
    let reference = Box::new(Reference::<f32>::new());
    let mut simulation =
        Simulation::with(scene.world.clone(), SolverConfig::default().without_sleep(), reference).expect(name);
    step(&mut simulation, steps);
    (scene, simulation)
}

fn step(simulation: &mut Simulation, steps: u32) {
    for _ in 0..steps {
        simulation.step(1.0 / 60.0).expect("a step");
    }
}

/// The only dynamic body.
fn only(simulation: &Simulation) -> &Body {
    simulation.world.bodies.iter().find(|b| b.kind == BodyKind::Dynamic).expect("a dynamic body")
}

/// Dynamic bodies that are not in place.
fn fallen(scene: &Scene, simulation: &Simulation) -> usize {
    let both = scene.world.bodies.iter().zip(&simulation.world.bodies);
    both.filter(|(before, after)| after.kind == BodyKind::Dynamic && !in_place(before, after)).count()
}

/// That what cannot move pushes up with the weight of all that can, so that nothing only hangs in the air.
fn bears_its_weight(name: &str, simulation: &mut Simulation) {
    let manifolds: Vec<_> = simulation.manifolds().collect();
    let world = &simulation.world;
    let is_fixed = |side: ColliderOf| world.bodies[side.body].kind == BodyKind::Fixed;
    let mut pushed = Vec3::ZERO;
    for m in manifolds.iter().filter(|m| is_fixed(m.a) || is_fixed(m.b)) {
        let sum: Vec3 = m.points().iter().map(|p| m.normal * p.normal_impulse + p.friction_impulse).sum();
        let substep = 1.0 / 60.0 / m.substeps as f32;
        pushed += if is_fixed(m.a) { sum } else { -sum } / substep;
    }
    let dynamic = world.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic);
    let weight = -world.gravity * dynamic.map(|b| b.mass.mass).sum::<f32>();
    assert!(pushed.distance(weight) < 0.02 * weight.length(), "{name}: {pushed} N of {weight}");
}

fn energy(simulation: &Simulation) -> f64 {
    simulation.world.kinetic_energy() + simulation.world.potential_energy()
}

#[test]
fn every_scene_stands_on_the_page_of_pictures() {
    let docs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let page = std::fs::read_to_string(docs.join("gallery.md")).expect("the page");
    for entry in CATALOGUE {
        let section = format!("## {}\n\n{}\n", entry.name, entry.summary);
        assert!(page.contains(&section), "docs/gallery.md lacks {section}");
        assert!(docs.join("gallery").join(format!("{}.png", entry.name)).is_file(), "no picture of {}", entry.name);
    }
}

/// Colors that follow rows of bricks let a wall rattle at 23 mm/s for ever, although every brick stays in its place.
#[test]
fn a_wall_rests() {
    let scene = Scene::find("wall", &[]).expect("the scene");
    let lanes = Box::new(Cpu::new());
    let mut simulation =
        Simulation::with(scene.world.clone(), SolverConfig::default().without_sleep(), lanes).expect("a simulation");
    step(&mut simulation, 300);
    let speed = rms_speed(&simulation.world);
    assert!(speed < 1e-3 && fallen(&scene, &simulation) == 0, "{speed:e} m/s");
    bears_its_weight("wall", &mut simulation);
}

#[test]
fn a_ball_dropped_on_a_half_space_rests_on_it() {
    let ball = only(&run("sphere-plane", &["height=1"], 120).1).clone();
    assert!((ball.position.y - 0.5).abs() < 1e-4 && ball.linear_velocity.length() < 1e-4, "{ball:?}");
}

#[test]
fn a_block_on_a_slope_sticks_or_slides_with_the_acceleration_of_coulomb() {
    let (scene, simulation) = run("slide", &["angle=20", "mu=0.4"], 120);
    let moved = only(&simulation).position.distance(only(&run("slide", &["angle=20"], 0).1).position);
    assert!(scene.stands && moved < 1e-3, "{moved}");
    let (scene, simulation) = run("slide", &["angle=20", "mu=0.2"], 120);
    let (sin, cos) = 20_f32.to_radians().sin_cos();
    let (speed, exact) = (only(&simulation).linear_velocity.length(), 2.0 * 9.81 * (sin - 0.2 * cos));
    assert!(!scene.stands && (speed / exact - 1.0).abs() < 0.005, "{speed} m/s, {exact} m/s exactly");
}

#[test]
fn a_ball_rolls_down_a_slope_without_slipping() {
    let ball = only(&run("roll", &["angle=20"], 120).1).clone();
    let (speed, exact) = (ball.linear_velocity.length(), 2.0 * 9.81 * 5.0 / 7.0 * 20_f32.to_radians().sin());
    assert!((speed / exact - 1.0).abs() < 0.002, "{speed} m/s, {exact} m/s exactly");
    let slip = (speed - 0.5 * ball.angular_velocity.length()).abs();
    assert!(slip < 1e-3 * speed, "{slip} m/s");
}

#[test]
fn small_standing_scenes_stand() {
    for (name, parameters) in [
        ("stack", vec!["n=8"]),
        ("misaligned", vec!["n=8"]),
        ("mass-ratio", vec!["n=6"]),
        ("pyramid-heavy", vec!["base=4"]),
        ("card-house", vec!["storeys=2"]),
        ("many-pyramids", vec!["n=5", "base=4"]),
        ("arch", vec![]),
    ] {
        let (scene, mut simulation) = run(name, &parameters, 90);
        assert!(scene.stands);
        assert_eq!(fallen(&scene, &simulation), 0, "{name}");
        bears_its_weight(name, &mut simulation);
    }
}

#[test]
fn an_arch_that_is_too_thin_falls_and_cards_that_are_too_smooth_slip() {
    for (name, parameter) in [("arch", "thickness=0.09"), ("card-house", "mu=0.2")] {
        let (scene, simulation) = run(name, &[parameter], 120);
        assert!(fallen(&scene, &simulation) > 2, "{name}");
    }
}

#[test]
fn a_stack_stands_until_the_ball_hits_it() {
    let (scene, mut simulation) = run("throw", &["n=6"], 50);
    assert_eq!(fallen(&scene, &simulation), 1, "the ball moves, the stack does not");
    step(&mut simulation, 70);
    assert!(fallen(&scene, &simulation) > 3);
}

#[test]
fn a_pendulum_keeps_its_energy() {
    let mut simulation = run("pendulum", &["angle=90"], 0).1;
    let before = energy(&simulation);
    let deepest = 9.81 * f64::from(only(&simulation).mass.mass);
    let mut fastest = 0.0_f64;
    for _ in 0..300 {
        step(&mut simulation, 1);
        fastest = fastest.max(simulation.world.kinetic_energy());
    }
    assert!(fastest > 0.98 * deepest, "it swings through the lowest point: {fastest} J of {deepest}");
    let lost = (before - energy(&simulation)) / deepest;
    assert!(lost.abs() < 0.005, "{lost} of what it has at the bottom");
}

#[test]
fn jointed_scenes_stay_together_and_gain_no_energy() {
    for (name, parameters) in [
        ("chain", ["links=8", "ratio=10"]),
        ("chain", ["links=8", "angle=0"]),
        ("bridge", ["planks=10", "boxes=3"]),
        ("joint-grid", ["n=6", "n=6"]),
    ] {
        let (scene, mut simulation) = run(name, &parameters, 0);
        // The steps of symplectic Euler swing about the energy less this: h/2 times the power of gravity.
        let swing = |simulation: &Simulation| {
            let power = |b: &drystone::Body| f64::from(b.mass.mass * b.linear_velocity.dot(simulation.world.gravity));
            0.5 * f64::from(scene.dt) / 8.0 * simulation.world.bodies.iter().map(power).sum::<f64>()
        };
        let before = energy(&simulation);
        let mut gap = 0.0_f32;
        for _ in 0..90 {
            step(&mut simulation, 1);
            gap = gap.max(simulation.world.joint_gap());
        }
        assert!(gap < 0.01, "{name}: {gap} m");
        let gained = energy(&simulation) + swing(&simulation) - before;
        println!("{name} {parameters:?}: {gained} J gained of {before}");
        assert!(gained < 1.0, "{name}: {gained} J");
        // Its weight at least stretches what it hangs on, or is borne by joints that are solved at once.
        let both = scene.world.bodies.iter().zip(&simulation.world.bodies);
        let moved = both.map(|(was, is)| was.position.distance(is.position)).fold(0.0, f32::max);
        println!("{name} {parameters:?}: {moved} m");
        let weight: f32 = scene.world.bodies.iter().map(|b| b.mass.mass * 9.81).sum();
        let first = simulation.joint_impulse(simulation.world.joints.handles()[0]).expect("a joint");
        let borne = first.length() * 8.0 / scene.dt;
        let hangs_still = parameters[1] == "angle=0" && (borne / weight - 1.0).abs() < 1e-3;
        assert!(moved > 1e-5 || hangs_still, "{name}: {moved} m in 1.5 s, {borne} N of {weight}");
    }
}

#[test]
fn boxes_stay_on_the_bridge_and_in_the_drum() {
    // Joints that are solved at once stretch by a fraction of a millimeter under the boxes.
    for (name, parameters, least) in [("bridge", ["planks=10", "boxes=5"], 5e-4), ("drum", ["n=20", "speed=2"], 0.1)] {
        let (scene, simulation) = run(name, &parameters, 240);
        assert_eq!(scene.escaped(&simulation.world), 0, "{name}");
        let both = scene.world.bodies.iter().zip(&simulation.world.bodies);
        let boxes = both.filter(|(was, _)| was.kind == BodyKind::Dynamic);
        let farthest = boxes.map(|(was, is)| was.position.distance(is.position)).fold(0.0, f32::max);
        println!("{name}: {farthest} m");
        assert!(farthest > least, "{name}: nothing moved by more than {farthest} m in 4 s");
    }
}

#[test]
fn every_domino_falls() {
    let simulation = run("dominoes", &["n=6"], 160).1;
    let tilts = simulation.world.bodies[1..].iter().map(|b| (b.rotation * Vec3::Y).y);
    let upright: Vec<_> = tilts.filter(|&y| y > 0.5).collect();
    assert!(upright.is_empty(), "{upright:?}");
}

/// Falls at g/d with damping d and at the largest speed; then an arm on its cone, a flag at sin(angle) = load, and a lamp
/// that has sunk by m g/k. A crate with locked axes comes down the stairs and keeps its plane and its rotation to the bit.
#[test]
fn every_body_of_held_obeys_its_formula() {
    for [damping, cone, load] in [[3.0, 30.0, 0.5], [6.0, 60.0, 0.8]] {
        let parameters = [format!("damping={damping}"), format!("cone={cone}"), format!("load={load}")];
        let scene = Scene::find("held", &parameters).expect("held");
        let mut simulation =
            Simulation::with(scene.world, SolverConfig::default().without_sleep(), Box::new(Reference::<f32>::new()))
                .expect("a world");
        step(&mut simulation, 90);
        let named = |simulation: &Simulation, name: &str| {
            let found = simulation.world.bodies.iter().find(|body| body.name == name);
            found.expect("the body").clone()
        };
        let [damped, slow] = ["damped", "slow"].map(|name| -named(&simulation, name).linear_velocity.y);
        let expected = 9.81 / damping * (1.0 - (-damping * 1.5_f32).exp());
        assert!(
            (damped - expected).abs() < 1e-3 && (slow - 2.0).abs() < 1e-5,
            "{damped}, not {expected} m/s; {slow} m/s"
        );
        step(&mut simulation, 810);
        let leans = |name: &str| (named(&simulation, name).rotation * Vec3::Y).angle_between(Vec3::Y).to_degrees();
        let (arm, flag) = (leans("arm"), leans("flag"));
        // Pushed with three times its weight, it would lean by 72 degrees.
        assert!((arm - cone).abs() < 0.3, "the arm leans by {arm} degrees");
        assert!((flag - load.asin().to_degrees()).abs() < 0.3, "the flag leans by {flag} degrees");
        let lamp = named(&simulation, "lamp").position.y;
        assert!((2.5 - lamp - 4.0 * 9.81 / 200.0).abs() < 1e-3, "the lamp hangs at {lamp} m");
        let sled = named(&simulation, "crate");
        assert!(sled.position.x > 6.0 && sled.position.y < 0.16, "{} m", sled.position);
        assert_eq!((sled.position.z, sled.rotation), (0.0, glam::Quat::IDENTITY));
    }
}

/// A scene with spawners, stepped as the program does; `tell` is called after each step with what came and left so far.
fn flow(name: &str, parameters: &[&str], steps: u32, tell: impl FnMut(u32, &Simulation, &Spawners)) {
    flow_on(Box::new(Reference::<f32>::new()), name, parameters, steps, tell);
}

fn flow_on(
    backend: Box<dyn Backend>,
    name: &str,
    parameters: &[&str],
    steps: u32,
    mut tell: impl FnMut(u32, &Simulation, &Spawners),
) {
    let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
    let scene = Scene::find(name, &parameters).expect(name);
    let mut spawners = Spawners::new(&scene);
    let mut simulation = Simulation::with(scene.world.clone(), SolverConfig::default(), backend).expect(name);
    for step in 0..steps {
        spawners.before_step(&mut simulation.world, scene.dt);
        simulation.step(scene.dt).expect("a step");
        tell(step + 1, &simulation, &spawners);
    }
}

/// A box rides from x = 0.6 m to the last roller at 8 m: 7.4 s at 1 m/s, and falls by a meter in 0.5 s.
#[test]
fn boxes_ride_on_a_conveyor_at_its_speed_and_as_many_leave_as_come() {
    for (speed, every) in [(1.0, 120), (2.0, 60)] {
        let parameters = [format!("speed={speed}"), format!("every={every}")];
        let (mut carried, mut sum, mut left) = (0, 0.0, Vec::new());
        flow("conveyor", &[&parameters[0], &parameters[1]], 1500, |step, simulation, spawners| {
            assert_eq!(spawners.came(), (step - 1) / every);
            left.push(spawners.left());
            for body in simulation.world.dynamic().filter(|b| (2.0..6.0).contains(&b.position.x)) {
                let slip = (body.linear_velocity - Vec3::X * speed).length();
                // A box with straight edges hops over the rollers by 7 mm at 2 m/s, at 0.33 m/s, and slips by 0.11 m/s.
                assert!(slip < 0.04 * speed, "step {step}: {slip} m/s");
                assert!((body.position.y - 0.2).abs() < 1e-3 && body.position.z.abs() < 0.1, "{}", body.position);
                (carried, sum) = (carried + 1, sum + body.linear_velocity.x);
            }
        });
        let mean = sum / carried as f32;
        assert!(carried > 500 && (mean - speed).abs() < 0.01 * speed, "{mean} m/s of {carried}");
        // From the first that leaves on, one leaves every so many steps.
        let first = left.iter().position(|&count| count == 1).expect("one leaves") as u32;
        let ride = first as f32 / 60.0;
        assert!((ride - 7.4 / speed - 0.6).abs() < 0.6, "{ride} s");
        let expected = 1 + (1500 - 1 - first) / every;
        assert!(left[1499].abs_diff(expected) <= 1, "{} left, not {expected}", left[1499]);
    }
}

/// Every body goes round the square: its angle about the middle grows, and it stays between the walls.
#[test]
fn all_bodies_ride_round_on_belts_and_none_leaves() {
    for speed in [1.0, 2.0] {
        let mut turned = vec![0.0; 24];
        let mut before: Option<Vec<Vec3>> = None;
        let steps = (1800.0 / speed) as u32;
        flow("belts", &[&format!("speed={speed}")], steps, |step, simulation, _| {
            let places: Vec<Vec3> = simulation.world.dynamic().map(|b| b.position).collect();
            for (i, at) in places.iter().enumerate() {
                let out = at.x.abs().max(at.z.abs());
                let name = &simulation.world.bodies[i + 2].name;
                assert!((2.5..3.5).contains(&out) && (at.y - 0.2).abs() < 0.2, "step {step}: {name} {i} at {at}");
                if let Some(before) = &before {
                    turned[i] += before[i].cross(*at).y.atan2(before[i].dot(*at));
                }
            }
            before = Some(places);
        });
        // A round of 24 m takes 24 s at 1 m/s.
        let least = turned.iter().map(|angle| -angle).fold(f32::INFINITY, f32::min);
        println!("the slowest turned by {least} rad at {speed} m/s");
        assert!(least > 0.8 * std::f32::consts::TAU, "{turned:?}");
    }
}

/// Balls that come alone find the cross in any pose. With 75, 90 or 120 steps between them, one comes under the end of an
/// arm that closes on the wall at 19 degrees, and jams: friction holds up to 27 degrees at the wall and 6 at the arm.
#[test]
fn every_ball_that_passes_a_turnstile_turns_its_cross_by_a_quarter_and_all_pass() {
    for every in [40, 45, 60, 65, 110] {
        let (mut quarters, mut passed, mut left) = (0.0, 0, 0);
        flow("turnstile", &[&format!("every={every}")], 1900, |step, simulation, spawners| {
            let world = &simulation.world;
            let cross = world.bodies.iter().find(|b| b.name == "cross").expect("a cross");
            quarters -= cross.angular_velocity.y / 60.0 / std::f32::consts::FRAC_PI_2;
            let balls = || world.dynamic().filter(|b| b.name == "ball");
            let beyond = balls().filter(|b| b.position.x > 1.0).count() as u32 + spawners.left();
            // The first arm stands across, so that the first ball passes within a quarter turn.
            if beyond > passed {
                (passed, left) = (beyond, spawners.left());
                assert!(quarters > passed as f32 - 0.1, "step {step}: {passed} passed in {quarters} quarter turns");
            }
            assert!(
                balls().all(|b| b.position.x > 3.5 || b.position.z.abs() < 0.2),
                "step {step}: a ball left the channel"
            );
            assert!(world.joint_gap() < 2.5e-3, "step {step}: the hinge is open by {} m", world.joint_gap());
            left = left.max(spawners.left());
        });
        assert_eq!((passed, left), (12, 12), "every {every} steps");
    }
}

/// More balls come than pass: those that wait stand one behind the other up to the spawner, which waits too.
#[test]
fn a_turnstile_with_more_balls_than_pass_does_not_jam() {
    let (mut passed, mut came, mut deepest) = (Vec::new(), 0, 0.0_f64);
    flow("turnstile", &["every=40", "n=1000"], 4000, |step, simulation, spawners| {
        let mut balls = simulation.world.dynamic().filter(|b| b.name == "ball");
        let in_channel = |b: &Body| (-12.0..3.5).contains(&b.position.x) && b.position.z.abs() < 0.2;
        assert!(balls.all(|b| b.position.x > 3.5 || in_channel(b)), "step {step}: a ball left the channel");
        deepest = deepest.max(simulation.solved_penetration().max);
        came = spawners.came();
        passed.push(spawners.left());
    });
    println!("{came} came, {:?} passed, {deepest} m deep", [999, 1999, 2999, 3999].map(|step| passed[step]));
    assert!(came < 4000 / 40, "no ball waited");
    assert!(deepest < 0.02, "{deepest} m deep");
    assert!(passed[3999] > passed[2999] + 2, "{} balls passed, and {} in the end", passed[2999], passed[3999]);
}

/// A ball waits for the place of the one before, so that what comes does not show it.
#[test]
fn balls_of_a_board_come_one_after_another() {
    let scene = Scene::find("galton", &["n=5".into(), "every=12".into()]).expect("the scene");
    let first: Vec<_> = scene.spawners.iter().map(|spawner| spawner.first).collect();
    assert_eq!(first, [0, 12, 24, 36, 48]);
}

#[test]
fn sensors_count_every_ball_of_a_board_once_on_any_backend() {
    const BALLS: u32 = 30;
    let counts = |backend: Box<dyn Backend>| {
        let mut told: Vec<(u32, Event)> = Vec::new();
        let parameters = [format!("n={BALLS}"), "every=12".into()];
        flow_on(
            backend,
            "galton",
            &[&parameters[0], &parameters[1]],
            12 * BALLS + 300,
            |step, simulation, spawners| {
                told.extend(simulation.events().iter().map(|&event| (step, event)));
                let world = &simulation.world;
                let name = |body: drystone::BodyHandle| &*world.body(body).expect("all stay").name;
                let count = |is: fn(&Event) -> bool, of: &str| {
                    let sensor = |event: &Event| match *event {
                        Event::Entered { sensor, .. } | Event::Left { sensor, .. } => name(sensor.body),
                        _ => "",
                    };
                    told.iter().filter(|(_, event)| is(event) && sensor(event).starts_with(of)).count() as u32
                };
                let entered = |of: &str| count(|event| matches!(event, Event::Entered { .. }), of);
                let left = |of: &str| count(|event| matches!(event, Event::Left { .. }), of);
                // A ball falls from above the gate through the gate within half a second.
                assert!(entered("gate") <= spawners.came() && entered("gate") + 3 >= spawners.came(), "step {step}");
                assert!(left("gate") <= entered("gate") && entered("bin") <= left("gate"), "step {step}");
                if step < 12 * BALLS + 300 {
                    return;
                }
                assert_eq!((spawners.came(), entered("gate"), left("gate")), (BALLS, BALLS, BALLS));
                assert_eq!((entered("bin"), left("bin")), (BALLS, 0));
                let balls: Vec<_> = world.dynamic().map(|ball| ball.position).collect();
                assert_eq!(balls.len() as u32, BALLS);
                for bin in world.bodies.iter().filter(|body| body.name.starts_with("bin")) {
                    let inside = balls.iter().filter(|at| (at.x - bin.position.x).abs() < 0.2).count() as u32;
                    assert_eq!(entered(&bin.name), inside, "{}", bin.name);
                }
                let filled = (1..=9).map(|k| entered(&format!("bin {k}"))).filter(|&balls| balls > 0).count();
                assert!(filled >= 4, "{filled} bins have balls");
            },
        );
        told
    };
    let [reference, lanes] = [counts(Box::new(Reference::<f32>::new())), counts(Box::new(Cpu::new()))];
    assert_eq!(reference, lanes);
}

/// The angle of a body about z, in the plane.
fn angle_of(body: &Body) -> f32 {
    let along = body.rotation * Vec3::X;
    along.y.atan2(along.x)
}

#[test]
fn the_rocker_swings_between_the_angles_of_the_linkage() {
    let mut simulation = run("four-bar", &[], 60).1;
    let (mut least, mut most, mut gap) = (f32::MAX, f32::MIN, 0.0_f32);
    let (mut before, mut turned) = (angle_of(&simulation.world.bodies[0]), 0.0);
    for _ in 0..300 {
        step(&mut simulation, 1);
        let angle = angle_of(&simulation.world.bodies[2]);
        (least, most, gap) = (least.min(angle), most.max(angle), gap.max(simulation.world.joint_gap()));
        let crank = angle_of(&simulation.world.bodies[0]);
        turned += (crank - before).rem_euclid(std::f32::consts::TAU);
        before = crank;
    }
    // Where the crank lies along the coupler, three sides of a triangle give the angle of the rocker.
    let at = |diagonal: f32| std::f32::consts::PI - ((0.41 - diagonal * diagonal) / 0.4_f32).acos();
    let [far, near] = [at(0.7), at(0.3)];
    println!("{least} to {most}, exact {far} to {near}, {gap} m, {turned} rad");
    // 5 s at 6 rad/s: one sweep a substep leaves 0.15 %.
    assert!((turned - 30.0).abs() < 0.1, "{turned} rad");
    assert!((least - far).abs() < 0.01 && (most - near).abs() < 0.01, "{least} to {most}, exact {far} to {near}");
    assert!(gap < 2e-3, "{gap} m");
}

#[test]
fn winches_pull_up_the_drawbridge() {
    let mut simulation = run("drawbridge", &[], 60).1;
    let rope = |simulation: &Simulation| simulation.world.joint_motion(&simulation.world.joints[1]).position[0];
    let before = rope(&simulation);
    step(&mut simulation, 120);
    let speed = (before - rope(&simulation)) / 2.0;
    assert!((speed - 0.4).abs() < 0.004, "{speed} m/s");
    step(&mut simulation, 360);
    let angle = angle_of(&simulation.world.bodies[1]);
    println!("{speed} m/s, {angle} rad, {} m", simulation.world.joint_gap());
    assert!((angle - 0.6).abs() < 0.01, "{angle} rad");
    let [deck, load] = [1, 2].map(|i| &simulation.world.bodies[i]);
    let place = deck.rotation.inverse() * (load.position - deck.position);
    assert!(place.distance(Vec3::new(-1.2, 0.4, 0.0)) < 0.02, "{place}");
    assert!(simulation.world.joint_gap() < 5e-3, "{} m", simulation.world.joint_gap());
}

#[test]
fn the_car_drives_over_bumps() {
    let mut simulation = run("car", &["speed=5"], 0).1;
    let chassis = |simulation: &Simulation| {
        simulation.world.bodies.iter().find(|body| body.name == "chassis").expect("a chassis").clone()
    };
    let (mut upright, mut gap, mut highest) = (1.0_f32, 0.0_f32, 0.0_f32);
    for _ in 0..360 {
        step(&mut simulation, 1);
        upright = upright.min((chassis(&simulation).rotation * Vec3::Y).y);
        gap = gap.max(simulation.world.joint_gap());
        highest = highest.max(chassis(&simulation).position.y);
    }
    let Vec3 { x, .. } = chassis(&simulation).position;
    println!("x {x} m, up {upright}, gap {gap} m, highest {highest} m");
    assert!(upright > 0.98 && x > 20.0 && gap < 0.02, "up {upright}, {x} m, gap {gap} m");
    // The bumps lift it, and behind them it rests on its springs as high as it was built.
    assert!(highest > 0.77, "{highest} m");
    step(&mut simulation, 180);
    let Body { position, linear_velocity, .. } = chassis(&simulation);
    println!("{position} {linear_velocity}");
    assert!((linear_velocity.x - 5.0).abs() < 0.1, "{linear_velocity}");
    assert!((position.y - 0.75).abs() < 0.01, "{position}");
}

/// How far the ragdoll goes beyond a limit while it falls is chaotic: the bounds are those of eight falls.
#[test]
fn ragdolls_fall_down_the_stairs_and_stay_in_joint() {
    const FALLS: usize = 8;
    let mut sum = 0.0;
    for push in 0..FALLS {
        let mut simulation = run("ragdoll", &[], 0).1;
        simulation.world.bodies.iter_mut().for_each(|body| body.linear_velocity *= 0.8 + 0.05 * push as f32);
        let (mut gap, mut beyond) = (0.0_f32, 0.0_f32);
        for _ in 0..600 {
            step(&mut simulation, 1);
            gap = gap.max(simulation.world.joint_gap());
            for joint in &simulation.world.joints {
                let angles = &simulation.world.joint_motion(joint).position[3..];
                for (axis, angle) in joint.angular.iter().zip(angles) {
                    beyond = beyond.max(match axis.bounds {
                        Bounds::Free => 0.0,
                        Bounds::Locked => angle.abs(),
                        Bounds::Between { min, max } => (min - angle).max(angle - max),
                    });
                }
            }
        }
        let hips = simulation.world.bodies.iter().find(|body| body.name == "hips").expect("hips").position;
        let speed = rms_speed(&simulation.world);
        println!("{gap} m, {beyond} rad, hips {hips} {speed}");
        assert!(hips.x > 1.5 && hips.y < 1.6, "{hips}");
        assert!(gap < 0.012, "{gap} m");
        assert!(beyond < 0.15, "{beyond} rad");
        assert!(speed < 0.02, "{speed} m/s");
        sum += beyond;
    }
    let mean = sum / FALLS as f32;
    assert!(mean < 0.09, "{mean} rad beyond a limit in the mean of all falls");
}

/// Dynamic bodies that leave the container of a scene, after each of some steps.
fn leaving(name: &str, parameters: &[&str], steps: u32) -> usize {
    let (scene, mut simulation) = run(name, parameters, 0);
    let (low, high) = scene.container.expect("a container");
    let mut most = 0;
    for _ in 0..steps {
        step(&mut simulation, 1);
        let dynamic = simulation.world.bodies.iter().filter(|body| body.kind == BodyKind::Dynamic);
        let is_out = |at: Vec3| (at.cmplt(low) | at.cmpgt(high)).any();
        most = most.max(dynamic.filter(|body| is_out(body.position)).count());
    }
    most
}

#[test]
fn nothing_falls_through_a_terrain_and_no_bullet_leaves_its_room() {
    assert_eq!(leaving("terrain", &[], 300), 0);
    assert_eq!(leaving("terrain", &["n=30", "height=50"], 400), 0);
    for speed in ["speed=30", "speed=300", "speed=1000"] {
        assert_eq!(leaving("bullets", &[speed], 120), 0, "{speed}");
    }
}

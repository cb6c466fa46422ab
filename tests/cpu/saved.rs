//! Runs that fork, go back, or go through bytes have the bits of one that does none of that.

use crate::common::state::reference;
use drystone::config::FrictionAt;
use drystone::glam::{Quat, Vec3};
use drystone::{
    Backend, Body, BodyHandle, BodyKind, CombineRule, Cpu, Joint, Material, Shape, Simulation, SolverConfig, StepStats,
    World,
};
use drystone_scenes::Scene;

const DT: f32 = 1.0 / 60.0;

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

fn scene(name: &str, parameters: &[&str]) -> World {
    let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
    Scene::find(name, &parameters).expect(name).world
}

/// The counts of a step, without times.
fn counts(stats: &StepStats) -> impl PartialEq + std::fmt::Debug {
    let StepStats { pairs, computed, manifolds, points, joints, colors, overflow, asleep, efforts, dispatches, .. } =
        *stats;
    ((pairs, computed, manifolds, points, joints), (colors, overflow, asleep, efforts, dispatches))
}

/// Runs a world for some steps, and at each of the `moments` begins three more runs that go on from there: through bytes, as a fork, and back
/// from two steps later. All have the same bits in every step after that, and leave the same state behind. `change` changes the world before a
/// step.
fn goes_on(what: &str, world: &World, config: &SolverConfig, steps: u32, moments: &[u32], change: fn(u32, &mut World)) {
    let mut whole = Simulation::with(world.clone(), config.clone(), cpu()).expect("a good world");
    let mut others: Vec<(String, Simulation)> = Vec::new();
    for step in 0..steps {
        change(step, &mut whole.world);
        others.iter_mut().for_each(|(_, other)| change(step, &mut other.world));
        if moments.contains(&step) {
            let bytes = whole.save();
            let mut loaded = Simulation::load(&bytes, reference()).expect("the bytes of a run");
            assert!(loaded.save() == bytes, "{what}, {step}: what was loaded is saved otherwise");
            let mut back = whole.fork(cpu());
            let snapshot = back.snapshot();
            (0..2).for_each(|_| drop(back.step(DT).expect("a step")));
            back.restore(&snapshot);
            assert!(back.save() == bytes, "{what}, {step}: what went back is saved otherwise");
            others.push((format!("{what}, saved before step {step}"), loaded));
            others.push((format!("{what}, forked before step {step}"), whole.fork(reference())));
            others.push((format!("{what}, back before step {step}"), back));
        }
        let stats = whole.step(DT).expect("a step");
        for (other, simulation) in &mut others {
            let theirs = simulation.step(DT).expect("a step");
            assert_eq!(simulation.hash(), whole.hash(), "{other}: step {step}");
            assert_eq!(counts(&theirs), counts(&stats), "{other}: step {step}");
        }
    }
    let bytes = whole.save();
    for (other, simulation) in &mut others {
        assert!(simulation.save() == bytes, "{other}: the state at the end");
    }
    assert!(!others.is_empty());
}

fn unchanged(_: u32, _: &mut World) {}

#[test]
fn a_falling_pile_goes_on_to_the_same_bits() {
    for config in [SolverConfig::default(), SolverConfig::default().with(|c| c.friction_at = FrictionAt::Manifold)] {
        goes_on("pile", &scene("pile", &["n=120"]), &config, 150, &[0, 1, 17, 60], unchanged);
    }
    goes_on("mixed", &scene("pile-mixed", &["n=60"]), &SolverConfig::default(), 90, &[30], unchanged);
}

#[test]
fn a_tower_that_sleeps_goes_on_to_the_same_bits_when_it_wakes() {
    let push = |step: u32, world: &mut World| {
        if step == 130 {
            world.bodies[3].linear_velocity.x = 1.0;
        }
    };
    goes_on("tower", &scene("tower", &["n=6"]), &SolverConfig::default(), 160, &[20, 120, 130, 131], push);
}

#[test]
fn joints_go_on_to_the_same_bits() {
    let config = SolverConfig::default();
    for (name, parameters) in
        [("chain", &["links=12", "ratio=1000"][..]), ("bridge", &[]), ("joint-grid", &[]), ("pendulum", &[])]
    {
        goes_on(name, &scene(name, parameters), &config, 60, &[10, 31], unchanged);
    }
}

#[test]
fn bodies_that_the_caller_drives_go_on_to_the_same_bits() {
    goes_on("drum", &scene("drum", &[]), &SolverConfig::default(), 60, &[7, 40], unchanged);
}

/// Damping that came while the run went on is in its state, and in the next steps of all that go on from it.
#[test]
fn damped_bodies_go_on_to_the_same_bits() {
    let damp = |step: u32, world: &mut World| {
        if step == 12 {
            let of = |(k, body): (usize, &mut Body)| {
                (body.linear_damping, body.angular_damping) = (0.1 * (k % 4) as f32, 0.3 * (k % 3) as f32);
            };
            world.bodies.iter_mut().enumerate().for_each(of);
        }
    };
    goes_on("damped", &scene("pile", &["n=40"]), &SolverConfig::default(), 90, &[11, 12, 13, 40], damp);
}

/// The same of axes that are locked while the run goes on.
#[test]
fn locked_bodies_go_on_to_the_same_bits() {
    let lock = |step: u32, world: &mut World| {
        if step == 12 || step == 50 {
            let of = |(k, body): (usize, &mut Body)| {
                body.locked_rotations = [k % 2 > 0, k % 3 > 0, step == 12 && k % 5 > 0];
                body.can_sleep = k % 4 > 0;
            };
            world.bodies.iter_mut().enumerate().for_each(of);
        }
    };
    goes_on("locked", &scene("pile-mixed", &["n=40"]), &SolverConfig::default(), 90, &[11, 12, 13, 40, 50, 51], lock);
}

/// The same of materials of shapes, and of their rules.
#[test]
fn bodies_with_materials_of_shapes_go_on_to_the_same_bits() {
    let paint = |step: u32, world: &mut World| {
        if step == 12 || step == 50 {
            let rules = [None, Some(CombineRule::Average), Some(CombineRule::Multiply)];
            for (k, body) in world.bodies.iter_mut().enumerate() {
                (body.material.friction_rule, body.material.restitution_rule) = (rules[k % 3], rules[k / 3 % 3]);
                let own = Material { restitution: 0.3, friction_rule: rules[k % 2], ..Material::default() };
                body.colliders.iter_mut().for_each(|c| c.material = (k % 4 < 2).then_some(own));
            }
        }
    };
    goes_on("painted", &scene("pile-mixed", &["n=40"]), &SolverConfig::default(), 90, &[11, 12, 13, 40, 50, 51], paint);
}

/// The same of belts, on bodies that turn, and of rolling friction that comes and goes.
#[test]
fn belts_and_rolling_friction_go_on_to_the_same_bits() {
    let paint = |step: u32, world: &mut World| {
        if step == 12 || step == 50 {
            for (k, body) in world.bodies.iter_mut().enumerate() {
                body.material.surface_velocity = if k % 3 == 0 { Vec3::new(0.3, -0.2, 0.5) } else { Vec3::ZERO };
                body.material.rolling_friction = if step == 12 && k % 2 == 0 { 0.02 } else { 0.0 };
                body.material.spinning_friction = if step == 12 && k % 5 == 0 { 0.01 } else { 0.0 };
            }
        }
    };
    goes_on("belts", &scene("pile-mixed", &["n=40"]), &SolverConfig::default(), 90, &[11, 12, 13, 40, 50, 51], paint);
    let patches = SolverConfig::default().with(|c| c.friction_at = FrictionAt::Manifold);
    let belts = |step: u32, world: &mut World| {
        if step == 12 {
            world.bodies[0].material.surface_velocity = Vec3::X;
        }
    };
    goes_on("belts at patches", &scene("pile", &["n=40"]), &patches, 60, &[11, 12, 13, 40], belts);
}

#[test]
fn islands_of_higher_effort_go_on_to_the_same_bits() {
    let world = scene("mass-ratio", &[]);
    goes_on("mass-ratio", &world, &SolverConfig::default(), 60, &[1, 20], unchanged);
    let mut simulation = Simulation::with(world, SolverConfig::default(), cpu()).expect("a good world");
    let efforts: Vec<_> = (0..20).map(|_| simulation.step(DT).expect("a step").efforts).collect();
    assert!(efforts.iter().any(|counts| counts[1..].iter().any(|&count| count > 0)), "{efforts:?}");
}

/// A hull, a mesh, a height field, and all other shapes on them.
fn all_shapes() -> World {
    let mut world = World::new();
    let hill = |i: usize, j: usize| 0.05 * ((i * 7 + j * 3) % 5) as f32;
    let heights: Vec<Vec<f32>> = (0..9).map(|i| (0..7).map(|j| hill(i, j)).collect()).collect();
    world.insert(Body::fixed().shape(Shape::height_field(&heights, Vec3::new(8.0, 1.0, 8.0)).expect("hills")));
    let corners = [[-4.0, 0.0, -4.0], [4.0, 0.0, -4.0], [4.0, 0.5, 4.0], [-4.0, 0.2, 4.0], [-4.0, 0.0, -4.0]];
    let triangles = vec![[0, 2, 1], [4, 3, 2]];
    let mesh = Shape::mesh(corners.map(Vec3::from_array).to_vec(), triangles).expect("a mesh");
    world.insert(Body::fixed().shape(mesh).position(20.0, 0.0, 0.0));
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::new(0.6, 0.8, 0.0))).position(-40.0, -20.0, 0.0));
    let points: Vec<Vec3> = (0..14).map(|i| (0.4 + 0.01 * (i % 3) as f32) * point_on_ball(i)).collect();
    let hull = Shape::convex_hull(&points).expect("a hull");
    let shapes = [
        hull,
        Shape::ball(0.4),
        Shape::cuboid(0.3, 0.4, 0.5),
        Shape::capsule(0.3, 0.2),
        Shape::cylinder(0.3, 0.3),
        Shape::cone(0.4, 0.4),
    ];
    for (i, shape) in shapes.iter().cycle().take(24).enumerate() {
        let at = Vec3::new((i % 4) as f32 - 1.5, 1.0 + 0.9 * (i / 8) as f32, (i / 4 % 2) as f32 - 0.5);
        let side = if i % 2 == 0 { 0.0 } else { 20.0 };
        let turn = Quat::from_euler(drystone::glam::EulerRot::XYZ, 0.3 * i as f32, 0.7, 0.1 * i as f32);
        let body = Body::dynamic().shape(shape.clone()).rotation(turn).named(format!("body {i}"));
        world.insert(body.position(at.x + side, at.y, at.z));
    }
    let bar = Body::dynamic().shape(shapes[2].clone()).shape_at(shapes[1].clone(), Vec3::X, Quat::IDENTITY);
    world.insert(bar.position(0.0, 4.0, 0.0));
    world
}

/// Points spread over the unit ball.
fn point_on_ball(i: usize) -> Vec3 {
    let (y, angle) = (1.0 - (2 * i + 1) as f32 / 14.0, 2.4 * i as f32);
    let r = (1.0 - y * y).sqrt();
    Vec3::new(r * angle.cos(), y, r * angle.sin())
}

#[test]
fn shapes_of_all_kinds_go_on_to_the_same_bits() {
    goes_on("shapes", &all_shapes(), &SolverConfig::default(), 100, &[0, 30, 70], unchanged);
    for name in ["arch", "coins", "roll"] {
        goes_on(name, &scene(name, &[]), &SolverConfig::default(), 40, &[15], unchanged);
    }
}

#[test]
fn worlds_beside_each_other_go_on_to_the_same_bits() {
    let mut worlds = scene("pile", &["n=20"]);
    (0..2).for_each(|_| worlds.beside(&scene("tower", &["n=4"])));
    goes_on("worlds", &worlds, &SolverConfig::default(), 80, &[25], unchanged);
}

/// The dynamic body of number `k`.
fn dynamic(world: &World, k: usize) -> BodyHandle {
    let is_dynamic = |&body: &BodyHandle| world.bodies[body.index()].kind == BodyKind::Dynamic;
    world.bodies.handles().filter(is_dynamic).nth(k).expect("a dynamic body")
}

fn dynamic_mut(world: &mut World, k: usize) -> &mut Body {
    let index = dynamic(world, k).index();
    &mut world.bodies[index]
}

/// Bodies and joints that come, go and change between steps, also right before the state is saved.
fn come_and_go(step: u32, world: &mut World) {
    let cube = |x: f32| Body::dynamic().shape(Shape::cuboid(0.5, 0.4, 0.5)).position(x, 6.0, 0.1);
    match step {
        10 | 20 => drop(world.remove(dynamic(world, 5))),
        12 | 22 | 24 => drop(world.insert(cube(0.1 * step as f32 - 2.0))),
        30 => dynamic_mut(world, 2).colliders[0].shape = Shape::ball(0.45),
        40 => {
            let (a, b) = (world.insert(cube(4.0)), world.insert(cube(5.5)));
            world.insert_joint(Joint::new(a, 0.75 * Vec3::X, b, -0.75 * Vec3::X));
        }
        50 => drop(world.remove(world.joints[0].body_a)),
        55 => dynamic_mut(world, 3).material.friction = 0.9,
        60 => dynamic_mut(world, 1).kind = BodyKind::Kinematic,
        65 => world.gravity.x = 0.5,
        70 => dynamic_mut(world, 4).position.y += 3.0,
        _ => {}
    }
}

#[test]
fn bodies_that_come_and_go_do_so_after_a_state_was_saved_as_before() {
    let moments = [9, 10, 11, 13, 20, 22, 30, 31, 40, 41, 50, 55, 60, 65, 70];
    goes_on("changes", &scene("pile", &["n=40"]), &SolverConfig::default(), 90, &moments, come_and_go);
}

#[test]
fn all_settings_go_on() {
    let config = SolverConfig::default().with(|c| {
        c.substeps = 5;
        c.recycle_distance = 0.01;
        c.sleep_after = 0.25;
        c.max_colors = 3;
        c.rules.slip_friction = true;
    });
    goes_on("settings", &scene("pile", &["n=40"]), &config, 60, &[20], unchanged);
    let mut simulation = Simulation::with(scene("stack", &[]), config.clone(), cpu()).expect("a good world");
    let loaded = Simulation::load(&simulation.save(), cpu()).expect("the bytes of a run");
    assert_eq!(*loaded.config(), config);
}

#[test]
fn settings_that_change_after_a_state_was_saved_have_the_same_effect() {
    let mut one = Simulation::with(scene("pile", &["n=60"]), SolverConfig::default(), cpu()).expect("a good world");
    (0..100).for_each(|_| drop(one.step(DT).expect("a step")));
    one.set_config(SolverConfig::default().with(|c| c.substeps = 4)).expect("good settings");
    let mut other = Simulation::load(&one.save(), reference()).expect("the bytes of a run");
    for step in 0..60 {
        if step == 20 {
            [&mut one, &mut other]
                .into_iter()
                .for_each(|s| s.set_config(SolverConfig::default()).expect("good settings"));
        }
        let dt = if step > 40 { 0.5 * DT } else { DT };
        [&mut one, &mut other].into_iter().for_each(|s| drop(s.step(dt).expect("a step")));
        assert_eq!(one.hash(), other.hash(), "step {step}");
    }
    assert!(one.save() == other.save());
}

#[test]
fn handles_name_the_same_bodies_and_joints_after_loading() {
    let mut world = World::new();
    let cube = || Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
    let bodies: Vec<_> =
        (0..4).map(|i| world.insert(cube().position(2.0 * i as f32, 0.0, 0.0).named(format!("cube {i}")))).collect();
    let joints = [0, 1].map(|i| world.insert_joint(Joint::new(bodies[i], Vec3::X, bodies[i + 1], -Vec3::X)));
    world.remove_joint(joints[0]);
    world.remove(bodies[3]);
    let mut simulation = Simulation::with(world, SolverConfig::default(), cpu()).expect("a good world");
    let mut loaded = Simulation::load(&simulation.save(), cpu()).expect("the bytes of a run");
    assert!(loaded.world.body(bodies[3]).is_none() && loaded.world.joint(joints[0]).is_none());
    assert_eq!(loaded.world.body(bodies[2]).expect("a cube").name, "cube 2");
    assert_eq!(loaded.world.joint(joints[1]), simulation.world.joint(joints[1]));
    let new = [&mut simulation, &mut loaded].map(|s| s.world.insert(cube()));
    assert!(new[0] == new[1] && new[0].index() == bodies[3].index() && new[0] != bodies[3]);
}

fn small() -> Vec<u8> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for i in 0..2 {
        world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5 + i as f32, 0.0));
    }
    let mut simulation = Simulation::with(world, SolverConfig::default(), cpu()).expect("a good world");
    (0..5).for_each(|_| drop(simulation.step(DT).expect("a step")));
    simulation.save()
}

fn refusal(bytes: &[u8]) -> String {
    let error = Simulation::load(bytes, cpu()).err().expect("bytes that are no run").to_string();
    assert!(error.starts_with("a saved run cannot be loaded: ") && !error.contains('\n'), "{error}");
    error
}

#[test]
fn bytes_that_are_damaged_or_cut_short_are_refused_in_one_line() {
    let bytes = small();
    for length in 0..bytes.len() {
        refusal(&bytes[..length]);
    }
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        refusal(&damaged);
    }
    assert!(refusal(&[bytes.clone(), vec![0]].concat()).contains("damaged"));
    let mut other = bytes.clone();
    other[8] += 1;
    let line = refusal(&other);
    assert!(line.contains("version 10") && line.contains("reads version 9"), "{line}");
    assert!(refusal(b"a file of another program").contains("these bytes are not a saved run"));
}

/// A hash that follows a known definition: FNV-1a over the bytes of one ball.
#[test]
fn a_hash_is_what_its_definition_says() {
    let mut world = World::new();
    world.insert(Body::fixed());
    let gone = world.insert(Body::fixed());
    world.remove(gone);
    world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(1.0, -0.0, 3.0).velocity(Vec3::X, Vec3::Y));
    assert_eq!(world.bodies.len(), 2);
    let simulation = Simulation::with(world, SolverConfig::default(), cpu()).expect("a good world");
    let numbers = |index: u32, generation: u32, floats: [f32; 13]| {
        [index, generation].into_iter().chain(floats.map(f32::to_bits)).collect::<Vec<_>>()
    };
    let mut all = numbers(0, 0, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    all.extend(numbers(1, 2, [1.0, -0.0, 3.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    let bytes = all.into_iter().flat_map(u32::to_le_bytes);
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    assert_eq!(simulation.hash(), hash);
}

/// Rows and manifolds as they are would take 3,500 bytes a body.
#[test]
fn a_pile_at_rest_takes_few_bytes_a_body() {
    let mut simulation =
        Simulation::with(scene("pile", &["n=200"]), SolverConfig::default(), cpu()).expect("a good world");
    (0..400).for_each(|_| drop(simulation.step(DT).expect("a step")));
    assert_eq!(simulation.world.bodies.handles().filter(|&body| simulation.is_asleep(body)).count(), 200);
    let bytes = simulation.save().len() / 200;
    assert!(bytes <= 300, "{bytes} bytes a body");
}

/// Several thousand pairs, in chunks that threads share.
#[test]
fn bytes_are_the_same_for_any_number_of_threads() {
    let mut simulation =
        Simulation::with(scene("pile", &["n=700"]), SolverConfig::default(), cpu()).expect("a good world");
    (0..60).for_each(|_| drop(simulation.step(DT).expect("a step")));
    let bytes = simulation.save();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert!(pool.install(|| simulation.save()) == bytes, "{threads} threads");
        let mut loaded = pool.install(|| Simulation::load(&bytes, cpu())).expect("the bytes of a run");
        assert!(loaded.save() == bytes, "loaded by {threads} threads");
    }
}

/// Bytes that were cut short, with a hash that was made to fit: every part says so in one line.
#[test]
fn bytes_that_end_anywhere_are_refused_without_help_of_the_hash() {
    let bytes = small();
    let fitted = |mut bytes: Vec<u8>| {
        let (words, rest) = bytes[20..].as_chunks::<8>();
        let mut last = [0; 8];
        last[..rest.len()].copy_from_slice(rest);
        let mix = |hash: u64, word: &[u8; 8]| {
            (hash.rotate_left(5) ^ u64::from_le_bytes(*word)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        };
        let hash = words.iter().chain([&last]).fold(bytes.len() as u64 - 20, mix);
        bytes[12..20].copy_from_slice(&hash.to_le_bytes());
        bytes
    };
    assert!(fitted(bytes.clone()) == bytes, "the hash of this test is that of the library");
    for length in 20..bytes.len() {
        let line = refusal(&fitted(bytes[..length].to_vec()));
        assert!(!line.contains("hash"), "{length} bytes: {line}");
    }
    let line = refusal(&fitted([bytes, vec![0]].concat()));
    assert!(line.contains("it has bytes after its end"), "{line}");
}

/// The world is replaced between two steps, by a smaller one and by a larger one.
#[test]
fn a_world_that_was_replaced_is_saved_before_the_next_step() {
    for other in [scene("tower", &["n=4"]), scene("pile", &["n=80"])] {
        let mut one = Simulation::with(scene("pile", &["n=40"]), SolverConfig::default(), cpu()).expect("a good world");
        (0..60).for_each(|_| drop(one.step(DT).expect("a step")));
        one.world = other;
        let mut loaded = Simulation::load(&one.save(), reference()).expect("the bytes of a run");
        for step in 0..30 {
            [&mut one, &mut loaded].into_iter().for_each(|s| drop(s.step(DT).expect("a step")));
            assert_eq!(one.hash(), loaded.hash(), "step {step}");
        }
    }
}

//! Worlds whose bodies come and go while they move.

use crate::common::state::{all_bits, bits_of, joint_impulses};
use drystone::glam::{Quat, Vec3};
use drystone::{
    Backend, Body, BodyHandle, BodyKind, Cpu, Groups, Joint, Reference, Shape, Simulation, SolverConfig, World,
};

use crate::common::Open;

const DT: f32 = 1.0 / 60.0;

tests! {
    every_backend {
        a_fixed_body_with_a_velocity_is_as_one_without,
        settings_change_after_a_contact_ended,
        a_body_that_goes_lets_fall_what_lay_on_it_and_nothing_else,
        a_body_that_comes_lands_and_rests_on_what_sleeps,
        a_body_in_the_place_of_another_is_another_body,
        a_twin_in_the_place_of_a_body_begins_without_its_impulses,
        a_fixed_body_that_becomes_dynamic_lands_on_fixed_ground,
        ground_without_bounds_that_goes_bears_nothing_more,
        kinds_and_shapes_change_between_steps,
        a_joint_goes_with_its_body_and_another_in_its_place_begins_without_impulse,
        bodies_meet_only_those_of_their_groups,
    }
    no_gpu {
        bodies_come_and_go_in_one_of_several_worlds,
        a_pyramid_of_which_bricks_are_replaced_stands,
        a_world_in_which_bodies_come_and_go_for_long_does_not_grow,
    }
    exact_gpu {
        what_comes_and_goes_has_the_same_bits_everywhere,
    }
}

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

fn run(simulation: &mut Simulation, steps: u32) {
    (0..steps).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

fn ground() -> Body {
    Body::fixed().shape(Shape::cuboid(50.0, 0.5, 50.0)).position(0.0, -0.5, 0.0)
}

fn cube(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, 0.0)
}

/// Towers of five cubes, 3 m apart; the handles of their cubes from below.
fn towers(count: usize) -> (World, Vec<Vec<BodyHandle>>) {
    let mut world = World::new();
    world.insert(ground());
    let tower = |k: usize| {
        (0..5).map(move |level| cube(3.0 * k as f32, 0.5 + level as f32).velocity(1e-9 * Vec3::NEG_Y, Vec3::ZERO))
    };
    let towers = (0..count).map(|k| tower(k).map(|body| world.insert(body)).collect()).collect();
    (world, towers)
}

fn simulation(world: &World, config: &SolverConfig, open: Open) -> Simulation {
    Simulation::with(world.clone(), config.clone(), open()).expect("a good world")
}

/// What lies on a body falls when the body goes, and what the body does not touch does not see it, to the last bit.
fn a_body_that_goes_lets_fall_what_lay_on_it_and_nothing_else(open: Open) {
    for config in [SolverConfig::default(), SolverConfig::default().without_sleep()] {
        let (world, towers) = towers(3);
        let mut changed = simulation(&world, &config, open);
        let mut unchanged = simulation(&world, &config, open);
        run(&mut changed, 120);
        run(&mut unchanged, 120);
        assert_eq!(changed.is_asleep(towers[0][0]), config.sleep_after > 0.0);
        let lowest = changed.world.remove(towers[1][0]).expect("a cube");
        assert!((lowest.position.y - 0.5).abs() < 1e-3);
        for step in 0..90 {
            run(&mut changed, 1);
            run(&mut unchanged, 1);
            for cube in towers[0].iter().chain(&towers[2]).map(|cube| cube.index()) {
                assert_eq!(bits_of(&changed.world.bodies[cube]), bits_of(&unchanged.world.bodies[cube]), "step {step}");
            }
        }
        for (level, cube) in towers[1].iter().skip(1).enumerate() {
            let fell = changed.world.body(*cube).expect("a cube").position.y;
            assert!((fell - (0.5 + level as f32)).abs() < 2e-3, "{level} is at {fell}");
        }
        assert!(changed.world.body(towers[1][0]).is_none() && changed.world.remove(towers[1][0]).is_none());
    }
}

fn a_body_that_comes_lands_and_rests_on_what_sleeps(open: Open) {
    let (world, towers) = towers(2);
    let mut simulation = simulation(&world, &SolverConfig::default(), open);
    run(&mut simulation, 120);
    assert!(simulation.is_asleep(towers[0][0]));
    let new = simulation.world.insert(cube(0.0, 7.0));
    run(&mut simulation, 240);
    let landed = simulation.world.body(new).expect("the cube").position;
    assert!((landed.y - 5.5).abs() < 2e-3 && landed.x.abs() < 0.02, "{landed}");
    assert!(simulation.is_asleep(new));
    assert!(simulation.manifolds().any(|m| [m.a.body, m.b.body].contains(&new)));
}

/// The vacancy is filled at once: the new body begins without contacts and impulses of the one before.
fn a_body_in_the_place_of_another_is_another_body(open: Open) {
    let (world, towers) = towers(2);
    let mut simulation = simulation(&world, &SolverConfig::default(), open);
    run(&mut simulation, 120);
    let gone = towers[0][4];
    simulation.world.remove(gone);
    let new = simulation.world.insert(cube(20.0, 30.0));
    assert_eq!(new.index(), gone.index());
    assert!(new != gone && simulation.world.body(gone).is_none());
    run(&mut simulation, 1);
    let body = simulation.world.body(new).expect("the cube");
    assert!((body.linear_velocity.y + 9.81 * DT).abs() < 1e-5, "{}", body.linear_velocity);
    assert!(simulation.manifolds().all(|m| ![m.a.body, m.b.body].contains(&new)));
    run(&mut simulation, 240);
    assert!((simulation.world.body(new).expect("the cube").position.y - 0.5).abs() < 2e-3);
    assert!((simulation.world.body(towers[0][3]).expect("a cube").position.y - 3.5).abs() < 2e-3);
}

/// Nothing tells the twin from the body before but its handle.
fn a_twin_in_the_place_of_a_body_begins_without_its_impulses(open: Open) {
    let (world, towers) = towers(1);
    let mut changed = simulation(&world, &SolverConfig::default().without_sleep(), open);
    run(&mut changed, 120);
    let mut unchanged = changed.fork(open());
    let top = towers[0][4];
    let twin = changed.world.remove(top).expect("a cube");
    assert_eq!(changed.world.insert(twin).index(), top.index());
    run(&mut changed, 1);
    run(&mut unchanged, 1);
    let [new, old] = [&changed, &unchanged].map(|s| bits_of(&s.world.bodies[top.index()]));
    assert_ne!(new, old, "impulses of a contact at rest keep every bit");
    run(&mut changed, 60);
    assert!((changed.world.bodies[top.index()].position.y - 4.5).abs() < 2e-3);
}

/// Two fixed bodies make no pair, so that detection has to look again.
fn a_fixed_body_that_becomes_dynamic_lands_on_fixed_ground(open: Open) {
    let mut world = World::new();
    world.insert(ground());
    let low = world.insert(cube(0.0, 0.5));
    world.bodies[low].kind = BodyKind::Fixed;
    let mut simulation = simulation(&world, &SolverConfig::default(), open);
    run(&mut simulation, 10);
    simulation.world.bodies[low].kind = BodyKind::Dynamic;
    run(&mut simulation, 60);
    let y = simulation.world.bodies[low].position.y;
    assert!((y - 0.5).abs() < 2e-3, "{y} m");
}

fn ground_without_bounds_that_goes_bears_nothing_more(open: Open) {
    let mut world = World::new();
    let plane = world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let low = world.insert(cube(0.0, 0.5));
    let mut simulation = simulation(&world, &SolverConfig::default(), open);
    run(&mut simulation, 60);
    simulation.world.remove(plane);
    run(&mut simulation, 30);
    assert_eq!(simulation.manifolds().count(), 0);
    let speed = simulation.world.bodies[low].linear_velocity.y;
    assert!((speed + 0.5 * 9.81).abs() < 1e-3, "{speed} m/s");
}

fn kinds_and_shapes_change_between_steps(open: Open) {
    let (world, towers) = towers(3);
    let mut simulation = simulation(&world, &SolverConfig::default(), open);
    run(&mut simulation, 120);
    let body = |s: &Simulation, tower: usize, level: usize| s.world.body(towers[tower][level]).expect("a cube").clone();
    // The second from below hangs in the air when the lowest goes.
    simulation.world.body_mut(towers[0][1]).expect("a cube").kind = BodyKind::Fixed;
    simulation.world.remove(towers[0][0]);
    // The lowest becomes half as high.
    let low = Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.5));
    let lowest = simulation.world.body_mut(towers[1][0]).expect("a cube");
    (lowest.colliders, lowest.mass) = (low.colliders, low.mass);
    // The ground is a belt.
    run(&mut simulation, 120);
    for level in 1..5 {
        let y = body(&simulation, 0, level).position.y;
        assert!((y - 0.5 - level as f32).abs() < 2e-3, "{level}: {y}");
        let y = body(&simulation, 1, level).position.y;
        assert!((y - level as f32).abs() < 3e-3, "{level}: {y}");
    }
    assert!((body(&simulation, 1, 0).position.y - 0.25).abs() < 2e-3);
    simulation.world.body_mut(towers[0][1]).expect("a cube").kind = BodyKind::Dynamic;
    run(&mut simulation, 120);
    assert!((body(&simulation, 0, 1).position.y - 0.5).abs() < 2e-3);
    assert!((body(&simulation, 0, 4).position.y - 3.5).abs() < 2e-3);
    assert!((body(&simulation, 2, 4).position.y - 4.5).abs() < 2e-3);
}

/// Each copy of a world goes the way of the world alone, whatever comes and goes in the others.
fn bodies_come_and_go_in_one_of_several_worlds() {
    let (alone, towers) = towers(1);
    let mut all = alone.clone();
    for _ in 0..2 {
        all.beside(&alone);
    }
    let each = alone.bodies.len();
    let mut one = simulation(&alone, &SolverConfig::default(), cpu);
    let mut three = simulation(&all, &SolverConfig::default(), cpu);
    run(&mut one, 60);
    run(&mut three, 60);
    // World 0 loses a cube and gets two, world 2 gets one; world 1 stays as it is.
    three.world.remove(three.world.bodies.handle(towers[0][4].index()).expect("a cube"));
    let new: Vec<_> = [(0, 9.0), (0, 11.0), (2, 7.0)]
        .map(|(world, y)| three.world.insert_in(world, cube(0.1, y)).expect("a world"))
        .into();
    assert_eq!(new.iter().map(|body| three.world.bodies.worlds()[body.index()]).collect::<Vec<_>>(), [0, 0, 2]);
    for _ in 0..200 {
        run(&mut one, 1);
        run(&mut three, 1);
        for i in 0..each {
            assert_eq!(bits_of(&three.world.bodies[each + i]), bits_of(&one.world.bodies[i]));
        }
    }
    let heights: Vec<f32> = new.iter().map(|body| three.world.body(*body).expect("a cube").position.y).collect();
    assert!(heights.iter().zip([4.5, 5.5, 5.5]).all(|(y, at)| (y - at).abs() < 3e-3), "{heights:?}");
}

fn a_joint_goes_with_its_body_and_another_in_its_place_begins_without_impulse(open: Open) {
    let mut world = World::new();
    let link = |y: f32| Body::dynamic().shape(Shape::cuboid(0.1, 0.25, 0.1)).position(0.0, y, 0.0);
    let end = 0.25 * Vec3::Y;
    let links: Vec<_> = (0..4).map(|k| world.insert(link(-0.25 - 0.5 * k as f32))).collect();
    world.insert_joint(Joint::to_world(links[0], end, Vec3::ZERO));
    let joints: Vec<_> = links.windows(2).map(|w| world.insert_joint(Joint::new(w[0], -end, w[1], end))).collect();
    let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), open);
    run(&mut simulation, 120);
    let weight = joint_impulses(&simulation)[0].y;
    simulation.world.remove(links[2]);
    assert!(simulation.world.joint(joints[0]).is_some() && simulation.world.joint(joints[1]).is_none());
    assert_eq!(simulation.world.joints.len(), 2);
    run(&mut simulation, 60);
    // Two links of four are left on the first joint.
    assert!((joint_impulses(&simulation)[0].y / weight - 0.5).abs() < 0.01);
    let new = simulation.world.insert(link(-1.25));
    simulation.world.insert_joint(Joint::new(links[1], -end, new, end));
    run(&mut simulation, 120);
    assert!((joint_impulses(&simulation)[0].y / weight - 0.75).abs() < 0.01);
    assert!(simulation.world.joint_gap() < 1e-3);
}

/// A brick is taken out and put back every tenth step: the pyramid stands, because all other contacts keep their impulses.
fn a_pyramid_of_which_bricks_are_replaced_stands() {
    let mut world = World::new();
    world.insert(ground());
    let rows = 10;
    let brick = |row: usize, k: usize| {
        let x = k as f32 + 0.5 * row as f32;
        Body::dynamic().shape(Shape::cuboid(0.5, 0.25, 0.25)).position(x, 0.25 + 0.5 * row as f32, 0.0)
    };
    let places: Vec<Body> = (0..rows).flat_map(|row| (0..rows - row).map(move |k| brick(row, k))).collect();
    let mut bricks: Vec<BodyHandle> = places.iter().map(|place| world.insert(place.clone())).collect();
    let mut simulation = simulation(&world, &SolverConfig::default(), cpu);
    for i in 0..40 {
        run(&mut simulation, 10);
        let k = i * 37 % places.len();
        let taken = simulation.world.remove(bricks[k]).expect("a brick");
        bricks[k] = simulation.world.insert(taken);
    }
    run(&mut simulation, 240);
    for (i, (handle, place)) in bricks.iter().zip(&places).enumerate() {
        let now = simulation.world.body(*handle).expect("a brick").position;
        assert!(now.distance(place.position) < 5e-3, "brick {i}: {now} and not {}", place.position);
    }
    assert_eq!(simulation.world.bodies.len(), 1 + places.len());
}

/// Places are used again, so that nothing grows.
fn a_world_in_which_bodies_come_and_go_for_long_does_not_grow() {
    let mut world = World::new();
    world.insert(ground());
    let mut simulation = simulation(&world, &SolverConfig::default(), cpu);
    let mut rain = std::collections::VecDeque::new();
    let mut most = [0; 2];
    for step in 0..3000_u32 {
        let place = |of: u32| (step * of % 17) as f32 * 0.25 - 2.0;
        let turn = Quat::from_rotation_x(0.1 * (step % 7) as f32);
        let body = Body::dynamic().shape(Shape::cuboid(0.2, 0.2, 0.2)).position(place(5), 3.0, place(7)).rotation(turn);
        rain.push_back(simulation.world.insert(body));
        if rain.len() > 100 {
            assert!(simulation.world.remove(rain.pop_front().expect("a body")).is_some());
        }
        run(&mut simulation, 1);
        if step == 999 {
            most = [simulation.world.bodies.len(), simulation.problem().contacts.len()];
        }
    }
    assert_eq!(simulation.world.bodies.len(), most[0]);
    let contacts = simulation.problem().contacts.len();
    assert!(contacts < 2 * most[1], "{contacts} rows after {}", most[1]);
    assert!(simulation.world.dynamic().all(|body| body.is_finite() && body.position.y > 0.0));
}

/// The ghost falls through the tower and lands on the ground, and a cube that becomes a ghost falls through what it lay on.
fn bodies_meet_only_those_of_their_groups(open: Open) {
    let (mut world, towers) = towers(1);
    let (solid, ghost) = (Groups { membership: 1, filter: 1 }, Groups { membership: 2, filter: 2 });
    world.bodies.iter_mut().skip(1).for_each(|body| body.groups = solid);
    let falling = world.insert(cube(0.0, 8.0).groups(ghost));
    let mut simulation = simulation(&world, &SolverConfig::default(), open);
    run(&mut simulation, 180);
    let height = |s: &Simulation, body: BodyHandle| s.world.body(body).expect("a cube").position.y;
    assert!((height(&simulation, falling) - 0.5).abs() < 2e-3);
    assert!((height(&simulation, towers[0][4]) - 4.5).abs() < 2e-3);
    simulation.world.body_mut(towers[0][4]).expect("a cube").groups = ghost;
    run(&mut simulation, 180);
    assert!((height(&simulation, towers[0][4]) - 1.5).abs() < 2e-3, "{}", height(&simulation, towers[0][4]));
    assert!((height(&simulation, towers[0][3]) - 3.5).abs() < 2e-3);
}

/// Cubes come, go, change kind, shape and groups, and joints with them: reference, lanes on one thread and on three, and the GPU in exact mode.
fn what_comes_and_goes_has_the_same_bits_everywhere() {
    let opens: [Open; 3] =
        [|| Box::new(Reference::<f32>::new()), cpu, || Box::new(crate::common::gpu::exact()) as Box<dyn Backend>];
    let end = |open: Open| {
        let (world, towers) = towers(3);
        let mut simulation = simulation(&world, &SolverConfig::default(), open);
        let mut all: Vec<BodyHandle> = towers.concat();
        let mut states = Vec::new();
        for round in 0..24_usize {
            run(&mut simulation, 5);
            let world = &mut simulation.world;
            let chosen = all[round * 7 % all.len()];
            match round % 6 {
                0 => drop(world.remove(all.remove(round * 5 % all.len()))),
                1 => all.push(world.insert(cube(3.0 * (round % 3) as f32 + 0.1, 7.0))),
                2 => world.body_mut(chosen).expect("a cube").colliders[0].shape = Shape::ball(0.5),
                3 => world.body_mut(chosen).expect("a cube").kind = BodyKind::Fixed,
                4 => {
                    let at = world.bodies[chosen.index()].position;
                    world.insert_joint(Joint::to_world(chosen, Vec3::ZERO, at + 0.1 * Vec3::X));
                }
                _ => world.body_mut(chosen).expect("a cube").groups = Groups { membership: 2, filter: 3 },
            }
            states.push(all_bits(&simulation.world));
        }
        run(&mut simulation, 5);
        states.push(all_bits(&simulation.world));
        states
    };
    let expected = end(opens[0]);
    for (k, open) in opens.into_iter().enumerate().skip(1) {
        for (round, (states, expected)) in end(open).iter().zip(&expected).enumerate() {
            assert!(states == expected, "backend {k}: round {round}");
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a pool");
    assert!(pool.install(|| end(cpu)) == expected);
}

/// The first pair of the world has no contact, and the rows of a contact that ended are free: other settings write no free rows.
fn settings_change_after_a_contact_ended(open: Open) {
    let ball = |x: f32, y: f32| Body::dynamic().shape(Shape::ball(0.5)).position(x, y, 0.0);
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let near = [world.insert(ball(0.0, 0.0)), world.insert(ball(0.9, 0.9))];
    let touching = [world.insert(ball(10.0, 0.0)), world.insert(ball(10.99, 0.0))];
    let mut simulation = simulation(&world, &SolverConfig::default().without_sleep(), open);
    run(&mut simulation, 1);
    assert_eq!(simulation.manifolds().count(), 1);
    simulation.world.remove(touching[1]);
    run(&mut simulation, 1);
    simulation.set_config(SolverConfig::default().without_sleep().with(|c| c.substeps = 4)).expect("good settings");
    run(&mut simulation, 1);
    assert_eq!(simulation.manifolds().count(), 0);
    assert!(near.iter().all(|&body| simulation.world.body(body).expect("a ball").linear_velocity == Vec3::ZERO));
}

/// A body that moved and became fixed keeps the numbers of its velocity, and they mean nothing.
fn a_fixed_body_with_a_velocity_is_as_one_without(open: Open) {
    let mut world = World::new();
    world.insert(ground());
    // The cube passes by the corner of the fixed one.
    let fixed = world.insert(cube(0.0, 1.2).rotation(Quat::from_rotation_z(0.6)));
    let passing = world.insert(cube(-1.45, 3.0).velocity(Vec3::new(0.1, 0.0, 0.0), Vec3::splat(0.5)));
    world.body_mut(fixed).expect("a cube").kind = BodyKind::Fixed;
    let mut still = simulation(&world, &SolverConfig::default(), open);
    let body = world.body_mut(fixed).expect("a cube");
    (body.linear_velocity, body.angular_velocity) = (Vec3::new(-3.0, 0.0, 20.0), Vec3::splat(8.0));
    assert_eq!(world.kinetic_energy(), still.world.kinetic_energy());
    let mut moving = simulation(&world, &SolverConfig::default(), open);
    for step in 0..90 {
        run(&mut still, 1);
        run(&mut moving, 1);
        let body = |s: &Simulation| bits_of(s.world.body(passing).expect("a cube"));
        assert_eq!(body(&still), body(&moving), "step {step}");
        assert_eq!(still.manifolds().count(), moving.manifolds().count(), "step {step}");
    }
}

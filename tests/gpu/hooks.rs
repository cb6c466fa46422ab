//! Hooks that refuse pairs, drop points and change materials within a step.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use drystone::glam::{Quat, Vec3};
use drystone::{
    Body, BodyHandle, ColliderOf, ContactHooks, Cpu, Error, Listen, PendingContact, Shape, Simulation, SolverConfig,
    World,
};

use crate::common::state::{all_bits, reference};
use crate::common::{Open, gpu};

tests! {
    every_backend {
        a_body_rises_through_a_one_way_platform_and_lands_on_it,
        a_cube_that_keeps_two_points_tips_about_them,
        a_hook_changes_the_friction_of_a_contact_that_is_reused,
        a_hook_changes_the_restitution_of_every_bounce,
        refused_bodies_pass_through_each_other_at_any_speed,
    }
    exact_gpu {
        a_gpu_has_the_bits_of_the_reference_with_hooks,
    }
    no_gpu {
        a_body_that_may_not_touch_wakes_no_sleeper,
        a_hook_that_panics_leaves_the_world_as_it_was,
        points_that_were_dropped_once_are_there_in_the_next_step,
        a_loaded_run_goes_on_with_the_same_bits,
        a_hook_takes_the_friction_from_a_contact_at_rest_at_once,
        a_material_out_of_range_is_an_error_that_names_the_bodies,
        calls_come_in_one_order,
        contacts_have_their_own_materials_without_hooks,
        lanes_have_the_bits_of_the_reference_with_hooks,
    }
}

const DT: f32 = 1.0 / 60.0;
const G: f32 = 9.81;

fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).total_mass(6.0)
}

fn floor() -> Body {
    Body::fixed().shape(Shape::half_space(Vec3::Y))
}

fn simulation(world: World, open: Open) -> Simulation {
    Simulation::with(world, SolverConfig::default(), open()).expect("a good world")
}

fn steps(simulation: &mut Simulation, count: u32) {
    (0..count).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

/// Hooks of two functions.
struct Hooks<F, M>(F, M);

impl<F, M> ContactHooks for Hooks<F, M>
where
    F: FnMut(&World, BodyHandle, BodyHandle) -> bool + Send + Sync,
    M: FnMut(&World, &mut PendingContact) + Send + Sync,
{
    fn may_touch(&mut self, world: &World, a: ColliderOf, b: ColliderOf) -> bool {
        self.0(world, a.body, b.body)
    }

    fn modify(&mut self, world: &World, contact: &mut PendingContact) {
        self.1(world, contact);
    }
}

fn all(_: &World, _: BodyHandle, _: BodyHandle) -> bool {
    true
}

fn nothing(_: &World, _: &mut PendingContact) {}

fn filtering(
    filter: impl FnMut(&World, BodyHandle, BodyHandle) -> bool + Send + Sync + 'static,
) -> Option<Box<dyn ContactHooks>> {
    Some(Box::new(Hooks(filter, nothing)))
}

fn modifying(modify: impl FnMut(&World, &mut PendingContact) + Send + Sync + 'static) -> Option<Box<dyn ContactHooks>> {
    Some(Box::new(Hooks(all, modify)))
}

/// A plate of 10 cm at a height of 2 m, and cubes below it that go up at different speeds.
fn a_body_rises_through_a_one_way_platform_and_lands_on_it(open: Open) {
    let mut world = World::new();
    let plate = world.insert(Body::fixed().shape(Shape::cuboid(30.0, 0.05, 1.0)).position(0.0, 2.0, 0.0));
    let apex = [1.5_f32, 3.5, 4.0, 30.0];
    for (k, &apex) in apex.iter().enumerate() {
        let v = Vec3::Y * (2.0 * G * apex).sqrt();
        world.insert(cube().position(3.0 * k as f32, 0.0, 0.0).velocity(v, Vec3::ZERO));
    }
    let mut simulation = simulation(world, open);
    simulation.set_hooks(filtering(move |world, a, b| {
        assert!(a == plate && b > plate);
        // Only what was above it may touch it.
        world.bodies[b].position.y - 0.5 > 2.04
    }));
    simulation.listen(Listen { contacts: true, ..Listen::default() }).expect("in range");
    let mut highest = [0.0_f32; 4];
    for _ in 0..360 {
        simulation.step(DT).expect("a step");
        let heights = simulation.world.bodies.iter().skip(1).map(|body| body.position.y);
        highest.iter_mut().zip(heights).for_each(|(most, y)| *most = most.max(y));
    }
    for ((&apex, highest), body) in apex.iter().zip(highest).zip(simulation.world.bodies.iter().skip(1)) {
        // A step of 1/60 s misses the top by less than g dt²/8.
        assert!((highest - apex).abs() < 1e-3, "{highest} m, not {apex}");
        if apex > 2.55 {
            assert!((body.position.y - 2.55).abs() < 1e-3, "{}", body.position);
        } else {
            assert!(body.position.y < -10.0, "{}", body.position);
        }
    }
}

/// 200 m/s, through a wall of 2 cm.
fn refused_bodies_pass_through_each_other_at_any_speed(open: Open) {
    for is_refused in [true, false] {
        let mut world = World { gravity: Vec3::ZERO, ..World::new() };
        world.insert(Body::fixed().shape(Shape::cuboid(0.01, 5.0, 5.0)));
        let shot = Body::dynamic().shape(Shape::ball(0.1)).position(-5.0, 0.3, 0.0);
        let shot = world.insert(shot.velocity(Vec3::X * 200.0, Vec3::ZERO).swept());
        let mut simulation = simulation(world, open);
        // As a filter, and as a hook that drops all points.
        let by_filter = filtering(move |_, _, _| !is_refused);
        let by_points = modifying(move |_, contact| {
            contact.points_mut().iter_mut().for_each(|point| point.is_dropped = is_refused);
        });
        for hooks in [by_filter, by_points] {
            simulation.world.bodies[shot].position.x = -5.0;
            simulation.world.bodies[shot].linear_velocity = Vec3::X * 200.0;
            simulation.set_hooks(hooks);
            steps(&mut simulation, 12);
            let ball = &simulation.world.bodies[shot];
            if is_refused {
                assert!((ball.position - Vec3::new(35.0, 0.3, 0.0)).length() < 1e-3, "{}", ball.position);
                assert_eq!(ball.linear_velocity, Vec3::X * 200.0);
            } else {
                assert!(ball.position.x < -0.1, "{}", ball.position);
            }
        }
    }
}

/// A cube slides with the friction of its material, and from a time on without any: its contact is the same one.
fn a_hook_changes_the_friction_of_a_contact_that_is_reused(open: Open) {
    let mut world = World::new();
    world.insert(floor());
    let slider = world.insert(cube().position(0.0, 0.5, 0.0).velocity(Vec3::X * 6.0, Vec3::ZERO));
    let mut simulation = simulation(world, open);
    let mut speeds = Vec::new();
    for friction in [0.5, 0.0, 0.2] {
        simulation.set_hooks(modifying(move |_, contact| {
            assert_eq!((contact.friction, contact.restitution), (0.5, 0.0));
            contact.friction = friction;
        }));
        let before = simulation.world.bodies[slider].linear_velocity.x;
        steps(&mut simulation, 20);
        speeds.push((friction, before - simulation.world.bodies[slider].linear_velocity.x));
    }
    for (friction, lost) in speeds {
        let exact = friction * G * 20.0 * DT;
        assert!((lost - exact).abs() < 0.01 * G * DT + 0.01 * exact, "mu {friction}: lost {lost} m/s, not {exact}");
    }
}

/// A ball of a material without restitution, that every bounce gives another one.
fn a_hook_changes_the_restitution_of_every_bounce(open: Open) {
    let mut world = World::new();
    world.insert(floor());
    let ball = world.insert(Body::dynamic().shape(Shape::ball(0.2)).position(0.0, 1.2, 0.0));
    let mut simulation = simulation(world, open);
    for (height, e) in [(1.0_f32, 0.8_f32), (0.64, 0.5), (0.16, 0.9)] {
        simulation.set_hooks(modifying(move |_, contact| contact.restitution = e));
        let mut highest = 0.0_f32;
        let mut has_bounced = false;
        for _ in 0..200 {
            let before = simulation.world.bodies[ball].linear_velocity.y;
            simulation.step(DT).expect("a step");
            let body = &simulation.world.bodies[ball];
            has_bounced |= before < 0.0 && body.linear_velocity.y > 0.0;
            if has_bounced {
                highest = highest.max(body.position.y - 0.2);
                if body.linear_velocity.y < 0.0 {
                    break;
                }
            }
        }
        let exact = e * e * height;
        assert!((highest - exact).abs() < 0.03 * height, "e = {e}: {highest} m, not {exact}");
    }
}

/// A cube that only the points of one side hold turns about them: 3 g/4 a for sides a.
fn a_cube_that_keeps_two_points_tips_about_them(open: Open) {
    let mut world = World::new();
    world.insert(floor());
    let body = world.insert(cube().position(0.0, 0.5, 0.0).friction(2.0));
    let mut simulation = simulation(world, open);
    steps(&mut simulation, 10);
    simulation.set_hooks(modifying(|_, contact| {
        contact.points_mut().iter_mut().for_each(|point| point.is_dropped = point.position.x > 0.0);
    }));
    steps(&mut simulation, 6);
    let spin = simulation.world.bodies[body].angular_velocity;
    let exact = -0.75 * G * 6.0 * DT;
    assert!((spin.z / exact - 1.0).abs() < 0.05, "{spin} rad/s, not {exact}");
    assert!(simulation.manifolds().all(|manifold| manifold.points().len() == 2));
    // All four hold again, and the cube lies still.
    simulation.set_hooks(None);
    steps(&mut simulation, 180);
    assert!(simulation.world.bodies[body].linear_velocity.length() < 1e-3);
    assert!(simulation.manifolds().all(|manifold| manifold.points().len() == 4));
}

fn points_that_were_dropped_once_are_there_in_the_next_step() {
    let mut world = World::new();
    world.insert(floor());
    world.insert(cube().position(0.0, 0.5, 0.0));
    let mut simulation = simulation(world, reference);
    steps(&mut simulation, 10);
    let points = |simulation: &mut Simulation| simulation.manifolds().map(|m| m.points().len()).collect::<Vec<_>>();
    simulation.set_hooks(modifying(|_, contact| {
        contact.points_mut().iter_mut().for_each(|point| point.is_dropped = point.position.x > 0.0);
    }));
    steps(&mut simulation, 1);
    assert_eq!(points(&mut simulation), [2]);
    simulation.set_hooks(None);
    steps(&mut simulation, 1);
    assert_eq!(points(&mut simulation), [4]);
}

/// Cubes, balls and boards that fall on each other.
fn heap() -> World {
    let mut world = World::new();
    world.insert(floor());
    for k in 0..24 {
        let shape = match k % 3 {
            0 => Shape::cuboid(0.3, 0.2, 0.25),
            1 => Shape::ball(0.25),
            _ => Shape::cuboid(0.5, 0.05, 0.3),
        };
        let at = Vec3::new(0.35 * (k % 4) as f32, 0.4 + 0.3 * k as f32, 0.3 * (k % 3) as f32);
        let turn = Quat::from_scaled_axis(Vec3::new(0.2, 0.3, 0.1) * k as f32);
        world.insert(Body::dynamic().shape(shape).position(at.x, at.y, at.z).rotation(turn));
    }
    world
}

/// Rules that depend on the world only: every fifth body passes through every seventh, balls are icy, cubes bounce, and
/// boards lie on half of their points.
fn rules() -> Option<Box<dyn ContactHooks>> {
    let filter = |_: &World, a: BodyHandle, b: BodyHandle| {
        let [a, b] = [a, b].map(BodyHandle::index);
        !(a.is_multiple_of(5) && b.is_multiple_of(7) && a > 0)
    };
    let modify = |world: &World, contact: &mut PendingContact| {
        let is = |kind: usize| [contact.a, contact.b].iter().any(|side| side.body.index() % 3 == kind);
        let (bounces, is_icy, is_board) = (is(1), is(2), is(0));
        if is_icy {
            contact.friction *= 0.1;
        }
        if bounces {
            contact.restitution = 0.4;
        }
        if is_board && world.bodies[contact.b.body].linear_velocity.y < -1.0 {
            contact.points_mut()[0].is_dropped = true;
        }
    };
    Some(Box::new(Hooks(filter, modify)))
}

fn hooked_run(open: Open, count: u32) -> World {
    let mut simulation = simulation(heap(), open);
    simulation.set_hooks(rules());
    steps(&mut simulation, count);
    simulation.into_world()
}

fn lanes_have_the_bits_of_the_reference_with_hooks() {
    let expected = all_bits(&hooked_run(reference, 120));
    assert_eq!(all_bits(&hooked_run(|| Box::new(Cpu::new()), 120)), expected);
    assert_eq!(all_bits(&hooked_run(|| Box::new(Cpu::new().dividing_above(0)), 120)), expected);
    let mut free = simulation(heap(), reference);
    steps(&mut free, 120);
    assert_ne!(all_bits(&free.world), expected, "the hooks change nothing");
}

fn a_gpu_has_the_bits_of_the_reference_with_hooks() {
    assert_eq!(all_bits(&hooked_run(|| Box::new(gpu::exact()), 60)), all_bits(&hooked_run(reference, 60)));
}

/// Friction holds a cube that a force pulls with 0.3 m g, so that its contact is reused.
/// Without friction it goes in the very next step.
fn a_hook_takes_the_friction_from_a_contact_at_rest_at_once() {
    let mut world = World::new();
    world.insert(floor());
    let body = world.insert(cube().position(0.0, 0.5, 0.0));
    world.bodies[body].force = Vec3::X * (0.3 * G * world.bodies[body].mass.mass);
    let mut simulation = simulation(world, reference);
    steps(&mut simulation, 10);
    assert!(simulation.world.bodies[body].linear_velocity.length() < 1e-3);
    simulation.set_hooks(modifying(|_, contact| contact.friction = 0.0));
    steps(&mut simulation, 1);
    let speed = simulation.world.bodies[body].linear_velocity.x;
    let exact = 0.3 * G * DT;
    assert!((speed - exact).abs() < 0.03 * exact, "{speed} m/s, not {exact}");
}

fn a_loaded_run_goes_on_with_the_same_bits() {
    let mut one = simulation(heap(), reference);
    one.set_hooks(rules());
    for _ in 0..12 {
        steps(&mut one, 9);
        let mut other = Simulation::load(&one.save(), reference()).expect("its own bytes");
        other.set_hooks(rules());
        let mut fork = one.fork(reference());
        fork.set_hooks(rules());
        for simulation in [&mut one, &mut other, &mut fork] {
            steps(simulation, 3);
        }
        assert_eq!(all_bits(&one.world), all_bits(&other.world));
        assert_eq!(all_bits(&one.world), all_bits(&fork.world));
    }
}

fn calls_come_in_one_order() {
    let calls = |open: Open| {
        let said = Arc::new(Mutex::new(Vec::new()));
        let (asked, told) = (Arc::clone(&said), Arc::clone(&said));
        let filter = move |_: &World, a: BodyHandle, b: BodyHandle| {
            let [a, b] = [a, b].map(BodyHandle::index);
            assert!(a < b);
            asked.lock().expect("no panic").push([a, b, usize::MAX]);
            true
        };
        let modify = move |_: &World, contact: &mut PendingContact| {
            let [a, b] = [contact.a, contact.b].map(|side| side.body.index());
            told.lock().expect("no panic").push([a, b, contact.points().len()]);
        };
        let mut simulation = simulation(heap(), open);
        simulation.set_hooks(Some(Box::new(Hooks(filter, modify))));
        steps(&mut simulation, 40);
        drop(simulation);
        Arc::into_inner(said).expect("the last").into_inner().expect("no panic")
    };
    let expected = calls(reference);
    assert!(expected.iter().any(|call| call[2] == 4) && expected.iter().any(|call| call[2] == usize::MAX));
    assert_eq!(calls(|| Box::new(Cpu::new())), expected);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    assert_eq!(pool.install(|| calls(|| Box::new(Cpu::new()))), expected);
}

fn a_hook_that_panics_leaves_the_world_as_it_was() {
    let mut world = heap();
    world.bodies[1].name = "crate".into();
    let mut simulation = simulation(world, reference);
    steps(&mut simulation, 30);
    let before = all_bits(&simulation.world);
    let count = Arc::new(AtomicUsize::new(0));
    let seen = Arc::clone(&count);
    simulation.set_hooks(modifying(move |_, contact| {
        seen.fetch_add(1, Ordering::Relaxed);
        assert!([contact.a, contact.b].iter().all(|side| side.body.index() != 1), "no crates");
    }));
    let error = simulation.step(DT).expect_err("the hook panics");
    assert!(matches!(error, Error::Panicked(_)), "{error:?}");
    let line = error.to_string();
    assert!(line.contains("\"crate\"") && line.contains("no crates"), "{line}");
    assert!(count.load(Ordering::Relaxed) > 0);
    assert_eq!(all_bits(&simulation.world), before);
    simulation.set_hooks(filtering(|_, _, _| panic!("none")));
    assert!(simulation.step(DT).is_err());
    assert_eq!(all_bits(&simulation.world), before);
    simulation.set_hooks(None);
    steps(&mut simulation, 30);
    assert_ne!(all_bits(&simulation.world), before);
}

fn a_material_out_of_range_is_an_error_that_names_the_bodies() {
    let mut world = World::new();
    world.insert(floor());
    world.insert(cube().named("crate").position(0.0, 0.5, 0.0));
    let mut simulation = simulation(world, reference);
    let before = all_bits(&simulation.world);
    let mut line = |modify: fn(&World, &mut PendingContact)| {
        simulation.set_hooks(modifying(modify));
        let line = simulation.step(DT).expect_err("out of range").to_string();
        assert_eq!(all_bits(&simulation.world), before);
        line
    };
    let friction = line(|_, contact| contact.friction = f32::NAN);
    assert!(friction.contains("\"crate\"") && friction.contains("friction = NaN: must be 0 or more"), "{friction}");
    let restitution = line(|_, contact| contact.restitution = 1.5);
    assert!(restitution.ends_with("restitution = 1.5: must be 0 to 1"), "{restitution}");
}

/// Without hooks, a slider has the friction of its material again, and bits do not depend on hooks that change nothing.
fn contacts_have_their_own_materials_without_hooks() {
    let mut world = World::new();
    world.insert(floor());
    let slider = world.insert(cube().position(0.0, 0.5, 0.0).velocity(Vec3::X * 9.0, Vec3::ZERO));
    let mut icy = simulation(world, reference);
    icy.set_hooks(modifying(|_, contact| contact.friction = 0.0));
    steps(&mut icy, 30);
    assert!((icy.world.bodies[slider].linear_velocity.x - 9.0).abs() < 1e-3);
    icy.set_hooks(None);
    steps(&mut icy, 30);
    let speed = icy.world.bodies[slider].linear_velocity.x;
    assert!((speed - (9.0 - 0.5 * G * 0.5)).abs() < 0.03, "{speed} m/s");

    let [mut free, mut idle] = [None, modifying(nothing)].map(|hooks| {
        let mut simulation = simulation(heap(), reference);
        simulation.set_hooks(hooks);
        simulation
    });
    steps(&mut free, 120);
    steps(&mut idle, 120);
    assert_eq!(all_bits(&free.world), all_bits(&idle.world));
}

fn a_body_that_may_not_touch_wakes_no_sleeper() {
    for may_touch in [false, true] {
        let mut world = World::new();
        world.insert(floor());
        let sleeper = world.insert(cube().position(0.0, 0.5, 0.0));
        let mut simulation = simulation(world, reference);
        steps(&mut simulation, 60);
        assert!(simulation.is_asleep(sleeper));
        let ghost = simulation.world.insert(cube().position(-3.0, 0.7, 0.0).gravity_scale(0.0));
        simulation.world.bodies[ghost].linear_velocity = Vec3::X * 3.0;
        simulation.set_hooks(filtering(move |_, a, b| may_touch || [a, b] != [sleeper, ghost]));
        let mut woke = false;
        for _ in 0..120 {
            simulation.step(DT).expect("a step");
            woke |= !simulation.is_asleep(sleeper);
        }
        assert_eq!(woke, may_touch);
        assert_eq!((simulation.world.bodies[ghost].position.x - 3.0).abs() < 1e-3, !may_touch);
    }
}

//! Events: contacts that begin and end, hits, and the impulses of whole steps.

use crate::common::sample::one_in;
use crate::common::state::reference;
use crate::common::{Open, gpu};
use drystone::glam::{Quat, Vec3, Vec3Swizzles};
use drystone::{
    Backend, Body, BodyHandle, ColliderOf, Cpu, Event, Groups, Hit, Joint, Listen, Shape, Simulation, SolverConfig,
    World,
};

/// The example, whose own check has to hold.
#[path = "../../examples/events.rs"]
mod example;

tests! {
    exact_gpu {
        a_ball_that_lands_begins_once_and_ends_once_when_it_is_lifted,
        a_ball_loses_the_summed_impulse_in_every_step,
        contacts_of_a_device_have_their_impulses_without_asking_it,
        all_backends_tell_the_same,
        a_joint_breaks_at_its_force_and_is_gone,
    }
    any_gpu {
        plain_wgsl_sums_the_impulses_too,
    }
    no_gpu {
        a_ball_that_bounces_begins_and_ends_with_every_bounce,
        a_hit_has_the_speed_and_the_impulse_of_the_closed_form,
        a_slow_contact_is_no_hit,
        a_body_that_goes_ends_its_contacts_under_its_old_handle,
        a_compound_names_the_collider_that_touches,
        bodies_that_are_only_near_do_not_touch,
        worlds_beside_each_other_tell_what_each_alone_tells,
        who_begins_to_listen_hears_of_what_touches_and_who_ends_hears_nothing,
        listening_changes_no_bit_of_the_motion,
        a_threshold_that_is_no_speed_is_refused,
        the_contacts_of_a_body_are_those_of_all_that_name_it,
        the_example_counts_five_balls,
        a_ball_falls_through_a_sensor_as_if_none_were_there,
        a_sensor_tells_of_overlap_to_the_step,
        a_moving_sensor_meets_what_sleeps_and_wakes_nothing,
        sensors_see_whom_their_groups_meet_and_no_sensors,
        what_is_gone_left_the_sensor,
        a_sensor_sees_what_moved_further_than_expected,
        a_sensor_has_no_mass_and_holds_nobody,
    }
}

const DT: f32 = 1.0 / 60.0;
const CONTACTS: Listen = Listen { contacts: true, hits_above: None, impulses: false };

fn cpu() -> Box<dyn Backend> {
    Box::new(Cpu::new())
}

fn exact() -> Box<dyn Backend> {
    Box::new(gpu::exact())
}

fn plain() -> Box<dyn Backend> {
    Box::new(gpu::plain())
}

const EXACT: [Open; 3] = [reference, cpu, exact];

fn floor() -> Body {
    Body::fixed().shape(Shape::cuboid(50.0, 0.5, 50.0)).position(0.0, -0.5, 0.0)
}

fn ball(height: f32) -> Body {
    Body::dynamic().shape(Shape::ball(0.5)).position(0.0, height, 0.0)
}

fn cube(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, 0.0)
}

fn simulation(world: &World, config: &SolverConfig, backend: Box<dyn Backend>, listen: Listen) -> Simulation {
    let mut simulation = Simulation::with(world.clone(), config.clone(), backend).expect("a good world");
    simulation.listen(listen).expect("a good threshold");
    simulation
}

/// The events of some steps, with the number of their step.
fn run(simulation: &mut Simulation, steps: usize) -> Vec<(usize, Event)> {
    let mut told = Vec::new();
    for step in 0..steps {
        simulation.step(DT).expect("a step");
        told.extend(simulation.events().iter().map(|event| (step, *event)));
    }
    told
}

fn of(body: BodyHandle) -> ColliderOf {
    ColliderOf { body, collider: 0 }
}

fn began(a: BodyHandle, b: BodyHandle) -> Event {
    Event::Began { a: of(a), b: of(b) }
}

fn ended(a: BodyHandle, b: BodyHandle) -> Event {
    Event::Ended { a: of(a), b: of(b) }
}

fn on_floor(body: Body) -> (World, BodyHandle, BodyHandle) {
    let mut world = World::new();
    let floor = world.insert(floor());
    let body = world.insert(body);
    (world, floor, body)
}

fn a_ball_that_lands_begins_once_and_ends_once_when_it_is_lifted() {
    for open in EXACT {
        let (world, floor, ball) = on_floor(ball(1.5));
        let mut simulation = simulation(&world, &SolverConfig::default(), open(), CONTACTS);
        let told = run(&mut simulation, 200);
        // It falls 1 m in 27.1 steps, and is stopped a substep before its surface meets the floor.
        assert_eq!(told, [(26, began(floor, ball))]);
        assert!(simulation.is_asleep(ball), "the ball rests and sleeps");
        simulation.world.body_mut(ball).expect("the ball").position.y += 2.0;
        let told = run(&mut simulation, 5);
        assert_eq!(told, [(0, ended(floor, ball))]);
    }
}

fn a_ball_that_bounces_begins_and_ends_with_every_bounce() {
    for open in [reference, cpu] {
        let (world, floor, ball) = on_floor(ball(5.5).restitution(0.8));
        let mut simulation = simulation(&world, &SolverConfig::default(), open(), CONTACTS);
        let told = run(&mut simulation, 240);
        let events: Vec<Event> = told.iter().map(|(_, event)| *event).collect();
        // Bounces at 1.01, 2.62 and 3.91 s.
        assert_eq!(events, [began(floor, ball), ended(floor, ball)].repeat(3));
        let begins: Vec<usize> = told.iter().step_by(2).map(|(step, _)| *step).collect();
        assert_eq!(begins, [60, 157, 235]);
        assert!(told.chunks(2).all(|bounce| bounce[1].0 == bounce[0].0 + 1), "{told:?}");
    }
}

/// Balls and cubes of several masses, materials and sizes fall into each other.
fn heap() -> World {
    let mut world = World::new();
    world.insert(floor());
    for i in 0..24 {
        let (x, y) = ((i % 4) as f32 * 0.9, 1.0 + (i / 4) as f32 * 1.3);
        let body = if i % 3 == 0 { ball(0.0) } else { cube(0.0, 0.0) };
        let body = body.density(200.0 * (1 + i % 5) as f32).restitution(0.1 * (i % 6) as f32);
        world.insert(body.position(x, y, 0.3 * (i % 2) as f32).rotation(Quat::from_rotation_y(0.4 * i as f32)));
    }
    world
}

/// The momentum that contacts gave to each body in a step.
fn given(simulation: &mut Simulation) -> Vec<Vec3> {
    let mut given = vec![Vec3::ZERO; simulation.world.bodies.len()];
    for manifold in simulation.manifolds() {
        // A contact that rests keeps what it had.
        let impulse = manifold.summed.expect("somebody listens");
        given[manifold.a.body.index()] -= impulse;
        given[manifold.b.body.index()] += impulse;
    }
    given
}

/// Largest difference between the momentum that bodies gained in a step and what contacts and gravity gave, over the largest impulse. Steps are
/// left out that took energy which contacts had made: no contact took that momentum.
fn largest_error(world: &World, config: &SolverConfig, backend: Box<dyn Backend>, steps: usize) -> f32 {
    let mut simulation = simulation(world, config, backend, Listen { impulses: true, ..Listen::default() });
    let (mut worst, mut largest, mut left_out) = (0.0_f32, 0.0_f32, 0);
    for _ in 0..steps {
        let before: Vec<Vec3> = simulation.world.bodies.iter().map(|body| body.linear_velocity).collect();
        if simulation.step(DT).expect("a step").energy_taken > 0.0 {
            left_out += 1;
            continue;
        }
        let given = given(&mut simulation);
        for (i, body) in simulation.world.bodies.iter().enumerate().filter(|(_, body)| body.mass.mass > 0.0) {
            let gained = (body.linear_velocity - before[i] - simulation.world.gravity * DT) * body.mass.mass;
            worst = worst.max((gained - given[i]).length());
            largest = largest.max(given[i].length());
        }
    }
    assert!(largest > 100.0, "{largest} N s: nothing bounced");
    assert!(10 * left_out <= steps, "{left_out} of {steps} steps took energy");
    worst / largest
}

/// A ball of 524 kg that falls 5 m loses 5,190 N s on the floor, and gains some of it again; all of it stands in the sums.
fn a_ball_loses_the_summed_impulse_in_every_step() {
    let config = SolverConfig::default().without_sleep();
    for open in EXACT {
        for restitution in [0.0, 0.7] {
            let (world, ..) = on_floor(ball(5.5).restitution(restitution));
            for substeps in [1, 3, 8, 20].into_iter().step_by(one_in(2)) {
                let config = config.clone().with(|c| c.substeps = substeps);
                let error = largest_error(&world, &config, open(), 90);
                assert!(error < 2e-6, "{substeps} substeps, restitution {restitution}: {error}");
            }
        }
    }
    // Friction, patches, several colors and classes of effort.
    for open in EXACT {
        for friction_at in [drystone::config::FrictionAt::Points, drystone::config::FrictionAt::Manifold] {
            let config = config.clone().with(|c| c.friction_at = friction_at);
            let error = largest_error(&heap(), &config, open(), 90);
            assert!(error < 1e-5, "{friction_at:?}: {error}");
        }
    }
    let mut world = World::new();
    world.insert(floor());
    let [lowest, ..] = [0.5, 1.5, 2.5, 3.5].map(|y| world.insert(cube(0.0, y)));
    world.insert(cube(0.0, 6.5).density(100_000.0));
    for open in EXACT {
        let mut tower = simulation(&world, &config, open(), Listen::default());
        assert!((0..90).any(|_| tower.step(DT).map(|_| tower.substeps_of(lowest) > config.substeps).expect("a step")));
        let error = largest_error(&world, &config, open(), 90);
        assert!(error < 1e-5, "classes of effort: {error}");
    }
}

fn plain_wgsl_sums_the_impulses_too() {
    let (world, ..) = on_floor(ball(5.5).restitution(0.7));
    let config = SolverConfig::default().without_sleep();
    let error = largest_error(&world, &config, plain(), 90);
    assert!(error < 2e-6, "{error}");
}

fn a_hit_has_the_speed_and_the_impulse_of_the_closed_form() {
    for open in [reference, cpu] {
        for (drop, restitution) in [(0.5, 0.0), (2.0, 0.5), (5.0, 1.0)] {
            let (world, floor, ball) = on_floor(ball(0.5 + drop).restitution(restitution));
            let listen = Listen { hits_above: Some(1.0), ..Listen::default() };
            let mut simulation = simulation(&world, &SolverConfig::default(), open(), listen);
            let told = run(&mut simulation, 80);
            let Some((_, Event::Hit(hit))) = told.first() else { panic!("no hit from {drop} m") };
            let Hit { a, b, point, normal, speed, impulse } = *hit;
            assert_eq!((a, b), (of(floor), of(ball)));
            assert!(normal.distance(Vec3::Y) < 1e-5 && point.xz().length() < 1e-3, "{hit:?}");
            let expected = (2.0 * 9.81 * drop).sqrt();
            assert!((speed / expected - 1.0).abs() < 2e-3, "{speed} m/s, not {expected}");
            let mass = simulation.world.body(ball).expect("the ball").mass.mass;
            let momentum = mass * expected * (1.0 + restitution);
            // In the rest of its step the ball weighs on the floor, or flies.
            assert!((impulse / momentum - 1.0).abs() < 0.06, "{impulse} N s, not {momentum}");
        }
    }
}

fn a_slow_contact_is_no_hit() {
    let (world, ..) = on_floor(ball(1.5));
    for (least, hits) in [(4.4, 1), (4.5, 0)] {
        let listen = Listen { hits_above: Some(least), ..Listen::default() };
        let mut simulation = simulation(&world, &SolverConfig::default(), reference(), listen);
        assert_eq!(run(&mut simulation, 120).len(), hits, "above {least} m/s");
    }
}

fn a_body_that_goes_ends_its_contacts_under_its_old_handle() {
    for open in [reference, cpu] {
        let mut world = World::new();
        let floor = world.insert(floor());
        let cubes = [0.5, 1.5].map(|y| world.insert(cube(0.0, y)));
        let mut simulation = simulation(&world, &SolverConfig::default(), open(), CONTACTS);
        let told = run(&mut simulation, 120);
        assert_eq!(told, [(0, began(floor, cubes[0])), (0, began(cubes[0], cubes[1]))]);
        assert!(simulation.is_asleep(cubes[0]));
        simulation.world.remove(cubes[0]);
        // Another body takes the index, and the place.
        let new = simulation.world.insert(cube(0.0, 0.5));
        assert_eq!(new.index(), cubes[0].index());
        let told = run(&mut simulation, 60);
        let expected = [ended(floor, cubes[0]), began(floor, new), ended(cubes[0], cubes[1]), began(new, cubes[1])]
            .map(|e| (0, e));
        assert_eq!(told, expected);
        // A change of groups ends contacts; that of a shape which still touches does not.
        let shape = Shape::cuboid(0.4, 0.5, 0.4);
        simulation.world.body_mut(new).expect("the cube").colliders[0].shape = shape;
        assert_eq!(run(&mut simulation, 60), []);
        simulation.world.body_mut(cubes[1]).expect("the cube").groups = Groups { membership: 1, filter: 0 };
        assert_eq!(run(&mut simulation, 60), [(0, ended(new, cubes[1]))]);
    }
}

fn a_compound_names_the_collider_that_touches() {
    let dumbbell = Body::dynamic().shape_at(Shape::ball(0.2), Vec3::new(0.0, 0.8, 0.0), Quat::IDENTITY).shape_at(
        Shape::ball(0.5),
        Vec3::ZERO,
        Quat::IDENTITY,
    );
    let (world, floor, dumbbell) = on_floor(dumbbell.position(0.0, 0.6, 0.0));
    let mut simulation = simulation(&world, &SolverConfig::default(), reference(), CONTACTS);
    let told = run(&mut simulation, 20);
    let lower = ColliderOf { body: dumbbell, collider: 1 };
    assert_eq!(told.iter().map(|told| told.1).collect::<Vec<_>>(), [Event::Began { a: of(floor), b: lower }]);
}

/// Speculative contacts reach further than the surfaces.
fn bodies_that_are_only_near_do_not_touch() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let [left, right] = [-0.502, 0.502].map(|x| world.insert(cube(x, 0.0)));
    let mut simulation = simulation(&world, &SolverConfig::default(), reference(), CONTACTS);
    assert_eq!(run(&mut simulation, 10), []);
    assert_eq!(simulation.manifolds().count(), 1, "there is a contact, 4 mm apart");
    simulation.world.body_mut(left).expect("a cube").linear_velocity.x = 0.1;
    let told = run(&mut simulation, 10);
    // 4 mm at 0.1 m/s take 2.4 steps.
    assert_eq!(told.first(), Some(&(2, began(left, right))));
}

fn all_backends_tell_the_same() {
    let listen = Listen { contacts: true, hits_above: Some(0.5), impulses: true };
    let mut world = heap();
    world.beside(&heap());
    let steps = 100;
    let told = EXACT.map(|open| run(&mut simulation(&world, &SolverConfig::default(), open(), listen), steps));
    let hits = told[0].iter().filter(|told| matches!(told.1, Event::Hit(_))).count();
    let ends = told[0].iter().filter(|told| matches!(told.1, Event::Ended { .. })).count();
    assert!(told[0].len() > 100 && hits > 30 && ends > 10, "{} events, {hits} hits, {ends} ends", told[0].len());
    assert!(told[0] == told[1], "the lanes tell something else");
    assert!(told[0] == told[2], "the device tells something else");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let again = pool.install(|| run(&mut simulation(&world, &SolverConfig::default(), cpu(), listen), steps));
        assert!(told[0] == again, "{threads} threads tell something else");
    }
}

fn worlds_beside_each_other_tell_what_each_alone_tells() {
    let alone = heap();
    let mut beside = heap();
    beside.beside(&alone);
    let config = SolverConfig::default();
    let listen = Listen { contacts: true, hits_above: Some(1.0), impulses: false };
    let expected = run(&mut simulation(&alone, &config, cpu(), listen), 90);
    let told = run(&mut simulation(&beside, &config, cpu(), listen), 90);
    let bodies = alone.bodies.len();
    for world in 0..2 {
        let of_world = |side: ColliderOf| {
            assert!(side.body.index() / bodies < 2);
            (side.body.index() / bodies == world).then(|| (side.body.index() % bodies, side.collider))
        };
        let named = |(step, event): &(usize, Event)| {
            let (a, b, rest) = match event {
                Event::Began { a, b } => (a, b, "began".into()),
                Event::Ended { a, b } => (a, b, "ended".into()),
                Event::Hit(hit) => (&hit.a, &hit.b, format!("{} {} {}", hit.point, hit.speed, hit.impulse)),
                _ => panic!("{event:?}"),
            };
            Some((*step, of_world(*a)?, of_world(*b)?, rest))
        };
        let own: Vec<_> = told.iter().filter_map(named).collect();
        let first = |(step, event): &(usize, Event)| {
            let (a, b, rest) = match event {
                Event::Began { a, b } => (a, b, "began".to_string()),
                Event::Ended { a, b } => (a, b, "ended".into()),
                Event::Hit(hit) => (&hit.a, &hit.b, format!("{} {} {}", hit.point, hit.speed, hit.impulse)),
                _ => panic!("{event:?}"),
            };
            (*step, (a.body.index(), a.collider), (b.body.index(), b.collider), rest)
        };
        let expected: Vec<_> = expected.iter().map(first).collect();
        assert!(expected.len() > 40, "{} events", expected.len());
        assert_eq!(own, expected, "world {world}");
    }
}

fn who_begins_to_listen_hears_of_what_touches_and_who_ends_hears_nothing() {
    let (world, floor, cube) = on_floor(cube(0.0, 0.5));
    let config = SolverConfig::default().without_sleep();
    let mut simulation = simulation(&world, &config, cpu(), Listen::default());
    assert_eq!(run(&mut simulation, 30), []);
    assert!(simulation.manifolds().all(|m| m.summed.is_none() && m.points().iter().all(|p| p.summed.is_none())));
    simulation.listen(CONTACTS).expect("a good threshold");
    assert_eq!(run(&mut simulation, 30), [(0, began(floor, cube))]);
    let weight = 9.81 * 1000.0 * DT;
    let borne: f32 = simulation.manifolds().map(|m| m.summed.expect("sums").y).sum();
    assert!((borne / weight - 1.0).abs() < 1e-3, "{borne} N s, not {weight}");
    simulation.listen(Listen::default()).expect("a good threshold");
    simulation.world.body_mut(cube).expect("the cube").position.y += 1.0;
    assert_eq!(run(&mut simulation, 60), []);
    assert!(simulation.manifolds().all(|m| m.summed.is_none()));
}

fn listening_changes_no_bit_of_the_motion() {
    let config = SolverConfig::default();
    let all = Listen { contacts: true, hits_above: Some(0.0), impulses: true };
    for open in [reference, cpu] {
        let [mut deaf, mut hearing] =
            [Listen::default(), all].map(|listen| simulation(&heap(), &config, open(), listen));
        for step in 0..120 {
            deaf.step(DT).expect("a step");
            hearing.step(DT).expect("a step");
            for (one, other) in deaf.world.bodies.iter().zip(&hearing.world.bodies) {
                let bits = |body: &Body| {
                    let (p, q, v) = (body.position, body.rotation, body.linear_velocity);
                    [p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z].map(f32::to_bits)
                };
                assert_eq!(bits(one), bits(other), "step {step}");
            }
        }
    }
}

fn a_threshold_that_is_no_speed_is_refused() {
    let (world, ..) = on_floor(ball(1.0));
    let mut simulation = simulation(&world, &SolverConfig::default(), cpu(), CONTACTS);
    for least in [-1.0, f32::NAN] {
        let refused = simulation.listen(Listen { hits_above: Some(least), ..Listen::default() });
        assert!(refused.is_err_and(|e| e.to_string().contains("hits_above")));
        assert_eq!(simulation.listening(), CONTACTS);
    }
}

fn entered(sensor: BodyHandle, visitor: BodyHandle) -> Event {
    Event::Entered { sensor: of(sensor), visitor: of(visitor) }
}

fn left(sensor: BodyHandle, visitor: BodyHandle) -> Event {
    Event::Left { sensor: of(sensor), visitor: of(visitor) }
}

fn hears_sensors(world: &World, backend: Box<dyn Backend>) -> Simulation {
    simulation(world, &SolverConfig::default(), backend, Listen::default())
}

fn a_ball_falls_through_a_sensor_as_if_none_were_there() {
    for open in [reference, cpu] {
        let (without, _, ball) = on_floor(ball(4.0));
        let mut with = without.clone();
        let gate = with.insert(Body::fixed().sensor(Shape::cuboid(1.0, 0.25, 1.0)).position(0.0, 2.0, 0.0));
        let mut without = hears_sensors(&without, open());
        let mut with = hears_sensors(&with, open());
        let mut told = Vec::new();
        for step in 0..120 {
            run(&mut without, 1);
            told.extend(run(&mut with, 1).into_iter().map(|(_, event)| (step, event)));
            let [one, other] = [&without, &with].map(|s| s.world.body(ball).expect("the ball"));
            assert_eq!((one.position, one.linear_velocity), (other.position, other.linear_velocity), "step {step}");
            let height = other.position.y;
            let overlaps = (1.25..=2.75).contains(&height);
            assert_eq!(with.overlaps().len(), usize::from(overlaps), "step {step}: at {height}");
        }
        let events: Vec<Event> = told.iter().map(|told| told.1).collect();
        assert_eq!(events, [entered(gate, ball), left(gate, ball)]);
        assert_eq!(with.manifolds().count(), without.manifolds().count());
    }
}

/// Overlap is that of the surfaces where a step left them, and neither that of their boxes nor of a margin.
fn a_sensor_tells_of_overlap_to_the_step() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let probe = world.insert(Body::kinematic().sensor(Shape::ball(0.5)).position(-2.0, 0.9, 0.0));
    let still = world.insert(Body::dynamic().shape(Shape::ball(0.5)));
    let mut simulation = hears_sensors(&world, cpu());
    simulation.world.body_mut(probe).expect("the probe").linear_velocity.x = 1.0;
    let mut seen = 0;
    for step in 0..240 {
        run(&mut simulation, 1);
        let distance = simulation.world.bodies[probe.index()].position.distance(Vec3::ZERO);
        assert_eq!(!simulation.overlaps().is_empty(), distance <= 1.0, "step {step}: {distance} m");
        seen += simulation.overlaps().len();
        assert_eq!(simulation.world.bodies[still.index()].linear_velocity, Vec3::ZERO);
    }
    // 2 sqrt(1 - 0.9^2) = 0.872 m at 1/60 m a step are 52.3 steps.
    assert_eq!(seen, 53);
}

fn a_moving_sensor_meets_what_sleeps_and_wakes_nothing() {
    for open in [reference, cpu] {
        let (mut world, _, cube) = on_floor(cube(0.0, 0.5));
        let broom = world.insert(Body::kinematic().sensor(Shape::cuboid(0.2, 0.2, 0.2)).position(-3.0, 0.5, 0.0));
        let mut simulation = hears_sensors(&world, open());
        run(&mut simulation, 120);
        assert!(simulation.is_asleep(cube));
        simulation.world.body_mut(broom).expect("the broom").linear_velocity.x = 2.0;
        let mut told = Vec::new();
        for _ in 0..180 {
            told.extend(run(&mut simulation, 1).into_iter().map(|told| told.1));
            assert!(simulation.is_asleep(cube), "the broom woke the cube");
        }
        assert!(told.contains(&entered(broom, cube)) && told.contains(&left(broom, cube)), "{told:?}");
        assert!(simulation.world.body(broom).expect("the broom").position.x > 2.0);
    }
}

fn sensors_see_whom_their_groups_meet_and_no_sensors() {
    let some = Groups { membership: 0b10, filter: 0b10 };
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let ground = world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).position(0.0, -0.2, 0.0));
    let volume = world.insert(Body::fixed().sensor(Shape::cuboid(1.0, 1.0, 1.0)));
    let foot = world.insert(Body::kinematic().sensor(Shape::ball(0.5)));
    let picky = world.insert(Body::kinematic().sensor(Shape::ball(0.5)).groups(some));
    let platform = world.insert(Body::kinematic().shape(Shape::cuboid(0.1, 0.1, 0.1)).position(0.2, 0.0, 0.0));
    let member = world.insert(ball(0.0).position(0.0, 0.4, 0.0).groups(Groups { membership: 0b10, filter: 0b11 }));
    let mut simulation = hears_sensors(&world, cpu());
    run(&mut simulation, 1);
    let pairs: Vec<[usize; 2]> = simulation.overlaps().iter().map(|pair| pair.map(|side| side.body.index())).collect();
    let expected = [(volume, platform), (volume, member), (foot, ground), (foot, platform), (foot, member)];
    let expected = expected.into_iter().chain([(picky, ground), (picky, platform), (picky, member)]);
    assert_eq!(pairs, expected.map(|(s, v)| [s.index(), v.index()]).collect::<Vec<_>>());
    simulation.world.body_mut(ground).expect("the ground").groups = Groups { membership: 0b01, filter: u32::MAX };
    run(&mut simulation, 1);
    assert_eq!(simulation.events(), [left(picky, ground)]);
}

fn what_is_gone_left_the_sensor() {
    let (mut world, _, cube) = on_floor(cube(0.0, 0.5));
    let gate = world.insert(Body::fixed().sensor(Shape::cuboid(2.0, 2.0, 2.0)));
    let mut simulation = hears_sensors(&world, cpu());
    assert_eq!(run(&mut simulation, 120), [(0, entered(gate, cube))]);
    assert!(simulation.is_asleep(cube));
    simulation.world.remove(cube);
    assert_eq!(run(&mut simulation, 3), [(0, left(gate, cube))]);
    let next = simulation.world.insert(self::cube(0.0, 0.5));
    assert_eq!((next.index(), run(&mut simulation, 3)), (cube.index(), vec![(0, entered(gate, next))]));
    simulation.world.remove(gate);
    assert_eq!(run(&mut simulation, 3), [(0, left(gate, next))]);
    // A solid shape that becomes a sensor: the cube falls through.
    let floor = simulation.world.bodies.handle(0).expect("the floor");
    simulation.world.body_mut(floor).expect("the floor").colliders[0].sensor = true;
    assert_eq!(run(&mut simulation, 60), [(0, entered(floor, next)), (38, left(floor, next))]);
    assert!(simulation.world.body(next).expect("the cube").position.y < -1.5);
}

/// A ball that is hit moves against its expected way, out of the box that the tree has of it.
fn a_sensor_sees_what_moved_further_than_expected() {
    let mut world = World::new();
    world.gravity = Vec3::ZERO;
    let fast = ball(0.0).velocity(Vec3::new(100.0, 0.0, 0.0), Vec3::ZERO).position(-1.2, 0.0, 0.0).restitution(1.0);
    let struck = world.insert(ball(0.0));
    world.insert(fast);
    let gate = world.insert(Body::fixed().sensor(Shape::cuboid(0.2, 1.0, 1.0)).position(1.35, 0.0, 0.0));
    let mut simulation = hears_sensors(&world, cpu());
    let told = run(&mut simulation, 1);
    let at = simulation.world.body(struck).expect("the ball").position.x;
    assert!((0.65..2.05).contains(&at), "the ball is at {at} after one step");
    assert_eq!(told, [(0, entered(gate, struck))]);
}

fn a_sensor_has_no_mass_and_holds_nobody() {
    let plain = cube(0.0, 3.0);
    let sensing = plain.clone().sensor_at(Shape::ball(2.0), Vec3::X, Quat::IDENTITY);
    assert_eq!(plain.mass, sensing.mass);
    let mut world = World::new();
    world.insert(Body::fixed().sensor(Shape::cuboid(5.0, 0.5, 5.0)));
    let cube = world.insert(sensing);
    let mut simulation = hears_sensors(&world, cpu());
    run(&mut simulation, 60);
    let body = simulation.world.body(cube).expect("the cube");
    assert!((body.position.y - (3.0 - 4.905)).abs() < 0.1, "{}", body.position);
    assert_eq!(body.mass, plain.mass);
    let refused = World::check(&{
        let mut world = World::new();
        world.insert(Body::fixed().sensor(Shape::half_space(Vec3::Y)));
        world
    });
    assert!(refused.is_err_and(|e| e.to_string().contains("cannot be sensors")));
}

fn the_contacts_of_a_body_are_those_of_all_that_name_it() {
    for listen in [Listen { impulses: true, ..Listen::default() }, Listen::default()] {
        let mut simulation = simulation(&heap(), &SolverConfig::default().without_sleep(), cpu(), listen);
        run(&mut simulation, 90);
        let mut seen = 0;
        for body in simulation.world.bodies.handles().collect::<Vec<_>>() {
            let own: Vec<_> = simulation.contacts_of(body).collect();
            let named = simulation.contacts().filter(|c| c.a.body == body || c.b.body == body);
            assert_eq!(own, named.collect::<Vec<_>>(), "body {}", body.index());
            seen += own.len();
        }
        assert!(seen > 40 && seen == 2 * simulation.contacts().count(), "{seen}");
        let solved: Vec<_> = simulation.manifolds().collect();
        assert_eq!(solved.len(), simulation.contacts().count());
        for manifold in solved {
            let same = |c: &drystone::Contact| [c.a, c.b] == [manifold.a, manifold.b];
            let contact = simulation.contacts().find(same).expect("the contact");
            assert_eq!((contact.normal, contact.impulse), (manifold.normal, manifold.summed.unwrap_or_default()));
            for (point, solved) in contact.points().iter().zip(manifold.points()) {
                assert_eq!(point.separation, solved.separation);
                let surface = |body: BodyHandle, anchor: Vec3| {
                    let body = &simulation.world.bodies[body];
                    body.position + body.rotation * anchor
                };
                let on_a = surface(manifold.a.body, solved.anchor_a);
                let on_b = surface(manifold.b.body, solved.anchor_b);
                assert!((0.5 * (on_a + on_b)).distance(point.position) < 1e-5, "{point:?}");
            }
        }
        // Contacts of a body that went are not those of the body that came.
        let gone = simulation.world.bodies.handle(1).expect("a ball");
        assert!(simulation.contacts_of(gone).count() > 0);
        simulation.world.remove(gone);
        assert_eq!(simulation.contacts_of(gone).count(), 0);
        let new = simulation.world.insert(ball(9.0));
        assert_eq!((new.index(), simulation.contacts_of(new).count()), (1, 0));
        assert!(simulation.contacts().all(|c| c.a.body != gone && c.b.body != gone));
    }
}

fn contacts_of_a_device_have_their_impulses_without_asking_it() {
    let listen = Listen { impulses: true, ..Listen::default() };
    let of = |open: Open| {
        let mut simulation = simulation(&heap(), &SolverConfig::default().without_sleep(), open(), listen);
        run(&mut simulation, 60);
        let of_each = simulation.world.bodies.handles().skip(1).map(|body| simulation.contacts_of(body).collect());
        let contacts: Vec<_> = of_each.max_by_key(Vec::len).expect("bodies");
        (contacts, simulation.contacts().map(|c| c.impulse.length()).sum::<f32>())
    };
    let (ours, theirs) = (of(reference), of(exact));
    assert!(ours.0.len() > 1 && ours.1 > 1000.0, "{} contacts, {} N s", ours.0.len(), ours.1);
    assert_eq!(ours, theirs);
}

fn the_example_counts_five_balls() {
    example::main().expect("a good world");
}

/// A cube of 1,000 kg hangs at 9,810 N; pulled down, it breaks its joint at 10,000 N.
fn a_joint_breaks_at_its_force_and_is_gone() {
    for open in EXACT {
        let mut world = World::new();
        let [held, torn] = [0.0, 5.0].map(|x| {
            let cube = world.insert(cube(x, -0.5).rotation(Quat::IDENTITY));
            let joint = Joint::to_world(cube, 0.5 * Vec3::Y, Vec3::new(x, 0.0, 0.0));
            (cube, world.insert_joint(joint.breaking_at(10_000.0)))
        });
        let mut simulation = hears_sensors(&world, open());
        assert_eq!(run(&mut simulation, 60), []);
        simulation.world.body_mut(torn.0).expect("the cube").force = Vec3::new(0.0, -1000.0, 0.0);
        let told = run(&mut simulation, 60);
        let [(step, Event::Broke { joint, force })] = told[..] else { panic!("{told:?}") };
        assert!(step < 3 && joint == torn.1, "{told:?}");
        // It may not bear all of the pull in the step in which it breaks.
        assert!((10_000.0..10_900.0).contains(&force), "{force} N");
        assert!(simulation.world.joint(torn.1).is_none() && simulation.world.joint(held.1).is_some());
        assert!(simulation.world.body(torn.0).expect("the cube").position.y < -4.0);
        assert!((simulation.world.body(held.0).expect("the cube").position.y + 0.5).abs() < 1e-3);
        simulation.world.joint_mut(held.1).expect("the joint").break_force = 0.0;
        assert!(simulation.step(DT).is_err_and(|e| e.to_string().contains("break_force")));
    }
}

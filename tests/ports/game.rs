//! A small game, and a small job of an engineer.

use std::collections::VecDeque;
use std::f32::consts::PI;

use drystone::glam::{Quat, Vec3, vec3};
use drystone::queries::Filter;
use drystone::{
    Axis, Body, BodyHandle, Cpu, Event, Groups, Joint, JointHandle, Listen, MassProperties, Rollback, Shape,
    Simulation, World,
};
use drystone_scenes::{Scene, SceneFile};

use crate::scene::{DT, at, body, body_mut, cube, floor, ground, place, run, started, upright};

/// The game: 4,000 bodies come and 3,000 go in 400 steps.
#[test]
fn bodies_that_come_and_go_take_the_places_of_each_other() {
    let mut world = World::new();
    world.insert(ground(15.0, 0.5));
    let mut simulation = started(world);
    simulation.listen(Listen { contacts: true, ..Listen::default() }).expect("no threshold");
    let mut present: VecDeque<BodyHandle> = VecDeque::new();
    let (mut gone, mut told) = (Vec::new(), 0);
    for step in 0..400 {
        for i in 0..10 {
            let n = (step * 10 + i) as f32;
            let shape = if i % 2 == 0 { cube(0.2) } else { Shape::ball(0.2) };
            let place = vec3(10.0 * (0.37 * n).sin(), 4.0 + 0.5 * i as f32, 10.0 * (0.71 * n).cos());
            present.push_back(simulation.world.insert(at(Body::dynamic().shape(shape), place)));
        }
        let leave = present.len().saturating_sub(1000);
        for handle in present.drain(..leave) {
            simulation.world.remove(handle).expect("it was there");
            gone.push(handle);
        }
        run(&mut simulation, 1);
        told += simulation.events().len();
        for event in simulation.events() {
            if let Event::Began { a, b } = event {
                assert!([a, b].iter().all(|side| simulation.world.body(side.body).is_some()), "step {step}");
            }
        }
    }
    assert_eq!((present.len(), gone.len()), (1000, 3000));
    assert!(gone.iter().all(|&handle| simulation.world.body(handle).is_none()));
    assert!(simulation.world.bodies.len() <= 1011, "{} places", simulation.world.bodies.len());
    assert!(told > 10_000, "{told} events");
}

/// The game: a lift with a rider, a sensor at its top, a ray and a capsule that look for the rider.
#[test]
fn a_rider_stays_on_a_lift_and_is_found_there() {
    let mut world = World::new();
    world.insert(floor());
    let lift = world.insert(Body::kinematic().shape(Shape::cuboid(2.0, 0.1, 2.0)).position(0.0, 0.1, 0.0));
    let top = world.insert(Body::fixed().sensor(Shape::cuboid(2.0, 0.5, 2.0)).position(0.0, 5.7, 0.0));
    let rider = world.insert(Body::dynamic().shape(cube(0.5)).position(0.0, 0.7, 0.0));
    let mut simulation = started(world);
    run(&mut simulation, 120);
    assert!(simulation.is_asleep(rider));
    let (mut entered, mut left) = (0, 0);
    for step in 0..600 {
        let height = 0.1 + 2.5 * (1.0 - (PI * step as f32 * DT / 5.0).cos());
        body_mut(&mut simulation, lift).move_to(Vec3::Y * height, Quat::IDENTITY, DT);
        run(&mut simulation, 1);
        let slip = (place(&simulation, rider) - place(&simulation, lift) - Vec3::Y * 0.6).length();
        assert!(slip < 1e-3, "step {step}: {slip} m");
        let is_of_rider = |sensor: BodyHandle, visitor: BodyHandle| (sensor, visitor) == (top, rider);
        for event in simulation.events() {
            match event {
                Event::Entered { sensor, visitor } if is_of_rider(sensor.body, visitor.body) => entered += 1,
                Event::Left { sensor, visitor } if is_of_rider(sensor.body, visitor.body) => left += 1,
                _ => {}
            }
        }
    }
    assert_eq!((entered, left), (1, 1));
    let (queries, filter) = (simulation.queries(), Filter::default());
    let ray = queries.ray(Vec3::Y * 20.0, Vec3::NEG_Y, 50.0, &filter).expect("the rider");
    let capsule = Shape::capsule(0.5, 0.3);
    let cast = queries.cast(&capsule, vec3(-5.0, 1.1, 0.0), Quat::IDENTITY, Vec3::X, 10.0, &filter).expect("the rider");
    assert_eq!([ray.body, cast.body], [rider; 2]);
    assert!((cast.distance - 4.2).abs() < 2e-3, "{} m", cast.distance);
}

/// A car on sprung axles, with the joints that steer and those that drive.
struct Car {
    chassis: BodyHandle,
    steered: Vec<JointHandle>,
    driven: Vec<JointHandle>,
}

impl Car {
    const RADIUS: f32 = 0.28;
    const CHASSIS: Groups = Groups { membership: 0b01, filter: !0b10 };
    const WHEELS: Groups = Groups { membership: 0b10, filter: !0b01 };

    fn insert(world: &mut World) -> Self {
        let chassis = Body::dynamic().shape(Shape::cuboid(0.65, 0.3, 0.9)).density(100.0).groups(Self::CHASSIS);
        let middle = Vec3::Y * 0.87;
        let mut car = Self { chassis: world.insert(at(chassis, middle)), steered: vec![], driven: vec![] };
        for (x, z) in [(0.6874, -0.7802), (-0.6874, -0.7802), (0.64, 1.0254), (-0.64, 1.0254)] {
            let (out, is_front) = (vec3(x, 0.6783, z), z > 0.0);
            let inertia = MassProperties::point(9.2, Vec3::ZERO);
            let inertia = MassProperties { principal_inertia: Vec3::splat(0.29), ..inertia };
            let axle = world.insert(at(Body::dynamic().mass_properties(inertia), out));
            let wheel = Body::dynamic().shape(Shape::ball(Self::RADIUS)).density(100.0).friction(1.0);
            let wheel = world.insert(at(wheel.groups(Self::WHEELS), out));
            let strut = Axis::limited(0.0, 0.12).spring(0.0, 3.0, 0.5, 1e5);
            let steering = if is_front { Self::steering(0.0) } else { Axis::LOCKED };
            let mount = Joint::new(axle, Vec3::ZERO, car.chassis, out - middle);
            let mount = mount.generic([Axis::LOCKED, strut, Axis::LOCKED], [Axis::LOCKED, steering, Axis::LOCKED]);
            let mount = world.insert_joint(mount);
            let hub = Joint::new(wheel, Vec3::ZERO, axle, Vec3::ZERO).hinge(Vec3::X).motor(0.0, 0.5);
            let hub = world.insert_joint(hub);
            if is_front {
                car.steered.push(mount);
                car.driven.push(hub);
            }
        }
        car
    }

    fn steering(angle: f32) -> Axis {
        Axis::limited(-0.61, 0.61).spring(angle, 10.0, 1.0, 1e4)
    }

    fn drive(&self, world: &mut World, speed: f32) {
        for &joint in &self.driven {
            world.joint_mut(joint).expect("it is there").angular[0] = Axis::FREE.motor(speed, 100.0);
        }
    }

    fn steer(&self, world: &mut World, angle: f32) {
        for &joint in &self.steered {
            world.joint_mut(joint).expect("it is there").angular[1] = Self::steering(angle);
        }
    }
}

/// Rapier, vehicle_joints3: the car of the game.
#[test]
fn a_car_on_joints_drives_at_the_speed_of_its_rims_and_steers() {
    let mut world = World::new();
    world.insert(floor().friction(1.0));
    let car = Car::insert(&mut world);
    let mut simulation = started(world);
    run(&mut simulation, 120);
    assert!(upright(body(&simulation, car.chassis)) > 0.999);
    car.drive(&mut simulation.world, 20.0);
    run(&mut simulation, 300);
    let speed = body(&simulation, car.chassis).linear_velocity.length();
    assert!((speed - 20.0 * Car::RADIUS).abs() < 0.02, "{speed} m/s");
    let gap = simulation.world.joint_gap();
    assert!(gap < 1e-3, "{gap} m");
    let ahead = |simulation: &Simulation| body(simulation, car.chassis).rotation * Vec3::Z;
    let before = ahead(&simulation);
    car.steer(&mut simulation.world, 0.35);
    run(&mut simulation, 120);
    let turned = before.angle_between(ahead(&simulation)).to_degrees();
    assert!(turned > 45.0, "{turned} degrees in 2 s");
    assert!(upright(body(&simulation, car.chassis)) > 0.95);
}

/// Four players and a hundred boxes.
fn game() -> (Simulation, [BodyHandle; 4]) {
    let mut world = World::new();
    world.insert(floor());
    let player = Body::dynamic().shape(Shape::capsule(0.5, 0.3)).total_mass(80.0).friction(0.8);
    let players = [0.0, 3.0, 6.0, 9.0].map(|x| world.insert(player.clone().position(x, 0.8, 0.0)));
    for i in 0..100 {
        let place = vec3((i % 10) as f32, 0.3 + 0.6 * (i / 10) as f32, 3.0);
        world.insert(at(Body::dynamic().shape(cube(0.3)), place));
    }
    (started(world), players)
}

/// The push of a player in a frame (N).
fn input(player: usize, frame: usize) -> Vec3 {
    let (sin, cos) = (1.3 * (0.1 * frame as f32 + player as f32)).sin_cos();
    400.0 * vec3(cos, 0.0, sin)
}

/// One frame of the game, with the inputs that are known.
fn play(simulation: &mut Simulation, players: &[BodyHandle], frame: usize, is_known: impl Fn(usize) -> bool) {
    for (i, &player) in players.iter().enumerate().filter(|(i, _)| is_known(*i)) {
        body_mut(simulation, player).apply_force(input(i, frame));
    }
    run(simulation, 1);
}

/// The game: inputs of three of four players come ten frames late.
#[test]
fn late_inputs_of_players_give_the_bits_of_inputs_in_time() {
    let ((mut late, players), (mut in_time, same_players)) = (game(), game());
    let (frames, delay) = (120, 10);
    let mut rollback = Rollback::new(delay);
    for frame in 0..frames {
        play(&mut in_time, &same_players, frame, |_| true);
        rollback.push(&late);
        play(&mut late, &players, frame, |player| player == 0);
        if (frame + 1) % delay == 0 {
            rollback.back(delay, &mut late).expect("ten states are kept");
            for again in frame + 1 - delay..=frame {
                rollback.push(&late);
                play(&mut late, &players, again, |_| true);
            }
        }
    }
    assert_eq!(late.hash(), in_time.hash());
}

/// The game: a run goes through a file. Handles stay valid, and damage is one line.
#[test]
fn a_saved_game_goes_on_and_damage_of_its_file_is_told() {
    let (mut simulation, players) = game();
    for frame in 0..50 {
        play(&mut simulation, &players, frame, |_| true);
    }
    let file = tempfile::NamedTempFile::new().expect("a file");
    std::fs::write(file.path(), simulation.save()).expect("it is written");
    run(&mut simulation, 100);
    let bytes = std::fs::read(file.path()).expect("it is there");
    let mut loaded = Simulation::load(&bytes, Box::new(Cpu::new())).expect("a saved run");
    run(&mut loaded, 100);
    assert_eq!(loaded.hash(), simulation.hash());
    assert_eq!(players.map(|player| place(&loaded, player)), players.map(|player| place(&simulation, player)));
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    for bad in [&flipped[..], &bytes[..100], b"hello"] {
        let line = Simulation::load(bad, Box::new(Cpu::new())).err().expect("it is refused").to_string();
        assert!(!line.is_empty() && line.lines().count() == 1, "{line}");
    }
}

/// The job: a block slides in 64 worlds that have gravity and friction of their own, for 5 s.
#[test]
fn blocks_slide_in_sixty_four_worlds_as_far_as_on_paper() {
    let of = |k: usize| (1.62 + 0.2 * k as f32, 0.05 + 0.01 * k as f32);
    let one = |k: usize| {
        let (gravity, friction) = of(k);
        let mut world = World { gravity: Vec3::NEG_Y * gravity, ..World::new() };
        world.insert(floor().friction(friction));
        let block = Body::dynamic().shape(cube(0.5)).friction(friction).position(0.0, 0.5, 0.0);
        world.insert(block.velocity(Vec3::X * 4.0, Vec3::ZERO));
        world
    };
    let mut worlds = one(0);
    (1..64).for_each(|k| worlds.beside(&one(k)));
    let mut simulation = started(worlds);
    run(&mut simulation, 300);
    for (k, bodies) in simulation.world.worlds().iter().enumerate() {
        let (gravity, friction) = of(k);
        let slows = friction * gravity;
        let time = (4.0 / slows).min(5.0);
        let wanted = 4.0 * time - 0.5 * slows * time * time;
        let slid = simulation.world.bodies[bodies[1]].position.x;
        assert!((slid / wanted - 1.0).abs() < 0.0055, "world {k}: {slid} m in place of {wanted} m");
    }
    let mut alone = started(one(17));
    run(&mut alone, 300);
    let beside = &simulation.world.bodies[simulation.world.worlds()[17][1]];
    assert_eq!(beside.position, alone.world.bodies[1].position);
}

/// The game as a scene file.
#[test]
fn a_game_comes_back_from_its_scene_file_with_the_same_bits() {
    let (mut simulation, _) = game();
    let scene = Scene::new("game", simulation.world.clone(), 10);
    let text = SceneFile::of(&scene).expect("a file").to_text();
    let again = SceneFile::parse(&text).and_then(|file| file.into_scene("game")).expect("its own text");
    let mut again = started(again.world);
    run(&mut simulation, 60);
    run(&mut again, 60);
    assert_eq!(again.hash(), simulation.hash());
}

/// The answer to a world with one mistake.
fn refusal(mistake: impl Fn(&mut World)) -> String {
    let mut world = World::new();
    world.insert(floor().named("floor"));
    mistake(&mut world);
    let line = Simulation::new(world).err().expect("it is refused").to_string();
    assert_eq!(line.lines().count(), 1, "{line}");
    line
}

/// Bad bodies. Each answer names the body and the number.
#[test]
fn a_bad_body_is_refused_with_its_name_and_the_number() {
    let crate_ = || Body::dynamic().shape(cube(0.5)).named("crate");
    let shaped = |shape: Shape| Body::dynamic().shape(shape).named("crate");
    let nothing = || Body::dynamic().named("crate");
    let quaternion = |w: f32| Quat::from_xyzw(0.0, 0.0, 0.0, w);
    let bodies = [
        ("position", crate_().position(f32::NAN, 0.0, 0.0)),
        ("position", crate_().position(1e10, 0.0, 0.0)),
        ("velocity", crate_().velocity(Vec3::splat(f32::INFINITY), Vec3::ZERO)),
        ("rotation", crate_().rotation(quaternion(0.0))),
        ("rotation", crate_().rotation(quaternion(2.0))),
        ("density = 0", crate_().density(0.0)),
        ("mass = -1", crate_().total_mass(-1.0)),
        ("needs a shape", nothing()),
        ("needs a shape", nothing().sensor(cube(0.5))),
        ("ball", shaped(Shape::ball(-1.0))),
        ("ball", shaped(Shape::ball(f32::NAN))),
        ("cuboid", shaped(Shape::cuboid(0.5, 0.0, 0.5))),
        ("half-space", shaped(Shape::half_space(Vec3::Y))),
        ("friction = -0.1", crate_().friction(-0.1)),
        ("friction = NaN", crate_().friction(f32::NAN)),
        ("restitution = 1.5", crate_().restitution(1.5)),
    ];
    for (named, body) in bodies {
        let line = refusal(|world| {
            world.insert(body.clone());
        });
        assert!(line.contains("crate") && line.contains(named), "{named}: {line}");
    }
}

/// Bad joints. Each answer names the joint.
#[test]
fn a_bad_joint_is_refused_with_its_number() {
    type Mistake = fn(BodyHandle, [BodyHandle; 2]) -> Joint;
    let joints: [(&str, Mistake); 8] = [
        ("beyond the last", |a, _| Joint::new(a, Vec3::ZERO, BodyHandle::default(), Vec3::ZERO)),
        ("a body with itself", |a, _| Joint::new(a, Vec3::ZERO, a, Vec3::X)),
        ("two fixed bodies", |_, [b, floor]| Joint::new(b, Vec3::ZERO, floor, Vec3::X)),
        ("a NaN anchor", |a, _| Joint::to_world(a, vec3(f32::NAN, 0.0, 0.0), Vec3::Y)),
        ("no direction", |a, _| Joint::to_world(a, Vec3::ZERO, Vec3::Y).hinge(Vec3::ZERO)),
        ("reversed limits", |a, _| Joint::to_world(a, Vec3::ZERO, Vec3::Y).hinge(Vec3::Z).limited(1.0, -1.0)),
        ("limits of nothing", |a, _| Joint::to_world(a, Vec3::ZERO, Vec3::Y).fixed().limited(-0.5, 0.5)),
        ("a motor of nothing", |a, _| Joint::to_world(a, Vec3::ZERO, Vec3::Y).fixed().motor(1.0, 1.0)),
    ];
    for (mistake, joint) in joints {
        let line = refusal(|world| {
            let a = world.insert(Body::dynamic().shape(cube(0.5)).position(0.0, 3.0, 0.0));
            let b = world.insert(Body::fixed().shape(cube(0.5)));
            let floor = world.bodies.handle(0).expect("the floor");
            world.insert_joint(joint(a, [b, floor]));
        });
        assert!(line.starts_with("joint 0"), "{mistake}: {line}");
    }
}

/// Bad meshes, fields and hulls, bad lengths of steps, and more steps back than are kept.
#[test]
fn bad_shapes_and_bad_calls_are_refused() {
    let nan = f32::NAN;
    let bad = [
        Shape::mesh(vec![], vec![]),
        Shape::mesh(vec![Vec3::ZERO; 3], vec![[0, 1, 7]]),
        Shape::mesh(vec![Vec3::ZERO, Vec3::X, Vec3::splat(nan)], vec![[0, 1, 2]]),
        Shape::height_field(&[vec![0.0]], Vec3::ONE),
        Shape::height_field(&[vec![0.0, 1.0], vec![0.0]], Vec3::ONE),
        Shape::height_field(&[vec![0.0, nan], vec![0.0, 0.0]], Vec3::ONE),
        Shape::convex_hull(&[]),
        Shape::convex_hull(&[Vec3::ZERO, Vec3::X, Vec3::Y, vec3(1.0, 1.0, 0.0)]),
        Shape::convex_hull(&[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(nan)]),
    ];
    assert!(bad.iter().all(Result::is_err), "{bad:?}");
    let (mut simulation, _) = game();
    let mut rollback = Rollback::new(4);
    for _ in 0..6 {
        rollback.push(&simulation);
        run(&mut simulation, 1);
    }
    let hash = simulation.hash();
    for dt in [0.0, -0.01, nan, 10.0] {
        assert!(simulation.step(dt).is_err(), "{dt} s");
    }
    assert!(rollback.back(9, &mut simulation).is_err());
    assert_eq!(simulation.hash(), hash);
}

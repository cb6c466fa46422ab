//! The plugin without a window: components in, components and events out.

use std::time::Duration;

use bevy_app::FixedMain;
use bevy_app::prelude::*;
use bevy_drystone::drystone::{
    BodyHandle, Character, ColliderOf, ContactHooks, Cpu, Material, Simulation, SolverConfig, World as Bodies,
};
use bevy_drystone::prelude::*;
use bevy_drystone::{Order, PhysicsSnapshot};
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce;
use bevy_math::{Quat, Vec3};
use bevy_time::{Fixed, Time, TimePlugin, TimeUpdateStrategy};
use bevy_transform::prelude::*;

/// The hash after each step.
#[derive(Resource, Default)]
struct Hashes(Vec<u64>);

/// Messages and errors of all steps, as text.
#[derive(Resource, Default)]
struct Told(Vec<String>);

fn note<M: Message + std::fmt::Debug>(mut messages: MessageReader<M>, mut told: ResMut<Told>) {
    told.0.extend(messages.read().map(|message| format!("{message:?}")));
}

/// An app without bodies, at 64 steps and as many frames a second.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((TimePlugin, TransformPlugin, DrystonePlugin));
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.init_resource::<Hashes>().init_resource::<Told>();
    let hash = |physics: Res<Physics>, mut hashes: ResMut<Hashes>| hashes.0.push(physics.simulation.hash());
    app.add_systems(FixedLast, hash);
    app.add_systems(FixedLast, (note::<PhysicsError>, note::<CollisionStart>, note::<CollisionEnd>).chain());
    app.add_systems(FixedLast, (note::<SensorEnter>, note::<SensorExit>, note::<JointBreak>).chain());
    // The first frame takes no time.
    app.update();
    app
}

/// The same without gravity.
fn app_in_space() -> App {
    let mut app = app();
    app.world_mut().resource_mut::<Physics>().simulation.world.gravity = Vec3::ZERO;
    app
}

fn step(app: &mut App, steps: usize) {
    (0..steps).for_each(|_| app.update());
}

fn ball(x: f32, y: f32) -> (RigidBody, Collider, Transform) {
    (RigidBody::Dynamic, Collider::from(Shape::ball(0.5)), Transform::from_xyz(x, y, 0.0))
}

fn floor() -> (RigidBody, Collider) {
    (RigidBody::Static, Collider::from(Shape::half_space(Vec3::Y)))
}

fn spawn<B: Bundle>(app: &mut App, bundle: B) -> Entity {
    app.world_mut().spawn(bundle).id()
}

fn get<C: Component + Clone>(app: &App, entity: Entity) -> C {
    app.world().get::<C>(entity).expect("the component is there").clone()
}

fn set<C: Component<Mutability = bevy_ecs::component::Mutable>>(
    app: &mut App,
    entity: Entity,
    set: impl FnOnce(&mut C),
) {
    set(&mut app.world_mut().get_mut::<C>(entity).expect("the component is there"));
}

fn place(app: &App, entity: Entity) -> Vec3 {
    get::<Transform>(app, entity).translation
}

fn hash(app: &App) -> u64 {
    app.world().resource::<Physics>().simulation.hash()
}

fn told(app: &mut App) -> Vec<String> {
    std::mem::take(&mut app.world_mut().resource_mut::<Told>().0)
}

fn listen(app: &mut App, listen: Listen) {
    app.world_mut().resource_mut::<Physics>().simulation.listen(listen).expect("a speed");
}

/// A pile that comes to rest, and a door that a motor drives.
fn spawn_scene(app: &mut App) -> Vec<Entity> {
    let mut entities = vec![spawn(app, floor())];
    for i in 0..12 {
        let at = Transform::from_xyz(0.3 * (i % 3) as f32, 0.6 + 1.05 * i as f32, 0.1 * (i % 2) as f32);
        let body = (RigidBody::Dynamic, Collider::from(Shape::cuboid(0.5, 0.5, 0.5)), at);
        entities.push(spawn(app, body));
        if i % 4 == 0 {
            app.world_mut().entity_mut(entities[entities.len() - 1]).insert((Mass(3.0), LinearDamping(0.1)));
        }
    }
    let door = spawn(app, ball(5.0, 3.0));
    let hinge =
        Joint::to_world(door, Vec3::X, Vec3::new(6.0, 3.0, 0.0)).with(|joint| joint.hinge(Vec3::Z).motor(3.0, 1e4));
    entities.extend([door, spawn(app, hinge)]);
    entities
}

#[test]
fn the_bits_are_the_same_at_every_frame_rate() {
    let run = |rate: f64| {
        let mut app = app();
        // Smooth motion between steps must not come back into them.
        let entities = spawn_scene(&mut app);
        for entity in &entities[1..entities.len() - 1] {
            app.world_mut().entity_mut(*entity).insert(TransformInterpolation);
        }
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / rate)));
        while app.world().resource::<Hashes>().0.len() < 120 {
            app.update();
        }
        app.world_mut().resource_mut::<Hashes>().0[..120].to_vec()
    };
    let [a, b, c] = [30.0, 60.0, 250.0].map(run);
    assert_eq!(a, b);
    assert_eq!(a, c);
    assert!(a.windows(2).all(|pair| pair[0] != pair[1]), "each step moves something");
}

#[test]
fn the_bits_are_those_of_the_library() {
    use bevy_drystone::drystone::{Body, Joint as Link};
    let mut app = app();
    spawn_scene(&mut app);
    step(&mut app, 100);
    let mut world = Bodies::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    for i in 0..12 {
        let body = Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5));
        let body = body.position(0.3 * (i % 3) as f32, 0.6 + 1.05 * i as f32, 0.1 * (i % 2) as f32);
        world.insert(if i % 4 == 0 { body.total_mass(3.0).linear_damping(0.1) } else { body });
    }
    let door = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(5.0, 3.0, 0.0));
    world.insert_joint(Link::to_world(door, Vec3::X, Vec3::new(6.0, 3.0, 0.0)).hinge(Vec3::Z).motor(3.0, 1e4));
    let mut simulation = Simulation::new(world).expect("a world");
    for _ in 0..100 {
        simulation.step(1.0 / 64.0).expect("a step");
    }
    assert_eq!(hash(&app), simulation.hash());
}

#[test]
fn every_component_goes_in_and_out() {
    let mut app = app();
    let locked = LockedAxes { rotations: [true, false, false], translations: [false, false, true] };
    let full = (
        (RigidBody::Dynamic, Collider::from(Shape::ball(0.5)), Mass(3.0), Transform::from_xyz(0.0, 5.0, 0.0)),
        (LinearVelocity(Vec3::X), AngularVelocity(Vec3::Y), GravityScale(0.5), LinearDamping(0.1), AngularDamping(0.2)),
        (
            ConstantForce(Vec3::Z),
            ConstantTorque(Vec3::X),
            locked,
            SweptCcd,
            MaxLinearSpeed(90.0),
            MaxAngularSpeed(80.0),
        ),
        (CollisionLayers { memberships: 2, filters: 4 }, SleepingDisabled, Name::new("all")),
        ContactMaterial(Material { friction: 0.9, restitution: 0.3, ..Material::default() }),
    );
    let entity = spawn(&mut app, full);
    let dense = spawn(&mut app, (ball(9.0, 5.0), ColliderDensity(2000.0)));
    let plain = spawn(&mut app, ball(19.0, 5.0));
    step(&mut app, 1);
    let masses = [dense, plain].map(|ball| app.world().resource::<Physics>().body(ball).expect("a body").mass.mass);
    assert!((masses[0] / masses[1] - 2.0).abs() < 1e-6, "{masses:?} kg");
    let body = app.world().resource::<Physics>().body(entity).expect("a body").clone();
    assert_eq!((body.mass.mass, body.gravity_scale, body.force, body.torque), (3.0, 0.5, Vec3::Z, Vec3::X));
    assert_eq!((body.linear_damping, body.angular_damping, body.swept), (0.1, 0.2, true));
    assert_eq!((body.locked_rotations, body.can_sleep), ([true, false, false], false));
    assert_eq!((body.locked_translations, body.position.z), ([false, false, true], 0.0));
    assert_eq!((body.max_linear_speed, body.max_angular_speed), (90.0, 80.0));
    assert_eq!((body.groups.membership, body.groups.filter, body.name.as_str()), (2, 4, "all"));
    assert_eq!((body.material.friction, body.material.restitution), (0.9, 0.3));
    // Out.
    let transform: Transform = get(&app, entity);
    assert_eq!((transform.translation, transform.rotation), (body.position, body.rotation));
    assert_eq!(get::<LinearVelocity>(&app, entity).0, body.linear_velocity);
    assert_eq!(get::<AngularVelocity>(&app, entity).0, body.angular_velocity);
    assert!(body.linear_velocity.y < -0.05 && body.position.x > 0.01, "{body:?}");

    // Changes, and components that are taken away.
    set(&mut app, entity, |mass: &mut Mass| mass.0 = 5.0);
    step(&mut app, 1);
    let changed = app.world().resource::<Physics>().body(entity).expect("a body").clone();
    assert_eq!((changed.mass.mass, changed.gravity_scale), (5.0, 0.5));
    let moved = (changed.position - body.position) * 64.0;
    assert!((moved - changed.linear_velocity).length() < 0.1, "{moved} m/s");
    app.world_mut().entity_mut(entity).remove::<(GravityScale, SweptCcd, ConstantForce)>();
    step(&mut app, 1);
    let body = app.world().resource::<Physics>().body(entity).expect("a body");
    assert_eq!((body.mass.mass, body.gravity_scale, body.swept, body.force), (5.0, 1.0, false, Vec3::ZERO));
    assert_eq!(told(&mut app), [""; 0]);

    set(&mut app, entity, |kind: &mut RigidBody| *kind = RigidBody::Static);
    step(&mut app, 1);
    let at = place(&app, entity);
    step(&mut app, 10);
    assert_eq!(place(&app, entity), at);
    assert_eq!(app.world().resource::<Physics>().body(entity).expect("a body").mass.mass, 0.0);
    app.world_mut().entity_mut(entity).insert(RigidBody::Dynamic);
    step(&mut app, 10);
    assert!(place(&app, entity).y < at.y);
    assert_eq!(app.world().resource::<Physics>().body(entity).expect("a body").mass.mass, 5.0);
}

#[test]
fn a_transform_and_a_velocity_that_a_program_sets_move_the_body() {
    let mut app = app_in_space();
    let entity = spawn(&mut app, ball(0.0, 0.0));
    step(&mut app, 2);
    set(&mut app, entity, |at: &mut Transform| at.translation.x = 7.0);
    step(&mut app, 1);
    assert_eq!(place(&app, entity), Vec3::X * 7.0);
    set(&mut app, entity, |velocity: &mut LinearVelocity| velocity.0 = Vec3::Y * 64.0);
    set(&mut app, entity, |at: &mut Transform| at.rotation = Quat::from_rotation_z(1.0));
    step(&mut app, 2);
    assert!((place(&app, entity) - Vec3::new(7.0, 2.0, 0.0)).length() < 1e-4, "{}", place(&app, entity));
    assert!(get::<Transform>(&app, entity).rotation.abs_diff_eq(Quat::from_rotation_z(1.0), 1e-6));
    // What a program does to the body itself stays too.
    let push = move |mut physics: ResMut<Physics>| {
        let body = physics.body_mut(entity).expect("a body");
        body.apply_impulse(body.mass.mass * Vec3::X * 64.0);
    };
    app.world_mut().run_system_once(push).expect("it runs");
    step(&mut app, 1);
    assert!((get::<LinearVelocity>(&app, entity).0 - Vec3::new(64.0, 64.0, 0.0)).length() < 1e-3);
    assert!((place(&app, entity) - Vec3::new(8.0, 3.0, 0.0)).length() < 1e-3, "{}", place(&app, entity));
    // Also beside a change of a component.
    let lift = move |mut physics: ResMut<Physics>| physics.body_mut(entity).expect("a body").position.z = 5.0;
    app.add_systems(FixedUpdate, lift.run_if(run_once));
    set(&mut app, entity, |velocity: &mut LinearVelocity| velocity.0 = Vec3::ZERO);
    step(&mut app, 1);
    assert!((place(&app, entity) - Vec3::new(8.0, 3.0, 5.0)).length() < 1e-3, "{}", place(&app, entity));
}

#[test]
fn a_kinematic_body_moves_as_told_and_carries_others() {
    let mut app = app();
    let lift = (RigidBody::Kinematic, Collider::from(Shape::cuboid(2.0, 0.5, 2.0)), LinearVelocity(Vec3::Y));
    let lift = spawn(&mut app, lift);
    let rider = spawn(&mut app, ball(0.0, 1.0));
    step(&mut app, 64);
    assert!((place(&app, lift).y - 1.0).abs() < 1e-4, "{}", place(&app, lift));
    assert!((place(&app, rider).y - 2.0).abs() < 0.01, "{}", place(&app, rider));
    // To a pose within a step, by the body itself.
    let to = move |mut physics: ResMut<Physics>| {
        physics.body_mut(lift).expect("a body").move_to(Vec3::Y * 1.1, Quat::IDENTITY, 1.0 / 64.0);
    };
    app.world_mut().run_system_once(to).expect("it runs");
    step(&mut app, 1);
    assert!((place(&app, lift).y - 1.1).abs() < 1e-4, "{}", place(&app, lift));
    assert!((get::<LinearVelocity>(&app, lift).0.y - 6.4).abs() < 1e-3);
}

/// How often transforms changed.
#[derive(Resource, Default)]
struct Changes(usize);

#[test]
fn a_body_at_rest_sleeps_on_and_changes_no_transform() {
    let mut app = app();
    spawn(&mut app, floor());
    let entity = spawn(&mut app, (ball(0.0, 0.5), TransformInterpolation));
    let beside = spawn(&mut app, ball(1.0, 0.5));
    step(&mut app, 100);
    assert!(app.world().get::<Sleeping>(entity).is_some() && app.world().get::<Sleeping>(beside).is_some());
    let count = |changed: Query<(), Changed<Transform>>, mut changes: ResMut<Changes>| {
        changes.0 += changed.iter().count();
    };
    app.init_resource::<Changes>().add_systems(Last, count);
    step(&mut app, 1);
    app.world_mut().resource_mut::<Changes>().0 = 0;
    step(&mut app, 50);
    assert_eq!(app.world().resource::<Changes>().0, 0);
    assert_eq!(app.world().resource::<Physics>().stats().asleep, 2);
    // To touch a component is no change.
    set(&mut app, entity, |at: &mut Transform| at.translation.x += 0.0);
    step(&mut app, 1);
    assert!(app.world().get::<Sleeping>(entity).is_some());
    // A program that takes the mark away wakes it, and a change does.
    app.world_mut().entity_mut(entity).remove::<Sleeping>();
    step(&mut app, 1);
    assert!(app.world().get::<Sleeping>(entity).is_none());
    step(&mut app, 100);
    assert!(app.world().get::<Sleeping>(entity).is_some());
    set(&mut app, entity, |at: &mut Transform| at.translation.y = 2.0);
    step(&mut app, 30);
    assert!(app.world().get::<Sleeping>(entity).is_none() && place(&app, entity).y < 2.0);
}

#[test]
fn a_body_leaves_with_its_component_and_with_its_entity() {
    let mut app = app();
    let [floor, a, b] = [spawn(&mut app, floor()), spawn(&mut app, ball(0.0, 2.0)), spawn(&mut app, ball(3.0, 2.0))];
    step(&mut app, 1);
    let count = |app: &App| app.world().resource::<Physics>().simulation.world.bodies.count();
    assert_eq!(count(&app), 3);
    app.world_mut().entity_mut(a).despawn();
    assert_eq!(count(&app), 2);
    app.world_mut().entity_mut(b).remove::<RigidBody>();
    assert_eq!(count(&app), 1);
    // One that never enters.
    let never = spawn(&mut app, ball(0.0, 5.0));
    app.world_mut().entity_mut(never).despawn();
    step(&mut app, 1);
    let at = place(&app, b);
    step(&mut app, 5);
    assert_eq!((count(&app), place(&app, b)), (1, at));
    app.world_mut().entity_mut(b).insert(RigidBody::Dynamic).remove::<RigidBody>().insert(RigidBody::Dynamic);
    step(&mut app, 5);
    assert!(count(&app) == 2 && place(&app, b).y < at.y);
    let physics = app.world().resource::<Physics>();
    let handle = physics.handle(floor).expect("the floor");
    assert_eq!((physics.entity(handle), physics.handle(a)), (Some(floor), None));
}

#[test]
fn a_joint_holds_its_entities_and_leaves_with_them() {
    let mut app = app();
    let joints = |app: &App| app.world().resource::<Physics>().simulation.world.joints.len();
    // The joint comes before its bodies.
    let [a, b] = [app.world_mut().spawn_empty().id(), app.world_mut().spawn_empty().id()];
    let rod = spawn(&mut app, Joint::new(a, Vec3::ZERO, b, Vec3::ZERO).with(|joint| joint.rod(2.0)));
    step(&mut app, 1);
    let lines = told(&mut app);
    assert!(lines.len() == 1 && lines[0].contains("which has no body in the world"), "{lines:?}");
    app.world_mut().entity_mut(a).insert((ball(0.0, 5.0), GravityScale(0.0)));
    app.world_mut().entity_mut(b).insert(ball(2.0, 5.0));
    step(&mut app, 30);
    assert_eq!(joints(&app), 1);
    let apart = |app: &App| (place(app, a) - place(app, b)).length();
    assert!((apart(&app) - 2.0).abs() < 1e-3 && place(&app, b).y < 4.9, "{} m", apart(&app));
    // Another length.
    set(&mut app, rod, |rod: &mut Joint| *rod = rod.with(|joint| joint.rope(5.0)));
    step(&mut app, 30);
    assert!(joints(&app) == 1 && apart(&app) > 2.1, "{} m", apart(&app));
    // A body that leaves takes it along, and brings it back.
    app.world_mut().entity_mut(b).remove::<RigidBody>();
    assert_eq!(joints(&app), 0);
    step(&mut app, 1);
    app.world_mut().entity_mut(b).insert(RigidBody::Dynamic);
    step(&mut app, 1);
    assert_eq!(joints(&app), 1);
    app.world_mut().entity_mut(rod).despawn();
    assert_eq!(joints(&app), 0);
    step(&mut app, 1);
    assert_eq!(joints(&app), 0);
}

#[test]
fn a_joint_that_breaks_is_told_and_comes_back_when_it_is_changed() {
    let mut app = app();
    let lamp = spawn(&mut app, ball(0.0, 5.0));
    let hook = Joint::to_world(lamp, Vec3::ZERO, Vec3::Y * 5.0).with(|joint| joint.breaking_at(1.0));
    let hook = spawn(&mut app, hook);
    app.world_mut().entity_mut(hook).observe(|_: On<JointBreak>, mut told: ResMut<Told>| told.0.push("seen".into()));
    step(&mut app, 3);
    let lines = told(&mut app);
    assert!(lines.len() == 2 && lines.contains(&"seen".into()), "{lines:?}");
    assert!(lines.iter().any(|line| line.starts_with("JointBreak")), "{lines:?}");
    assert_eq!(app.world().resource::<Physics>().joint_handle(hook), None);
    step(&mut app, 3);
    let y = place(&app, lamp).y;
    assert!(y < 5.0);
    set(&mut app, hook, |hook: &mut Joint| {
        hook.settings.anchor_b.y = y;
        hook.settings.break_force = f32::INFINITY;
    });
    set(&mut app, lamp, |velocity: &mut LinearVelocity| velocity.0 = Vec3::ZERO);
    step(&mut app, 30);
    assert!((place(&app, lamp).y - y).abs() < 1e-3, "{} of {y} m", place(&app, lamp).y);
}

#[test]
fn contacts_are_messages_and_events_of_both_bodies() {
    let mut app = app();
    listen(&mut app, Listen { contacts: true, hits_above: Some(1.0), ..Listen::default() });
    let ground = spawn(&mut app, floor());
    let entity = spawn(&mut app, ball(0.0, 1.0));
    for (watched, other, up) in [(ground, entity, 1.0), (entity, ground, -1.0)] {
        app.world_mut().entity_mut(watched).observe(move |touch: On<CollisionStart>, mut told: ResMut<Told>| {
            assert_eq!((touch.entity, touch.other), (watched, other));
            told.0.push("seen start".into());
        });
        app.world_mut().entity_mut(watched).observe(move |hit: On<CollisionHit>, mut told: ResMut<Told>| {
            assert_eq!((hit.entity, hit.other), (watched, other));
            assert!((hit.normal - Vec3::Y * up).length() < 1e-6 && hit.speed > 2.5 && hit.impulse > 1000.0, "{hit:?}");
            told.0.push("seen hit".into());
        });
    }
    step(&mut app, 60);
    let mut lines = told(&mut app);
    lines.sort();
    let start = format!("{:?}", CollisionStart { entity: ground, other: entity, shape: 0, other_shape: 0 });
    assert_eq!(lines, [start.as_str(), "seen hit", "seen hit", "seen start", "seen start"]);
    // A body that is gone ends its contacts, and the event still has its name.
    app.world_mut().entity_mut(ground).observe(move |end: On<CollisionEnd>, mut told: ResMut<Told>| {
        assert_eq!(end.other, entity);
        told.0.push("seen end".into());
    });
    app.world_mut().entity_mut(entity).despawn();
    step(&mut app, 2);
    let end = format!("{:?}", CollisionEnd { entity: ground, other: entity, shape: 0, other_shape: 0 });
    let mut lines = told(&mut app);
    lines.sort();
    assert_eq!(lines, [end.as_str(), "seen end"]);
}

#[test]
fn a_sensor_tells_who_enters_and_leaves() {
    let mut app = app();
    let gate = (RigidBody::Static, Sensor, Collider::from(Shape::cuboid(1.0, 0.1, 1.0)));
    let gate = spawn(&mut app, gate);
    let entity = spawn(&mut app, ball(0.0, 2.0));
    // It flies through within a step.
    let fast = (ball(0.0, 25.0), LinearVelocity(Vec3::Y * -640.0));
    step(&mut app, 100);
    let pass =
        |name: &str, visitor| format!("Sensor{name} {{ entity: {gate:?}, sensor: {gate:?}, visitor: {visitor:?} }}");
    assert_eq!(told(&mut app), [pass("Enter", entity), pass("Exit", entity)]);
    assert!(place(&app, entity).y < -2.0, "a sensor holds nothing");
    let fast = spawn(&mut app, fast);
    app.world_mut().entity_mut(fast).observe(|_: On<SensorEnter>, mut told: ResMut<Told>| told.0.push("seen".into()));
    step(&mut app, 10);
    let mut lines = told(&mut app);
    lines.sort();
    assert_eq!(lines, [pass("Enter", fast), pass("Exit", fast), "seen".into()]);
}

#[test]
fn queries_find_entities() {
    let mut app = app_in_space();
    let [a, b] = [spawn(&mut app, ball(2.0, 0.0)), spawn(&mut app, ball(4.0, 0.0))];
    let gate = spawn(
        &mut app,
        (RigidBody::Static, Sensor, Collider::from(Shape::ball(0.5)), Transform::from_xyz(6.0, 0.0, 0.0)),
    );
    let layered = spawn(&mut app, (ball(8.0, 0.0), CollisionLayers { memberships: 0b10, filters: u32::MAX }));
    // A body without an entity is not found.
    let stray = bevy_drystone::drystone::Body::fixed().shape(Shape::ball(0.5)).position(1.0, 0.0, 0.0);
    app.world_mut().resource_mut::<Physics>().simulation.world.insert(stray);
    step(&mut app, 1);
    let ask = move |space: SpatialQuery| {
        let is_b = |entity| entity == b;
        let (view, all) = (space.view(), SpatialFilter::default());
        let hit = view.ray(Vec3::ZERO, Vec3::X, 100.0, &all).expect("a");
        assert_eq!((hit.entity, hit.shape), (a, 0));
        assert!((hit.distance - 1.5).abs() < 1e-4 && (hit.normal + Vec3::X).length() < 1e-4);
        let entities =
            |filter| view.ray_all(Vec3::ZERO, Vec3::X, 100.0, &filter).iter().map(|hit| hit.entity).collect::<Vec<_>>();
        assert_eq!(entities(all), [a, b, layered]);
        assert_eq!(entities(SpatialFilter::except(a)), [b, layered]);
        assert_eq!(entities(SpatialFilter { only: Some(&is_b), ..all }), [b]);
        assert_eq!(entities(SpatialFilter { sensors: true, ..all }), [a, b, gate, layered]);
        let layers = CollisionLayers { memberships: u32::MAX, filters: 0b10 };
        assert_eq!(entities(SpatialFilter { layers, ..SpatialFilter::except(b) }), [a, layered]);
        let layers = CollisionLayers { memberships: u32::MAX, filters: 0b01 };
        assert_eq!(entities(SpatialFilter { layers, ..all }), [a, b]);
        let cube = Shape::cuboid(0.5, 0.5, 0.5);
        let cast = view.cast(&cube, Vec3::ZERO, Quat::IDENTITY, Vec3::X, 100.0, &all).expect("a");
        assert!(cast.entity == a && (cast.distance - 1.0).abs() < 1e-3);
        assert_eq!(view.closest(Vec3::X * 4.7, 5.0, &all).expect("b").entity, b);
        assert_eq!(view.point(Vec3::X * 4.2, &all), [(b, 0)]);
        assert_eq!(view.intersecting(&cube, Vec3::X * 2.9, Quat::IDENTITY, &all), [(a, 0)]);
        assert_eq!(view.overlapping(Vec3::new(4.4, -1.0, -1.0), Vec3::new(5.0, 1.0, 1.0), &all), [(b, 0)]);
    };
    app.world_mut().run_system_once(ask).expect("it runs");
}

#[test]
fn the_same_future_follows_from_a_state() {
    let mut app = app();
    listen(&mut app, Listen { contacts: true, ..Listen::default() });
    let entities = spawn_scene(&mut app);
    // It lands after the state.
    spawn(&mut app, ball(-3.0, 4.0));
    app.world_mut().entity_mut(entities[3]).insert(TransformInterpolation);
    step(&mut app, 30);
    let state = app.world().resource::<Physics>().snapshot();
    // The exact poses; an eased one comes with the next frame.
    let poses = |app: &mut App| {
        type Shown<'a> = (Entity, &'a Transform, &'a LinearVelocity, &'a AngularVelocity, Has<Sleeping>);
        let mut query = app.world_mut().query_filtered::<Shown, Without<TransformInterpolation>>();
        let mut poses: Vec<_> = query.iter(app.world()).map(|(entity, t, v, w, s)| (entity, *t, *v, *w, s)).collect();
        poses.sort_by_key(|pose| pose.0);
        poses
    };
    let now = poses(&mut app);
    told(&mut app);
    step(&mut app, 60);
    let (later, then, events) = (hash(&app), poses(&mut app), told(&mut app));
    assert!(!events.is_empty());
    Physics::restore(app.world_mut(), &state);
    assert_eq!(hash(&app), state.hash());
    assert_eq!(poses(&mut app), now);
    step(&mut app, 60);
    assert_eq!((hash(&app), poses(&mut app), told(&mut app)), (later, then, events));

    // From far in the future, when all sleeps, without a frame: the schedule by hand.
    step(&mut app, 300);
    Physics::restore(app.world_mut(), &state);
    assert_eq!(poses(&mut app), now);
    (0..60).for_each(|_| app.world_mut().run_schedule(FixedMain));
    assert_eq!(hash(&app), later);
}

#[test]
fn a_restored_state_follows_entities_that_came_and_went() {
    let mut app = app();
    let floor = spawn(&mut app, floor());
    let [a, b] = [spawn(&mut app, ball(0.0, 2.0)), spawn(&mut app, ball(3.0, 2.0))];
    let rope = |body| Joint::to_world(body, Vec3::ZERO, Vec3::Y * 4.0).with(|joint| joint.rope(5.0));
    let [rope_a, rope_b] = [spawn(&mut app, rope(a)), spawn(&mut app, rope(b))];
    let second = spawn(&mut app, rope(a));
    step(&mut app, 5);
    let state = app.world().resource::<Physics>().snapshot();
    let at = place(&app, a);
    app.world_mut().entity_mut(b).despawn();
    app.world_mut().entity_mut(rope_b).despawn();
    app.world_mut().entity_mut(second).despawn();
    app.world_mut().entity_mut(floor).remove::<RigidBody>();
    let c = spawn(&mut app, ball(6.0, 2.0));
    let rope_c = spawn(&mut app, rope(c));
    step(&mut app, 5);
    Physics::restore(app.world_mut(), &state);
    let counts = |app: &App| {
        let world = &app.world().resource::<Physics>().simulation.world;
        (world.bodies.count(), world.joints.len())
    };
    // Neither b nor the floor; c is not there yet.
    assert_eq!((counts(&app), place(&app, a)), ((1, 1), at));
    step(&mut app, 1);
    assert_eq!(counts(&app), (2, 2));
    let physics = app.world().resource::<Physics>();
    assert!(physics.handle(c).is_some() && physics.handle(b).is_none());
    assert!(physics.joint_handle(rope_a).is_some() && physics.joint_handle(rope_c).is_some());
    assert_eq!(told(&mut app), [""; 0]);

    // A game that spawns b again gives the state its new name.
    let body = (ball(3.0, 2.0), floor_of(&mut app));
    let again = spawn(&mut app, body.0);
    let (rope_again, floor_again, second_again) = (spawn(&mut app, rope(again)), body.1, spawn(&mut app, rope(a)));
    struct Names([(Entity, Entity); 4]);
    impl bevy_ecs::entity::EntityMapper for Names {
        fn get_mapped(&mut self, source: Entity) -> Entity {
            self.0.iter().find(|(old, _)| *old == source).map_or(source, |(_, new)| *new)
        }
        fn set_mapped(&mut self, _: Entity, _: Entity) {}
    }
    let mut named: PhysicsSnapshot = state.clone();
    let mut names = Names([(b, again), (rope_b, rope_again), (floor, floor_again), (second, second_again)]);
    bevy_ecs::entity::MapEntities::map_entities(&mut named, &mut names);
    app.world_mut().entity_mut(c).despawn();
    app.world_mut().entity_mut(rope_c).despawn();
    Physics::restore(app.world_mut(), &named);
    assert_eq!((counts(&app), hash(&app)), ((3, 3), state.hash()));
    step(&mut app, 5);
    assert_eq!(counts(&app), (3, 3));
    assert!(place(&app, again).y < at.y);
}

fn floor_of(app: &mut App) -> Entity {
    spawn(app, floor())
}

#[test]
fn interpolation_shows_the_way_between_two_steps() {
    let mut app = app_in_space();
    let velocity = LinearVelocity(Vec3::X * 6.4);
    let spin = AngularVelocity(Vec3::Z * 3.2);
    let smooth = spawn(&mut app, (ball(0.0, 0.0), velocity, spin, TransformInterpolation));
    let plain = spawn(&mut app, (ball(0.0, 3.0), velocity));
    // Systems of the fixed step see where the body is.
    let seen = move |bodies: Query<&Transform>, physics: Res<Physics>| {
        let body = physics.body(smooth);
        let at = bodies.get(smooth).expect("it is there");
        let is_there = body.is_none_or(|body| (body.position, body.rotation) == (at.translation, at.rotation));
        // Or the program just set it to where it jumps.
        assert!(is_there || at.translation.y == 50.0);
    };
    app.add_systems(FixedUpdate, seen);
    // 64 steps and 250 frames a second.
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(4)));
    let steps = |app: &App| app.world().resource::<Hashes>().0.len();
    let (mut seen, first) = (0, steps(&app));
    for _ in 0..250 {
        app.update();
        let (done, part) = (steps(&app) - first, app.world().resource::<Time<Fixed>>().overstep_fraction());
        if done == 0 {
            continue;
        }
        let moved = done as f32 - 1.0 + part;
        let at: Transform = get(&app, smooth);
        assert!((at.translation.x - 0.1 * moved).abs() < 1e-4, "{} m after {moved} steps", at.translation.x);
        assert!(at.rotation.abs_diff_eq(Quat::from_rotation_z(0.05 * moved), 1e-4));
        assert!((place(&app, plain).x - 0.1 * done as f32).abs() < 1e-4);
        seen += 1;
    }
    assert!(seen > 200);
    // A jump is not eased, whenever it comes.
    set(&mut app, smooth, |at: &mut Transform| at.translation = Vec3::Y * 50.0);
    step(&mut app, 1);
    assert!(place(&app, smooth).y > 49.9);
    step(&mut app, 8);
    assert!((place(&app, smooth).y - 50.0).abs() < 1e-4);
}

#[test]
fn a_wrong_component_is_told_once_and_spoils_nothing() {
    let mut app = app();
    let fine = spawn(&mut app, ball(9.0, 5.0));
    let entity = spawn(&mut app, ball(0.0, 5.0));
    step(&mut app, 2);
    let at = place(&app, fine);
    set(&mut app, entity, |at: &mut Transform| at.translation.x = f32::NAN);
    step(&mut app, 3);
    let lines = told(&mut app);
    assert!(lines.len() == 1 && lines[0].contains(&format!("entity: Some({entity:?})")), "{lines:?}");
    assert!(lines[0].contains("position = [NaN, "), "{lines:?}");
    assert!(place(&app, fine).y < at.y && place(&app, entity).is_finite());

    app.world_mut().entity_mut(entity).insert(ContactMaterial(Material { friction: f32::NAN, ..Material::default() }));
    step(&mut app, 3);
    let lines = told(&mut app);
    assert!(lines.len() == 1 && lines[0].contains("friction = NaN: must be 0 or more"), "{lines:?}");
    assert_eq!(app.world().resource::<Physics>().body(entity).expect("a body").material.friction, 0.5);

    // A new body and a new joint wait until they are in order.
    let new = spawn(&mut app, (ball(3.0, 5.0), Mass(-1.0)));
    let joint = spawn(&mut app, Joint::to_world(fine, Vec3::ZERO, Vec3::ZERO).with(|joint| joint.hinge(Vec3::ZERO)));
    let own = spawn(&mut app, Joint::new(fine, Vec3::ZERO, fine, Vec3::ZERO));
    step(&mut app, 3);
    let lines = told(&mut app);
    assert!(lines.len() == 3 && lines[0].contains("mass = -1e0 kg"), "{lines:?}");
    assert!(lines[1].contains("axis") && lines[2].contains("itself"), "{lines:?}");
    assert!(lines.iter().all(|line| line.contains("entity: Some")), "{lines:?}");
    set(&mut app, new, |mass: &mut Mass| mass.0 = 1.0);
    set(&mut app, joint, |joint: &mut Joint| *joint = joint.with(|joint| joint.along(Vec3::X).rope(100.0)));
    app.world_mut().entity_mut(own).despawn();
    step(&mut app, 1);
    let physics = app.world().resource::<Physics>();
    assert!(physics.handle(new).is_some() && physics.joint_handle(joint).is_some());
    assert_eq!((told(&mut app), app.world().resource::<Physics>().error()), (vec![], None));

    // A program that spoils the world itself: steps fail until it is in order.
    let gravity = |app: &mut App, y| app.world_mut().resource_mut::<Physics>().simulation.world.gravity = Vec3::Y * y;
    gravity(&mut app, f32::NAN);
    let before = hash(&app);
    step(&mut app, 3);
    let lines = told(&mut app);
    assert!(lines.len() == 1 && lines[0].contains("gravity = ") && lines[0].contains("entity: None"), "{lines:?}");
    assert!(app.world().resource::<Physics>().error().is_some() && hash(&app) == before);
    gravity(&mut app, -9.81);
    step(&mut app, 1);
    assert!(app.world().resource::<Physics>().error().is_none() && hash(&app) != before);
}

#[test]
fn bodies_enter_in_the_order_of_their_numbers() {
    let run = |places: [usize; 3]| {
        let mut app = app();
        for k in places {
            let at = Transform::from_xyz(0.2 * k as f32, 1.2 * k as f32, 0.0);
            let body = (RigidBody::Dynamic, Collider::from(Shape::ball(0.5)), at, Order(1 + k as u64));
            // An archetype of its own.
            let entity = spawn(&mut app, body);
            if k == 1 {
                app.world_mut().entity_mut(entity).insert(GravityScale(0.9));
            }
        }
        // Without a number, before all others.
        spawn(&mut app, floor());
        step(&mut app, 30);
        (hash(&app), told(&mut app))
    };
    assert_eq!(run([0, 1, 2]), run([2, 0, 1]));
}

#[test]
fn physics_of_the_program_and_bodies_before_the_plugin_are_taken_over() {
    let mut simulation = Simulation::new(Bodies { gravity: Vec3::Y, ..Bodies::new() }).expect("a world");
    simulation.set_config(SolverConfig::default().with(|config| config.substeps = 2)).expect("settings");
    simulation.set_backend(Box::new(Cpu::new()));
    let mut app = App::new();
    let entity = app.world_mut().spawn(ball(0.0, 0.0)).id();
    let rope =
        app.world_mut().spawn(Joint::to_world(entity, Vec3::ZERO, Vec3::ZERO).with(|joint| joint.rope(0.05))).id();
    app.insert_resource(Physics::new(simulation)).add_plugins((TimePlugin, DrystonePlugin));
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    step(&mut app, 60);
    assert!((place(&app, entity).y - 0.05).abs() < 1e-3, "{}", place(&app, entity));
    let physics = app.world().resource::<Physics>();
    assert!(physics.simulation.config().substeps == 2 && physics.joint_handle(rope).is_some());
}

#[derive(Component)]
struct Walker(Character);

fn walk(mut physics: ResMut<Physics>, mut walkers: Query<&mut Walker>) -> Result {
    for mut walker in &mut walkers {
        walker.0.walk(&mut physics.simulation, 2.0 * Vec3::X, 1.0 / 64.0)?;
    }
    Ok(())
}

/// A character walks for a second, up a step of 20 cm.
#[test]
fn a_character_walks_before_each_step() {
    let mut app = app();
    app.add_systems(FixedUpdate, walk);
    spawn(&mut app, floor());
    let step_up = Collider::from(Shape::cuboid(2.0, 0.1, 2.0));
    spawn(&mut app, (RigidBody::Static, step_up, Transform::from_xyz(3.2, 0.1, 0.0)));
    let capsule =
        (RigidBody::Kinematic, Collider::from(Shape::capsule(0.6, 0.3)), Transform::from_xyz(0.0, 0.906, 0.0));
    let walker = spawn(&mut app, capsule);
    step(&mut app, 1);
    let character = Character::new(app.world().resource::<Physics>().handle(walker).expect("a body"));
    app.world_mut().entity_mut(walker).insert(Walker(character));
    step(&mut app, 64);
    assert!(place(&app, walker).distance(Vec3::new(2.0, 1.106, 0.0)) < 0.01, "{}", place(&app, walker));
    assert!(told(&mut app).is_empty());
}

/// Lets the body of one entity pass.
struct Ghost(BodyHandle);

impl ContactHooks for Ghost {
    fn may_touch(&mut self, _: &Bodies, a: ColliderOf, b: ColliderOf) -> bool {
        a.body != self.0 && b.body != self.0
    }
}

#[test]
fn a_hook_lets_the_body_of_an_entity_fall_through_the_floor() {
    let mut app = app();
    spawn(&mut app, floor());
    let [ghost, other] = [0.0, 3.0].map(|x| spawn(&mut app, ball(x, 0.5)));
    step(&mut app, 1);
    let mut physics = app.world_mut().resource_mut::<Physics>();
    let handle = physics.handle(ghost).expect("a body");
    assert_eq!(physics.entity(handle), Some(ghost));
    physics.simulation.set_hooks(Some(Box::new(Ghost(handle))));
    step(&mut app, 64);
    assert!(place(&app, ghost).y < -4.0 && (place(&app, other).y - 0.5).abs() < 1e-3);
}

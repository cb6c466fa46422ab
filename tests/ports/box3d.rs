//! Unit tests and samples of Box3D, and examples of Avian.

use std::f32::consts::PI;
use std::sync::{Arc, Mutex};

use drystone::glam::{Mat3, Quat, Vec3, vec3};
use drystone::queries::{Filter, Queries};
use drystone::{
    Axis, Body, BodyHandle, ColliderOf, ContactHooks, Cpu, Event, Groups, Joint, Listen, MassProperties, Material,
    PendingContact, Shape, Simulation, World,
};
use drystone_scenes::{Recorder, RecordingIntervals, Replay};

use super::scene::{
    DT, assert_about, assert_near, at, body, body_mut, cube, ground, light, place, run, run_with, started, twist,
    weightless,
};

/// The gravity of most samples (m/s²).
const G: f32 = 10.0;
/// The overlap and the gap of a joint that Box3D permits (m).
const SLOP: f32 = 5e-3;

fn dynamic(shape: Shape) -> Body {
    Body::dynamic().shape(shape).friction(0.6)
}

fn fixed(shape: Shape) -> Body {
    Body::fixed().shape(shape).friction(0.6)
}

/// A world with the ground and the gravity of Box3D's samples.
fn sample() -> World {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    world.insert(ground(100.0, 1.0).friction(0.6));
    world
}

fn listening(world: World, hits_above: Option<f32>) -> Simulation {
    let mut simulation = started(world);
    simulation.listen(Listen { contacts: true, hits_above, ..Listen::default() }).expect("a good wish");
    simulation
}

// test_world

/// Box3D, test_world: HelloWorld.
#[test]
fn a_box_falls_on_the_ground_and_rests() {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    world.insert(fixed(Shape::cuboid(50.0, 10.0, 50.0)).position(0.0, -10.0, 0.0));
    let fallen = world.insert(light().shape(cube(1.0)).friction(0.3).position(0.0, 4.0, 0.0));
    let mut simulation = started(world);
    run(&mut simulation, 90);
    let fallen = body(&simulation, fallen);
    assert_about(fallen.position.y, 1.0, 0.01);
    assert_about(fallen.rotation.x, 0.0, 0.01);
    assert_about(fallen.rotation.z, 0.0, 0.01);
}

/// Box3D, test_world: EmptyWorld, TestIsValid.
#[test]
fn an_empty_world_steps_and_handles_of_removed_bodies_are_stale() {
    let mut simulation = started(World::new());
    run(&mut simulation, 60);
    let world = &mut simulation.world;
    let handles = [Body::fixed(), Body::fixed()].map(|body| world.insert(body));
    for handle in handles {
        assert!(world.body(handle).is_some() && world.remove(handle).is_some());
        assert!(world.body(handle).is_none() && world.remove(handle).is_none());
    }
    let mut other = World::new();
    let stranger = other.insert(Body::fixed());
    world.insert(Body::fixed());
    assert!(world.body(stranger).is_none(), "a handle of another world names nothing");
}

/// Box3D, test_world: DestroyAllBodiesWorld.
#[test]
fn ten_boxes_come_and_go_while_the_world_runs() {
    let mut simulation = started(World::new());
    let mut boxes = Vec::new();
    for step in 0..30 {
        if step < 10 {
            boxes.push(simulation.world.insert(dynamic(cube(0.5))));
        } else if let Some(last) = boxes.pop() {
            assert!(simulation.world.remove(last).is_some());
        }
        run(&mut simulation, 1);
    }
    assert_eq!(simulation.world.bodies.count(), 0);
}

/// Box3D, test_world: TestSensor.
#[test]
fn a_flying_sensor_enters_and_leaves_a_wall_once() {
    let mut world = World::new();
    let wall = world.insert(fixed(Shape::cuboid(0.5, 10.0, 1.0)).position(1.5, 11.0, 0.0));
    let bullet = Body::dynamic().sensor(Shape::ball(0.1)).mass_properties(dynamic(Shape::ball(0.1)).mass).swept();
    let bullet = bullet.gravity_scale(0.0).position(7.39814, 4.0, 0.0).velocity(-20.0 * Vec3::X, Vec3::ZERO);
    let bullet = world.insert(bullet);
    let mut simulation = started(world);
    let mut told = Vec::new();
    while place(&simulation, bullet).x >= -1.0 {
        run(&mut simulation, 1);
        told.extend_from_slice(simulation.events());
    }
    let [Event::Entered { sensor, visitor }, Event::Left { .. }] = told[..] else { panic!("{told:?}") };
    assert_eq!((sensor.body, visitor.body), (bullet, wall));
}

/// Box3D, test_world: TestContinuousMoveEvent.
#[test]
fn a_ball_at_30_m_per_s_stops_at_a_thin_wall() {
    let mut world = World::new();
    world.insert(fixed(Shape::cuboid(0.1, 5.0, 5.0)));
    let ball = light().shape(Shape::ball(0.25)).gravity_scale(0.0);
    let ball = world.insert(ball.position(3.0, 0.0, 0.0).velocity(-30.0 * Vec3::X, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 30);
    let x = place(&simulation, ball).x;
    assert!(0.2 < x && x < 0.8, "{x}");
}

/// Box3D, test_world: TestContactEvents.
#[test]
fn a_bouncing_ball_begins_and_ends_contacts() {
    let mut world = World::new();
    let land = world.insert(ground(10.0, 0.5));
    let ball = world.insert(light().shape(Shape::ball(0.5)).restitution(0.6).position(0.0, 5.0, 0.0));
    let mut simulation = listening(world, None);
    let (mut began, mut ended) = (0, 0);
    run_with(&mut simulation, 120, |simulation, _| {
        for event in simulation.events() {
            match event {
                Event::Began { a, b } => {
                    assert_eq!((a.body, b.body), (land, ball));
                    began += 1;
                }
                Event::Ended { .. } => ended += 1,
                _ => {}
            }
        }
    });
    assert!(began >= 1 && ended >= 1, "{began} began, {ended} ended");
}

/// The first hit of a ball that flies down at 30 m/s from x.
fn first_hit(mut world: World, x: f32) -> (drystone::Hit, BodyHandle) {
    let ball = light().shape(Shape::ball(0.5)).gravity_scale(0.0).position(x, 3.0, 0.0);
    let ball = world.insert(ball.velocity(-30.0 * Vec3::Y, Vec3::ZERO));
    let mut simulation = listening(world, Some(1.0));
    let mut hits = Vec::new();
    run_with(&mut simulation, 30, |simulation, _| {
        hits.extend(simulation.events().iter().filter_map(|event| match event {
            Event::Hit(hit) => Some(*hit),
            _ => None,
        }));
    });
    (hits[0], ball)
}

/// Box3D, test_world: TestHitEvents.
#[test]
fn a_hit_tells_its_speed_and_its_normal() {
    let mut world = World::new();
    world.insert(ground(10.0, 0.5));
    let (hit, ball) = first_hit(world, 0.0);
    assert_eq!(hit.b.body, ball);
    assert_about(hit.speed, 30.0, 0.01);
    assert_near(hit.normal, Vec3::Y, 0.01);
    assert_about(hit.impulse / (30.0 * PI / 6.0), 1.0, 0.01);
}

/// Box3D, test_world: TestCompoundHitEvents.
#[test]
fn a_hit_names_the_part_of_a_compound() {
    for (x, part) in [(-3.0, 0), (3.0, 1)] {
        let mut world = World::new();
        let parts = Body::fixed().shape_at(cube(1.0), -3.0 * Vec3::X, Quat::IDENTITY);
        let parts = world.insert(parts.shape_at(cube(1.0), 3.0 * Vec3::X, Quat::IDENTITY));
        let (hit, _) = first_hit(world, x);
        assert_eq!(hit.a, ColliderOf { body: parts, collider: part });
    }
}

/// Notes the colliders and the friction of all contacts.
struct Notes(Arc<Mutex<Vec<(usize, f32)>>>);

impl ContactHooks for Notes {
    fn modify(&mut self, _: &World, contact: &mut PendingContact) {
        self.0.lock().expect("no panic").push((contact.a.collider, contact.friction));
    }
}

/// Box3D, test_world: TestCompoundContactMaterials.
#[test]
fn a_contact_has_the_material_of_the_part_that_it_meets() {
    for shape in [Shape::ball(0.5), Shape::capsule(0.5, 0.5), cube(0.5)] {
        let part = |x: f32, friction: f32| drystone::world::Collider {
            position: x * Vec3::X,
            rotation: Quat::from_rotation_x(0.5 * PI),
            material: Some(Material { friction, ..Material::default() }),
            ..drystone::world::Collider::new(shape.clone())
        };
        let mut world = World::new();
        world.insert(Body::fixed().collider(part(-3.0, 0.04)).collider(part(3.0, 0.81)));
        let ball = light().shape(Shape::ball(0.5)).friction(1.0).gravity_scale(0.0).position(3.0, 3.0, 0.0);
        world.insert(ball.velocity(-30.0 * Vec3::Y, Vec3::ZERO));
        let mut simulation = started(world);
        let notes = Arc::new(Mutex::new(Vec::new()));
        simulation.set_hooks(Some(Box::new(Notes(notes.clone()))));
        run(&mut simulation, 30);
        let notes = notes.lock().expect("no panic");
        assert!(!notes.is_empty() && notes.iter().all(|&(part, _)| part == 1));
        notes.iter().for_each(|&(_, friction)| assert_about(friction, 0.9, 1e-5));
    }
}

// test_body

/// The mass of balls of 0.5 m and 1 kg/m³ at these places.
fn mass_of_balls(places: &[Vec3]) -> (MassProperties, Mat3) {
    let add = |body: Body, place: &Vec3| body.shape_at(Shape::ball(0.5), *place, Quat::IDENTITY);
    let mass = places.iter().fold(light(), add).mass;
    (mass, mass.world_inertia(Quat::IDENTITY))
}

/// Box3D, test_body: FarSingleSphereMass, FarCubeSphereMass.
#[test]
fn the_inertia_of_balls_far_off_is_that_about_their_center() {
    let own = PI / 6.0;
    let center = vec3(100.0, -50.0, 75.0);
    let (mass, inertia) = mass_of_balls(&[center]);
    assert_about(mass.mass, own, 1e-4);
    assert_near(mass.center, center, 1e-3);
    assert!(inertia.abs_diff_eq(Mat3::from_diagonal(Vec3::splat(0.1 * own)), 1e-3), "{inertia}");
    let middle = Vec3::splat(100.0);
    let corners: Vec<_> = super::scene::corners(1.0).into_iter().map(|corner| middle + corner).collect();
    let (mass, inertia) = mass_of_balls(&corners);
    assert_about(mass.mass, 8.0 * own, 1e-3);
    assert_near(mass.center, middle, 1e-2);
    assert!(inertia.abs_diff_eq(Mat3::from_diagonal(Vec3::splat(16.8 * own)), 1e-2), "{inertia}");
}

/// Moments 2, 4 and 8 kg m² about the axes of the body.
fn given(mass: f32, center: Vec3) -> Body {
    let principal_inertia = vec3(2.0, 4.0, 8.0);
    let mass = MassProperties { mass, center, principal_inertia, principal_frame: Quat::IDENTITY };
    Body::dynamic().mass_properties(mass)
}

/// Box3D, test_body: SetMassDataRoundTrip, SetMassDataWorldInertiaRotated, SetMassDataFixedRotation.
#[test]
fn given_mass_properties_turn_with_the_body() {
    let center = vec3(0.1, 0.2, 0.3);
    let free = given(3.0, center).position(5.0, -3.0, 2.0);
    assert_eq!((free.mass.mass, free.mass.center), (3.0, center));
    assert!(free.mass.world_inertia(Quat::IDENTITY).abs_diff_eq(Mat3::from_diagonal(vec3(2.0, 4.0, 8.0)), 1e-6));
    assert!(free.world_inverse_inertia().abs_diff_eq(Mat3::from_diagonal(vec3(0.5, 0.25, 0.125)), 1e-5));
    assert_near(free.center_of_mass(), vec3(5.1, -2.8, 2.3), 1e-5);
    let turned = given(1.0, Vec3::ZERO).rotation(Quat::from_rotation_z(0.5 * PI));
    assert!(turned.world_inverse_inertia().abs_diff_eq(Mat3::from_diagonal(vec3(0.25, 0.5, 0.125)), 1e-4));
    let locked = given(5.0, Vec3::ZERO).locked_rotations([true; 3]);
    assert_eq!((locked.mass.mass, locked.world_inverse_inertia()), (5.0, Mat3::ZERO));
}

/// Box3D, test_body: SetMassDataZeroMass. Box3D takes a dynamic body without mass, drystone refuses it.
#[test]
fn a_dynamic_body_without_mass_is_an_error() {
    let mut world = World::new();
    world.insert(Body::dynamic().mass_properties(MassProperties::IMMOVABLE));
    let error = Simulation::new(world).map(drop).expect_err("no mass").to_string();
    assert!(error.contains("mass"), "{error}");
}

// test_body_query, test_height_field, test_hull

/// Box3D, test_body_query: CastRayHitsSphere, CastRayMiss, CastRayClosestShape, CastRayRotatedBody.
#[test]
fn rays_meet_the_nearest_ball_of_a_body() {
    let balls = |places: &[Vec3], radius: f32| {
        places.iter().fold(Body::fixed(), |body, at| body.shape_at(Shape::ball(radius), *at, Quat::IDENTITY))
    };
    let quarter = Quat::from_rotation_z(0.5 * PI);
    let cases = [
        (balls(&[Vec3::ZERO], 1.0).position(5.0, 0.0, 0.0), Vec3::ZERO, Vec3::X, Some((4.0, Vec3::NEG_X))),
        (balls(&[Vec3::ZERO], 1.0).position(5.0, 0.0, 0.0), Vec3::ZERO, Vec3::Y, None),
        (balls(&[Vec3::ZERO, 4.0 * Vec3::X], 1.0), -5.0 * Vec3::X, Vec3::X, Some((4.0, Vec3::NEG_X))),
        (balls(&[2.0 * Vec3::Y], 0.5).rotation(quarter), Vec3::ZERO, Vec3::NEG_X, Some((1.5, Vec3::X))),
    ];
    for (body, from, direction, wanted) in cases {
        let mut world = World::new();
        world.insert(body);
        let hit = Queries::of(&world).ray(from, direction, 10.0, &Filter::default());
        assert_eq!(hit.is_some(), wanted.is_some());
        let (Some(hit), Some((distance, normal))) = (hit, wanted) else { continue };
        assert_eq!(hit.collider, 0);
        assert_about(hit.distance, distance, 1e-4);
        assert_near(hit.normal, normal, 1e-5);
        assert_near(hit.point, from + distance * direction, 1e-4);
    }
}

/// Box3D, test_body_query: CastShapeHitsBox, CastShapeMiss, CastShapeRotatedBody, OverlapTrue, OverlapFalse,
/// OverlapRespectsBodyTransform, OverlapFilter.
#[test]
fn a_ball_is_cast_against_bodies_and_laid_on_them() {
    let ball = Shape::ball(0.5);
    let boxed = Body::fixed().shape(cube(1.0)).position(5.0, 0.0, 0.0);
    let turned = Body::fixed().shape_at(Shape::ball(1.0), 2.0 * Vec3::Y, Quat::IDENTITY);
    let turned = turned.rotation(Quat::from_rotation_z(0.5 * PI));
    let cases = [
        (boxed.clone(), Vec3::X, Some((3.5, vec3(4.0, 0.0, 0.0), Vec3::NEG_X))),
        (boxed.clone(), Vec3::Y, None),
        (turned, Vec3::NEG_X, Some((0.5, Vec3::NEG_X, Vec3::X))),
    ];
    for (body, direction, wanted) in cases {
        let mut world = World::new();
        world.insert(body);
        let hit = Queries::of(&world).cast(&ball, Vec3::ZERO, Quat::IDENTITY, direction, 10.0, &Filter::default());
        assert_eq!(hit.is_some(), wanted.is_some());
        let (Some(hit), Some((distance, point, normal))) = (hit, wanted) else { continue };
        assert_about(hit.distance, distance, 1e-3);
        assert_about(hit.point.dot(direction), point.dot(direction), 1e-3);
        assert_near(hit.normal, normal, 1e-4);
    }
    let mut world = World::new();
    let found = world.insert(boxed.groups(Groups { membership: 0b10, filter: !0 }));
    let queries = Queries::of(&world);
    let meets = |x: f32, filter: Filter| queries.intersecting(&ball, x * Vec3::X, Quat::IDENTITY, &filter);
    let only = |filter: u32| Filter::default().groups(Groups { membership: !0, filter });
    assert_eq!(meets(5.0, Filter::default()), [(found, 0)]);
    assert_eq!(meets(20.0, Filter::default()), []);
    assert_eq!(meets(5.0, only(0b10)), [(found, 0)]);
    assert_eq!(meets(5.0, only(0b01)), []);
}

/// Box3D, test_height_field: RayCastFlatField, OverlapAtSurface.
#[test]
fn a_flat_field_meets_rays_and_balls() {
    let mut world = World::new();
    world.insert(
        Body::fixed().shape(Shape::height_field(&vec![vec![0.0; 4]; 4], vec3(3.0, 1.0, 3.0)).expect("heights")),
    );
    let queries = Queries::of(&world);
    let hit = queries.ray(vec3(0.2, 10.0, -0.3), Vec3::NEG_Y, 20.0, &Filter::default()).expect("the field");
    assert_about(hit.distance / 20.0, 0.5, 1e-5);
    assert_near(hit.normal, Vec3::Y, 1e-5);
    let meets = |y: f32| queries.intersecting(&Shape::ball(0.5), y * Vec3::Y, Quat::IDENTITY, &Filter::default()).len();
    assert_eq!((meets(1.0), meets(0.0)), (0, 1));
}

/// Box3D, test_hull: CreateHullDegenerateTest.
#[test]
fn points_without_volume_are_no_hull() {
    let line: Vec<_> = (0..8).map(|x| x as f32 * Vec3::X).collect();
    let flat = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, 0.5), (0.5, 2.0)];
    let flat = flat.map(|(x, y)| vec3(x, y, 0.0));
    let one = [vec3(1.0, 2.0, 3.0); 8];
    for points in [&[][..], &line[..3], &one, &line, &flat] {
        assert!(Shape::convex_hull(points).is_err(), "{points:?}");
    }
    assert!(Shape::convex_hull(&super::scene::corners(1.0)).is_ok());
}

// test_large_world

/// Heights of a stack of six boxes that falls by gaps of 5 cm, and whether it is asleep after 400 steps.
fn stack_at(x: f32) -> (Vec<Vec3>, bool) {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    world.insert(fixed(Shape::cuboid(10.0, 1.0, 10.0)).position(x, 0.0, 0.0));
    let boxes: Vec<_> = (0..6)
        .map(|i| world.insert(light().shape(cube(0.5)).friction(0.6).position(x, 2.0 + 1.05 * i as f32, 0.0)))
        .collect();
    let mut simulation = started(world);
    run(&mut simulation, 400);
    let places = boxes.iter().map(|&handle| place(&simulation, handle) - x * Vec3::X).collect();
    (places, boxes.iter().all(|&handle| simulation.is_asleep(handle)))
}

/// Box3D, test_large_world: LargeWorldStackTest, as far as single precision goes: heights, because boxes that fall flat
/// shift sideways by 3 mm, and roundings decide where to.
#[test]
fn a_stack_far_from_the_origin_settles_as_at_the_origin() {
    let (here, sleeps) = stack_at(0.0);
    assert!(sleeps);
    for x in [1e3, 1e4, 1e5, 1e6] {
        let (there, sleeps) = stack_at(x);
        assert!(sleeps, "at {x} m");
        here.iter().zip(&there).for_each(|(here, there)| assert_about(there.y, here.y, 1e-3));
    }
}

/// Box3D, test_large_world: LargeWorldBulletTest.
#[test]
fn a_bullet_far_from_the_origin_stops_at_a_thin_wall() {
    for x in [0.0, 1e3, 1e4, 1e5] {
        let mut world = World::new();
        world.insert(fixed(Shape::cuboid(0.05, 5.0, 5.0)).position(x + 5.0, 0.0, 0.0));
        let bullet = light().shape(Shape::ball(0.1)).gravity_scale(0.0).swept();
        let bullet = world.insert(bullet.position(x, 0.0, 0.0).velocity(200.0 * Vec3::X, Vec3::ZERO));
        let mut simulation = started(world);
        run(&mut simulation, 30);
        let at = place(&simulation, bullet).x - x;
        assert!(at > 4.0 && at < 5.0, "{at} m from {x} m");
    }
}

/// Box3D, test_large_world: LargeWorldQueryTest.
#[test]
fn queries_far_from_the_origin_meet_a_box() {
    for x in [0.0, 1e3, 1e4] {
        let mut world = World::new();
        world.insert(Body::fixed().shape(cube(1.0)).position(x, 0.0, 0.0));
        let (queries, all, from) = (Queries::of(&world), Filter::default(), (x - 5.0) * Vec3::X);
        let cast = queries.cast(&Shape::ball(0.25), from, Quat::IDENTITY, Vec3::X, 10.0, &all).expect("the box");
        assert_about(cast.point.x - x, -1.0, 0.05);
        let ray = queries.ray(from, Vec3::X, 10.0, &all).expect("the box");
        assert_about(ray.point.x - x, -1.0, 0.05);
        assert_eq!(queries.intersecting(&Shape::ball(0.5), x * Vec3::X, Quat::IDENTITY, &all).len(), 1);
        let capsule = Shape::capsule(0.3, 0.3);
        assert_eq!(queries.contacts(&capsule, (x - 1.1) * Vec3::X, Quat::IDENTITY, 0.0, &all).len(), 1);
    }
}

// test_joint

/// Position of a cube after a second on a joint to the fixed box beside it. The joint has its anchor at the cube.
fn held(of: impl Fn(Joint) -> Joint) -> (Simulation, BodyHandle) {
    let mut world = World::new();
    let holder = world.insert(fixed(cube(0.5)));
    let held = world.insert(dynamic(cube(0.5)).position(2.0, 0.0, 0.0));
    world.insert_joint(of(Joint::new(held, Vec3::ZERO, holder, 2.0 * Vec3::X)));
    let mut simulation = started(world);
    run(&mut simulation, 60);
    (simulation, held)
}

/// Box3D, test_joint: TestParallelJoint, TestPrismaticJoint, TestRevoluteJoint, TestSphericalJoint, TestWeldJoint,
/// TestWheelJoint.
#[test]
fn each_kind_of_joint_holds_what_it_should() {
    let (free, locked) = (Axis::FREE, Axis::LOCKED);
    let falls = vec3(2.0, -0.5 * 9.81, 0.0);
    let kinds: [(&dyn Fn(Joint) -> Joint, Vec3); 8] = [
        (&|joint| joint, 2.0 * Vec3::X),
        (&|joint| joint.hinge(Vec3::Z), 2.0 * Vec3::X),
        (&|joint| joint.fixed(), 2.0 * Vec3::X),
        (&|joint| joint.slider(Vec3::X), 2.0 * Vec3::X),
        (&|joint| joint.slider(Vec3::Y).limited(-1.5, 1.5), vec3(2.0, -1.5, 0.0)),
        (&|joint| joint.generic([free; 3], [locked; 3]), falls),
        (&|joint| joint.along(Vec3::Y).generic([free, locked, locked], [free, locked, locked]), falls),
        (&|joint| joint.rope(0.75), vec3(2.0, -0.75, 0.0)),
    ];
    for (kind, (of, wanted)) in kinds.into_iter().enumerate() {
        let (simulation, held) = held(of);
        let within = if wanted == falls { 9.81 * DT } else { SLOP };
        let found = place(&simulation, held);
        assert!(found.distance(wanted) <= within, "kind {kind}: {found}, not {wanted}");
    }
}

/// Box3D, test_joint: TestFilterJoint. Samples: Filter.
#[test]
fn a_joint_with_six_free_axes_only_keeps_its_bodies_from_colliding() {
    let mut world = World::new();
    let bodies = [0.0, 0.3].map(|x| world.insert(dynamic(cube(0.5)).position(x, 0.0, 0.0)));
    world.insert_joint(
        Joint::new(bodies[0], Vec3::ZERO, bodies[1], Vec3::ZERO).generic([Axis::FREE; 3], [Axis::FREE; 3]),
    );
    let mut simulation = started(world);
    run(&mut simulation, 60);
    for (handle, x) in bodies.into_iter().zip([0.0, 0.3]) {
        assert_near(place(&simulation, handle), vec3(x, -0.5 * 9.81, 0.0), 9.81 * DT);
        assert_eq!(body(&simulation, handle).angular_velocity, Vec3::ZERO);
    }
}

/// Box3D, test_joint: TestMotorJoint, TestPrismaticJoint, TestRevoluteJoint.
#[test]
fn motors_hold_the_speeds_of_six_axes() {
    let speeds = [1.0, 2.0, 3.0, 0.1, 0.0, 0.0];
    let drive = |axis: usize| Axis::FREE.motor(speeds[axis], 1e6);
    let (simulation, held) = held(|joint| joint.generic([0, 1, 2].map(drive), [3, 4, 5].map(drive)));
    let found = body(&simulation, held);
    assert_near(found.linear_velocity, vec3(1.0, 2.0, 3.0), 1e-3);
    assert_near(found.angular_velocity, 0.1 * Vec3::X, 1e-3);
    let (simulation, held) = self::held(|joint| joint.hinge(Vec3::Z).motor(2.0, 1e6));
    assert_near(body(&simulation, held).angular_velocity, 2.0 * Vec3::Z, 1e-3);
}

/// Box3D, test_joint: TestSphericalJoint, with its limits of cone and twist.
#[test]
fn a_ball_joint_holds_its_cone_and_its_twist() {
    let mut world = weightless();
    let arm = world.insert(dynamic(Shape::capsule(0.3, 0.1)).position(0.0, -0.5, 0.0));
    let shoulder = Joint::to_world(arm, 0.5 * Vec3::Y, Vec3::ZERO).along(Vec3::Y);
    world.insert_joint(shoulder.limited(-0.5, 0.5));
    world.insert_joint(shoulder.cone(0.5));
    let mut simulation = started(world);
    for turned in [vec3(1.0, 2.0, 0.3), vec3(-0.5, -3.0, 1.0), vec3(0.0, 3.0, -2.0)] {
        body_mut(&mut simulation, arm).angular_velocity = 3.0 * turned;
        run_with(&mut simulation, 120, |simulation, _| {
            let rotation = body(simulation, arm).rotation;
            let cone = (rotation * Vec3::Y).angle_between(Vec3::Y);
            let swing = Quat::from_rotation_arc(Vec3::Y, rotation * Vec3::Y);
            let twisted = twist(swing.inverse() * rotation, Vec3::Y);
            assert!(cone <= 0.5 + 0.01 && twisted.abs() <= 0.5 + 0.01, "cone {cone}, twist {twisted}");
        });
        assert!(simulation.world.joint_gap() < SLOP);
    }
}

// test_recording, test_determinism

/// Box3D, test_recording: MidStreamContacts, ScrubBackward, SeekWithHull.
#[test]
fn a_recording_plays_again_from_any_step() {
    let mut world = sample();
    let wedge = Shape::convex_hull(&[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z]).expect("a wedge");
    for i in 0..5 {
        world.insert(dynamic(cube(0.3)).position(0.1 * i as f32, 0.5 + 0.8 * i as f32, 0.0));
        world.insert(dynamic(wedge.clone()).position(2.0, 0.5 + 1.2 * i as f32, 0.1 * i as f32));
    }
    let mut simulation = started(world);
    let intervals = RecordingIntervals { hash: 5, state: 20 };
    let mut recorder = Recorder::new(Vec::new(), "boxes", &mut simulation, intervals).expect("memory");
    let mut hashes = vec![simulation.hash()];
    for step in 0..100 {
        if step == 50 {
            simulation.world.insert(dynamic(Shape::ball(0.4)).position(0.0, 6.0, 0.0));
        }
        recorder.step(&mut simulation, DT).expect("a step");
        hashes.push(simulation.hash());
    }
    let bytes = recorder.finish().expect("memory");
    let mut replay = Replay::read(&bytes).expect("a recording");
    let mut again = replay.begin(Box::new(Cpu::new())).expect("a start");
    for step in [100, 0, 73, 20, 51, 99] {
        replay.seek(&mut again, step).expect("a step of the recording");
        assert_eq!(again.hash(), hashes[step as usize], "step {step}");
    }
    assert!(replay.first_difference().is_none());
}

/// Box3D, test_recording: ReservedHeaderBytes, and the damaged files of the fixtures.
#[test]
fn a_damaged_recording_is_an_error() {
    let mut simulation = started(sample());
    let intervals = RecordingIntervals { hash: 5, state: 20 };
    let mut recorder = Recorder::new(Vec::new(), "ground", &mut simulation, intervals).expect("memory");
    (0..20).for_each(|_| drop(recorder.step(&mut simulation, DT).expect("a step")));
    let bytes = recorder.finish().expect("memory");
    assert!(Replay::read(&bytes).is_ok());
    let mut changed = bytes.clone();
    changed[0] ^= 1;
    for damaged in [&changed[..], b"", b"a recording", &bytes[..20]] {
        let error = Replay::read(damaged).map(drop).expect_err("a damaged file").to_string();
        assert!(!error.is_empty() && !error.contains('\n'), "{error}");
    }
}

/// Box3D, test_determinism: MeshDropTest. Avian, tests: cubes_simulation_is_locally_deterministic.
#[test]
fn cubes_fall_on_a_mesh_to_the_same_bits() {
    let fallen = || {
        let mut world = sample();
        world.insert(fixed(super::scene::sheet(10.0)).position(0.0, 0.5, 0.0));
        for i in 0..27 {
            let (x, y, z) = ((i % 3) as f32, (i / 9) as f32, (i / 3 % 3) as f32);
            world.insert(dynamic(cube(0.4)).position(1.1 * x + 0.1 * y, 2.0 + y, 1.1 * z));
        }
        let mut simulation = started(world);
        run(&mut simulation, 200);
        simulation.hash()
    };
    assert_eq!(fallen(), fallen());
}

// Samples: Continuous

/// Box3D, Continuous: Thin Wall.
#[test]
fn spinning_bodies_at_180_m_per_s_stay_before_a_wall() {
    let mut world = sample();
    world.insert(fixed(Shape::cuboid(10.0, 10.0, 0.1)).position(0.0, 10.0, 0.0));
    let lying = Quat::from_rotation_z(0.5 * PI);
    let shapes = [
        (Body::dynamic().shape(Shape::ball(0.1)), -5.0, 0.0),
        (Body::dynamic().shape_at(Shape::capsule(0.3, 0.1), Vec3::ZERO, lying), 0.0, -5.0),
        (Body::dynamic().shape(Shape::cuboid(0.4, 0.1, 0.1)), 5.0, 5.0),
    ];
    let shot = shapes.map(|(body, x, spin)| {
        let body = body.position(x, 10.0, 20.0);
        world.insert(body.friction(0.6).velocity(-180.0 * Vec3::Z, vec3(20.0, spin, 0.0)))
    });
    let mut simulation = started(world);
    run_with(&mut simulation, 120, |simulation, step| {
        for handle in shot {
            let at = place(simulation, handle);
            assert!(at.z > 0.0 && at.y > 0.0, "{at} in step {step}");
        }
    });
}

/// Box3D, Continuous: Bounce House.
#[test]
fn an_elastic_ball_at_170_m_per_s_stays_in_its_room_with_its_speed() {
    let mut world = sample();
    let walls =
        [(10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0)].into_iter().fold(Body::fixed(), |body, (x, z)| {
            let shape = if x != 0.0 { Shape::cuboid(0.1, 5.0, 10.0) } else { Shape::cuboid(10.0, 5.0, 0.1) };
            body.shape_at(shape, vec3(x, 5.0, z), Quat::IDENTITY)
        });
    world.insert(walls.friction(0.0));
    let ball = Body::dynamic().shape(Shape::ball(0.5)).gravity_scale(0.0).friction(0.0).restitution(1.0);
    let velocity = vec3(120.0, 0.0, 120.0);
    let ball = world.insert(ball.position(-8.0, 4.0, 0.0).velocity(velocity, Vec3::ZERO));
    let mut simulation = started(world);
    run_with(&mut simulation, 600, |simulation, step| {
        let found = body(simulation, ball);
        let at = found.position;
        assert!(at.x.abs() < 9.9 && at.z.abs() < 9.9 && (at.y - 4.0).abs() < 0.1, "{at} in step {step}");
        assert_about(found.linear_velocity.length() / velocity.length(), 1.0, 1e-3);
    });
}

/// Box3D, Continuous: Spinning Stick, with ten spins in place of a random one. The ground ends 100 m away.
#[test]
fn spinning_sticks_at_100_m_per_s_do_not_pass_the_ground() {
    for case in 0..10 {
        let some = |k: f32| 50.0 * (12.9898 * (case as f32 + 1.0) + 78.233 * k).sin();
        let mut world = sample();
        world.insert(fixed(Shape::cuboid(0.125, 0.5, 10.0)).position(0.0, 0.5, 0.0));
        let stick = dynamic(Shape::cuboid(2.0, 0.1, 0.1)).position(0.0, 20.0, 0.5);
        let stick = world.insert(stick.velocity(-100.0 * Vec3::Y, vec3(some(1.0), some(2.0), some(3.0))));
        let mut simulation = started(world);
        run_with(&mut simulation, 180, |simulation, step| {
            let found = body(simulation, stick);
            let ends = [-2.0, 0.0, 2.0].map(|x| found.position + found.rotation * (x * Vec3::X));
            let above = ends.into_iter().filter(|end| end.x.abs().max(end.z.abs()) < 100.0);
            let low = above.map(|end| end.y).fold(f32::INFINITY, f32::min);
            assert!(low > 0.0, "{low} m in step {step} of case {case}");
        });
    }
}

/// Box3D, Continuous: Bullet vs Stack.
#[test]
fn a_bullet_at_500_m_per_s_hits_a_stack_and_nothing_passes_the_wall_behind_it() {
    let mut world = sample();
    world.insert(fixed(Shape::cuboid(0.1, 5.0, 10.0)).position(-1.0, 5.0, 0.0));
    let stack: Vec<_> = (0..10).map(|i| world.insert(dynamic(cube(0.5)).position(0.0, 0.5 + i as f32, 0.0))).collect();
    let bullet = dynamic(Shape::ball(0.25)).density(10_000.0).swept();
    let bullet = world.insert(bullet.position(20.5, 5.5, 0.0).velocity(-500.0 * Vec3::X, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 10);
    let struck = body(&simulation, stack[5]);
    assert!(struck.position.x < -0.1, "{}", struck.position);
    run_with(&mut simulation, 50, |simulation, step| {
        for &handle in stack.iter().chain([&bullet]) {
            let at = place(simulation, handle);
            assert!(at.x > -1.0 || at.y > 10.0, "{at} in step {step}");
        }
    });
}

/// Box3D, Continuous: Needle Mesh.
#[test]
fn a_thin_plate_lands_on_four_needles() {
    let needle = |height: f32, x: f32, z: f32| {
        let around = |i: u32| vec3(x + 0.1 * (0.25 * PI * i as f32).cos(), 0.0, z + 0.1 * (0.25 * PI * i as f32).sin());
        let points = [vec3(x, height, z)].into_iter().chain((0..8).map(around)).collect();
        Shape::mesh(points, (0..8).map(|i| [0, (i + 1) % 8 + 1, i + 1]).collect()).expect("a needle")
    };
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    let needles = [(0.99, 0.2, 0.2), (1.01, 0.2, -0.2), (0.98, -0.2, -0.2), (1.02, -0.2, 0.2)];
    for (height, x, z) in needles {
        world.insert(fixed(needle(height, x, z)));
    }
    let plate = dynamic(Shape::cuboid(0.3, 0.01, 0.3)).position(0.0, 5.0, 0.0);
    let plate = world.insert(plate.velocity(-10.0 * Vec3::Y, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 300);
    let y = place(&simulation, plate).y;
    assert!(y > 0.95, "{y}");
}

/// Box3D, Continuous: Hump Mesh.
#[test]
fn a_thin_plate_at_50_m_per_s_does_not_pass_a_hump() {
    let points = (0..6)
        .map(|i| vec3(8.0 * (i / 3) as f32 - 4.0, if i % 3 == 1 { 0.4 } else { 0.0 }, 8.0 * (i % 3) as f32 - 8.0));
    let triangles = [0, 1].into_iter().flat_map(|i| [[i, i + 1, i + 4], [i + 4, i + 3, i]]);
    let hump = Shape::mesh(points.collect(), triangles.collect()).expect("a hump");
    let mut world = sample();
    world.insert(fixed(hump));
    let plate = dynamic(Shape::cuboid(0.5, 0.05, 1.0)).position(0.0, 5.0, 0.0).velocity(-50.0 * Vec3::Y, Vec3::ZERO);
    let plate = world.insert(plate);
    let mut simulation = started(world);
    run_with(&mut simulation, 300, |simulation, step| {
        let at = place(simulation, plate);
        let height = 0.4 - 0.05 * at.z.abs();
        assert!(at.y > height, "{at} in step {step}");
    });
}

/// Box3D, Continuous: Is Fast.
#[test]
fn long_boxes_spin_freely_at_4_rad_per_s() {
    let mut world = sample();
    let spins = [4.0 * Vec3::Z, 4.0 * Vec3::Y, 4.0 * Vec3::X].into_iter().zip([-12.0, 0.0, 12.0]);
    let boxes: Vec<_> = spins
        .map(|(spin, x)| {
            let long = dynamic(Shape::cuboid(0.5, 10.0, 0.5)).gravity_scale(0.0).position(x, 20.0, 0.0);
            (world.insert(long.velocity(Vec3::ZERO, spin)), spin, x)
        })
        .collect();
    let mut simulation = started(world);
    run(&mut simulation, 600);
    for (handle, spin, x) in boxes {
        let found = body(&simulation, handle);
        assert_near(found.angular_velocity, spin, 1e-3);
        assert_near(found.position, vec3(x, 20.0, 0.0), 1e-4);
    }
}

/// Box3D, Continuous: Stall, with a torus of 40 by 40 quads in place of 200 by 200.
#[test]
fn a_bullet_stops_at_a_torus_of_triangles() {
    let (count, large, small) = (40, 2.0_f32, 1.0_f32);
    let angle = |i: u32| 2.0 * PI * i as f32 / count as f32;
    let points = (0..count * count).map(|k| {
        let ((sin, cos), (up, out)) = (angle(k / count).sin_cos(), angle(k % count).sin_cos());
        let radius = large + small * out;
        vec3(radius * cos, small * up, radius * sin)
    });
    let triangles = (0..count * count).flat_map(|k| {
        let (i, j) = (k / count, k % count);
        let at = |i: u32, j: u32| i % count * count + j % count;
        let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        [[a, b, c], [a, c, d]]
    });
    let torus = Shape::mesh(points.collect(), triangles.collect()).expect("a torus");
    for speed in [100.0, 400.0] {
        let mut world = weightless();
        world.insert(fixed(torus.clone()));
        let bullet = dynamic(Shape::ball(0.1)).position(-10.0, 0.3, 0.0).velocity(speed * Vec3::X, Vec3::ZERO);
        let bullet = world.insert(bullet);
        let mut simulation = started(world);
        run_with(&mut simulation, 30, |simulation, step| {
            let at = place(simulation, bullet);
            let out = at.x.hypot(at.z) - large;
            assert!(out.hypot(at.y) > small, "{at} in step {step} at {speed} m/s");
        });
        assert!(body(&simulation, bullet).linear_velocity.x < 0.9 * speed);
    }
}

// Samples: Stacking, Robustness

/// Box3D, Stacking: Card House.
#[test]
fn a_house_of_40_cards_of_2_mm_stands() {
    let mut world = sample();
    let material = Material { friction: 0.7, rolling_friction: 0.05 * 0.001, ..Material::default() };
    let mut cards = Vec::new();
    let (mut y, mut first) = (0.18, 0.0);
    for count in (1..=5).rev() {
        let mut z = first;
        for i in 0..count {
            let mut card = |x: f32, y: f32, degrees: f32| {
                let turned = Quat::from_rotation_z(degrees.to_radians());
                let card = Body::dynamic().shape(Shape::cuboid(0.001, 0.2, 0.1)).material(material);
                cards.push(world.insert(card.position(x, y, 0.0).rotation(turned)));
            };
            if i != count - 1 {
                card(z + 0.25, y + 0.185, 90.0);
            }
            card(z, y, -25.0);
            z += 0.175;
            card(z, y, 25.0);
            z += 0.175;
        }
        y += 0.37;
        first += 0.175;
    }
    assert_eq!(cards.len(), 40);
    let mut simulation = started(world);
    let before: Vec<_> = cards.iter().map(|&card| place(&simulation, card)).collect();
    run(&mut simulation, 600);
    for (&card, before) in cards.iter().zip(before) {
        let moved = place(&simulation, card).distance(before);
        // Half the distance between two cards.
        assert!(moved < 0.0875, "{moved} m from {before}");
    }
}

/// Lets bodies fall on each other, runs for a time, and returns how far each lies from a stack with this pitch.
fn stack(count: usize, pitch: f32, first: f32, gap: f32, steps: usize, of: impl Fn() -> Body) -> (f32, bool) {
    let mut world = sample();
    let bodies: Vec<_> = (0..count).map(|i| world.insert(of().position(0.0, first + gap * i as f32, 0.0))).collect();
    let mut simulation = started(world);
    run(&mut simulation, steps);
    let off = |(i, handle): (usize, &BodyHandle)| {
        place(&simulation, *handle).distance((0.5 * pitch + pitch * i as f32) * Vec3::Y)
    };
    let worst = bodies.iter().enumerate().map(off).fold(0.0, f32::max);
    (worst, bodies.iter().all(|&handle| simulation.is_asleep(handle)))
}

/// Box3D, Stacking: Sphere Stack, with its rolling resistance.
#[test]
fn thirty_balls_fall_on_each_other_and_stand() {
    let material = Material { friction: 0.6, rolling_friction: 0.1 * 0.5, ..Material::default() };
    let (off, sleeps) = stack(30, 1.0, 0.75, 1.5, 900, || Body::dynamic().shape(Shape::ball(0.5)).material(material));
    assert!(off < 0.05 && sleeps, "{off} m off, asleep: {sleeps}");
}

/// Box3D, Stacking: Capsule Stack.
#[test]
fn twenty_capsules_with_locked_rotations_stand() {
    let lying = Quat::from_rotation_z(0.5 * PI);
    let of = || {
        let capsule = Body::dynamic().shape_at(Shape::capsule(1.0, 0.5), Vec3::ZERO, lying).friction(0.6);
        capsule.locked_rotations([true; 3]).locked_translations([false, false, true])
    };
    let (off, sleeps) = stack(20, 1.0, 0.75, 1.0, 600, of);
    assert!(off < SLOP && sleeps, "{off} m off, asleep: {sleeps}");
}

/// Box3D, Stacking: Cylinder Stack, of 10 cylinders.
#[test]
fn ten_cylinders_fall_on_each_other_and_stand() {
    let (off, sleeps) = stack(10, 1.0, 0.6, 1.1, 600, || dynamic(Shape::cylinder(0.5, 0.5)));
    assert!(off < 0.25 && sleeps, "{off} m off, asleep: {sleeps}");
}

/// Box3D, Stacking: Box Stack, of 40 boxes with gaps of a quarter.
#[test]
fn forty_boxes_fall_on_each_other_and_stand() {
    let (off, _) = stack(40, 1.0, 0.75, 1.25, 1200, || dynamic(cube(0.5)));
    assert!(off < 0.25, "{off} m off");
}

/// Box3D, Stacking: Pyramid2D, of 12 boxes at its base, held in a plane by locks.
#[test]
fn a_pyramid_falls_together_in_its_plane() {
    let mut world = sample();
    let mut boxes = Vec::new();
    for row in 0..12 {
        for column in 0..12 - row {
            let x = -10.0 + 2.0 * column as f32 + row as f32;
            let body = dynamic(cube(1.0)).position(x, 1.5 + 2.5 * row as f32, 0.0);
            let body = body.locked_translations([false, false, true]).locked_rotations([true, true, false]);
            boxes.push((world.insert(body), vec3(x, 1.0 + 2.0 * row as f32, 0.0)));
        }
    }
    let mut simulation = started(world);
    run(&mut simulation, 600);
    for (handle, wanted) in boxes {
        let found = body(&simulation, handle);
        assert_near(found.position, wanted, 0.5);
        assert_eq!((found.position.z, found.rotation.x, found.rotation.y), (0.0, 0.0, 0.0));
    }
}

/// Box3D, Stacking: Double Domino.
#[test]
fn fifteen_dominoes_fall_in_order() {
    let mut world = sample();
    let dominoes: Vec<_> = (0..15)
        .map(|i| {
            let domino = dynamic(Shape::cuboid(0.125, 0.5, 0.25)).density(4.0);
            world.insert(domino.position(-7.5 + 1.01 * i as f32, 0.5, 0.0))
        })
        .collect();
    world.body_mut(dominoes[0]).expect("it is there").apply_impulse_at(0.2 * Vec3::X, vec3(-7.5, 1.0, 0.0));
    let mut simulation = started(world);
    let mut fell = vec![None; 15];
    run_with(&mut simulation, 900, |simulation, step| {
        for (&handle, fell) in dominoes.iter().zip(&mut fell) {
            if super::scene::upright(body(simulation, handle)) < 0.8 {
                fell.get_or_insert(step);
            }
        }
    });
    assert!(fell.iter().all(Option::is_some) && fell.is_sorted(), "{fell:?}");
}

/// Box3D, Stacking: Jenga Stack, with the height that Rapier keeps.
#[test]
#[ignore = "the top comes down to 5.69 m, with Rapier to 5.76 m"]
fn a_tower_of_30_layers_with_gaps_keeps_its_height() {
    let mut world = sample();
    let mut top = 0.0_f32;
    let mut planks = Vec::new();
    for i in 0..30 {
        let (x, z, turn) = if i % 2 == 1 { (0.0, 0.8, 0.0) } else { (0.8, 0.0, 0.5 * PI) };
        for side in [1.0, -1.0] {
            let plank = dynamic(Shape::cuboid(1.0, 0.1, 0.1)).rotation(Quat::from_rotation_y(turn));
            planks.push(world.insert(plank.position(side * x, (2.1 * i as f32 + 0.5) * 0.1, side * z)));
        }
    }
    let mut simulation = started(world);
    run(&mut simulation, 600);
    for &plank in &planks {
        top = top.max(place(&simulation, plank).y);
    }
    assert!(top > 5.76, "{top} m, of 5.9 without gaps");
}

/// The left half of an arch of Box3D: inner and outer points, in quarters of a meter.
const ARCH: [[[f32; 2]; 2]; 9] = [
    [[16.0, 0.0], [24.0, 0.0]],
    [[14.93804, 5.133601], [22.336195, 6.022998]],
    [[13.798717, 10.249281], [20.54937, 12.00964]],
    [[12.56253, 15.34107], [18.608546, 17.947032]],
    [[11.20041, 20.398565], [16.467693, 23.813679]],
    [[9.665212, 25.4037], [14.05325, 29.570794]],
    [[7.871799, 30.317934], [11.23551, 35.137758]],
    [[5.6352, 35.038207], [7.752568, 40.30451]],
    [[2.405938, 39.09554], [3.016932, 44.288916]],
];

/// Box3D, Stacking: Arch, with the sag of Rapier.
#[test]
fn an_arch_under_four_boxes_stands() {
    let mut world = sample();
    let stone = |ring: &[[f32; 2]]| {
        let corners = ring.iter().flat_map(|p| [-0.5, 0.5].map(|z| vec3(0.25 * p[0], 0.25 * p[1], z)));
        Body::dynamic().shape(Shape::convex_hull(&corners.collect::<Vec<_>>()).expect("a stone")).density(200.0)
    };
    let mirrored = |p: [f32; 2]| [-p[0], p[1]];
    for pair in ARCH.windows(2) {
        let ring = [pair[0][0], pair[0][1], pair[1][1], pair[1][0]];
        world.insert(stone(&ring).friction(0.6));
        world.insert(stone(&ring.map(mirrored)).friction(0.6));
    }
    let [inner, outer] = ARCH[8];
    let key = world.insert(stone(&[inner, outer, mirrored(outer), mirrored(inner)]).friction(0.6));
    let before = world.body(key).expect("it is there").center_of_mass().y;
    for i in 0..4 {
        let load = dynamic(Shape::cuboid(2.0, 0.5, 0.5)).density(200.0);
        world.insert(load.position(0.0, 0.5 + 0.25 * outer[1] + i as f32, 0.0));
    }
    let mut simulation = started(world);
    run(&mut simulation, 600);
    let sag = before - body(&simulation, key).center_of_mass().y;
    assert!(sag < 0.21, "{sag} m");
}

/// Box3D, Robustness: HighMassRatio1. The tops fall by 2 m.
#[test]
fn pyramids_bear_tops_of_100_to_300_times_the_mass_of_a_box() {
    let mut world = sample();
    let mut boxes = Vec::new();
    for pyramid in 0..3 {
        for (row, count) in (1..=10).rev().enumerate() {
            for i in 0..count {
                let x = 2.0 * (i as f32 - 0.5 * count as f32) - 20.0 + 22.0 * pyramid as f32;
                let y = 1.0 + 2.0 * row as f32;
                let is_top = count == 1;
                let density = if is_top { 100.0 * (pyramid + 1) as f32 } else { 1.0 };
                let body = dynamic(cube(1.0)).density(density).position(x, if is_top { y + 2.0 } else { y }, 0.0);
                boxes.push((world.insert(body), vec3(x, y, 0.0)));
            }
        }
    }
    let mut simulation = started(world);
    run(&mut simulation, 600);
    for (handle, wanted) in boxes {
        let found = place(&simulation, handle);
        assert_about(found.y, wanted.y, 0.05);
        // No box slides by more than half of its overlap with the boxes below.
        assert_near(found, wanted, 0.5);
    }
}

/// Box3D, Robustness: Tiny Pyramid, with a base of 20 boxes in place of 30.
#[test]
fn a_pyramid_of_boxes_of_5_cm_stands() {
    let mut world = sample();
    let half = 0.025;
    let mut boxes = Vec::new();
    for (row, count) in (1..=20).rev().enumerate() {
        for i in 0..count {
            let at = vec3((2.0 * i as f32 + 1.0 - count as f32) * half, (2.0 * row as f32 + 1.0) * half, 0.0);
            boxes.push((world.insert(super::scene::at(dynamic(cube(half)), at)), at));
        }
    }
    let mut simulation = started(world);
    run(&mut simulation, 300);
    for (handle, wanted) in boxes {
        assert_near(place(&simulation, handle), wanted, SLOP);
    }
}

/// Box3D, Robustness: Overlap Recovery, with its push speed of 3 m/s for each pair.
#[test]
fn boxes_that_overlap_by_a_quarter_part_without_an_explosion() {
    let mut world = sample();
    let mut boxes = Vec::new();
    for row in 0..4 {
        for i in 0..4 - row {
            let x = 0.375 * (row as f32 - 4.0) + 0.75 * i as f32;
            let at = vec3(x, 0.5 + 0.75 * row as f32, 0.0);
            boxes.push((world.insert(super::scene::at(light().shape(cube(0.5)).friction(0.6), at)), at));
        }
    }
    let mut simulation = started(world);
    run_with(&mut simulation, 300, |simulation, step| {
        for (a, at_a) in &boxes {
            for (b, at_b) in boxes.iter().filter(|(_, at_b)| at_b.distance(*at_a) < 1.1) {
                let speed = |handle: BodyHandle| body(simulation, handle).linear_velocity;
                let apart = speed(*a).distance(speed(*b));
                assert!(apart <= 3.0, "{apart} m/s in step {step}, of {at_a} and {at_b}");
            }
        }
    });
    assert!(simulation.penetration().max < f64::from(SLOP), "{:?}", simulation.penetration());
}

/// Box3D, Issues: Restitution Overshoot.
#[test]
fn an_elastic_box_on_a_small_floor_never_rises_above_its_start() {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    world.insert(fixed(Shape::cuboid(0.375, 0.25, 0.375)).position(0.0, -0.25, 0.0));
    let bouncing = world.insert(dynamic(cube(0.5)).restitution(1.0).position(0.0, 10.0, 0.0));
    let mut simulation = started(world);
    let mut bounced = false;
    run_with(&mut simulation, 600, |simulation, step| {
        let found = body(simulation, bouncing);
        bounced |= found.linear_velocity.y > 0.0;
        assert!(found.position.y <= 10.05, "{} in step {step}", found.position);
    });
    assert!(bounced);
}

// Samples: Joints

/// Box3D, Joints: Ball and Chain.
#[test]
fn a_chain_of_light_links_holds_a_ball_of_33_t() {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    let friction = |joint: Joint| joint.generic([Axis::LOCKED; 3], [Axis::FREE.motor(0.0, 10.0); 3]);
    let mut parent: Option<(BodyHandle, Vec3)> = None;
    for i in 0..33 {
        let is_link = i < 32;
        let lying = Quat::from_rotation_z(0.5 * PI);
        let (body, reach) = if is_link {
            (Body::dynamic().shape_at(Shape::capsule(0.5, 0.125), Vec3::ZERO, lying), 0.5)
        } else {
            (dynamic(Shape::ball(2.0)), 2.0)
        };
        let x = if is_link { 0.5 + i as f32 } else { 34.0 };
        let child = world.insert(body.position(x, 0.0, 0.0));
        world.insert_joint(friction(match parent {
            Some((parent, end)) => Joint::new(parent, end, child, -reach * Vec3::X),
            None => Joint::to_world(child, -reach * Vec3::X, Vec3::ZERO),
        }));
        parent = Some((child, reach * Vec3::X));
    }
    let mut simulation = started(world);
    run_with(&mut simulation, 300, |simulation, step| {
        let gap = simulation.world.joint_gap();
        assert!(gap < SLOP, "{gap} m in step {step}");
    });
}

/// Box3D, Joints: Bridge, with 50 planks in place of 150.
#[test]
fn a_bridge_of_planks_hangs_together() {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    let (half, count) = (0.125, 50);
    let mut last: Option<BodyHandle> = None;
    for i in 0..=count {
        let pivot = 2.0 * half * i as f32;
        let plank = dynamic(Shape::cuboid(half, half, 0.5)).density(20.0).linear_damping(0.1).angular_damping(0.1);
        let plank = (i < count).then(|| world.insert(plank.position(pivot + half, 20.0, 0.0)));
        for z in [-0.5, 0.5] {
            let (before, after) = (vec3(half, 0.0, z), vec3(-half, 0.0, z));
            let at = vec3(pivot, 20.0, z);
            world.insert_joint(match (last, plank) {
                (Some(last), Some(plank)) => Joint::new(last, before, plank, after),
                (Some(last), None) => Joint::to_world(last, before, at),
                (None, Some(plank)) => Joint::to_world(plank, after, at),
                (None, None) => unreachable!("a bridge has planks"),
            });
        }
        last = plank;
    }
    let mut simulation = started(world);
    run(&mut simulation, 300);
    let gap = simulation.world.joint_gap();
    assert!(gap < SLOP, "{gap} m");
    assert!(super::scene::lowest(&simulation.world) > 10.0);
}

/// Box3D, Joints: Door.
#[test]
fn a_door_that_is_pushed_open_swings_shut_by_its_spring() {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    let land = world.insert(ground(20.0, 1.0));
    let door = dynamic(Shape::cuboid(0.75, 1.5, 0.1)).gravity_scale(2.0).position(0.0, 1.5, 0.0);
    let door = world.insert(door);
    for y in [0.0, 3.0] {
        let hinge = Joint::new(door, vec3(-0.75, y - 1.5, 0.0), land, vec3(-0.75, y + 1.0, 0.0)).hinge(Vec3::Y);
        world.insert_joint(hinge.limited(-0.5 * PI, 0.5 * PI).spring(0.0, 1.0, 0.5));
    }
    let mut simulation = started(world);
    let opened = vec3(0.75, 1.5, 0.0);
    body_mut(&mut simulation, door).apply_impulse_at(1000.0 * Vec3::Z, opened);
    let mut widest = 0.0_f32;
    run_with(&mut simulation, 600, |simulation, _| {
        widest = widest.max(twist(body(simulation, door).rotation, Vec3::Y).abs());
        assert!(simulation.world.joint_gap() < SLOP, "{} m", simulation.world.joint_gap());
    });
    assert!(widest > 0.2 && widest <= 0.5 * PI + 0.01, "{widest}");
    assert_about(twist(body(&simulation, door).rotation, Vec3::Y), 0.0, 1e-2);
}

/// Box3D, Ragdoll: Box. Arms and legs by joints with limits of cone and twist.
#[test]
fn a_ragdoll_gains_no_energy_from_the_limits_of_its_joints() {
    let mut world = weightless();
    let limb = |half: f32, radius: f32| dynamic(Shape::capsule(half, radius));
    let spin = vec3(1.0, 2.0, 4.0);
    let trunk = world.insert(limb(0.25, 0.15).velocity(Vec3::ZERO, spin));
    for (x, y) in [(-0.35, 0.2), (0.35, 0.2), (-0.1, -0.75), (0.1, -0.75)] {
        let mut last = (trunk, vec3(x, y + 0.22, 0.0));
        for part in 0..2 {
            let middle = vec3(x, y - 0.44 * part as f32, 0.0);
            let limb = world.insert(at(limb(0.15, 0.06), middle).velocity(spin.cross(middle), spin));
            let joint = Joint::new(limb, 0.22 * Vec3::Y, last.0, last.1).along(Vec3::Y);
            world.insert_joint(joint.limited(-0.4, 0.4));
            world.insert_joint(joint.cone(0.7));
            last = (limb, -0.22 * Vec3::Y);
        }
    }
    let start = world.kinetic_energy();
    let mut simulation = started(world);
    run_with(&mut simulation, 600, |simulation, step| {
        let energy = simulation.world.kinetic_energy();
        assert!(energy <= 1.001 * start, "{energy} J of {start} J in step {step}");
    });
    assert!(simulation.world.joint_gap() < SLOP);
}

/// Box3D, Joints: Weld, with an angular spring of 2 Hz. A torque turns it by its angle over the stiffness.
#[test]
fn a_soft_weld_turns_by_the_torque_over_its_stiffness() {
    let mut world = World::new();
    let held = dynamic(Shape::cuboid(0.5, 1.5, 0.25)).gravity_scale(0.0).position(0.0, 4.0, 0.0);
    let held = world.insert(held);
    let stiffness = 50_000.0;
    let soft = Axis::FREE.spring_damper(0.0, stiffness, 5_000.0, f32::MAX);
    let weld = Joint::to_world(held, 1.5 * Vec3::Y, 5.5 * Vec3::Y).generic([Axis::LOCKED; 3], [soft; 3]);
    world.insert_joint(weld);
    world.body_mut(held).expect("it is there").torque = 0.1 * stiffness * Vec3::Z;
    let mut simulation = started(world);
    run(&mut simulation, 900);
    assert_about(twist(body(&simulation, held).rotation, Vec3::Z), 0.1, 1e-3);
    assert!(simulation.world.joint_gap() < SLOP);
}

/// A gear of 16 teeth on a hinge, with its rolling circle at 1 m.
fn gear(world: &mut World, x: f32, turn: f32, of: impl Fn(Joint) -> Joint) -> BodyHandle {
    let lying = Quat::from_rotation_x(0.5 * PI);
    let core = Body::dynamic().shape_at(Shape::cylinder(0.1, 0.9), Vec3::ZERO, lying).friction(0.1);
    let gear = (0..16).fold(core, |body, tooth| {
        let turned = Quat::from_rotation_z(PI / 8.0 * tooth as f32);
        let ring = [(0.85, 0.11), (1.0, 0.085), (1.1, 0.04)];
        let points = ring.into_iter().flat_map(|(r, half)| {
            [-1.0, 1.0].into_iter().flat_map(move |side| [-0.1, 0.1].map(|z| vec3(r, side * half, z)))
        });
        body.shape_at(Shape::convex_hull(&points.collect::<Vec<_>>()).expect("a tooth"), Vec3::ZERO, turned)
    });
    let gear = world.insert(gear.position(x, 0.0, 0.0).rotation(Quat::from_rotation_z(turn)));
    world.insert_joint(of(Joint::to_world(gear, Vec3::ZERO, x * Vec3::X).hinge(Vec3::Z)));
    gear
}

/// Box3D, Joints: Gear Lift, the gears.
#[test]
fn a_gear_turns_another_by_its_teeth() {
    let mut world = World::new();
    let driver = gear(&mut world, 0.0, 0.0, |joint| joint.motor(1.0, 30_000.0));
    let follower = gear(&mut world, 2.02, PI / 16.0, |joint| joint.motor(0.0, 0.5));
    let mut simulation = started(world);
    let mut turned = [0.0_f32; 2];
    run_with(&mut simulation, 600, |simulation, _| {
        for (sum, handle) in turned.iter_mut().zip([driver, follower]) {
            *sum += body(simulation, handle).angular_velocity.z * DT;
        }
    });
    assert_about(turned[0], 10.0, 0.1);
    // The play of a tooth.
    assert_about(turned[1], -10.0, 0.1);
}

// Samples: Bodies, Shapes, Events

/// Box3D, Bodies: Gyroscopic Precession, with one top. A heavy top precesses by the law of Goldstein 5.7.
#[test]
fn a_top_precesses_as_fast_as_the_law_of_a_heavy_top_says() {
    let mut points = vec![Vec3::ZERO];
    points.extend((0..7).map(|i| {
        let (sin, cos) = (2.0 * PI / 7.0 * i as f32).sin_cos();
        vec3(2.0 * cos, 2.0, 2.0 * sin)
    }));
    let mut world = sample();
    let tilted = Quat::from_rotation_z(15_f32.to_radians());
    let top = Body::dynamic().shape(Shape::convex_hull(&points).expect("a top")).friction(0.6);
    let top = top.position(0.0, 2.0, 0.0).rotation(tilted).velocity(Vec3::ZERO, tilted * (75.0 * Vec3::Y));
    let (mass, inertia) = (top.mass, top.mass.world_inertia(Quat::IDENTITY));
    let top = world.insert(top);
    let mut simulation = started(world);
    let arm = mass.center.y;
    let across = 0.5 * (inertia.x_axis.x + inertia.z_axis.z) + mass.mass * arm * arm;
    let expected = |body: &Body| {
        let axis = body.rotation * Vec3::Y;
        let momentum = inertia.y_axis.y * body.angular_velocity.dot(axis);
        let (a, torque) = (across * axis.y, mass.mass * G * arm);
        (momentum - (momentum * momentum - 4.0 * a * torque).sqrt()) / (2.0 * a)
    };
    let azimuth = |body: &Body| {
        let axis = body.rotation * Vec3::Y;
        (-axis.z).atan2(axis.x)
    };
    run(&mut simulation, 120);
    let (mut before, mut found, mut wanted) = (azimuth(body(&simulation, top)), 0.0, 0.0);
    run_with(&mut simulation, 600, |simulation, _| {
        let body = body(simulation, top);
        let now = azimuth(body);
        found += (now - before + PI).rem_euclid(2.0 * PI) - PI;
        wanted += expected(body) * DT;
        before = now;
    });
    assert_about(found / wanted, 1.0, 0.01);
}

/// Box3D, Bodies: Weeble.
#[test]
fn a_weeble_stands_up_and_comes_to_rest() {
    let mut world = sample();
    let material = Material { friction: 0.6, rolling_friction: 0.1, ..Material::default() };
    let weeble = Body::dynamic().shape(Shape::capsule(1.0, 1.0)).material(material);
    let own = weeble.mass;
    let moments = own.world_inertia(Quat::IDENTITY);
    let farther = own.mass * 1.5 * 1.5;
    let low = MassProperties {
        mass: own.mass,
        center: -1.5 * Vec3::Y,
        principal_inertia: vec3(moments.x_axis.x + farther, moments.y_axis.y, moments.z_axis.z + farther),
        principal_frame: Quat::IDENTITY,
    };
    let weeble = weeble.mass_properties(low).position(0.0, 5.0, 0.0).rotation(Quat::from_rotation_z(0.95 * PI));
    let weeble = world.insert(weeble);
    let mut simulation = started(world);
    run(&mut simulation, 3600);
    let up = (body(&simulation, weeble).rotation * Vec3::Y).y;
    // It rests where the lever of its weight, half a meter times the sine of its tilt, is that of rolling friction.
    assert!(up > (1.0_f32 - 0.2 * 0.2).sqrt() - 1e-3, "{up}");
    assert!(simulation.is_asleep(weeble));
}

/// Box3D, Bodies: Lock Mixing.
#[test]
fn locked_boxes_stay_where_they_are_among_free_ones() {
    let mut world = sample();
    let of = |x: f32, y: f32, z: f32| dynamic(cube(1.0)).position(x, y, z);
    let free = world.insert(of(0.0, 2.0, 0.0));
    let turning = world.insert(of(2.0, 2.0, 0.0).locked_rotations([true, false, true]));
    let floating = world.insert(of(-2.0, 2.0, 0.0).locked_translations([true; 3]));
    let full = world.insert(of(0.0, 1.0, 2.0).locked_translations([true; 3]).locked_rotations([true; 3]));
    world.insert(fixed(cube(1.0)).position(0.0, 1.0, -3.0));
    let mut simulation = started(world);
    run(&mut simulation, 300);
    assert_eq!(place(&simulation, floating), vec3(-2.0, 2.0, 0.0));
    let full = body(&simulation, full);
    assert_eq!((full.position, full.rotation), (vec3(0.0, 1.0, 2.0), Quat::IDENTITY));
    assert_about(place(&simulation, free).y, 1.0, SLOP);
    assert_about(place(&simulation, turning).y, 1.0, SLOP);
    let rotation = body(&simulation, turning).rotation;
    assert_eq!((rotation.x, rotation.z), (0.0, 0.0));
}

/// Box3D, Bodies: Fixed Rotation.
#[test]
fn a_capsule_with_locked_rotations_is_pushed_out_of_another_without_a_turn() {
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    let capsule = |radius: f32| Shape::capsule(0.5, radius);
    let [low, half] = [0.5 * Vec3::Y, Vec3::ZERO];
    world.insert(Body::fixed().shape_at(capsule(0.3), low, Quat::IDENTITY).position(0.0, 0.5, 0.0));
    let pushed = Body::dynamic().shape_at(capsule(0.2), low, Quat::IDENTITY).gravity_scale(0.0);
    let pushed = pushed.can_sleep(false).locked_rotations([true; 3]).position(0.3, 0.5, half.z);
    let pushed = world.insert(pushed);
    let mut simulation = started(world);
    run(&mut simulation, 600);
    let pushed = body(&simulation, pushed);
    assert_eq!(pushed.rotation, Quat::IDENTITY);
    assert!(pushed.position.x > 0.5 - SLOP, "{}", pushed.position);
}

/// Box3D, Bodies: Offset Kinematic.
#[test]
fn a_kinematic_body_turns_about_the_center_that_it_is_given() {
    let mut world = World::new();
    let center = vec3(0.5, 0.5, 1.0);
    let turning = Body::kinematic().shape_at(Shape::cuboid(0.5, 0.5, 1.0), center, Quat::IDENTITY);
    let turning = turning.mass_properties(MassProperties::point(0.0, center)).position(0.0, 3.0, 0.0);
    let turning = world.insert(turning.velocity(Vec3::ZERO, vec3(1.0, -1.0, 2.0)));
    let mut simulation = started(world);
    run(&mut simulation, 120);
    let turning = body(&simulation, turning);
    assert_near(turning.center_of_mass(), vec3(0.5, 3.5, 1.0), 1e-4);
    assert!(turning.position.distance(3.0 * Vec3::Y) > 0.1);
}

/// Free rotation of a body for 10 s: relative changes of energy and angular momentum, and the least cosine of the
/// turn of an axis.
fn spun(mut spun: Body, spin: Vec3, axis: Vec3) -> (f64, f64, f32) {
    spun.angular_velocity = spin;
    let mut world = weightless();
    let spun = world.insert(spun);
    let start = (world.kinetic_energy(), world.angular_momentum());
    let turned = world.body(spun).expect("it is there").rotation * axis;
    let mut simulation = started(world);
    let mut worst = (0.0_f64, 0.0_f64, 1.0_f32);
    run_with(&mut simulation, 600, |simulation, _| {
        let world = &simulation.world;
        worst.0 = worst.0.max((world.kinetic_energy() / start.0 - 1.0).abs());
        worst.1 = worst.1.max((world.angular_momentum() - start.1).length() / start.1.length());
        worst.2 = worst.2.min((body(simulation, spun).rotation * axis).dot(turned));
    });
    worst
}

/// Box3D, Bodies: Spinning Book.
#[test]
fn a_book_tumbles_only_about_its_middle_axis() {
    let book = || dynamic(Shape::cuboid(0.35, 0.08, 0.5));
    let cases = [
        (vec3(5.0, 0.01, 0.01), Vec3::X, true),
        (vec3(0.01, 5.0, 0.01), Vec3::Y, false),
        (vec3(0.01, 0.01, -5.0), Vec3::Z, false),
    ];
    for (spin, axis, tumbles) in cases {
        let (energy, momentum, least) = spun(book(), spin, axis);
        // The part of the angular momentum that a test of Rapier lets change.
        assert!(energy < 1e-3 && momentum < 0.02, "{energy}, {momentum}");
        assert!(if tumbles { least < -0.9 } else { least > 0.99 }, "{least} about {axis}");
    }
}

/// Box3D, Bodies: Gyroscopic Torque. Avian, examples: gyroscopic_motion.
#[test]
fn handles_and_rackets_keep_energy_and_angular_momentum() {
    let along = |angle: f32| Quat::from_rotation_z(angle);
    let handle = Body::dynamic().shape(Shape::cylinder(2.5, 0.4)).shape_at(
        Shape::cylinder(0.625, 0.25),
        Vec3::X,
        along(0.5 * PI),
    );
    let propeller = Body::dynamic().shape(Shape::cylinder(0.3, 0.15)).shape(Shape::cuboid(1.0, 0.05, 0.1));
    let racket = Body::dynamic()
        .shape_at(Shape::cylinder(0.75, 0.25), 1.5 * Vec3::Z, Quat::from_rotation_x(0.5 * PI))
        .shape_at(Shape::cylinder(0.1, 1.5), -1.5 * Vec3::Z, Quat::IDENTITY)
        .rotation(Quat::from_rotation_y(0.001));
    let cases = [
        (handle.rotation(Quat::from_rotation_y(0.5 * PI)), 10.0 * Vec3::Z),
        (propeller.rotation(Quat::from_rotation_x(-0.5 * PI)), vec3(0.01, 0.01, 10.0)),
        (racket, 10.0 * Vec3::X),
    ];
    for (body, spin) in cases {
        let (energy, momentum, _) = spun(body, spin, Vec3::X);
        assert!(energy < 1e-3 && momentum < 0.02, "energy by {energy}, angular momentum by {momentum}");
    }
}

/// Box3D, Shapes: Inclined Plane. The boxes begin on the plane in place of above it.
#[test]
fn boxes_slide_down_a_plane_by_the_law_of_coulomb() {
    let turned = Quat::from_rotation_x(40_f32.to_radians());
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    world.insert(Body::fixed().shape(Shape::cuboid(16.0, 0.5, 10.0)).friction(1.0).rotation(turned));
    let (sin, cos) = 40_f32.to_radians().sin_cos();
    let boxes = [1, 2, 3, 4, 5].map(|i| {
        let friction = 0.2 * i as f32;
        let from = turned * vec3(-15.0 + 5.0 * i as f32, 1.5, -6.0);
        let sliding = at(Body::dynamic().shape(cube(1.0)), from).friction(friction * friction).rotation(turned);
        (world.insert(sliding), from, 0.5 * G * (sin - friction * cos).max(0.0))
    });
    let mut simulation = started(world);
    run(&mut simulation, 60);
    for (handle, from, way) in boxes {
        assert_near(place(&simulation, handle), from + turned * (way * Vec3::Z), 0.01);
    }
}

/// Box3D, Shapes: Rolling Resistance. The balls begin on the plane in place of above it.
#[test]
fn rolling_friction_slows_balls_on_a_slope_by_its_lever() {
    let angle = 10_f32.to_radians();
    let turned = Quat::from_rotation_x(angle);
    let mut world = World { gravity: G * Vec3::NEG_Y, ..World::new() };
    world.insert(fixed(Shape::cuboid(32.0, 0.5, 15.0)).rotation(turned));
    let balls = [0, 1, 2, 3, 4].map(|i| {
        let lever = 0.05 * i as f32;
        let material = Material { friction: 0.6, rolling_friction: lever, ..Material::default() };
        let from = turned * vec3(-10.0 + 5.0 * i as f32, 1.5, -10.0);
        let ball = world.insert(at(Body::dynamic().shape(Shape::ball(1.0)), from).material(material));
        (ball, from, 5.0 / 7.0 * G * (angle.sin() - lever * angle.cos()).max(0.0))
    });
    let mut simulation = started(world);
    run(&mut simulation, 120);
    for (handle, from, acceleration) in balls {
        let wanted = from + turned * (2.0 * acceleration * Vec3::Z);
        assert_near(place(&simulation, handle), wanted, 0.01);
    }
}

/// Box3D, Shapes: Isotropic Friction, with 8 boxes in place of 32.
#[test]
fn boxes_slide_as_far_in_all_directions() {
    let mut world = sample();
    let boxes: Vec<_> = (0..8)
        .map(|i| {
            let turned = Quat::from_rotation_y(-PI / 4.0 * i as f32);
            let out = turned * Vec3::X;
            let sliding = dynamic(cube(1.0)).position(15.0 * out.x, 1.0, 15.0 * out.z).rotation(turned);
            (world.insert(sliding.velocity(25.0 * out, Vec3::ZERO)), out)
        })
        .collect();
    let mut simulation = started(world);
    run(&mut simulation, 360);
    for (handle, out) in boxes {
        // 15 m + v²/(2 mu g).
        assert_near(place(&simulation, handle), (15.0 + 625.0 / 12.0) * out + Vec3::Y, 0.03);
    }
}

/// Box3D, Shapes: Conveyor Belt.
#[test]
fn boxes_ride_on_a_belt_along_its_direction() {
    let turned = Quat::from_rotation_y(0.2);
    let mut world = sample();
    let material = Material { friction: 0.8, surface_velocity: 2.0 * Vec3::X, ..Material::default() };
    let belt = Body::fixed().shape(Shape::cuboid(10.0, 0.25, 2.0)).material(material);
    world.insert(belt.position(-5.0, 5.0, 0.0).rotation(turned));
    let boxes: Vec<_> =
        (1..5).map(|i| world.insert(dynamic(cube(0.5)).position(-10.0 + 2.0 * i as f32, 7.0, 0.0))).collect();
    let mut simulation = started(world);
    run(&mut simulation, 120);
    for handle in boxes {
        assert_near(body(&simulation, handle).linear_velocity, turned * (2.0 * Vec3::X), 5e-3);
    }
}

/// Box3D, Events: Sensor Hits. The sensors are slabs in place of sheets.
#[test]
fn sensors_of_all_kinds_notice_a_bullet() {
    for speed in [4.0, 60.0, 250.0] {
        let mut world = sample();
        world.insert(fixed(Shape::cuboid(0.1, 5.0, 5.0)).position(10.0, 5.0, 0.0));
        let slab = || Shape::cuboid(0.05, 5.0, 5.0);
        let moving = Body::kinematic().sensor(slab()).velocity(0.5 * Vec3::X, Vec3::ZERO);
        let floating = Body::dynamic().sensor(slab()).mass_properties(dynamic(slab()).mass).gravity_scale(0.0);
        let sensors = [(Body::fixed().sensor(slab()), -4.0), (moving, 0.0), (floating, 4.0)];
        let sensors = sensors.map(|(body, x)| world.insert(body.position(x, 6.0, 0.0)));
        let bullet = dynamic(Shape::ball(0.25)).gravity_scale(0.0).swept().position(-26.7, 6.0, 0.0);
        let bullet = world.insert(bullet.velocity(speed * Vec3::X, Vec3::ZERO));
        let mut simulation = started(world);
        let mut seen = Vec::new();
        run_with(&mut simulation, (40.0 / speed / DT) as usize + 10, |simulation, _| {
            seen.extend(simulation.events().iter().filter_map(|event| match event {
                Event::Entered { sensor, visitor } | Event::Passed { sensor, visitor, .. }
                    if visitor.body == bullet =>
                {
                    Some(sensor.body)
                }
                _ => None,
            }));
        });
        assert_eq!(seen, sensors, "at {speed} m/s");
        assert!(place(&simulation, bullet).x < 10.0);
    }
}

// Avian's examples

/// Avian, tests: body_with_velocity_moves.
#[test]
fn a_body_with_a_velocity_moves() {
    let mut world = weightless();
    let moving = world.insert(dynamic(Shape::ball(0.5)).velocity(Vec3::X, Vec3::ZERO));
    let mut simulation = started(world);
    run(&mut simulation, 500);
    assert_near(place(&simulation, moving), 500.0 * DT * Vec3::X, 1e-4);
}

/// Avian, examples: chain_3d, whipped to and fro at 10 m/s.
#[test]
fn a_chain_of_100_balls_that_is_whipped_stays_together() {
    let mut world = World::new();
    let mut last = world.insert(Body::kinematic());
    let handle = last;
    let radius = 0.06;
    for i in 1..100 {
        let ball = Body::dynamic().mass_properties(light().shape(Shape::ball(radius)).mass);
        let ball = world.insert(ball.position(0.0, -2.2 * radius * i as f32, 0.0));
        world.insert_joint(Joint::new(ball, 1.1 * radius * Vec3::Y, last, -1.1 * radius * Vec3::Y));
        last = ball;
    }
    let mut simulation = started(world);
    let mut worst = 0.0_f32;
    for round in 0..8 {
        let side = if round % 2 == 0 { 10.0 } else { -10.0 };
        body_mut(&mut simulation, handle).linear_velocity = side * Vec3::X;
        run_with(&mut simulation, 30, |simulation, _| worst = worst.max(simulation.world.joint_gap()));
    }
    assert!(worst < SLOP, "{worst} m");
}

/// An anchor that turns at 1.5 rad/s, and a cube of 1 kg that is joined to it.
fn turning(from: Vec3, of: impl Fn(Joint) -> Joint) -> (Simulation, [BodyHandle; 2]) {
    let mut world = World::new();
    let anchor = world.insert(Body::kinematic().velocity(Vec3::ZERO, 1.5 * Vec3::Z));
    let held = Body::dynamic().mass_properties(light().shape(cube(0.5)).mass);
    let held = world.insert(at(held, from));
    world.insert_joint(of(Joint::new(held, Vec3::ZERO, anchor, Vec3::ZERO)));
    (started(world), [anchor, held])
}

/// Avian, examples: fixed_joint_3d, prismatic_joint_3d.
#[test]
fn a_turning_anchor_takes_a_welded_and_a_sliding_cube_along() {
    let weld = |joint: Joint| Joint { anchor_b: 1.5 * Vec3::X, ..joint }.fixed();
    let slide = |joint: Joint| Joint { anchor_b: Vec3::X, ..joint }.slider(Vec3::X).limited(0.5, 2.0);
    let kinds: [&dyn Fn(Joint) -> Joint; 2] = [&weld, &slide];
    for (of, [near, far]) in kinds.into_iter().zip([[1.5, 1.5], [1.5, 3.0]]) {
        let (mut simulation, [anchor, held]) = turning(1.5 * Vec3::X, of);
        run_with(&mut simulation, 600, |simulation, step| {
            let (anchor, held) = (body(simulation, anchor), body(simulation, held));
            let seen = anchor.rotation.inverse() * held.position;
            assert!(seen.x > near - SLOP && seen.x < far + SLOP, "{seen} in step {step}");
            assert!(seen.with_x(0.0).length() < SLOP, "{seen} in step {step}");
            assert!(held.rotation.angle_between(anchor.rotation) < 0.01);
        });
    }
}

/// Avian, examples: revolute_joint_3d.
#[test]
fn a_cube_on_a_hinge_with_limits_follows_a_turning_anchor() {
    let hinge = |joint: Joint| Joint { anchor_a: 2.0 * Vec3::Y, ..joint }.hinge(Vec3::Z).limited(-1.0, 1.0);
    let (mut simulation, [anchor, held]) = turning(-2.0 * Vec3::Y, hinge);
    run_with(&mut simulation, 600, |simulation, step| {
        let (anchor, held) = (body(simulation, anchor), body(simulation, held));
        let angle = twist(anchor.rotation.inverse() * held.rotation, Vec3::Z);
        assert!(angle.abs() <= 1.0 + 0.01, "{angle} rad in step {step}");
        assert_near(held.position + held.rotation * (2.0 * Vec3::Y), Vec3::ZERO, SLOP);
    });
}

/// Avian, examples: distance_joint_3d. A spring of 400 N/m holds 1 kg, and damping brings it to rest.
#[test]
fn a_soft_rod_stretches_by_the_weight_over_its_stiffness() {
    let mut world = World::new();
    let hanging = light().shape(cube(0.5)).position(-2.0, -0.5, 0.0).linear_damping(1.0).angular_damping(1.0);
    let hanging = world.insert(hanging);
    let rod = Joint::to_world(hanging, Vec3::splat(0.5), Vec3::ZERO);
    world.insert_joint(rod.at_distance(Axis::FREE.spring_damper(1.5, 400.0, 1.0, f32::MAX)));
    let mut simulation = started(world);
    run(&mut simulation, 1800);
    let end = body(&simulation, hanging);
    let hook = end.position + end.rotation * Vec3::splat(0.5);
    assert_about(hook.length(), 1.5 + 9.81 / 400.0, 1e-3);
    assert!(hook.with_y(0.0).length() < 0.01, "{hook}");
}

/// Avian, examples: conveyor_belt, with one layer of cubes in place of three.
#[test]
fn four_belts_carry_cubes_around_a_square() {
    let mut world = World::new();
    let belt = |half: f32, speed: f32| {
        let material = Material { friction: 1.0, surface_velocity: speed * Vec3::X, ..Material::default() };
        Body::fixed().shape(Shape::cuboid(half, 0.05, 3.0)).material(material)
    };
    let tilt = Quat::from_rotation_z(2_f32.to_radians());
    let quarter = Quat::from_rotation_y(0.5 * PI);
    world.insert(belt(9.0, 6.0).position(-3.0, -0.25, 7.0).rotation(tilt));
    world.insert(belt(9.0, -6.0).position(3.0, -0.25, -7.0).rotation(tilt.inverse()));
    world.insert(belt(7.0, 3.0).position(9.0, -0.25, 3.0).rotation(quarter * tilt));
    world.insert(belt(7.0, -3.0).position(-9.0, -0.25, -3.0).rotation(quarter * tilt.inverse()));
    let cubes = [8.0, 9.0, 10.0, 11.0].into_iter().flat_map(|x| [-2.0, -1.0, 0.0, 1.0].map(|z| (x, z)));
    let cubes: Vec<_> =
        cubes.map(|(x, z)| world.insert(Body::dynamic().shape(cube(0.5)).position(x, 1.0, z))).collect();
    let mut simulation = started(world);
    // Each cube reaches the far belt, and then the near one again.
    for far in [true, false] {
        let mut waits = cubes.clone();
        run_with(&mut simulation, 900, |simulation, _| {
            waits.retain(
                |&handle| if far { place(simulation, handle).x >= -6.0 } else { place(simulation, handle).x <= 6.0 },
            );
        });
        assert!(waits.is_empty(), "{} of 16 cubes do not come around", waits.len());
    }
    // They push each other at the corners: of 192 cubes that began within 1 mm of these places, 2 fell off.
    let fell = cubes.iter().filter(|&&handle| place(&simulation, handle).y < -1.0).count();
    assert!(fell <= 1, "{fell} cubes fell off");
}

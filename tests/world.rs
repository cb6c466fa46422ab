//! Worlds that no step can be made of are refused, by name and in one line.

use drystone::glam::{Quat, Vec3};
use drystone::{Body, Joint, Reference, Shape, Simulation, SolverConfig, World};

fn cube() -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).named("cube")
}

fn refusal(change: impl FnOnce(&mut World)) -> Option<String> {
    let mut world = World::new();
    world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    world.add(cube());
    change(&mut world);
    let made = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()));
    made.err().map(|e| e.to_string())
}

#[test]
fn a_good_world_is_taken() {
    assert_eq!(refusal(|_| ()), None);
}

#[test]
fn bodies_at_the_ends_of_the_range_are_taken() {
    for (mass, moments) in [(1e-15, Vec3::splat(1e-30)), (1e15, Vec3::splat(1e30)), (1.0, Vec3::new(1.0, 1e-12, 1.0))] {
        let taken = refusal(|w| {
            w.bodies[1].mass.mass = mass;
            w.bodies[1].mass.principal_inertia = moments;
        });
        assert_eq!(taken, None);
    }
}

#[test]
fn what_cannot_be_simulated_is_refused_by_name() {
    type Change = fn(&mut World);
    let cases: [(&str, Change); 32] = [
        ("gravity", |w| w.gravity.y = f32::NAN),
        ("gravity", |w| w.gravity.y = -2e19),
        ("body 1 \"cube\": position", |w| w.bodies[1].position.x = f32::INFINITY),
        ("body 1 \"cube\": rotation", |w| w.bodies[1].rotation = Quat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
        ("body 1 \"cube\": friction", |w| w.bodies[1].material.friction = -1.0),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 0.0),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 2e15),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 5e-16),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.principal_inertia.y = 2e30),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.principal_inertia = Vec3::splat(5e-31)),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.principal_inertia = Vec3::new(1.0, 1.0, 2e12)),
        ("body 1 \"cube\": center of mass", |w| w.bodies[1].mass.center.z = f32::NAN),
        ("body 2 \"\": mass", |w| {
            w.add(Body::dynamic());
        }),
        ("body 1 \"cube\": position", |w| w.bodies[1].position.z = 2e9),
        ("body 1 \"cube\": linear velocity", |w| w.bodies[1].linear_velocity.x = -2e9),
        ("body 1 \"cube\": angular velocity", |w| w.bodies[1].angular_velocity.x = f32::NAN),
        ("body 1 \"cube\": force", |w| w.bodies[1].force.x = f32::INFINITY),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = f32::NAN),
        ("body 1 \"cube\": mass", |w| w.bodies[1].mass.mass = 1e-40),
        ("body 1 \"cube\": center of mass", |w| w.bodies[1].mass.center.x = f32::NAN),
        ("body 2 \"\": shapes[0]: ball of radius -1", |w| {
            w.add(Body::fixed().shape(Shape::ball(-1.0)));
        }),
        ("body 2 \"\": shapes[1]: capsule of radius 0", |w| {
            w.add(Body::fixed().shape(Shape::ball(1.0)).shape(Shape::capsule(1.0, 0.0)));
        }),
        ("body 2 \"\": shapes[0]: cuboid of half extent inf", |w| {
            w.add(Body::fixed().shape(Shape::cuboid(1.0, f32::INFINITY, 1.0)));
        }),
        ("body 2 \"\": shapes[0]: cylinder of half height NaN", |w| {
            w.add(Body::fixed().shape(Shape::cylinder(f32::NAN, 1.0)));
        }),
        ("body 2 \"\": shapes[0]: cylinder of radius -1", |w| {
            w.add(Body::fixed().shape(Shape::cylinder(1.0, -1.0)));
        }),
        ("body 2 \"\": shapes[0]: cone of half height -2", |w| {
            w.add(Body::fixed().shape(Shape::cone(-2.0, 1.0)));
        }),
        ("body 2 \"\": shapes[0]: cone of radius", |w| {
            w.add(Body::fixed().shape(Shape::cone(1.0, 2e9)));
        }),
        ("body 2 \"\": shapes[0]: half-space of normal", |w| {
            w.add(Body::fixed().shape(Shape::half_space(3.0 * Vec3::Y)));
        }),
        ("body 2 \"\": shapes[0]: position", |w| {
            w.add(Body::fixed().shape_at(Shape::ball(1.0), Vec3::splat(f32::NAN), Quat::IDENTITY));
        }),
        ("body 2 \"\": shapes[0]: half-spaces", |w| {
            w.add(Body::kinematic().shape(Shape::half_space(Vec3::Y)));
        }),
        ("joint 0: names", |w| {
            w.join(Joint::new(1, Vec3::ZERO, 0, Vec3::ZERO));
            w.joints[0].body_b = Some(7);
        }),
        ("joint 0: ties", |w| {
            w.join(Joint::new(1, Vec3::ZERO, 1, Vec3::ZERO));
        }),
    ];
    for (start, change) in cases {
        let line = refusal(change).unwrap_or_else(|| panic!("{start}: was taken"));
        assert!(line.starts_with(start) && !line.contains('\n'), "{line}");
    }
}

//! Single bodies whose motion has a closed form, and a ball thrown at a stack.

use glam::Vec3;

use super::common::{centered, floor, slope};
use super::stacks::stack;
use crate::scene::Scene;
use drystone::stages::math::about;
use drystone::{Body, Shape, World};

/// A ball of radius 0.5 m. Its lowest point is `height` above a half-space (m).
pub(super) fn sphere_plane(height: f32) -> Scene {
    let mut world = World::new();
    world.insert(Body::fixed().named("ground").shape(Shape::half_space(Vec3::Y)));
    world.insert(Body::dynamic().named("ball").shape(Shape::ball(0.5)).position(0.0, 0.5 + height, 0.0));
    Scene::new("sphere-plane", world, 300)
}

/// A flat block on a slope of `degrees`; both have the friction `mu`. It sticks if tan(angle) < mu; else it slides with
/// the acceleration g (sin(angle) - mu cos(angle)). It is too flat to topple.
pub(super) fn slide(degrees: f32, mu: f32) -> Scene {
    let block = Body::dynamic().named("block").shape(Shape::cuboid(0.5, 0.25, 0.5));
    let scene = on_slope("slide", block, 0.25, degrees, mu);
    if libm::tanf(degrees.to_radians()) < mu { scene.standing() } else { scene }
}

/// A ball on a slope of `degrees`; both have the friction `mu`. It rolls with the acceleration 5/7 g sin(angle),
/// without slipping if tan(angle) < 7/2 mu.
pub(super) fn roll(degrees: f32, mu: f32) -> Scene {
    let ball = Body::dynamic().named("ball").shape(Shape::ball(0.5));
    on_slope("roll", ball, 0.5, degrees, mu)
}

/// 25 balls of 1 kg, 2 m apart, on a plate of 10 kg. A force of 150 N pushes the plate at `degrees` from x. Friction is
/// 0.4 below the plate and 0.8 on it. The plate slides straight along the push and the balls roll on it: m a = f for
/// each ball, M A = 150 N - 0.4 (M + 25 m) g - 25 f, and A = 7/2 a at each ball. The run takes 4 s in steps of 1 ms.
/// Source: SimBenchmark, "rolling".
pub(super) fn rolling(degrees: f32) -> Scene {
    let mut world = World::new();
    world.insert(Body::fixed().named("ground").shape(Shape::half_space(Vec3::Y)).friction(0.2));
    let plate = Body::dynamic().named("plate").shape(Shape::cuboid(10.0, 0.5, 10.0)).total_mass(10.0).friction(0.8);
    let plate = world.insert(plate.position(0.0, 0.5, 0.0));
    let (sin, cos) = libm::sincosf(degrees.to_radians());
    world.bodies[plate].force = 150.0 * Vec3::new(cos, 0.0, sin);
    for k in 0..25 {
        let [x, z] = [k / 5, k % 5].map(|k| 2.0 * centered(k, 5) as f32);
        let ball = Body::dynamic().named(format!("ball {k}")).shape(Shape::ball(0.5)).total_mass(1.0).friction(0.8);
        world.insert(ball.position(x, 1.5, z));
    }
    Scene { dt: 1e-3, ..Scene::new("rolling", world, 4000) }
}

/// A body whose center is `height` above a slope that descends towards x.
pub(super) fn on_slope(name: &str, body: Body, height: f32, degrees: f32, mu: f32) -> Scene {
    let angle = degrees.to_radians();
    let mut world = World::new();
    world.insert(slope(angle).friction(mu));
    let (x, y) = (height * libm::sinf(angle), height * libm::cosf(angle));
    world.insert(body.friction(mu).position(x, y, 0.0).rotation(about(Vec3::Z, -angle)));
    Scene::new(name, world, 120)
}

/// A ball of radius 0.5 m and a stack of `n` cubes. The ball is thrown with a horizontal `speed` (m/s) from 20 m away.
/// It hits the middle of the stack at the height of the throw.
pub(super) fn throw(n: usize, speed: f32) -> Scene {
    const DISTANCE: f32 = 20.0;
    let mut world = floor(40.0, 10.0);
    stack(&mut world, n, 0.0, |_| ([0.0; 2], 1000.0));
    let rise = 0.5 * -world.gravity.y * DISTANCE / speed;
    let ball = Body::dynamic().named("ball").shape(Shape::ball(0.5)).velocity(Vec3::new(speed, rise, 0.0), Vec3::ZERO);
    world.insert(ball.position(-1.0 - DISTANCE, (0.5 * n as f32).max(0.5), 0.0));
    Scene::new("throw", world, 400)
}

//! Blows on several points of a manifold at once.

use drystone::glam::Vec3;
use drystone::{Body, Cpu, Shape, Simulation, SolverConfig, World};

const DT: f32 = 1.0 / 60.0;

/// A cuboid that falls flat onto a half-space from `height`, for 100 steps: how far it went aside (m),
/// how high it bounced (m), its fastest way up (m/s) and its fastest spin (rad/s).
fn fallen_flat(half_extents: Vec3, restitution: f32, height: f32) -> [f32; 4] {
    let Vec3 { x, y, z } = half_extents;
    let mut world = World::new();
    world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)).restitution(restitution));
    let body = world.add(Body::dynamic().shape(Shape::cuboid(x, y, z)).restitution(restitution).position(
        0.0,
        y + height,
        0.0,
    ));
    let config = SolverConfig::default().without_sleep();
    let mut simulation = Simulation::new(world, config, Box::new(Cpu::new())).expect("a good world");
    let [mut bounced, mut fastest, mut spin] = [0.0_f32; 3];
    let mut has_met = false;
    for _ in 0..100 {
        simulation.step(DT).expect("a step");
        let body = &simulation.world.bodies[body];
        has_met |= body.linear_velocity.y > -0.5 && body.position.y < y + 0.5 * height;
        if has_met {
            bounced = bounced.max(body.position.y - y);
            fastest = fastest.max(body.linear_velocity.y);
            spin = spin.max(body.angular_velocity.length());
        }
    }
    let Vec3 { x, z, .. } = simulation.world.bodies[body].position;
    [x.hypot(z), bounced, fastest, spin]
}

/// Swept one after another the first of its four points took more than its share: the cube went 94 mm aside and rebounded at 0.37 m/s.
#[test]
fn a_cube_that_falls_flat_stays_where_it_lands() {
    for half_extents in [Vec3::ONE, Vec3::new(1.0, 0.5, 2.0)] {
        let [aside, _, fastest, spin] = fallen_flat(half_extents, 0.0, 5.0);
        assert!(aside < 1e-4 && fastest < 1e-2 && spin < 1e-2, "{aside} m, {fastest} m/s, {spin} rad/s");
    }
}

/// A plate kept 0.51 of its height at restitution 1, and turned.
#[test]
fn a_plate_bounces_flat() {
    for (half_extents, restitution) in [
        (Vec3::new(1.0, 0.5, 2.0), 1.0),
        (Vec3::splat(0.5), 1.0),
        (Vec3::new(1.0, 0.05, 2.0), 0.8),
        (Vec3::splat(0.3), 0.5),
    ] {
        let [_, bounced, _, spin] = fallen_flat(half_extents, restitution, 2.0);
        let expected = 2.0 * restitution * restitution;
        assert!((bounced - expected).abs() < 0.02 * expected, "{bounced} m in place of {expected} m");
        assert!(spin < 0.05, "{spin} rad/s");
    }
}

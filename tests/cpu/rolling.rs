//! A ball and a block on a board that turns, against what paper says.

use drystone::{Body, BodyHandle, Cpu, Shape, Simulation, SolverConfig, World};
use glam::{Quat, Vec3};

/// A wide board that turns about the z axis through the middle of its upper side, at `rate` [rad/s], down to the right.
fn turning_board(rate: f32) -> World {
    let mut world = World::new();
    let mut board = Body::kinematic().shape_at(Shape::cuboid(2.0, 1.0, 2.0), Vec3::NEG_Y, Quat::IDENTITY);
    board.angular_velocity = Vec3::new(0.0, 0.0, -rate);
    world.insert(board);
    world
}

/// Where a body of `simulation` is along its board [m].
fn along_board(simulation: &Simulation, body: BodyHandle) -> f32 {
    let bodies = &simulation.world.bodies;
    let (board, body) = (&bodies[0], &bodies[body]);
    (board.rotation.inverse() * body.position).x
}

/// On paper x'' = 5/7 g sin(rate t) + 5/7 rate² x, from x = 0 and x' = -rate r: the ball is at rest, the board turns under it.
#[test]
fn a_ball_rolls_on_a_board_that_tilts_as_on_paper() {
    let (rate, radius, g) = (20.0_f32.to_radians(), 0.015, 9.81);
    let mut world = turning_board(rate);
    let ball = world.insert(Body::dynamic().density(7800.0).shape(Shape::ball(radius)).position(0.0, radius, 0.0));
    let mut simulation =
        Simulation::with(world, SolverConfig::default().without_sleep(), Box::new(Cpu::new())).expect("a simulation");
    let (mut paper, mut v, h) = (0.0, -f64::from(rate * radius), 1e-5);
    let mut time = 0.0;
    for _ in 0..60 {
        simulation.step(1.0 / 240.0).expect("a step");
    }
    while time < 0.25 {
        v += h * 5.0 / 7.0 * (g * (f64::from(rate) * time).sin() + f64::from(rate * rate) * paper);
        paper += h * v;
        time += h;
    }
    let rolled = f64::from(along_board(&simulation, ball));
    println!("{:.3} mm, {:.3} on paper", rolled * 1e3, paper * 1e3);
    // A step late at most: x' is 76 mm/s at the end.
    assert!((rolled - paper).abs() < 0.076 / 240.0, "{rolled} m instead of {paper}");
}

#[test]
fn a_block_on_a_board_that_tilts_slowly_slips_at_the_angle_of_friction() {
    let (rate, dt) = (4.0_f32.to_radians(), 1.0 / 60.0);
    let mut world = turning_board(rate);
    let block = world.insert(Body::dynamic().shape(Shape::cuboid(0.2, 0.05, 0.2)).position(0.0, 0.05, 0.0));
    let mut simulation =
        Simulation::with(world, SolverConfig::default().without_sleep(), Box::new(Cpu::new())).expect("a simulation");
    let mut angle = 0.0;
    while along_board(&simulation, block) < 1e-3 {
        simulation.step(dt).expect("a step");
        angle += (rate * dt).to_degrees();
    }
    // From there on x'' = 0.77 m/s³ t on paper: 1 mm takes 0.2 s, 0.8 degrees.
    let paper = 0.5_f32.atan().to_degrees() + 0.8;
    println!("{angle:.2} degrees, {paper:.2} on paper");
    assert!((angle - paper).abs() < 0.2, "{angle} degrees instead of {paper}");
}

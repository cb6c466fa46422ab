//! A fountain: each step a ball comes, and the oldest of them goes. Handles name bodies for as long as they are there.
//!
//!     cargo run --release --example spawn_and_remove

use std::collections::VecDeque;

use drystone::glam::Vec3;
use drystone::{Body, BodyHandle, Result, Shape, Simulation, World};

/// Balls that live at the same time.
const MOST: usize = 120;

fn main() -> Result<()> {
    run(|line| println!("{line}"))
}

pub fn run(mut print: impl FnMut(String)) -> Result<()> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::cuboid(4.0, 0.5, 4.0)).position(0.0, -0.5, 0.0).named("basin"));
    let mut simulation = Simulation::new(world)?;
    let mut balls: VecDeque<BodyHandle> = VecDeque::new();
    for step in 0..480 {
        let angle = 2.4 * step as f32;
        let up = Vec3::new(1.5 * angle.cos(), 7.0, 1.5 * angle.sin());
        let ball = Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 0.5, 0.0).velocity(up, Vec3::ZERO);
        balls.push_back(simulation.world.insert(ball));
        if balls.len() > MOST {
            balls.pop_front().and_then(|oldest| simulation.world.remove(oldest));
        }
        // Balls that left the basin go, too.
        let is_lost = |world: &World, ball| world.body(ball).is_none_or(|body| body.position.y < -1.0);
        let lost: Vec<BodyHandle> = balls.iter().copied().filter(|&ball| is_lost(&simulation.world, ball)).collect();
        for &ball in &lost {
            simulation.world.remove(ball);
        }
        balls.retain(|ball| !lost.contains(ball));

        simulation.step(1.0 / 60.0)?;
        if step % 120 == 119 {
            let top =
                balls.iter().filter_map(|&ball| Some(simulation.world.body(ball)?.position.y)).fold(0.0, f32::max);
            let places = simulation.world.bodies.len() - 1;
            print(format!("step {}: {} balls in {places} places, the highest at {top:.1} m", step + 1, balls.len()));
        }
    }
    // The handle of a ball that is gone names nothing, although another ball has its place.
    let gone = balls[0];
    simulation.world.remove(gone);
    let next = simulation.world.insert(Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 3.0, 0.0));
    let (is_gone, same_place) = (simulation.world.body(gone).is_none(), gone.index() == next.index());
    print(format!("gone: {is_gone}, place used again: {same_place}"));
    Ok(())
}

//! A platform that holds bodies from above and lets them through from below.
//!
//!     cargo run --release --example one_way_platform

use drystone::glam::Vec3;
use drystone::{Body, BodyHandle, ColliderOf, ContactHooks, Result, Shape, Simulation, World};

/// Height of the upper side of the platform (m).
const TOP: f32 = 1.1;
/// Radius of the balls (m).
const RADIUS: f32 = 0.2;

/// A ball may touch the platform once it is above it. Its own state would have to be saved with the simulation; this
/// rule needs none.
struct OneWay {
    platform: BodyHandle,
}

impl ContactHooks for OneWay {
    fn may_touch(&mut self, world: &World, a: ColliderOf, b: ColliderOf) -> bool {
        let is_above =
            |side: ColliderOf| world.body(side.body).is_some_and(|body| body.position.y > TOP + 0.9 * RADIUS);
        let other = if a.body == self.platform { b } else { a };
        (a.body != self.platform && b.body != self.platform) || is_above(other)
    }
}

fn main() -> Result<()> {
    run(&mut |line| println!("{line}"))
}

/// Throws three balls up from below the platform, and prints where they lie.
pub fn run(print: &mut dyn FnMut(String)) -> Result<()> {
    let mut world = World::new();
    let platform = Body::fixed().shape(Shape::cuboid(5.0, 0.1, 1.0)).position(0.0, TOP - 0.1, 0.0);
    let platform = world.insert(platform);
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
    let throw = |speed: f32| {
        let ball = Body::dynamic().shape(Shape::ball(RADIUS)).position(speed - 6.0, RADIUS, 0.0);
        ball.velocity(Vec3::Y * speed, Vec3::ZERO)
    };
    let balls: Vec<BodyHandle> = [3.0, 6.0, 9.0].map(|speed| world.insert(throw(speed))).into();
    let mut simulation = Simulation::new(world)?;
    simulation.set_hooks(Some(Box::new(OneWay { platform })));
    for _ in 0..180 {
        simulation.step(1.0 / 60.0)?;
    }
    for (ball, speed) in balls.into_iter().zip([3, 6, 9]) {
        let height = simulation.world.body(ball).map_or(0.0, |body| body.position.y);
        print(format!("thrown up at {speed} m/s: {height:.2} m high"));
    }
    Ok(())
}

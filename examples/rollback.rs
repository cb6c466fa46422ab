//! Two players push boxes. The pushes of the second one arrive four steps late: the game goes back, and steps again with them. In the end it
//! has the bits of a game in which all pushes were there in time.
//!
//!     cargo run --release --example rollback

use drystone::glam::Vec3;
use drystone::{Body, Result, Rollback, Shape, Simulation, World};

const DT: f32 = 1.0 / 60.0;
/// Steps that a push of the second player is late.
const LATE: usize = 4;

fn game() -> Result<Simulation> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).named("floor"));
    for i in 0..10 {
        let place = Vec3::new((i % 2) as f32 * 3.0, 0.5 + (i / 2) as f32, 0.0);
        world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(place.x, place.y, place.z));
    }
    Simulation::new(world)
}

/// Which body a player pushes in a step, if any.
fn push(player: usize, step: usize) -> Option<usize> {
    (step % 30 == 10 * player + 5).then_some(1 + (step / 7 + player) % 10)
}

/// Steps with the pushes of the players that are known.
fn step(game: &mut Simulation, step: usize, players: &[usize]) -> Result<()> {
    for body in players.iter().filter_map(|&player| push(player, step)) {
        game.world.bodies[body].linear_velocity += Vec3::new(0.0, 0.5, 2.0);
    }
    game.step(DT).map(drop)
}

pub fn main() -> Result<()> {
    let (mut late, mut in_time) = (game()?, game()?);
    let mut rollback = Rollback::new(8);
    let mut again = 0;
    for now in 0..120 {
        rollback.push(&late);
        step(&mut late, now, &[0])?;
        // The input of the second player arrives four steps late.
        let then = now.saturating_sub(LATE);
        if now >= LATE && push(1, then).is_some() {
            rollback.back(LATE + 1, &mut late)?;
            for i in then..=now {
                rollback.push(&late);
                step(&mut late, i, if i == then { &[0, 1] } else { &[0] })?;
                again += 1;
            }
        }
        step(&mut in_time, now, &[0, 1])?;
    }
    println!("{again} steps were made again; hash {:016x}, in time {:016x}", late.hash(), in_time.hash());
    assert!(again > 0 && late.hash() == in_time.hash());
    Ok(())
}

//! A server without a display: steps of one length whatever time a round takes, inputs of players, the state as lines of JSON.
//!
//!     cargo run --release --example server_loop

use drystone::glam::Vec3;
use drystone::{Body, BodyHandle, Result, Shape, Simulation, World};

/// Length of a step (s).
const STEP: f32 = 1.0 / 60.0;
/// Most steps of one round: a server that was held up does not try to catch up with all of it.
const MAX_STEPS: u32 = 4;
/// Steps between two states that are sent.
const SEND_EVERY: u32 = 30;

/// The input of a player.
#[derive(Clone, Copy)]
pub enum Input {
    /// A force (N) until the next input.
    Push(Vec3),
    /// A speed upward (m/s).
    Jump(f32),
}

fn main() -> Result<()> {
    run(180, |line| println!("{line}"))
}

/// Runs for a number of steps.
pub fn run(steps: u32, mut send: impl FnMut(String)) -> Result<()> {
    let mut world = World::new();
    world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(0.3));
    let puck =
        |x: f32| Body::dynamic().shape(Shape::cylinder(0.2, 0.5)).total_mass(10.0).position(x, 0.2, 0.0).friction(0.3);
    let players: Vec<BodyHandle> = [-3.0, 3.0].map(|x| world.insert(puck(x))).into();
    let mut simulation = Simulation::new(world)?;

    let (mut time, mut step) = (0.0, 0);
    for round in 0.. {
        time += time_of_round(round);
        for _ in 0..MAX_STEPS {
            if time < STEP || step == steps {
                break;
            }
            // An input counts from a step on, not from a time on: the same inputs give the same bits everywhere.
            for (player, input) in inputs_of(step) {
                let Some(body) = simulation.world.body_mut(players[player]) else { continue };
                match input {
                    Input::Push(force) => body.force = force,
                    Input::Jump(speed) => body.linear_velocity.y += speed,
                }
            }
            simulation.step(STEP)?;
            time -= STEP;
            step += 1;
            if step.is_multiple_of(SEND_EVERY) {
                send(state(&simulation.world, &players, step));
            }
        }
        if step == steps {
            break;
        }
        // The rest of a long delay is dropped.
        time = time.min(STEP);
    }
    Ok(())
}

/// The time since the round before (s). A server measures it with `std::time::Instant` and sleeps for the rest of a step.
fn time_of_round(round: usize) -> f32 {
    [0.004, 0.021, 0.016, 0.090, 0.012][round % 5]
}

/// The inputs that came for a step, by the number of the player. A server reads them from its sockets.
fn inputs_of(step: u32) -> Vec<(usize, Input)> {
    match step {
        0 => vec![(0, Input::Push(Vec3::new(60.0, 0.0, 0.0))), (1, Input::Push(Vec3::new(-60.0, 0.0, 0.0)))],
        45 => vec![(1, Input::Jump(3.0))],
        90 => vec![(0, Input::Push(Vec3::ZERO)), (1, Input::Push(Vec3::ZERO))],
        _ => Vec::new(),
    }
}

/// The state as a line of JSON. Numbers of single precision are printed so that they are read back to the bit.
fn state(world: &World, players: &[BodyHandle], step: u32) -> String {
    let player = |(number, &handle): (usize, &BodyHandle)| {
        let body = world.body(handle)?;
        let (at, turn, v) = (body.position.to_array(), body.rotation.to_array(), body.linear_velocity.to_array());
        Some(format!("{{\"player\":{number},\"position\":{at:?},\"rotation\":{turn:?},\"velocity\":{v:?}}}"))
    };
    let all: Vec<String> = players.iter().enumerate().filter_map(player).collect();
    format!("{{\"step\":{step},\"players\":[{}]}}", all.join(","))
}

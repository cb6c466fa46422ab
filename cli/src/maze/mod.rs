//! The maze game: a ball on a board that tilts about two axes must roll to the goal and not into a hole.
//!
//! ```text
//! map     text -> cells: floor, wall, hole, start, goal
//! board   map -> world: one kinematic board of triangles, the ball
//! script  text -> tilts over time
//! game    tilts the board, steps the world, knows when it is won or lost
//! pilot   finds a way and writes a script that follows it
//! ```

mod board;
mod game;
mod map;
mod pilot;
mod script;

pub use board::{BALL, BOARD, CELL, GOAL, RADIUS, scene};
pub use game::{Engine, Game, Outcome, Played, SAMPLES, Sample, Slip, play};
pub use map::{BOARDS, Cell, Map};
pub use pilot::pilot;
pub use script::{Script, TILT_LIMIT};

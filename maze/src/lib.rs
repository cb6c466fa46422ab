//! The maze game: a ball on a board that tilts about two axes has to roll to the goal and past the holes.

mod board;
mod game;
mod map;
mod pilot;
mod script;

pub use board::{CELL, RADIUS, scene};
pub use game::{Engine, Game, Outcome, Played, SAMPLES, Sample, Slip, play};
pub use map::{BOARDS, Cell, Map};
pub use pilot::pilot;
pub use script::{Script, TILT_LIMIT};

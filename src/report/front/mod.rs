//! `drystone report`: speed against error.

mod contender;
mod race;

pub use contender::{Contender, Drystone, Setting};
pub use race::{Row, blocks, race};

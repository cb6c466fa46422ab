//! `drystone report`: speed against error.

mod contender;
mod course;
mod origin;
mod page;
mod pareto;
mod picture;
mod race;
mod survey;
mod table;

pub use contender::{Contender, Drystone, Extent, Setting, Team};
pub use course::{course, drystone};
pub use origin::Origin;
pub use race::{Row, blocks, race};
pub use survey::{Progress, Survey};

//! Every tolerance of the tests, and how it was found.

// One pass, and one step in the middle one of the moments of a pile's fall.
#[allow(unused_imports)]
pub use drystone_conform::{PLAIN_PASS, PLAIN_STEP};

/// One step of plain WGSL at the worst moment of that fall. The law of a soft contact has a jump where surfaces just touch: rounding decides whether
/// a contact with a separation of 1e-10 m is stiff or soft. Measured: up to 4.2e-2, from one such contact; five times that.
pub const PLAIN_JUMP: f64 = 0.2;

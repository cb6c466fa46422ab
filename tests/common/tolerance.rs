//! Every tolerance of the tests, and how it was found.

/// One pass of plain WGSL against the reference, on random problems whose numbers are of order 1; in the units of
/// `difference::largest`. Measured over 24 seeds on software Vulkan: 3.9e-6, a sweep of joints; five times that. An impulse
/// of 0.1 that is one percent off: 9e-4.
pub const PLAIN_PASS: f64 = 2e-5;

/// One step of plain WGSL against the reference, in the middle one of the moments of a pile's fall: largest difference of
/// a velocity [m/s] or angular velocity [rad/s]. Measured on software Vulkan: up to 1.3e-6; eight times that. A step that lacks
/// one sweep of one color: 2.4e-2.
pub const PLAIN_STEP: f64 = 1e-5;

/// The same at the worst moment. The law of a soft contact has a jump where surfaces just touch: rounding decides whether
/// a contact with a separation of 1e-10 m is stiff or soft. Measured: up to 4.2e-2, from one such contact; five times that.
pub const PLAIN_JUMP: f64 = 0.2;

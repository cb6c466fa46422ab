//! Soft contacts: a spring and a damper in the form of a constraint.
//!
//! Implicit Euler applies to a spring k = m w² with the damper c = 2 z m w, where m is the effective mass. Its
//! condition on the velocity is `u + (k / (c + h k)) s + r / (h (c + h k)) = 0`. With a1 = 2 z + h w and a2 = h w a1,
//!
//! ```text
//! bias_rate     = k / (c + h k)   = w / a1
//! mass_scale    = a2 / (1 + a2)
//! impulse_scale =  1 / (1 + a2)
//! ```
//!
//! The limit w -> infinity gives the hard contact (1/h, 1, 0). At rest the overlap under a force F is F / (m w²), which
//! `tests/gpu/closed_forms.rs` checks. Source: Catto, "Soft constraints", 2011; "Solver2D", 2024.

use super::rows::{Softness, Substep};
use crate::config::{SolverConfig, Stabilization};

/// Coefficients of a contact with `frequency` (Hz) and `damping_ratio` over a substep of `h` seconds.
pub fn softness(frequency: f32, damping_ratio: f32, h: f32, push_limit: f32) -> Softness {
    let omega = 2.0 * std::f32::consts::PI * frequency;
    let a1 = 2.0 * damping_ratio + h * omega;
    let a2 = h * omega * a1;
    let a3 = 1.0 / (1.0 + a2);
    Softness { bias_rate: omega / a1, mass_scale: a2 * a3, impulse_scale: a3, push_limit }
}

impl Substep {
    /// A substep of `length` seconds.
    pub fn new(config: &SolverConfig, length: f32) -> Self {
        Self {
            length,
            inverse_length: 1.0 / length,
            movable: contact_softness(config, length, 1.0),
            fixed: contact_softness(config, length, config.fixed_contact_frequency_ratio),
            joint: joint_softness(config, length),
        }
    }
}

/// The law that removes overlap, for contacts of `ratio` times the frequency.
fn contact_softness(config: &SolverConfig, h: f32, ratio: f32) -> Softness {
    match config.stabilization {
        Stabilization::Soft => {
            softness(config.contact_frequency / h * ratio, config.contact_damping, h, config.push_limit)
        }
        Stabilization::Baumgarte => Softness::rigid(config.baumgarte / h, config.push_limit),
        Stabilization::None => Softness::rigid(0.0, config.push_limit),
    }
}

fn joint_softness(config: &SolverConfig, h: f32) -> Softness {
    match config.stabilization {
        Stabilization::Soft => softness(config.joint_frequency / h, config.joint_damping, h, config.push_limit),
        _ => contact_softness(config, h, 1.0),
    }
}

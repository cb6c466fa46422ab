//! One step as a value: plain rows in color order, whose names are the names of the WGSL bindings.

mod layout;
mod prepare;
pub mod softness;
mod store;

pub use layout::{BodyRow, ContactRow, ImpulseRow, InertiaRow, MassRow, Params, PassColors, PointRow, Softness};
pub use prepare::Prepared;

/// Everything that a backend needs for one step, and everything that it gives back (`bodies`, `impulses`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepProblem {
    /// The same for all.
    pub params: Params,
    /// State, one row a body of the world.
    pub bodies: Vec<BodyRow>,
    /// Masses, one row a body.
    pub masses: Vec<MassRow>,
    /// Principal inertia of the bodies whose moments differ; empty where the scene has none.
    pub inertias: Vec<InertiaRow>,
    /// Manifolds in color order.
    pub contacts: Vec<ContactRow>,
    /// Points of the manifolds, one manifold after another.
    pub points: Vec<PointRow>,
    /// Impulses of the points.
    pub impulses: Vec<ImpulseRow>,
    /// Where each color begins in `contacts`, and where the last ends.
    pub colors: Vec<u32>,
}

impl StepProblem {
    /// Number of colors.
    pub fn color_count(&self) -> u32 {
        self.colors.len().saturating_sub(1) as u32
    }

    /// Whether any contact has friction.
    pub fn has_friction(&self) -> bool {
        self.contacts.iter().any(|c| c.friction > 0.0)
    }

    /// Whether any contact can bounce.
    pub fn has_restitution(&self) -> bool {
        self.contacts.iter().any(|c| c.restitution > 0.0)
    }

    /// Whether any contact is made by a round surface, whose radius its rows carry.
    pub fn has_round_shapes(&self) -> bool {
        self.points.iter().any(|p| p.radius_a > 0.0 || p.radius_b > 0.0)
    }
}

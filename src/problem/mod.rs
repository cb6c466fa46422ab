//! One step as a value: plain rows, whose names are the names of the WGSL bindings.

mod bodies;
pub mod carry;
mod check;
mod contacts;
pub mod effective;
mod joint_loads;
mod joint_systems;
mod joints;
mod rescale;
mod rows;
mod slots;
pub mod softness;
mod write;

pub use bodies::{begin, store};
pub use contacts::ContactRows;
pub use joint_systems::{BlockRow, JointSystems, NodeRow};
pub use joints::JointRows;
pub use rescale::StepScale;
pub use rows::{
    BodyRow, ContactRow, ConvergenceRow, FreeRow, ImpulseRow, InertiaRow, JointImpulseRow, JointRow, MassRow,
    MomentumRow, Params, PassColors, PointRow, Softness, TurningRow,
};

use std::ops::Range;

/// Everything that a backend needs for one step, and everything that it gives back (`bodies`, `impulses`,
/// `joint_impulses`, `convergence`, `momentum`).
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
    /// Manifolds, in slots that they keep as long as they last. Only those in `order` take part.
    pub contacts: Vec<ContactRow>,
    /// Points of the manifolds.
    pub points: Vec<PointRow>,
    /// Impulses of the points.
    pub impulses: Vec<ImpulseRow>,
    /// Ball joints. Only those in `order` take part.
    pub joints: Vec<JointRow>,
    /// Impulses of the joints.
    pub joint_impulses: Vec<JointImpulseRow>,
    /// The contacts that take part, color by color, and after them the joints.
    pub order: Vec<u32>,
    /// Where each color begins in `order`, and where the last ends.
    pub colors: Vec<u32>,
    /// Which of `colors` is the first of the joints.
    pub first_joint_color: u32,
    /// How many of `colors`, the last ones, are of joints that are solved at once and not swept.
    pub direct_colors: u32,
    /// Joints that are solved at once.
    pub systems: JointSystems,
    /// Bodies of joints that are solved at once, ascending.
    pub turning: Vec<TurningRow>,
    /// Whether the sweeps still move anything.
    pub convergence: ConvergenceRow,
    /// How far the sweeps extrapolate.
    pub momentum: MomentumRow,
}

impl StepProblem {
    /// Colors of the contacts.
    pub fn contact_colors(&self) -> Range<u32> {
        0..self.first_joint_color
    }

    /// Colors of the joints.
    pub fn joint_colors(&self) -> Range<u32> {
        self.first_joint_color..(self.colors.len() as u32).saturating_sub(1).max(self.first_joint_color)
    }

    /// Colors of the joints that are swept.
    pub fn swept_joint_colors(&self) -> Range<u32> {
        let Range { start, end } = self.joint_colors();
        start..end.saturating_sub(self.direct_colors).max(start)
    }

    /// Colors of the joints that are solved at once.
    pub fn direct_joint_colors(&self) -> Range<u32> {
        self.swept_joint_colors().end..self.joint_colors().end
    }

    /// The contacts, or joints, of some neighboring colors, by their rows.
    pub fn rows_of(&self, colors: &Range<u32>) -> &[u32] {
        if colors.is_empty() {
            return &[];
        }
        &self.order[self.colors[colors.start as usize] as usize..self.colors[colors.end as usize] as usize]
    }

    /// The contacts that take part, in the order of the sweeps.
    pub fn swept_contacts(&self) -> impl Iterator<Item = &ContactRow> + Clone {
        self.rows_of(&self.contact_colors()).iter().map(|&row| &self.contacts[row as usize])
    }

    /// Lets all rows take part that are there, contacts and joints each in one color.
    pub fn sweep_in_order_of_rows(&mut self) {
        let (contacts, joints) = (self.contacts.len() as u32, self.joints.len() as u32);
        self.order = (0..contacts).chain(0..joints).collect();
        self.colors = vec![0, contacts];
        self.first_joint_color = 1;
        if joints > 0 {
            self.colors.push(contacts + joints);
        }
    }

    /// Whether a patch follows the points of every contact.
    pub fn has_patches(&self) -> bool {
        self.params.patches != 0
    }

    /// Number of impulses, those of patches and joints included.
    pub fn impulse_count(&self) -> usize {
        self.impulses.len() + self.joint_impulses.len()
    }

    /// Lets the contacts that take part begin without impulses and preloads.
    pub fn forget_impulses(&mut self) {
        let patch = usize::from(self.has_patches());
        for &row in &self.order[..self.colors.get(self.first_joint_color as usize).map_or(0, |&end| end as usize)] {
            let contact = &mut self.contacts[row as usize];
            contact.preload = 0.0;
            let first = contact.first_point as usize;
            self.impulses[first..first + contact.point_count as usize + patch].fill(ImpulseRow::default());
        }
    }

    /// Whether any contact has friction.
    pub fn has_friction(&self) -> bool {
        self.swept_contacts().any(|c| c.friction > 0.0)
    }

    /// Whether any contact can bounce.
    pub fn has_restitution(&self) -> bool {
        self.swept_contacts().any(|c| c.restitution > 0.0)
    }

    /// Whether any contact is made by a round surface, whose radius its rows carry.
    pub fn has_round_shapes(&self) -> bool {
        self.swept_contacts().any(|c| c.radius_a > 0.0 || c.radius_b > 0.0)
    }
}

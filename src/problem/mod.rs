//! One step as plain rows, with the names of the WGSL bindings.

mod axes;
mod blocks;
mod bodies;
pub mod carry;
mod check;
mod check_systems;
mod contacts;
pub(crate) mod damping;
pub mod effective;
mod geometric_stiffness;
mod impacts;
pub(crate) mod join;
mod joint_loads;
mod joint_sets;
mod joint_systems;
mod joints;
mod prepare;
mod rescale;
mod rows;
mod slots;
pub mod softness;
mod summary;
mod touching;
mod write;

pub use crate::math::effective_mass::{Mass, Sym3};
pub(crate) use axes::{drive_count, stiffness};
pub use blocks::{Block, lay_out};
pub(crate) use bodies::pose_after;
pub use bodies::{begin, find_thrown, follow_parabolas, store};
pub use contacts::{ContactRows, check_material};
pub use damping::write_dampings;
pub use joint_systems::{BlockRow, ImpulseNumber, JointSystems, NodeRow};
pub use joints::JointRows;
pub use rescale::StepScale;
pub(crate) use rows::points_a_slot;
pub use rows::{
    AxisRow, BodyRow, ContactRow, ConvergenceRow, DampingRow, FreeRow, ImpulseRow, InertiaRow, JointImpulseRow,
    JointRow, MAX_AXES, MassRow, MomentumRow, NO_LIMIT, Params, PassRow, PointRow, Softness, Substep, TorqueRow,
    TurningRow,
};
pub use summary::ContactSummary;
pub use touching::{Approach, ColliderPair};

use std::ops::Range;

use glam::Vec3;

/// The input of a backend for one step, and its output: `bodies`, `impulses`, `totals`, `joint_impulses`,
/// `joint_totals`, `convergence` and `momentum`.
///
/// ```
/// use drystone::Simulation;
/// use drystone::stages::problem::StepProblem;
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &["n=3".into()])?;
/// let mut simulation = Simulation::new(scene.world)?;
/// simulation.step(scene.dt)?;
/// let problem: StepProblem = simulation.problem().clone();
/// problem.check()?;
/// assert_eq!((problem.swept_contacts().count(), problem.rows_of(&problem.contact_colors()).len()), (3, 3));
/// assert!(problem.joint_colors().is_empty() && problem.system_colors().len() <= 1 && !problem.has_systems());
/// assert!(problem.impulse_count() >= 12 && !problem.has_patches() && !problem.has_friction_at_patches() && problem.is_isotropic(&[1, 2, 3]));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Debug, Default, PartialEq)]
pub struct StepProblem {
    /// Numbers that are the same for all rows.
    pub params: Params,
    /// State of the bodies, one row for each body of the world.
    pub bodies: Vec<BodyRow>,
    /// Masses, one row for each body.
    pub masses: Vec<MassRow>,
    /// Angular accelerations by torques, one row for each body; empty if no body has a torque.
    pub torques: Vec<TorqueRow>,
    /// Effects of damping, one row for each body; empty if no body is damped.
    pub dampings: Vec<DampingRow>,
    /// Principal inertia of the bodies whose moments differ; empty if there are none.
    pub inertias: Vec<InertiaRow>,
    /// Manifolds. Each keeps its slot as long as it lasts. Only the contacts in `order` take part.
    pub contacts: Vec<ContactRow>,
    /// Points of the manifolds.
    pub points: Vec<PointRow>,
    /// Impulses of the points.
    pub impulses: Vec<ImpulseRow>,
    /// Sums of the impulses over the substeps of the step, bounces in their normal parts; empty unless they are asked for.
    pub totals: Vec<ImpulseRow>,
    /// Sag of each manifold at rest under its load in the step before, from the masses of its bodies without their
    /// inertia (m).
    pub sags: Vec<f32>,
    /// Joints. Only the joints in `order` take part.
    pub joints: Vec<JointRow>,
    /// Axes of joints; empty if all joints are ball joints.
    pub axes: Vec<AxisRow>,
    /// Impulses of the joints, then of the axes.
    pub joint_impulses: Vec<JointImpulseRow>,
    /// Sums of the impulses of joints over the substeps of the step; empty unless they are asked for.
    pub joint_totals: Vec<JointImpulseRow>,
    /// The rows that passes go over, color by color: the contacts and joints that take part, the bodies, the rows of
    /// unequal moments of inertia, the systems of joints that take part, and the rows of turning inertia.
    pub order: Vec<u32>,
    /// The start of each color in `order`, and the end of the last.
    pub colors: Vec<u32>,
    /// The blocks. Their colors follow each other within each of the six kinds of rows.
    pub blocks: Vec<Block>,
    /// Joints that are solved directly, in systems.
    pub systems: JointSystems,
    /// Bodies of joints that are solved directly.
    pub turning: Vec<TurningRow>,
    /// Whether the sweeps still move anything.
    pub convergence: ConvergenceRow,
    /// How far the sweeps extrapolate.
    pub momentum: MomentumRow,
}

crate::saved::cloned!(StepProblem {
    params,
    bodies,
    masses,
    torques,
    dampings,
    inertias,
    contacts,
    points,
    impulses,
    totals,
    sags,
    joints,
    axes,
    joint_impulses,
    joint_totals,
    order,
    colors,
    blocks,
    systems,
    turning,
    convergence,
    momentum,
});

// The state that the next step continues from, without the rows of contacts ([`ContactRows::walk`]). The step writes
// all other fields anew.
crate::saved::fields!(Params { patches, rolls, driven } scratch {
    restitution_threshold, slop, relaxation, tolerance, body_count, point_count, joint_count, axis_count, zero,
    bounces
});
crate::saved::fields!(StepProblem { params, joint_impulses, systems } scratch {
    bodies, masses, torques, dampings, inertias, contacts, points, impulses, totals, sags, joints, axes, joint_totals,
    order, colors, blocks, turning, convergence, momentum
});

impl StepProblem {
    /// Colors of the contacts of all blocks.
    pub fn contact_colors(&self) -> Range<u32> {
        self.colors_of(|block| block.contacts[0]..block.contacts[1])
    }

    /// Colors of the joints of all blocks.
    pub fn joint_colors(&self) -> Range<u32> {
        self.colors_of(|block| block.joints[0]..block.joints[1])
    }

    /// Colors of the systems of joints of all blocks.
    pub fn system_colors(&self) -> Range<u32> {
        self.colors_of(|block| block.systems..block.systems + 1)
    }

    /// The colors of one kind in all blocks.
    pub(crate) fn colors_of(&self, own: impl Fn(&Block) -> Range<u32>) -> Range<u32> {
        let ends = self.blocks.first().zip(self.blocks.last());
        ends.map_or(0..0, |(first, last)| own(first).start..own(last).end)
    }

    /// Whether any joints are solved directly.
    pub fn has_systems(&self) -> bool {
        !self.rows_of(&self.system_colors()).is_empty()
    }

    /// The rows of some neighboring colors.
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

    /// Makes one block of all rows, with all contacts in one color and all joints in another. The block keeps the
    /// substep of the first block before, if there was one.
    pub fn sweep_in_order_of_rows(&mut self) {
        let substep = self.blocks.first().map(|block| block.substep).unwrap_or_default();
        self.order = (0..self.contacts.len() as u32).chain(0..self.joints.len() as u32).collect();
        let [contacts, all] = [self.contacts.len(), self.order.len()].map(|end| end as u32);
        self.colors = if self.joints.is_empty() { vec![0, contacts] } else { vec![0, contacts, all] };
        self.in_one_block(1, substep);
    }

    /// Makes one block of all bodies, and of the contacts and joints in `order`. The first `contact_colors` colors are
    /// those of contacts, the others those of joints.
    pub fn in_one_block(&mut self, contact_colors: u32, substep: Substep) {
        let joints = [contact_colors, (self.colors.len() as u32).saturating_sub(1).max(contact_colors)];
        // Systems, if there are any, solve all joints.
        let direct = if self.systems.is_empty() { joints[1] } else { joints[0] };
        self.colors.resize(self.colors.len().max(1), 0);
        for count in [self.bodies.len(), self.inertias.len(), self.systems.len(), self.turning.len()] {
            self.order.extend(0..count as u32);
            self.colors.push(self.order.len() as u32);
        }
        let [bodies, inertias, systems, turning] = [0, 1, 2, 3].map(|kind| joints[1] + kind);
        let contacts = [0, contact_colors];
        self.blocks = vec![Block {
            substeps: 1,
            substep,
            contacts,
            struck: contact_colors,
            jamming: contact_colors,
            joints,
            direct,
            bodies,
            inertias,
            systems,
            turning,
        }];
    }

    /// Whether a patch follows the points of every contact.
    pub fn has_patches(&self) -> bool {
        self.params.patches != 0
    }

    /// Whether friction acts once for each manifold, at its patch.
    pub fn has_friction_at_patches(&self) -> bool {
        self.has_patches() && self.params.rolls == 0
    }

    /// Whether any axis is a limit or a drive.
    pub(crate) fn has_swept_axes(&self) -> bool {
        self.axes.iter().any(|axis| !axis.is_lock())
    }

    /// Whether there are torques, damping, sums of impulses, sums of impulses of joints, axes of joints, axes that are
    /// limits or drives, and surfaces that may bounce.
    pub(crate) fn parts(&self) -> [bool; 7] {
        [
            !self.torques.is_empty(),
            !self.dampings.is_empty(),
            !self.totals.is_empty(),
            !self.joint_totals.is_empty(),
            !self.axes.is_empty(),
            self.has_swept_axes(),
            self.params.bounces != 0,
        ]
    }

    /// The impulse of a joint on its body b, from `joint_impulses` or `joint_totals`.
    pub(crate) fn joint_impulse(&self, impulses: &[JointImpulseRow], joint: usize) -> Vec3 {
        Vec3::from(impulses[joint].linear) + self.axis_impulse(impulses, joint, true)
    }

    /// The part of this impulse by the axes that body b shifts along (`is_linear`), or by those that it turns about.
    pub(crate) fn axis_impulse(&self, impulses: &[JointImpulseRow], joint: usize, is_linear: bool) -> Vec3 {
        let JointRow { first_axis, axis_count, .. } = self.joints[joint];
        let own = first_axis as usize..(first_axis + axis_count) as usize;
        let impulses = &impulses[self.joints.len()..];
        let rows = self.axes[own.clone()].iter().zip(&impulses[own]);
        let wanted = rows.filter(|(axis, _)| (axis.coordinate > 0.0) == is_linear);
        wanted.map(|(axis, impulse)| Vec3::from(axis.direction) * -impulse.linear[0]).sum()
    }

    /// Where the impulses of the three rows of a node are; `None` for a row that the node lacks.
    pub(crate) fn numbers_of(&self, node: &NodeRow) -> [Option<ImpulseNumber>; 3] {
        let joint = node.joint as usize;
        if node.is_of_anchors() {
            return [0, 1, 2].map(|component| Some(ImpulseNumber { row: joint, component }));
        }
        let first = self.joints.len() + self.joints[joint].first_axis as usize;
        let mut numbers = [None; 3];
        node.axes().for_each(|(i, k)| numbers[i] = Some(ImpulseNumber { row: first + k, component: 0 }));
        numbers
    }

    /// Number of impulses, including those of patches, joints and axes.
    pub fn impulse_count(&self) -> usize {
        self.impulses.len() + self.joint_impulses.len()
    }

    /// Whether each of some bodies moves alike along and about all axes: it has no locked axis, and its inertia is
    /// [isotropic](Self::is_isotropic).
    pub(crate) fn moves_alike(&self, bodies: &[u32]) -> bool {
        bodies.iter().all(|&body| self.masses[body as usize].locks == 0.0) && self.is_isotropic(bodies)
    }

    /// Whether each of some bodies has the same inverse inertia about all axes. The inverse inertia of a body that
    /// nothing turns is zero.
    pub fn is_isotropic(&self, bodies: &[u32]) -> bool {
        bodies.iter().map(|&body| &self.masses[body as usize]).all(|mass| {
            let ([xx, xy, xz], [yy, yz, zz]) = (mass.inv_inertia_x, mass.inv_inertia_yz);
            [xy, xz, yz] == [0.0; 3] && [yy, zz] == [xx; 2]
        })
    }
}

//! A problem in the form that the kernels read.

use super::rows::{Axis, Body, Contact, Damping, Impulse, Inertia, Joint, Mass, Momentum, Point, StepParams};
use crate::math::{Scalar, Vec3};
use crate::problem::StepProblem;

/// The rows of a problem over one type of numbers, without indices.
#[derive(Clone, Debug, Default)]
pub struct KernelRows<S> {
    /// The numbers that are the same for all rows of a block, for each block.
    pub params: Vec<StepParams<S>>,
    /// State of the bodies.
    pub bodies: Vec<Body<S>>,
    /// Masses of the bodies.
    pub masses: Vec<Mass<S>>,
    /// Angular accelerations of the bodies by torques; empty if no body has a torque.
    pub torques: Vec<Vec3<S>>,
    /// Effects of damping on the bodies; empty if none is damped.
    pub dampings: Vec<Damping<S>>,
    /// Principal inertia of the bodies whose moments differ.
    pub inertias: Vec<Inertia<S>>,
    /// Manifolds.
    pub contacts: Vec<Contact<S>>,
    /// Points of the manifolds.
    pub points: Vec<Point<S>>,
    /// Impulses of the points.
    pub impulses: Vec<Impulse<S>>,
    /// Sums of these impulses over the substeps.
    pub totals: Vec<Impulse<S>>,
    /// Joints.
    pub joints: Vec<Joint<S>>,
    /// Axes of the joints.
    pub axes: Vec<Axis<S>>,
    /// Impulses of the joints, then of their axes.
    pub joint_impulses: Vec<Vec3<S>>,
    /// Sums of these impulses over the substeps.
    pub joint_totals: Vec<Vec3<S>>,
    /// How far the sweeps extrapolate.
    pub momentum: Momentum<S>,
}

impl<S: Scalar> KernelRows<S> {
    /// Loads all rows from storage.
    pub fn load(&mut self, problem: &StepProblem) {
        fn refill<R, T>(rows: &[R], kept: &mut Vec<T>, load: impl Fn(&R) -> T) {
            kept.clear();
            kept.extend(rows.iter().map(load));
        }
        refill(&problem.blocks, &mut self.params, |block| StepParams::load(&problem.params, &block.substep));
        refill(&problem.bodies, &mut self.bodies, Body::load);
        refill(&problem.masses, &mut self.masses, Mass::load);
        refill(&problem.torques, &mut self.torques, |r| Vec3::load(r.angular_acceleration));
        refill(&problem.dampings, &mut self.dampings, Damping::load);
        refill(&problem.inertias, &mut self.inertias, Inertia::load);
        refill(&problem.contacts, &mut self.contacts, Contact::load);
        refill(&problem.points, &mut self.points, Point::load);
        refill(&problem.impulses, &mut self.impulses, Impulse::load);
        refill(&problem.totals, &mut self.totals, Impulse::load);
        refill(&problem.joints, &mut self.joints, Joint::load);
        refill(&problem.axes, &mut self.axes, Axis::load);
        refill(&problem.joint_impulses, &mut self.joint_impulses, |r| Vec3::load(r.linear));
        refill(&problem.joint_totals, &mut self.joint_totals, |r| Vec3::load(r.linear));
        self.momentum = Momentum::load(&problem.momentum);
    }

    /// Stores the rows that passes change.
    pub fn store(&self, problem: &mut StepProblem) {
        problem.bodies.iter_mut().zip(&self.bodies).for_each(|(row, body)| *row = body.store());
        problem.impulses.iter_mut().zip(&self.impulses).for_each(|(row, impulse)| *row = impulse.store());
        problem.totals.iter_mut().zip(&self.totals).for_each(|(row, total)| *row = total.store());
        let joints = problem.joint_impulses.iter_mut().zip(&self.joint_impulses);
        let totals = problem.joint_totals.iter_mut().zip(&self.joint_totals);
        joints.chain(totals).for_each(|(row, impulse)| row.linear = impulse.store());
        problem.momentum = self.momentum.store();
    }
}

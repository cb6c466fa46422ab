//! The number of bytes that a plan moves.

use std::ops::Range;

use super::{Kernel, Pass, StepPlan};
use crate::config::FrictionRule;
use crate::kernels::momentum::{IMPULSES_PER_CHUNK, StepLength};
use crate::problem::{
    AxisRow, BodyRow, ContactRow, ContactSummary, ConvergenceRow, DampingRow, FreeRow, ImpulseRow, InertiaRow,
    JointImpulseRow, JointRow, MassRow, PointRow, StepProblem, TorqueRow, TurningRow,
};

impl StepPlan {
    /// Bytes that the kernels read and write, if every row of a thread is moved once.
    pub fn bytes_moved(&self, problem: &StepProblem, contacts: &ContactSummary) -> u64 {
        self.passes.iter().map(|pass| pass.bytes_moved(problem, contacts)).sum()
    }

    /// The same, pass by pass.
    pub fn bytes_of_passes(&self, problem: &StepProblem) -> impl Iterator<Item = u64> {
        let contacts = ContactSummary::of(problem);
        self.passes.iter().map(move |pass| pass.bytes_moved(problem, &contacts))
    }
}

impl Pass {
    /// Bytes that this pass reads and writes.
    fn bytes_moved(&self, problem: &StepProblem, contacts: &ContactSummary) -> u64 {
        const BODY: usize = size_of::<BodyRow>();
        const MASS: usize = size_of::<MassRow>();
        // Velocities are the half of a body that a sweep writes.
        const VELOCITIES: usize = BODY / 2;
        let start = if self.kernel.reads_start() { 2 * size_of::<FreeRow>() } else { 0 };
        let pair = 2 * (BODY + MASS + VELOCITIES) + start;
        const IMPULSE: usize = size_of::<ImpulseRow>();
        const JOINT: usize = size_of::<JointRow>();
        const AXIS: usize = size_of::<AxisRow>();
        let axes =
            |rows: &[u32]| rows.iter().map(|&row| problem.joints[row as usize].axis_count as usize).sum::<usize>();
        let rows = problem.rows_of(&self.colors);
        let points_of = |colors: &Range<u32>| {
            let [first, end] = [colors.start, colors.end].map(|color| contacts.points[color as usize]);
            end - first
        };
        let bytes = match self.kernel {
            Kernel::IntegrateVelocities { warm_start, from_start } => {
                let free = usize::from(warm_start) + usize::from(!from_start);
                rows.len() * (BODY + MASS / 3 + size_of::<FreeRow>() * free)
            }
            Kernel::BeginChanges => rows.len() * (2 * VELOCITIES + MASS / 3 + size_of::<FreeRow>()),
            Kernel::EndChanges => rows.len() * (2 * VELOCITIES + size_of::<FreeRow>()),
            Kernel::IntegratePositions { from_start } => {
                rows.len() * (BODY + BODY / 2 + if from_start { size_of::<FreeRow>() } else { 0 })
            }
            Kernel::IntegrateTorques { from_start } => {
                let free = if from_start { 0 } else { size_of::<FreeRow>() };
                rows.len() * (2 * VELOCITIES + size_of::<TorqueRow>() + free)
            }
            Kernel::DampVelocities { from_start } => {
                let free = size_of::<FreeRow>() * if from_start { 1 } else { 2 };
                rows.len() * (2 * VELOCITIES + size_of::<DampingRow>() + free)
            }
            Kernel::IntegrateGyroscopic { .. } => {
                rows.len() * (size_of::<InertiaRow>() + 2 * size_of::<FreeRow>() + 2 * BODY)
            }
            Kernel::TurnInertias => rows.len() * (size_of::<TurningRow>() + BODY / 2 + MASS),
            Kernel::BeginSweep { .. } => 2 * size_of::<ConvergenceRow>(),
            // Reads and writes the previous values, and writes the start of the sweep.
            Kernel::Extrapolate { .. } => 4 * VELOCITIES * problem.bodies.len() + 5 * IMPULSE * problem.impulse_count(),
            Kernel::MeasureStep => 3 * IMPULSE * problem.impulse_count(),
            Kernel::UpdateMomentum => {
                problem.impulse_count().div_ceil(IMPULSES_PER_CHUNK) * size_of::<StepLength<f32>>()
            }
            Kernel::MeasureJoints(_) | Kernel::ApplyJointChanges(_) | Kernel::WarmStartJoints { .. } => {
                rows.len() * (pair + JOINT + IMPULSE) + axes(rows) * (AXIS + IMPULSE)
            }
            Kernel::SolveAxes(_) => rows.len() * (pair + JOINT) + axes(rows) * (AXIS + 2 * IMPULSE),
            Kernel::SolveJoints(_) => rows.len() * (pair + JOINT + 2 * IMPULSE) + axes(rows) * (AXIS + 2 * IMPULSE),
            Kernel::BeginSystems | Kernel::SolveJointSystems(_) => self.bytes_of_systems(problem),
            Kernel::ClearImpulses | Kernel::SumImpulses { .. } => {
                let patches = if problem.has_patches() { rows.len() } else { 0 };
                let each = if self.kernel == (Kernel::SumImpulses { first: false }) { 3 } else { 2 };
                (points_of(&self.colors) + patches) * each * IMPULSE
            }
            Kernel::SumJointImpulses { first } => (rows.len() + axes(rows)) * if first { 2 } else { 3 } * IMPULSE,
            Kernel::WarmStart(rules) | Kernel::SolveContacts(rules) | Kernel::ApplyRestitution(rules) => {
                let (contacts, points) = (rows.len(), points_of(&self.colors));
                let patches = if rules.patch { contacts } else { 0 };
                let writes = !matches!(self.kernel, Kernel::WarmStart(_));
                let once = size_of::<PointRow>() + IMPULSE * if writes { 2 } else { 1 };
                // Friction at points reads them a second time; friction per manifold adds one row.
                let again = if writes && rules.friction != FrictionRule::None && !rules.patch { points } else { 0 };
                // Bounces move bodies, and change the velocities without impulses.
                let free = if rules.from_start { 0 } else { 2 * size_of::<FreeRow>() };
                let moved = if self.kernel.moves_bodies() { 2 * (BODY / 2 + free) } else { 0 };
                contacts * (size_of::<ContactRow>() + pair + moved) + (points + again + patches) * once
            }
        };
        bytes as u64
    }

    /// Bytes of a kernel over joint systems: bodies and joints, blocks of the factors, and the products that form the
    /// blocks.
    fn bytes_of_systems(&self, problem: &StepProblem) -> usize {
        const PAIR: usize = 2 * (size_of::<BodyRow>() + size_of::<MassRow>());
        const BLOCK: usize = 48;
        let systems = &problem.systems;
        let of_system = |&system: &u32| {
            let nodes = systems.nodes_of(system as usize);
            let joints = nodes.len() * (PAIR + size_of::<JointRow>() + 2 * size_of::<JointImpulseRow>());
            let blocks = nodes.map(|node| systems.blocks_of(node)).map(|blocks| blocks.len()).sum::<usize>();
            joints + blocks * 2 * BLOCK
        };
        problem.rows_of(&self.colors).iter().map(of_system).sum()
    }
}

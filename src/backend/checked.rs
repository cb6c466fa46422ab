//! The boundary between problems from any source and the backends that rely on their validity.

use crate::error::{Error, Result};
use crate::plan::{Kernel, Pass};
use crate::problem::StepProblem;

/// A problem with passes that satisfy the invariants of backends: every index names an existing row, no two constraints
/// of a color share a movable body, and every pass covers only existing colors.
///
/// Because of this, threads of the CPU write bodies without locks, and a GPU accesses the intended rows. Shaders stay
/// inside their buffers with any rows.
#[derive(Debug)]
pub struct CheckedStep<'a> {
    problem: &'a mut StepProblem,
    passes: &'a [Pass],
}

impl<'a> CheckedStep<'a> {
    /// Checks a problem and its passes.
    ///
    /// # Errors
    /// One line names the row and the field.
    pub fn new(problem: &'a mut StepProblem, passes: &'a [Pass]) -> Result<Self> {
        problem.check()?;
        check_passes(problem, passes)?;
        Ok(Self { problem, passes })
    }

    /// A step that the simulation built. Its stages guarantee the same invariants: `graph` assigns the colors,
    /// `problem` lays out the rows, `plan` makes the passes, and `Simulation::step` has checked the indices of bodies
    /// and joints.
    pub(crate) fn built(problem: &'a mut StepProblem, passes: &'a [Pass]) -> Self {
        Self { problem, passes }
    }

    /// The problem, which the backend solves in place, and the passes.
    pub fn into_parts(self) -> (&'a mut StepProblem, &'a [Pass]) {
        (self.problem, self.passes)
    }
}

/// Refuses passes over colors that do not exist. Refuses passes with patches over rows without them, and the reverse.
fn check_passes(problem: &StepProblem, passes: &[Pass]) -> Result<()> {
    for (i, Pass { kernel, block, colors }) in passes.iter().enumerate() {
        let refuse = |what: String| Err(Error::input(format!("pass {i}, {}: {what}", kernel.name())));
        let Some(own) = problem.blocks.get(*block as usize) else {
            return refuse(format!("block {block}: must be less than {}", problem.blocks.len()));
        };
        let [contacts, joints, bodies, inertias, systems, turning] = own.colors();
        let (known, patch) = match kernel {
            Kernel::WarmStart(rules) | Kernel::SolveContacts(rules) | Kernel::ApplyRestitution(rules) => {
                (contacts, Some(rules.patch))
            }
            Kernel::ClearImpulses | Kernel::SumImpulses { .. } => (contacts, None),
            Kernel::WarmStartJoints { .. } | Kernel::SolveJoints(_) | Kernel::SumJointImpulses { .. } => (joints, None),
            Kernel::SolveAxes(_) | Kernel::MeasureJoints(_) | Kernel::ApplyJointChanges(_) => {
                (own.direct_joints(), None)
            }
            Kernel::IntegrateVelocities { .. }
            | Kernel::BeginChanges
            | Kernel::EndChanges
            | Kernel::IntegratePositions { .. } => (bodies, None),
            Kernel::IntegrateTorques { .. } => (if problem.torques.is_empty() { 0..0 } else { bodies }, None),
            Kernel::DampVelocities { .. } => (if problem.dampings.is_empty() { 0..0 } else { bodies }, None),
            Kernel::IntegrateGyroscopic { .. } => (inertias, None),
            Kernel::BeginSystems | Kernel::SolveJointSystems(_) => (systems, None),
            Kernel::TurnInertias => (turning, None),
            _ => (0..0, None),
        };
        if colors.start > colors.end || !(colors.is_empty() || known.start <= colors.start && colors.end <= known.end) {
            return refuse(format!("colors {colors:?}: must be within {known:?}"));
        }
        let sums = match kernel {
            Kernel::SumImpulses { .. } => Some(("totals", problem.totals.len())),
            Kernel::SumJointImpulses { .. } => Some(("joint_totals", problem.joint_totals.len())),
            _ => None,
        };
        if let Some((name, 0)) = sums.filter(|_| !colors.is_empty()) {
            return refuse(format!("needs {name}, but the problem has none"));
        }
        if matches!(kernel, Kernel::Extrapolate { .. }) && problem.blocks.len() > 1 {
            return refuse("acts on all bodies, so the problem must have one block".into());
        }
        if let Some(patch) = patch.filter(|patch| !problem.contacts.is_empty() && *patch != problem.has_patches()) {
            let have = if patch { "have no patches" } else { "have patches" };
            return refuse(format!("patch = {patch}: the contacts of this problem {have}"));
        }
    }
    Ok(())
}

//! The order of work as data: which kernel goes over what, in which order.
//!
//! A plan is built once a step from the settings and the problem, and backends only follow it: the algorithm stands here
//! and nowhere else. A plan has no pass for a feature that its scene lacks: without friction no kernel has friction, and without
//! restitution, unequal moments of inertia or joints there are no passes for these.

mod bytes;
mod kernel;

pub use kernel::Kernel;

use std::fmt;
use std::ops::Range;

use crate::config::{Clamping, FUSE_BELOW, FrictionOrder, FrictionRule, FrictionSweeps, Method, SolverConfig};
use crate::kernels::Rules;
use crate::problem::StepProblem;

/// One dispatch: a kernel over all bodies, or over some colors one after another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The kernel.
    pub kernel: Kernel,
    /// The colors that the kernel goes over; empty for a kernel over bodies. More than one are swept by one workgroup. For a kernel
    /// over systems of joints, places in `JointSystems::active`.
    pub colors: Range<u32>,
}

/// Some sweeps: which, how, and over which groups of colors.
struct Sweeps<'a> {
    method: Method,
    range: Range<u32>,
    /// Whether others may follow the last.
    go_on: bool,
    joints: &'a [Range<u32>],
    /// Joints that are solved at once: the systems that take part, and the groups of colors.
    systems: Range<u32>,
    direct: &'a [Range<u32>],
    contacts: &'a [Range<u32>],
}

/// The passes of one step.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StepPlan {
    /// In order.
    pub passes: Vec<Pass>,
}

/// The properties of a problem that its plan depends on, besides the settings and the rows of contacts.
#[derive(Clone, Debug)]
pub(crate) struct PlanKey {
    colors: Vec<u32>,
    first_joint_color: u32,
    direct_colors: u32,
    active_systems: usize,
    has_inertias: bool,
    is_long_enough: bool,
}

impl PlanKey {
    /// Whether it is that of the plan of a problem.
    pub fn is_of(&self, problem: &StepProblem) -> bool {
        let others = (problem.first_joint_color, !problem.inertias.is_empty(), is_long_enough(problem));
        let direct = (problem.direct_colors, problem.systems.active.len());
        others == (self.first_joint_color, self.has_inertias, self.is_long_enough)
            && direct == (self.direct_colors, self.active_systems)
            && self.colors == problem.colors
    }

    /// That of the plan of a problem.
    pub fn of(problem: &StepProblem) -> Self {
        Self {
            colors: problem.colors.clone(),
            first_joint_color: problem.first_joint_color,
            direct_colors: problem.direct_colors,
            active_systems: problem.systems.active.len(),
            has_inertias: !problem.inertias.is_empty(),
            is_long_enough: is_long_enough(problem),
        }
    }
}

/// Whether impulses can be carried over as velocities.
fn is_long_enough(problem: &StepProblem) -> bool {
    problem.params.substep >= SHORTEST_CARRIED
}

/// Shortest substep over which impulses are carried as velocities (s). A correction
/// below the last bit of a velocity is lost until the step ends, and corrections fall with the length of the substep. Squared error of the scene `rolling` with
/// and without: 9e-7 and 6e-7 at 1/2000 s, 6e-6 and 3e-6 at 1/4000 s, 5e-5 and 3e-6 at 1/8000 s.
const SHORTEST_CARRIED: f32 = 1.0 / 4100.0;

impl StepPlan {
    /// The plan of `problem` under `config`: in each substep velocities, warm start, biased sweeps, positions, relax
    /// sweeps; bounces at the end.
    pub fn new(config: &SolverConfig, problem: &StepProblem) -> Self {
        let groups = |colors| color_groups(&problem.colors, colors, config.fuse_colors_below);
        let (contacts, joints) = (groups(problem.contact_colors()), groups(problem.swept_joint_colors()));
        let direct = groups(problem.direct_joint_colors());
        let systems = 0..problem.systems.active.len() as u32;
        let friction = if problem.has_friction() { config.friction_rule() } else { FrictionRule::None };
        let shared = Rules {
            friction,
            patch: problem.has_patches(),
            friction_first: config.rules.friction_order == FrictionOrder::FrictionFirst,
            accumulated: config.rules.clamping == Clamping::Accumulated,
            round: problem.has_round_shapes(),
            driven: false,
            passes: config.rules.manifold_passes,
            measured: config.tolerance > 0.0,
            biased: false,
        };
        // Momentum begins with the third sweep.
        let method = |count: u32| if count < 3 { Method::Plain } else { config.method };
        let sweeps = |count: u32| Sweeps {
            method: method(count),
            range: 0..count,
            go_on: false,
            joints: &joints,
            systems: systems.clone(),
            direct: &direct,
            contacts: &contacts,
        };
        // Friction needs some sweep to happen in.
        let relax_only = config.friction_sweeps == FrictionSweeps::Relax && config.relax > 0;
        let biased_friction = if relax_only { FrictionRule::None } else { friction };
        let biased = Rules { biased: true, friction: biased_friction, ..shared };

        let mut plan = Self::default();
        // Neither arms nor masses of contacts change within a step, so that their impulses can be carried over as the
        // velocities that they gave. The arms of joints turn, and short steps give less than velocities are rounded by.
        let carried = {
            let joints = problem.joint_colors();
            shared.accumulated && joints.is_empty() && is_long_enough(problem)
        };
        plan.over_systems(Kernel::FactorJoints, &systems);
        for substep in 0..config.substeps {
            let carry = carried && substep > 0;
            plan.over_bodies(Kernel::IntegrateVelocities { carry });
            if !problem.inertias.is_empty() {
                plan.over_bodies(Kernel::IntegrateGyroscopic);
            }
            plan.over_colors(Kernel::WarmStartJoints, &joints);
            plan.over_colors(Kernel::WarmStartJoints, &direct);
            if carry {
                // Done already.
            } else if shared.accumulated {
                plan.over_colors(Kernel::WarmStart(shared.of_warm_start()), &contacts);
            } else if !problem.contact_colors().is_empty() {
                plan.passes.push(Pass { kernel: Kernel::ClearImpulses, colors: problem.contact_colors() });
            }
            plan.sweeps(sweeps(config.iterations), biased);
            plan.over_bodies(Kernel::IntegratePositions);
            if !systems.is_empty() {
                plan.over_bodies(Kernel::TurnInertias);
            }
            plan.over_systems(Kernel::FactorJoints, &systems);
            plan.sweeps(sweeps(config.relax), shared);
        }
        if problem.has_restitution() {
            let rules = Rules { patch: shared.patch, ..Rules::default() };
            plan.over_colors(Kernel::ApplyRestitution(rules), &contacts);
        }
        plan
    }

    /// Sweeps over a problem without time: what is wanted of the velocities stands in its rows, no body moves, and every
    /// contact is hard. Every manifold is swept `passes` times before the next. `range` begins at 0, or where the sweeps of the run before ended.
    pub fn of_sweeps(problem: &StepProblem, method: Method, passes: u8, range: Range<u32>) -> Self {
        let driven = problem.points.iter().any(|p| p.slip_1 != 0.0 || p.slip_2 != 0.0);
        let rules = Rules {
            biased: problem.points.iter().any(|p| p.separation < 0.0),
            friction: if problem.has_friction() { FrictionRule::Disc } else { FrictionRule::None },
            driven: driven && problem.has_friction(),
            passes,
            ..Rules::default()
        };
        let contacts = color_groups(&problem.colors, problem.contact_colors(), FUSE_BELOW);
        let joints = color_groups(&problem.colors, problem.joint_colors(), FUSE_BELOW);
        let mut plan = Self::default();
        let (go_on, systems, direct) = (true, 0..0, &[][..]);
        plan.sweeps(Sweeps { method, range, go_on, joints: &joints, systems, direct, contacts: &contacts }, rules);
        plan
    }

    /// Sweeps in the order of the course sheet: joints, then contacts.
    ///
    /// Joints have colors of their own. Colored together with the contacts they need as many (bridge: 6 + 2 apart, 8
    /// together; chain 3 + 0 and 3), and one kernel would have to hold both.
    ///
    /// With a tolerance every sweep is preceded by `begin_sweep`, and a sweep that is no longer needed is skipped on the flag
    /// that it leaves in a buffer: nothing is read back. A pile of 500 with up to 16 sweeps a substep and 1e-2 m/s took 0.66
    /// of the time of all 16 on a software adapter and 0.23 on the reference. Indirect dispatch was not taken: each such call
    /// adds a validating dispatch of its own, about the price of the empty one that it saves.
    fn sweeps(&mut self, sweeps: Sweeps, rules: Rules) {
        let measured = rules.measured;
        for sweep in sweeps.range.clone() {
            let first = sweep == 0;
            if measured {
                self.over_bodies(Kernel::BeginSweep { first });
            }
            let accelerated = sweeps.method == Method::Accelerated;
            if accelerated {
                self.over_bodies(Kernel::Extrapolate { first, measured });
            }
            if let Some(first) = sweeps.direct.first() {
                let rules = rules.of_joints();
                let all = first.start..sweeps.direct[sweeps.direct.len() - 1].end;
                self.over_colors(Kernel::MeasureJoints(rules), &[all]);
                self.over_systems(Kernel::SolveJointSystems(rules), &sweeps.systems);
                self.over_colors(Kernel::ApplyJointChanges(rules), sweeps.direct);
            }
            self.over_colors(Kernel::SolveJoints(rules.of_joints()), sweeps.joints);
            self.over_colors(Kernel::SolveContacts(rules), sweeps.contacts);
            if accelerated && (sweeps.go_on || sweep + 1 < sweeps.range.end) {
                self.over_bodies(Kernel::MeasureStep);
                self.over_bodies(Kernel::UpdateMomentum);
            }
        }
    }

    fn over_bodies(&mut self, kernel: Kernel) {
        self.passes.push(Pass { kernel, colors: 0..0 });
    }

    fn over_systems(&mut self, kernel: Kernel, systems: &Range<u32>) {
        if !systems.is_empty() {
            self.passes.push(Pass { kernel, colors: systems.clone() });
        }
    }

    fn over_colors(&mut self, kernel: Kernel, groups: &[Range<u32>]) {
        self.passes.extend(groups.iter().map(|colors| Pass { kernel, colors: colors.clone() }));
    }
}

/// Colors of at least `fuse_below` rows stand alone; neighboring smaller ones go together.
fn color_groups(offsets: &[u32], colors: Range<u32>, fuse_below: u32) -> Vec<Range<u32>> {
    let mut groups: Vec<Range<u32>> = Vec::new();
    let mut last_is_small = false;
    for color in colors {
        let small = offsets[color as usize + 1] - offsets[color as usize] < fuse_below;
        match groups.last_mut() {
            Some(group) if small && last_is_small => group.end = color + 1,
            _ => groups.push(color..color + 1),
        }
        last_is_small = small;
    }
    groups
}

/// One line a run of equal kernels: `3 x solve_contacts(friction) over colors 0, 1, 2..9`.
impl fmt::Display for StepPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for run in self.passes.chunk_by(|p, q| p.kernel == q.kernel) {
            write!(f, "{}", run[0].kernel)?;
            let colors: Vec<_> = run.iter().filter(|p| !p.colors.is_empty()).map(|p| group_name(&p.colors)).collect();
            if !colors.is_empty() {
                let is_over_systems = matches!(run[0].kernel, Kernel::FactorJoints | Kernel::SolveJointSystems(_));
                write!(f, " over {} {}", if is_over_systems { "systems" } else { "colors" }, colors.join(", "))?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

fn group_name(colors: &Range<u32>) -> String {
    if colors.len() == 1 { colors.start.to_string() } else { format!("{}..{}", colors.start, colors.end) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_neighbouring_colors_share_a_pass_and_large_ones_do_not() {
        let offsets = [0, 500, 900, 950, 960, 1500, 1510];
        assert_eq!(color_groups(&offsets, 0..6, 256), [0..1, 1..2, 2..4, 4..5, 5..6]);
        assert_eq!(color_groups(&offsets, 0..6, 0).len(), 6);
        assert_eq!(color_groups(&offsets, 2..5, 256), [2..4, 4..5]);
        assert!(color_groups(&[0], 0..0, 256).is_empty());
    }
}

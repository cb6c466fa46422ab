//! The order of work as data: the sequence of kernels and their ranges.
//!
//! A plan is built once per step from the settings and the problem. Backends only follow it, so the algorithm is
//! nowhere else. A plan has no pass for a feature that its scene lacks. Without friction no kernel has friction, and
//! without restitution, torques, damping, unequal moments of inertia or joints there are no passes for them.

mod bytes;
mod kernel;

pub use kernel::Kernel;

use std::fmt;
use std::ops::Range;

use crate::config::{Clamping, FUSE_BELOW, FrictionOrder, FrictionRule, FrictionSweeps, Method, SolverConfig};
use crate::constants::{JAMMED_PASSES, LONGEST_FROM_START};
use crate::kernels::Rules;
use crate::problem::{Block, ContactSummary, StepProblem};

/// One dispatch: a kernel over some colors of a block, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The kernel.
    pub kernel: Kernel,
    /// The block of the problem.
    pub block: u32,
    /// The colors of the kernel; empty for a kernel that processes everything. One workgroup sweeps them if there are
    /// several.
    pub colors: Range<u32>,
}

/// Some sweeps: their kind, and their groups of colors.
struct Sweeps<'a> {
    method: Method,
    range: Range<u32>,
    /// Whether other sweeps can follow the last one.
    go_on: bool,
    block: u32,
    joints: &'a [Range<u32>],
    /// Joints in systems: the color of their systems, and the groups of their colors.
    systems: &'a [Range<u32>],
    direct: &'a [Range<u32>],
    /// The groups of their colors if any joint has a limit or a drive.
    swept_axes: &'a [Range<u32>],
    contacts: &'a [Range<u32>],
    /// Contacts whose points are solved together.
    struck: &'a [Range<u32>],
    /// Contacts with jamming friction.
    jamming: &'a [Range<u32>],
}

/// The passes of one step.
///
/// ```
/// use drystone::Simulation;
/// use drystone::stages::plan::StepPlan;
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &["n=3".into()])?;
/// let mut simulation = Simulation::new(scene.world)?;
/// let (problem, plan) = simulation.next_problem(scene.dt)?;
/// assert_eq!(plan, StepPlan::new(simulation.config(), &problem));
/// assert_eq!(plan.bytes_of_passes(&problem).count(), plan.passes.len());
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Debug, Default, PartialEq, Eq)]
pub struct StepPlan {
    /// The passes, in order.
    pub passes: Vec<Pass>,
}

crate::saved::cloned!(StepPlan { passes });

/// The properties of a problem that its plan depends on, apart from the settings and the rows of contacts.
#[derive(Debug)]
pub(crate) struct PlanKey {
    colors: Vec<u32>,
    blocks: Vec<Block>,
    /// Whether the bodies of each block move alike along and about all axes. This can change, because joints add
    /// stiffness inertia in each step.
    isotropic: Vec<bool>,
    /// See [`StepProblem::parts`].
    parts: [bool; 7],
}

crate::saved::cloned!(PlanKey { colors, blocks, isotropic, parts });

impl PlanKey {
    /// Whether this is the key of the plan of a problem.
    pub fn is_of(&self, problem: &StepProblem) -> bool {
        self.blocks == problem.blocks
            && self.colors == problem.colors
            && self.parts == problem.parts()
            && isotropic(problem).eq(self.isotropic.iter().copied())
    }

    /// The key of the plan of a problem.
    pub fn of(problem: &StepProblem) -> Self {
        Self {
            colors: problem.colors.clone(),
            blocks: problem.blocks.clone(),
            isotropic: isotropic(problem).collect(),
            parts: problem.parts(),
        }
    }
}

/// Whether the bodies of each block move alike along and about all axes.
fn isotropic(problem: &StepProblem) -> impl Iterator<Item = bool> {
    problem.blocks.iter().map(|block| problem.moves_alike(problem.rows_of(&(block.bodies..block.bodies + 1))))
}

impl StepPlan {
    /// The plan of `problem` with `config`: one block after another.
    pub fn new(config: &SolverConfig, problem: &StepProblem) -> Self {
        Self::with_summary(config, problem, &ContactSummary::of(problem))
    }

    /// The same with a known summary of the contacts.
    pub fn with_summary(config: &SolverConfig, problem: &StepProblem, contacts: &ContactSummary) -> Self {
        let friction =
            if contacts.friction || problem.params.rolls != 0 { config.friction_rule() } else { FrictionRule::None };
        let rules = Rules {
            friction,
            patch: problem.has_patches(),
            rolls: problem.params.rolls != 0,
            friction_first: config.rules.friction_order == FrictionOrder::FrictionFirst,
            accumulated: config.rules.clamping == Clamping::Accumulated,
            round: contacts.round,
            as_one: false,
            driven: problem.params.driven != 0 && friction != FrictionRule::None,
            passes: config.rules.manifold_passes,
            measured: config.tolerance > 0.0,
            biased: false,
            from_start: false,
            isotropic: false,
            bounces: problem.params.bounces != 0,
            axes: !problem.axes.is_empty(),
        };
        let mut plan = Self::default();
        for (block, isotropic) in (0..).zip(isotropic(problem)) {
            let own = &problem.blocks[block as usize];
            let [_, _, bodies, ..] = own.colors();
            let from_start = own.substep.length < LONGEST_FROM_START && !problem.rows_of(&bodies).is_empty();
            let rules = Rules { from_start, isotropic, ..rules };
            if from_start {
                plan.over_colors(Kernel::BeginChanges, block, std::slice::from_ref(&bodies));
            }
            plan.substeps(config, problem, block, rules);
            if from_start {
                plan.over_colors(Kernel::EndChanges, block, &[bodies]);
            }
        }
        plan
    }

    /// The substeps of a block. Each has velocities, restitution, warm start, biased sweeps, positions, relax sweeps, and
    /// sums of impulses.
    fn substeps(&mut self, config: &SolverConfig, problem: &StepProblem, block: u32, shared: Rules) {
        let own = &problem.blocks[block as usize];
        let (substeps, from_start) = (own.substeps, shared.from_start);
        let [contact_colors, joint_colors, bodies, inertias, systems, turning] = own.colors();
        let groups = |colors: &Range<u32>| color_groups(&problem.colors, colors.clone(), config.fuse_colors_below);
        let (contacts, joints, direct) =
            (groups(&contact_colors), groups(&own.swept_joints()), groups(&own.direct_joints()));
        let [swept_once, struck, jamming] = own.contacts_by_kind().map(|colors| groups(&colors));
        // A color without rows needs no pass.
        let kept = |color: &'_ Range<u32>| !problem.rows_of(color).is_empty();
        let [bodies, inertias, systems, turning] =
            [bodies, inertias, systems, turning].map(|color| Some(color).filter(kept));
        let [bodies, inertias, systems, turning] = [&bodies, &inertias, &systems, &turning].map(Option::as_slice);
        let has_swept_axes = problem.has_swept_axes();
        // Momentum begins with the third sweep.
        let method = |count: u32| if count < 3 { Method::Plain } else { config.method };
        let sweeps = |count: u32| Sweeps {
            method: method(count),
            range: 0..count,
            go_on: false,
            block,
            joints: &joints,
            systems,
            direct: &direct,
            swept_axes: if has_swept_axes { &direct } else { &[] },
            contacts: &swept_once,
            struck: &struck,
            jamming: &jamming,
        };
        // Friction needs at least one sweep.
        let relax_only = config.friction_sweeps == FrictionSweeps::Relax && config.relax > 0;
        let biased_friction = if relax_only { FrictionRule::None } else { shared.friction };
        let biased = Rules { biased: true, friction: biased_friction, ..shared };
        // Arms and masses of contacts do not change within a step, so their impulses can be carried over as the
        // velocities that they caused. The arms of joints rotate.
        let carried = shared.accumulated && joint_colors.is_empty() && !from_start;
        self.over_colors(Kernel::BeginSystems, block, systems);
        for substep in 0..substeps {
            let warm_start = carried && substep > 0;
            self.over_colors(Kernel::IntegrateVelocities { warm_start, from_start }, block, bodies);
            if !problem.torques.is_empty() {
                self.over_colors(Kernel::IntegrateTorques { from_start }, block, bodies);
            }
            if !problem.dampings.is_empty() {
                self.over_colors(Kernel::DampVelocities { from_start }, block, bodies);
            }
            if shared.bounces {
                self.over_colors(Kernel::ApplyRestitution(shared.of_restitution()), block, &contacts);
            }
            self.over_colors(Kernel::WarmStartJoints { axes: shared.axes }, block, &joints);
            self.over_colors(Kernel::WarmStartJoints { axes: shared.axes }, block, &direct);
            if warm_start {
                // Done already.
            } else if shared.accumulated {
                self.over_colors(Kernel::WarmStart(shared.of_warm_start()), block, &contacts);
            } else if !contact_colors.is_empty() {
                self.passes.push(Pass { kernel: Kernel::ClearImpulses, block, colors: contact_colors.clone() });
            }
            self.sweeps(sweeps(config.iterations), biased);
            self.over_colors(Kernel::IntegratePositions { from_start }, block, bodies);
            self.over_colors(Kernel::IntegrateGyroscopic { from_start }, block, inertias);
            self.over_colors(Kernel::TurnInertias, block, turning);
            self.over_colors(Kernel::BeginSystems, block, systems);
            self.sweeps(sweeps(config.relax), shared);
            self.sum_impulses(problem, block, substep);
        }
    }

    /// Adds the impulses of a substep to the sums of earlier substeps, if the problem has room for the sums.
    fn sum_impulses(&mut self, problem: &StepProblem, block: u32, substep: u32) {
        let (first, [contacts, joints, ..]) = (substep == 0, problem.blocks[block as usize].colors());
        if !problem.totals.is_empty() && !contacts.is_empty() {
            self.passes.push(Pass { kernel: Kernel::SumImpulses { first }, block, colors: contacts });
        }
        if !problem.joint_totals.is_empty() && !joints.is_empty() {
            self.passes.push(Pass { kernel: Kernel::SumJointImpulses { first }, block, colors: joints });
        }
    }

    /// Sweeps over a problem without duration: its rows have the target velocities, no body moves, and every contact is
    /// hard. Every manifold is swept `passes` times before the next. `range` begins at 0, or at the end of the previous
    /// run's sweeps.
    pub fn of_sweeps(problem: &StepProblem, method: Method, passes: u8, range: Range<u32>) -> Self {
        let friction = ContactSummary::of(problem).friction;
        let driven = problem.points.iter().any(|p| p.slip_1 != 0.0 || p.slip_2 != 0.0);
        let rules = Rules {
            biased: problem.points.iter().any(|p| p.separation < 0.0),
            friction: if friction { FrictionRule::Disc } else { FrictionRule::None },
            driven: driven && friction,
            passes,
            axes: !problem.axes.is_empty(),
            ..Rules::default()
        };
        let contacts = color_groups(&problem.colors, problem.contact_colors(), FUSE_BELOW);
        let joints = color_groups(&problem.colors, problem.joint_colors(), FUSE_BELOW);
        let mut plan = Self::default();
        let sweeps = Sweeps {
            method,
            range,
            go_on: true,
            block: 0,
            joints: &joints,
            systems: &[],
            direct: &[],
            swept_axes: &[],
            contacts: &contacts,
            struck: &[],
            jamming: &[],
        };
        plan.sweeps(sweeps, rules);
        plan
    }

    /// Sweeps in the order of the course sheet: joints, then contacts. Joint systems come last.
    ///
    /// Joints have separate colors. Colored together with the contacts they need as many (bridge: 6 + 2 separately, 8
    /// together; chain 3 + 0 and 3), and one kernel would have to process both.
    ///
    /// With a tolerance, `begin_sweep` runs before every sweep. It leaves a flag in a buffer, and a sweep that is no
    /// longer needed is skipped: nothing is read back. A pile of 500 with up to 16 sweeps per substep and 1e-2 m/s took
    /// 0.66 of the time of all 16 on a software adapter and 0.23 on the reference. Indirect dispatch is not used: each
    /// such call adds a validating dispatch of its own, which costs about as much as the empty one that it saves.
    fn sweeps(&mut self, sweeps: Sweeps, rules: Rules) {
        let (measured, block) = (rules.measured, sweeps.block);
        for sweep in sweeps.range.clone() {
            let first = sweep == 0;
            if measured {
                self.over_all(Kernel::BeginSweep { first }, block);
            }
            let accelerated = sweeps.method == Method::Accelerated;
            if accelerated {
                self.over_all(Kernel::Extrapolate { first, measured }, block);
            }
            let of_systems = Rules { axes: true, ..rules.of_joints() };
            self.over_colors(Kernel::SolveAxes(of_systems), block, sweeps.swept_axes);
            self.over_colors(Kernel::SolveJoints(rules.of_joints()), block, sweeps.joints);
            let rules = Rules { axes: false, ..rules };
            self.over_colors(Kernel::SolveContacts(rules), block, sweeps.contacts);
            self.over_colors(Kernel::SolveContacts(Rules { as_one: true, ..rules }), block, sweeps.struck);
            let jammed = Rules { passes: rules.passes.max(JAMMED_PASSES), ..rules };
            self.over_colors(Kernel::SolveContacts(jammed), block, sweeps.jamming);
            // A sweep leaves its rows with small errors, a system is solved exactly. If a contact came after it, a light
            // body that hits something would open its joints.
            if let (Some(first), Some(last)) = (sweeps.direct.first(), sweeps.direct.last()) {
                let all = first.start..last.end;
                self.over_colors(Kernel::MeasureJoints(of_systems), block, &[all]);
                self.over_colors(Kernel::SolveJointSystems(of_systems), block, sweeps.systems);
                self.over_colors(Kernel::ApplyJointChanges(of_systems), block, sweeps.direct);
            }
            if accelerated && (sweeps.go_on || sweep + 1 < sweeps.range.end) {
                self.over_all(Kernel::MeasureStep, block);
                self.over_all(Kernel::UpdateMomentum, block);
            }
        }
    }

    fn over_all(&mut self, kernel: Kernel, block: u32) {
        self.passes.push(Pass { kernel, block, colors: 0..0 });
    }

    fn over_colors(&mut self, kernel: Kernel, block: u32, groups: &[Range<u32>]) {
        self.passes.extend(groups.iter().map(|colors| Pass { kernel, block, colors: colors.clone() }));
    }
}

/// Splits colors into groups. A color with at least `fuse_below` rows is a group of its own; neighboring smaller colors
/// form one group.
pub(crate) fn color_groups(offsets: &[u32], colors: Range<u32>, fuse_below: u32) -> Vec<Range<u32>> {
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

/// One line for each run of equal kernels: `3 x solve_contacts(friction) over colors 0, 1, 2..9`.
impl fmt::Display for StepPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for run in self.passes.chunk_by(|p, q| p.kernel == q.kernel && p.block == q.block) {
            if run[0].block > 0 {
                write!(f, "block {}: ", run[0].block)?;
            }
            write!(f, "{}", run[0].kernel)?;
            let named = |p: &&Pass| !p.colors.is_empty() && !p.kernel.has_one_color();
            let colors: Vec<_> = run.iter().filter(named).map(|p| group_name(&p.colors)).collect();
            if !colors.is_empty() {
                write!(f, " over colors {}", colors.join(", "))?;
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
    use crate::problem::{BodyRow, InertiaRow, MassRow};

    /// Only the color of the spins differs.
    #[test]
    fn a_plan_does_not_last_where_the_first_spin_comes() {
        let problem = |spins: usize| {
            let mut problem = StepProblem {
                bodies: vec![BodyRow::AT_REST; 2],
                masses: vec![MassRow::default(); 2],
                inertias: vec![InertiaRow::default(); spins],
                ..StepProblem::default()
            };
            problem.sweep_in_order_of_rows();
            problem
        };
        let [without, with] = [0, 1].map(problem);
        assert_eq!(without.blocks, with.blocks);
        let plan = |problem: &StepProblem| StepPlan::new(&SolverConfig::default(), problem);
        assert_ne!(plan(&without), plan(&with));
        assert!(PlanKey::of(&without).is_of(&without) && PlanKey::of(&with).is_of(&with));
        assert!(!PlanKey::of(&without).is_of(&with) && !PlanKey::of(&with).is_of(&without));
    }

    #[test]
    fn small_neighbouring_colors_share_a_pass_and_large_ones_do_not() {
        let offsets = [0, 500, 900, 950, 960, 1500, 1510];
        assert_eq!(color_groups(&offsets, 0..6, 256), [0..1, 1..2, 2..4, 4..5, 5..6]);
        assert_eq!(color_groups(&offsets, 0..6, 0).len(), 6);
        assert_eq!(color_groups(&offsets, 2..5, 256), [2..4, 4..5]);
        assert!(color_groups(&[0], 0..0, 256).is_empty());
    }
}

//! The order of work as data: which kernel goes over what, in which order.
//!
//! A plan is built once a step from the settings and the problem, and backends only follow it: the algorithm stands here
//! and nowhere else. What a scene lacks is absent from its plan: without friction no kernel has friction, without
//! restitution there is no pass for it, without unequal moments of inertia no gyroscopic pass.

use std::fmt;
use std::ops::Range;

use crate::config::{FrictionSweeps, SolverConfig};
use crate::kernels::contact::Rules;
use crate::problem::{BodyRow, ContactRow, ImpulseRow, InertiaRow, MassRow, PointRow, StepProblem};

/// One of the compute shaders, with its rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// Gravity and forces; over bodies.
    IntegrateVelocities,
    /// Free rotation of unequal moments of inertia; over `inertias`.
    IntegrateGyroscopic,
    /// Impulses that the manifolds carry; over colors.
    WarmStart(Rules),
    /// One sweep; over colors.
    SolveContacts(Rules),
    /// Poses; over bodies.
    IntegratePositions,
    /// Bounces; over colors.
    ApplyRestitution(Rules),
}

impl Kernel {
    /// Name of the shader file and of its entry point.
    pub fn name(self) -> &'static str {
        match self {
            Self::IntegrateVelocities => "integrate_velocities",
            Self::IntegrateGyroscopic => "integrate_gyroscopic",
            Self::WarmStart(_) => "warm_start",
            Self::SolveContacts(_) => "solve_contacts",
            Self::IntegratePositions => "integrate_positions",
            Self::ApplyRestitution(_) => "apply_restitution",
        }
    }

    /// Rules of a kernel over colors; none for one over bodies.
    pub fn rules(self) -> Option<Rules> {
        match self {
            Self::WarmStart(rules) | Self::SolveContacts(rules) | Self::ApplyRestitution(rules) => Some(rules),
            _ => None,
        }
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name())?;
        if let Some(rules) = self.rules() {
            let named = [(rules.biased, "biased"), (rules.friction, "friction"), (rules.round, "round")];
            let on: Vec<_> = named.iter().filter(|n| n.0).map(|n| n.1).collect();
            write!(f, "({})", on.join(" "))?;
        }
        Ok(())
    }
}

/// One dispatch: a kernel over all bodies, or over some colors one after another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// What is done.
    pub kernel: Kernel,
    /// The colors that it is done to; empty for a kernel over bodies. More than one are swept by one workgroup.
    pub colors: Range<u32>,
}

/// The passes of one step.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StepPlan {
    /// In order.
    pub passes: Vec<Pass>,
}

impl StepPlan {
    /// The plan of `problem` under `config`: in each substep velocities, warm start, biased sweeps, positions, relax
    /// sweeps; bounces at the end.
    pub fn new(config: &SolverConfig, problem: &StepProblem) -> Self {
        let groups = color_groups(&problem.colors, config.fuse_colors_below);
        let friction = problem.has_friction();
        let round = problem.has_round_shapes();
        let rules = |biased, friction| Rules { biased, friction, round };
        // Friction needs some sweep to happen in.
        let relax_only = config.friction_sweeps == FrictionSweeps::Relax && config.relax > 0;
        let biased = Kernel::SolveContacts(rules(true, friction && !relax_only));
        let relax = Kernel::SolveContacts(rules(false, friction));

        let mut plan = Self::default();
        for _ in 0..config.substeps {
            plan.over_bodies(Kernel::IntegrateVelocities);
            if !problem.inertias.is_empty() {
                plan.over_bodies(Kernel::IntegrateGyroscopic);
            }
            plan.over_colors(Kernel::WarmStart(Rules { friction, ..Rules::default() }), &groups);
            for _ in 0..config.iterations {
                plan.over_colors(biased, &groups);
            }
            plan.over_bodies(Kernel::IntegratePositions);
            for _ in 0..config.relax {
                plan.over_colors(relax, &groups);
            }
        }
        if problem.has_restitution() {
            plan.over_colors(Kernel::ApplyRestitution(Rules::default()), &groups);
        }
        plan
    }

    fn over_bodies(&mut self, kernel: Kernel) {
        self.passes.push(Pass { kernel, colors: 0..0 });
    }

    fn over_colors(&mut self, kernel: Kernel, groups: &[Range<u32>]) {
        self.passes.extend(groups.iter().map(|colors| Pass { kernel, colors: colors.clone() }));
    }

    /// Bytes that the kernels read and write when every row that a thread names is moved once.
    pub fn bytes_moved(&self, problem: &StepProblem) -> u64 {
        self.passes.iter().map(|p| p.bytes_moved(problem)).sum()
    }
}

impl Pass {
    /// Bytes that this pass reads and writes.
    pub fn bytes_moved(&self, problem: &StepProblem) -> u64 {
        const BODY: usize = size_of::<BodyRow>();
        const MASS: usize = size_of::<MassRow>();
        // Velocities are the half of a body that a sweep writes.
        const VELOCITIES: usize = BODY / 2;
        let bytes = match self.kernel {
            Kernel::IntegrateVelocities => problem.bodies.len() * (VELOCITIES + MASS / 3),
            Kernel::IntegratePositions => problem.bodies.len() * (BODY + BODY / 2),
            Kernel::IntegrateGyroscopic => problem.inertias.len() * (size_of::<InertiaRow>() + BODY + MASS),
            Kernel::WarmStart(_) | Kernel::SolveContacts(_) | Kernel::ApplyRestitution(_) => {
                let contacts = contact_range(&problem.colors, &self.colors);
                let rows = &problem.contacts[contacts];
                let points: usize = rows.iter().map(|c| c.point_count as usize).sum();
                let pair = 2 * (BODY + MASS + VELOCITIES);
                let writes_impulses = !matches!(self.kernel, Kernel::WarmStart(_));
                let impulses = size_of::<ImpulseRow>() * if writes_impulses { 2 } else { 1 };
                let sweeps = if self.kernel.rules().is_some_and(|r| r.friction && writes_impulses) { 2 } else { 1 };
                rows.len() * (size_of::<ContactRow>() + pair) + points * sweeps * (size_of::<PointRow>() + impulses)
            }
        };
        bytes as u64
    }
}

/// The contacts of some neighbouring colors.
pub fn contact_range(offsets: &[u32], colors: &Range<u32>) -> Range<usize> {
    if colors.is_empty() {
        return 0..0;
    }
    offsets[colors.start as usize] as usize..offsets[colors.end as usize] as usize
}

/// Colors of at least `fuse_below` contacts stand alone; neighbouring smaller ones go together.
fn color_groups(offsets: &[u32], fuse_below: u32) -> Vec<Range<u32>> {
    let mut groups: Vec<Range<u32>> = Vec::new();
    let mut last_is_small = false;
    for (color, ends) in (0..).zip(offsets.windows(2)) {
        let small = ends[1] - ends[0] < fuse_below;
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

    #[test]
    fn small_neighbouring_colors_share_a_pass_and_large_ones_do_not() {
        let offsets = [0, 500, 900, 950, 960, 1500, 1510];
        assert_eq!(color_groups(&offsets, 256), [0..1, 1..2, 2..4, 4..5, 5..6]);
        assert_eq!(color_groups(&offsets, 0).len(), 6);
        assert!(color_groups(&[0], 256).is_empty());
        assert!(color_groups(&[], 256).is_empty());
    }
}

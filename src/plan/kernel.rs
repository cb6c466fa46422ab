//! The kernels of a plan: compute shaders, each with its rules.

use std::fmt;

use crate::config::FrictionRule;
use crate::kernels::Rules;

/// One of the compute shaders, with its rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kernel {
    /// Gravity and forces; over bodies.
    IntegrateVelocities {
        /// Whether the kernel also applies the final impulses of the last substep, as velocities.
        warm_start: bool,
        /// Whether velocities are changes since the start of the step, here and below.
        from_start: bool,
    },
    /// Turns velocities into changes since the start of the step; over bodies.
    BeginChanges,
    /// Turns changes back into velocities; over bodies.
    EndChanges,
    /// Torques; over bodies.
    IntegrateTorques {
        /// As in `IntegrateVelocities`.
        from_start: bool,
    },
    /// Decay of velocities; over bodies.
    DampVelocities {
        /// As in `IntegrateVelocities`.
        from_start: bool,
    },
    /// Free rotation of unequal moments of inertia; over `inertias`.
    IntegrateGyroscopic {
        /// As in `IntegrateVelocities`.
        from_start: bool,
    },
    /// Clears impulses; over contact colors, all at once.
    ClearImpulses,
    /// Adds the impulses of a substep to the sums of earlier substeps; over contact colors, all at once.
    SumImpulses {
        /// Whether this is the first substep.
        first: bool,
    },
    /// The same; over joint colors, all at once.
    SumJointImpulses {
        /// As in `SumImpulses`.
        first: bool,
    },
    /// Rotates the inertia of bodies; over `turning`.
    TurnInertias,
    /// Sets up joint systems at the present poses of their bodies; over systems.
    BeginSystems,
    /// Applies carried impulses of joints; over joint colors.
    WarmStartJoints {
        /// Whether joints have axes.
        axes: bool,
    },
    /// Applies carried impulses of manifolds; over contact colors.
    WarmStart(Rules),
    /// Counts a sweep, and decides whether it is still needed. The `first` sweep of its kind in a substep always is.
    BeginSweep {
        /// Whether it is the first.
        first: bool,
    },
    /// Continues in the direction of the last sweeps; with `first` it only stores their start. Over bodies, points and
    /// joints.
    Extrapolate {
        /// Whether no sweep came before.
        first: bool,
        /// Whether the kernel is skipped when sweeps are no longer needed.
        measured: bool,
    },
    /// Measures the change of impulses in the last sweep; over points and joints.
    MeasureStep,
    /// Computes the length of the next extrapolation.
    UpdateMomentum,
    /// One sweep of the joints; over joint colors.
    SolveJoints(Rules),
    /// One sweep of the limits and drives of joints in systems; over their colors.
    SolveAxes(Rules),
    /// Measures the velocity errors of joints in systems; over their colors, in any order.
    MeasureJoints(Rules),
    /// Solves joint systems; over systems.
    SolveJointSystems(Rules),
    /// Applies the corrections of joints in systems; over their colors.
    ApplyJointChanges(Rules),
    /// One sweep of the contacts; over contact colors.
    SolveContacts(Rules),
    /// Integrates poses; over bodies.
    IntegratePositions {
        /// As in `IntegrateVelocities`.
        from_start: bool,
    },
    /// Applies restitution; over contact colors.
    ApplyRestitution(Rules),
}

impl Kernel {
    /// Name of the shader file.
    pub fn name(self) -> &'static str {
        match self {
            Self::IntegrateVelocities { .. } => "integrate_velocities",
            Self::BeginChanges => "begin_changes",
            Self::EndChanges => "end_changes",
            Self::IntegrateTorques { .. } => "integrate_torques",
            Self::DampVelocities { .. } => "damp_velocities",
            Self::IntegrateGyroscopic { .. } => "integrate_gyroscopic",
            Self::ClearImpulses => "clear_impulses",
            Self::SumImpulses { .. } => "sum_impulses",
            Self::SumJointImpulses { .. } => "sum_joint_impulses",
            Self::TurnInertias => "turn_inertias",
            Self::BeginSystems => "begin_systems",
            Self::WarmStartJoints { .. } => "warm_start_joints",
            Self::WarmStart(_) => "warm_start",
            Self::BeginSweep { .. } => "begin_sweep",
            Self::Extrapolate { .. } => "extrapolate",
            Self::MeasureStep => "measure_step",
            Self::UpdateMomentum => "update_momentum",
            Self::SolveJoints(_) => "solve_joints",
            Self::SolveAxes(_) => "solve_axes",
            Self::MeasureJoints(_) => "measure_joints",
            Self::SolveJointSystems(_) => "solve_joint_systems",
            Self::ApplyJointChanges(_) => "apply_joint_changes",
            Self::SolveContacts(_) => "solve_contacts",
            Self::IntegratePositions { .. } => "integrate_positions",
            Self::ApplyRestitution(_) => "apply_restitution",
        }
    }

    /// Whether it processes the only color that a block has of bodies, of inertia rows, or of joint systems.
    pub fn has_one_color(self) -> bool {
        matches!(
            self,
            Self::IntegrateVelocities { .. }
                | Self::BeginChanges
                | Self::EndChanges
                | Self::IntegrateTorques { .. }
                | Self::DampVelocities { .. }
                | Self::IntegrateGyroscopic { .. }
                | Self::IntegratePositions { .. }
                | Self::TurnInertias
                | Self::BeginSystems
                | Self::SolveJointSystems(_)
        )
    }

    /// Rules of a kernel that sweeps constraints, or `None`.
    pub fn rules(self) -> Option<Rules> {
        match self {
            Self::WarmStart(rules)
            | Self::SolveJoints(rules)
            | Self::SolveAxes(rules)
            | Self::MeasureJoints(rules)
            | Self::SolveJointSystems(rules)
            | Self::ApplyJointChanges(rules)
            | Self::SolveContacts(rules)
            | Self::ApplyRestitution(rules) => Some(rules),
            _ => None,
        }
    }

    /// Whether it treats the points of a manifold as one.
    pub fn presses_as_one(self) -> bool {
        matches!(self, Self::SolveContacts(Rules { as_one: true, .. }) | Self::ApplyRestitution(_))
    }

    /// Whether the kernel works with velocities that are changes since the start of the step.
    pub fn is_from_start(self) -> bool {
        match self {
            Self::IntegrateVelocities { from_start, .. }
            | Self::IntegrateTorques { from_start }
            | Self::DampVelocities { from_start }
            | Self::IntegrateGyroscopic { from_start }
            | Self::IntegratePositions { from_start } => from_start,
            _ => self.rules().is_some_and(|rules| rules.from_start),
        }
    }

    /// Whether the kernel reads the velocities of body pairs at the start of the step.
    pub fn reads_start(self) -> bool {
        let measures = matches!(
            self,
            Self::SolveJoints(_)
                | Self::SolveAxes(_)
                | Self::MeasureJoints(_)
                | Self::SolveContacts(_)
                | Self::ApplyRestitution(_)
        );
        measures && self.is_from_start()
    }

    /// Whether the kernel keeps the bounces of points.
    pub fn keeps_bounces(self) -> bool {
        match self {
            Self::SolveContacts(rules) => rules.bounces,
            _ => matches!(self, Self::ApplyRestitution(_)),
        }
    }

    /// Whether the kernel reads the relative accelerations or the slips of points.
    pub fn reads_pull_or_slip(self) -> bool {
        match self {
            Self::SolveContacts(rules) => rules.patch || rules.driven || rules.friction == FrictionRule::Slip,
            _ => matches!(self, Self::ApplyRestitution(_)),
        }
    }

    /// Whether the kernel over constraints changes the places of bodies.
    pub fn moves_bodies(self) -> bool {
        matches!(self, Self::ApplyRestitution(_))
    }

    /// Whether the kernel is skipped when sweeps are no longer needed.
    pub fn is_measured(self) -> bool {
        match self {
            Self::Extrapolate { measured, .. } => measured,
            Self::SolveJoints(rules)
            | Self::SolveAxes(rules)
            | Self::MeasureJoints(rules)
            | Self::SolveJointSystems(rules)
            | Self::ApplyJointChanges(rules)
            | Self::SolveContacts(rules) => rules.measured,
            _ => false,
        }
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name())?;
        match self {
            Self::IntegrateVelocities { warm_start: true, .. } => write!(f, "(warm start)")?,
            Self::SumImpulses { first: true } | Self::SumJointImpulses { first: true } => write!(f, "(first)")?,
            _ if self.rules().is_none() && self.is_from_start() => write!(f, "(from start)")?,
            _ => {}
        }
        if let Some(r) = self.rules() {
            let friction = match r.friction {
                FrictionRule::None => "",
                FrictionRule::Slip => "slip friction",
                FrictionRule::Box => "box friction",
                FrictionRule::Disc => "disc friction",
            };
            let named = [
                (r.biased, "biased"),
                (r.friction != FrictionRule::None, friction),
                (r.is_at_patch(), "per manifold"),
                (r.rolls, "rolling"),
                (r.friction_first, "first"),
                (!r.accumulated, "clamped per correction"),
                (r.round, "round"),
                (r.as_one, "as one"),
                (r.driven, "driven"),
                (r.passes > 1, "repeated"),
                (r.measured, "measured"),
                (r.from_start, "from start"),
                (r.isotropic, "isotropic"),
                (r.bounces, "bouncing"),
            ];
            let on: Vec<_> = named.iter().filter(|n| n.0).map(|n| n.1).collect();
            write!(f, "({})", on.join(", "))?;
        }
        Ok(())
    }
}

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
        /// Whether the impulses that the last substep ended with are applied as well, as velocities.
        warm_start: bool,
        /// Whether velocities are changes since the step began, here and below.
        from_start: bool,
    },
    /// Velocities become changes since the step began; over bodies.
    BeginChanges,
    /// Changes become velocities; over bodies.
    EndChanges,
    /// Torques; over bodies.
    IntegrateTorques {
        /// As of `IntegrateVelocities`.
        from_start: bool,
    },
    /// Decay of velocities; over bodies.
    DampVelocities {
        /// As of `IntegrateVelocities`.
        from_start: bool,
    },
    /// Free rotation of unequal moments of inertia; over `inertias`.
    IntegrateGyroscopic {
        /// As of `IntegrateVelocities`.
        from_start: bool,
    },
    /// Forgets impulses; over contact colors, all at once.
    ClearImpulses,
    /// Adds the impulses of a substep to those of the substeps before; over contact colors, all at once.
    SumImpulses {
        /// Whether no substep came before.
        first: bool,
    },
    /// The same; over joint colors, all at once.
    SumJointImpulses {
        /// As of `SumImpulses`.
        first: bool,
    },
    /// Inertia of bodies that turned; over `turning`.
    TurnInertias,
    /// Joints that are solved at once begin where their bodies are; over systems.
    BeginSystems,
    /// Impulses that the joints carry; over joint colors.
    WarmStartJoints {
        /// Whether joints have axes.
        axes: bool,
    },
    /// Impulses that the manifolds carry; over contact colors.
    WarmStart(Rules),
    /// Counts a sweep, and decides whether it is still needed; `first` of its kind in a substep always is.
    BeginSweep {
        /// Whether it is the first.
        first: bool,
    },
    /// Goes on in the direction of the last sweeps, or, `first`, only remembers where they begin; over bodies, points and joints.
    Extrapolate {
        /// Whether no sweep came before.
        first: bool,
        /// Whether it is left out where sweeps are no longer needed.
        measured: bool,
    },
    /// How far the last sweep moved the impulses; over points and joints.
    MeasureStep,
    /// How far the next extrapolation goes.
    UpdateMomentum,
    /// One sweep of the joints; over joint colors.
    SolveJoints(Rules),
    /// One sweep of the limits and drives of joints that are solved at once; over their colors.
    SolveAxes(Rules),
    /// The velocities that joints lack which are solved at once; over their colors, in any order.
    MeasureJoints(Rules),
    /// Solves joints at once; over systems.
    SolveJointSystems(Rules),
    /// Corrections of joints that are solved at once; over their colors.
    ApplyJointChanges(Rules),
    /// One sweep of the contacts; over contact colors.
    SolveContacts(Rules),
    /// Poses; over bodies.
    IntegratePositions {
        /// As of `IntegrateVelocities`.
        from_start: bool,
    },
    /// Bounces; over contact colors.
    ApplyRestitution(Rules),
}

impl Kernel {
    /// Name of the shader file and of its entry point.
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

    /// Whether it goes over the one color that a block has of bodies, of rows of inertia, or of systems of joints.
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

    /// Rules of a kernel that sweeps constraints, or none.
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

    /// Whether it presses the points of a manifold as one.
    pub fn presses_as_one(self) -> bool {
        matches!(self, Self::SolveContacts(Rules { as_one: true, .. }) | Self::ApplyRestitution(_))
    }

    /// Whether the kernel works with velocities that are changes since the step began.
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

    /// Whether the kernel reads the velocities that the step began with, of pairs of bodies.
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

    /// Whether the kernel keeps the largest impulses of points.
    pub fn keeps_peaks(self) -> bool {
        match self {
            Self::SolveContacts(rules) => rules.bounces,
            _ => matches!(self, Self::ApplyRestitution(_)),
        }
    }

    /// Whether the kernel reads the velocities of approach or the slips of points.
    pub fn reads_approach_or_slip(self) -> bool {
        match self {
            Self::SolveContacts(rules) => rules.patch || rules.driven || rules.friction == FrictionRule::Slip,
            _ => matches!(self, Self::ApplyRestitution(_)),
        }
    }

    /// Whether the kernel is left out where sweeps are no longer needed.
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
                (r.patch, "per manifold"),
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

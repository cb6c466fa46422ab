//! Error measures and sums of a world of a batch.

use drystone::batch::Member;
use drystone::metrics::{self, Penetration};
use drystone::{Cpu, named};
use glam::DVec3;

use crate::residuals::Residuals;
use crate::step::step_with_residuals;

/// A measure of the solution error or of the content of a world.
///
/// ```
/// use drystone::{SolverConfig, batch::Batch};
/// use drystone_problems::batch::Measure;
/// use drystone_scenes::Scene;
///
/// let scene = Scene::find("tower", &[])?;
/// let mut batch = Batch::of(&scene.world, scene.dt, &SolverConfig::default(), 1)?;
/// batch.step(60, &[0])?;
/// let [overlap, contacts] = Measure::values([Measure::OverlapMax, Measure::Contacts], batch.world(0));
/// assert!(overlap < 1e-3 && contacts == 10.0, "{overlap} m, {contacts}");
/// let mut values = [0.0; 2];
/// Measure::values_into(&[Measure::Finite, Measure::JointGap], batch.world(0), &mut values);
/// assert_eq!(values, [1.0, 0.0]);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Measure {
    /// Deepest overlap at the present poses, from contacts that are computed anew (m).
    OverlapMax,
    /// Mean over all contacts of the overlap at the deepest point (m).
    OverlapMean,
    /// 95th percentile of the overlap of contacts (m).
    Overlap95,
    /// Largest distance between the anchors of a joint that keeps them together (m).
    JointGap,
    /// Kinetic energy (J).
    KineticEnergy,
    /// Gravitational potential energy (J).
    PotentialEnergy,
    /// Momentum along x (N s).
    MomentumX,
    /// Momentum along y (N s).
    MomentumY,
    /// Momentum along z (N s).
    MomentumZ,
    /// Angular momentum about the origin along x (N m s).
    AngularMomentumX,
    /// Angular momentum about the origin along y (N m s).
    AngularMomentumY,
    /// Angular momentum about the origin along z (N m s).
    AngularMomentumZ,
    /// Speed of the fastest dynamic body (m/s).
    Fastest,
    /// Static compression of the most loaded contact of the last step with the substeps of the settings, divided by the
    /// promised overlap; 0 without a load.
    Need,
    /// Energy that the last step removed because constraints had added it (J).
    EnergyTaken,
    /// Number of contacts of the last step, including near ones.
    Contacts,
    /// Number of sleeping dynamic bodies.
    Asleep,
    /// 1 if all numbers are finite, else 0.
    Finite,
    /// Natural map of the impulses after the first substep of the next step, in velocities ([`Residuals::e_vel`]). The
    /// step runs on a copy. This residual and the next three are NaN for a world with joints.
    ResidualVelocity,
    /// Largest distance of an impulse from its friction cone ([`Residuals::cone`], N s).
    ResidualCone,
    /// Largest product of a normal impulse and the normal speed of its contact ([`Residuals::compl`], J).
    ResidualComplementarity,
    /// Largest deviation of friction from full opposition to the slip ([`Residuals::diss`], J).
    ResidualDissipation,
}

named!(Measure {
    OverlapMax = "overlap_max",
    OverlapMean = "overlap_mean",
    Overlap95 = "overlap_95",
    JointGap = "joint_gap",
    KineticEnergy = "kinetic_energy",
    PotentialEnergy = "potential_energy",
    MomentumX = "momentum_x",
    MomentumY = "momentum_y",
    MomentumZ = "momentum_z",
    AngularMomentumX = "angular_momentum_x",
    AngularMomentumY = "angular_momentum_y",
    AngularMomentumZ = "angular_momentum_z",
    Fastest = "fastest",
    Need = "need",
    EnergyTaken = "energy_taken",
    Contacts = "contacts",
    Asleep = "asleep",
    Finite = "finite",
    ResidualVelocity = "residual_velocity",
    ResidualCone = "residual_cone",
    ResidualComplementarity = "residual_complementarity",
    ResidualDissipation = "residual_dissipation",
});

impl Measure {
    /// Measures of a world. The three measures of overlap are computed together, and so are the residuals.
    pub fn values<const N: usize>(measures: [Self; N], member: &Member) -> [f64; N] {
        let mut values = [0.0; N];
        Self::values_into(&measures, member, &mut values);
        values
    }

    /// The same, into a slice.
    pub fn values_into(measures: &[Self], member: &Member, values: &mut [f64]) {
        let (mut overlap, mut residuals): (Option<Penetration>, Option<Option<Residuals>>) = (None, None);
        for (measure, value) in measures.iter().zip(values) {
            let overlap = || *overlap.get_or_insert_with(|| member.simulation().penetration());
            *value = measure.value(member, overlap, || *residuals.get_or_insert_with(|| of_next_step(member)));
        }
    }

    fn value(
        self,
        member: &Member,
        mut overlap: impl FnMut() -> Penetration,
        mut residuals: impl FnMut() -> Option<Residuals>,
    ) -> f64 {
        let mut residual = |of: fn(Residuals) -> f64| residuals().map_or(f64::NAN, of);
        let world = &member.simulation().world;
        let momentum = |k: usize| DVec3::to_array(&world.linear_momentum())[k];
        let turning = |k: usize| DVec3::to_array(&world.angular_momentum())[k];
        match self {
            Self::OverlapMax => overlap().max,
            Self::OverlapMean => overlap().mean,
            Self::Overlap95 => overlap().p95,
            Self::JointGap => f64::from(world.joint_gap()),
            Self::KineticEnergy => world.kinetic_energy(),
            Self::PotentialEnergy => world.potential_energy(),
            Self::MomentumX => momentum(0),
            Self::MomentumY => momentum(1),
            Self::MomentumZ => momentum(2),
            Self::AngularMomentumX => turning(0),
            Self::AngularMomentumY => turning(1),
            Self::AngularMomentumZ => turning(2),
            Self::Fastest => metrics::fastest(world).map_or(0.0, |(speed, _)| speed),
            Self::Need => member.stats().hardest.map_or(0.0, |hardest| f64::from(hardest.need)),
            Self::EnergyTaken => member.stats().energy_taken,
            Self::Contacts => member.simulation().contacts().count() as f64,
            Self::Asleep => world.bodies.handles().filter(|&body| member.simulation().is_asleep(body)).count() as f64,
            Self::ResidualVelocity => residual(|all| all.e_vel),
            Self::ResidualCone => residual(|all| all.cone),
            Self::ResidualComplementarity => residual(|all| all.compl),
            Self::ResidualDissipation => residual(|all| all.diss),
            Self::Finite => f64::from(u8::from(world.first_non_finite().is_none())),
        }
    }
}

/// The residuals of the next step, which runs on a copy. `None` for a world with joints, or if the step fails.
fn of_next_step(member: &Member) -> Option<Residuals> {
    if !member.simulation().world.joints.is_empty() {
        return None;
    }
    let mut copy = member.simulation().fork(Box::new(Cpu::new()));
    step_with_residuals(&mut copy, member.dt()).ok()
}

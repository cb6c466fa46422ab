//! Error measures and sums of a world.

use glam::DVec3;

use super::Member;
use crate::backend::cpu::Cpu;
use crate::metrics::{self, Penetration};
use crate::names::named;
use crate::residuals::Residuals;

/// A measure of the solution error or of the content of a world: see [`Member::measure`].
///
/// ```
/// use drystone::batch::{Batch, Measure};
/// use drystone::{Scene, SolverConfig};
///
/// let mut batch = Batch::of(&Scene::find("tower", &[])?, &SolverConfig::default(), 1)?;
/// batch.step(60, &[0])?;
/// let [overlap, contacts] = batch.world(0).measure([Measure::OverlapMax, Measure::Contacts]);
/// assert!(overlap < 1e-3 && contacts == 10.0, "{overlap} m, {contacts}");
/// let mut values = [0.0; 2];
/// batch.world(0).measure_into(&[Measure::Finite, Measure::JointGap], &mut values);
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
    /// How far the first substep of the next step leaves impulses from solving its contacts, in velocities ([`Residuals::e_vel`]). The step is made on
    /// a copy. NaN of a world with joints, as the three that follow.
    ResidualVelocity,
    /// Farthest that an impulse is outside of its cone of friction ([`Residuals::cone`], N s).
    ResidualCone,
    /// Largest impulse of a contact times the speed at which it parts ([`Residuals::compl`], J).
    ResidualComplementarity,
    /// Largest power of friction that does not oppose its slip ([`Residuals::diss`], J).
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

impl Member {
    /// Measures of the world. The three measures of overlap are computed together, and so are the residuals.
    pub fn measure<const N: usize>(&self, measures: [Measure; N]) -> [f64; N] {
        let mut values = [0.0; N];
        self.measure_into(&measures, &mut values);
        values
    }

    /// The same, into a slice.
    pub fn measure_into(&self, measures: &[Measure], values: &mut [f64]) {
        let (mut overlap, mut residuals): (Option<Penetration>, Option<Option<Residuals>>) = (None, None);
        for (measure, value) in measures.iter().zip(values) {
            let overlap = || *overlap.get_or_insert_with(|| self.simulation().penetration());
            *value = self.one(*measure, overlap, || *residuals.get_or_insert_with(|| self.residuals()));
        }
    }

    /// Those of the next step, made on a copy; none of a world with joints, or where the step fails.
    fn residuals(&self) -> Option<Residuals> {
        if !self.simulation().world.joints.is_empty() {
            return None;
        }
        let mut copy = self.simulation().fork(Box::new(Cpu::new()));
        copy.step_with_residuals(self.dt()).ok()
    }

    fn one(
        &self,
        measure: Measure,
        mut overlap: impl FnMut() -> Penetration,
        mut residuals: impl FnMut() -> Option<Residuals>,
    ) -> f64 {
        let mut residual = |of: fn(Residuals) -> f64| residuals().map_or(f64::NAN, of);
        let world = &self.simulation().world;
        let momentum = |k: usize| DVec3::to_array(&world.linear_momentum())[k];
        let turning = |k: usize| DVec3::to_array(&world.angular_momentum())[k];
        match measure {
            Measure::OverlapMax => overlap().max,
            Measure::OverlapMean => overlap().mean,
            Measure::Overlap95 => overlap().p95,
            Measure::JointGap => f64::from(world.joint_gap()),
            Measure::KineticEnergy => world.kinetic_energy(),
            Measure::PotentialEnergy => world.potential_energy(),
            Measure::MomentumX => momentum(0),
            Measure::MomentumY => momentum(1),
            Measure::MomentumZ => momentum(2),
            Measure::AngularMomentumX => turning(0),
            Measure::AngularMomentumY => turning(1),
            Measure::AngularMomentumZ => turning(2),
            Measure::Fastest => metrics::fastest(world).0,
            Measure::Need => self.stats().hardest.map_or(0.0, |hardest| f64::from(hardest.need)),
            Measure::EnergyTaken => self.stats().energy_taken,
            Measure::Contacts => self.simulation().contacts().count() as f64,
            Measure::Asleep => (0..world.bodies.len()).filter(|&i| self.simulation().is_asleep(i)).count() as f64,
            Measure::ResidualVelocity => residual(|all| all.e_vel),
            Measure::ResidualCone => residual(|all| all.cone),
            Measure::ResidualComplementarity => residual(|all| all.compl),
            Measure::ResidualDissipation => residual(|all| all.diss),
            Measure::Finite => f64::from(u8::from(world.first_non_finite().is_none())),
        }
    }
}

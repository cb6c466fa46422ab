//! Errors of a world after a run, by drystone's own metrics.

use drystone::collide::Detector;
use drystone::metrics::{Penetration, in_place, rms_speed};
use drystone::world::BodyKind;
use drystone::{Scene, SolverConfig, World};

/// What a run came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Overlap, from contacts that drystone computes at the poses.
    pub penetration: Penetration,
    /// sqrt(2 E / m) [m/s].
    pub rms_speed: f64,
    /// Farthest that the center of mass of a dynamic body is from where it began, horizontally [m].
    pub drift: f64,
    /// Dynamic bodies that moved by less than half of their height.
    pub in_place: usize,
    /// Largest distance between the anchors of a joint [m].
    pub joint_gap: f64,
    /// Dynamic bodies outside of the container.
    pub escaped: usize,
}

impl Score {
    /// Of `world`, which was `scene` before it was run.
    pub fn of(scene: &Scene, world: &World) -> Self {
        let mut detector = Detector::new(world);
        detector.detect(world, &SolverConfig::default(), 0.0);
        let dynamic = || scene.world.bodies.iter().zip(&world.bodies).filter(|(b, _)| b.kind == BodyKind::Dynamic);
        let drift = |(before, after): (&drystone::Body, &drystone::Body)| {
            let moved = after.center_of_mass().as_dvec3() - before.center_of_mass().as_dvec3();
            let up = -scene.world.gravity.as_dvec3().normalize_or_zero();
            (moved - moved.dot(up) * up).length()
        };
        Self {
            penetration: Penetration::of(detector.pairs()),
            rms_speed: rms_speed(world),
            drift: dynamic().map(drift).fold(0.0, |worst, x| if x > worst || x.is_nan() { x } else { worst }),
            in_place: dynamic().filter(|(before, after)| in_place(before, after)).count(),
            joint_gap: world.joint_gap().into(),
            escaped: scene.escaped(world),
        }
    }
}

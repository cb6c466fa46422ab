//! What a run got wrong: penetration and speed, in f64.

use crate::collide::Pair;
use crate::world::{BodyKind, World};

/// Overlap over all touching pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Penetration {
    /// Deepest [m].
    pub max: f64,
    /// Mean over the manifolds whose surfaces are within their margin of each other, of each one's deepest point [m].
    pub mean: f64,
}

impl Penetration {
    /// Of the manifolds of `pairs`; a manifold that is apart counts as zero.
    pub fn of(pairs: &[Pair]) -> Self {
        let deepest = |m: &crate::collide::Manifold| {
            m.points()
                .iter()
                .map(|p| f64::from(-p.separation))
                .fold(0.0, |x: f64, y| if y > x || y.is_nan() { y } else { x })
        };
        let depths: Vec<f64> = pairs.iter().flat_map(|p| &p.manifolds).map(deepest).collect();
        let max = depths.iter().copied().fold(0.0, |x: f64, y| if y > x || y.is_nan() { y } else { x });
        // Not a sum, which is -0 for none.
        let mean = depths.iter().fold(0.0, |total, depth| total + depth) / depths.len().max(1) as f64;
        Self { max, mean }
    }
}

/// Speed of the fastest dynamic body [m/s] and its index; NaN counts as fastest.
pub fn fastest(world: &World) -> (f64, usize) {
    let mut best = (0.0, 0);
    for (i, b) in world.bodies.iter().enumerate().filter(|(_, b)| b.kind == BodyKind::Dynamic) {
        let speed = b.linear_velocity.as_dvec3().length();
        if speed > best.0 || speed.is_nan() {
            best = (speed, i);
        }
    }
    best
}

/// Root of the mean square speed, weighted by mass: sqrt(2 E / m) [m/s]. 0 for a world without dynamic bodies.
pub fn rms_speed(world: &World) -> f64 {
    let mass: f64 = world.bodies.iter().map(|b| f64::from(b.mass.mass)).sum();
    if mass > 0.0 { (2.0 * world.kinetic_energy() / mass).sqrt() } else { 0.0 }
}

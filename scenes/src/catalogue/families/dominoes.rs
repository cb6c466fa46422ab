//! A row of dominoes, and the speed of its wave.

use glam::Vec3;

use super::Law;
use super::draw::Draw;
use crate::catalogue::masonry;
use crate::scene::Scene;

/// Friction between dominoes, nearly zero because the law neglects it. A contact has the geometric mean of two
/// materials: between dominoes and floor it is 1.
const SMOOTH: f32 = 0.01;
const ROUGH: f32 = 100.0;

/// A row on a rough floor.
pub(super) fn row(draw: &mut Draw, g: f64) -> (Scene, Law) {
    let n = draw.whole(30, 60);
    let height = draw.log_uniform(0.1, 1.0);
    let [thickness, spacing] = [draw.between(0.1, 0.2) * height, draw.between(0.2, 0.6) * height];
    let half = Vec3::new(0.5 * thickness as f32, 0.5 * height as f32, 0.25 * height as f32);
    // At least twice the speed that tips the first one over its edge.
    let push = 0.5 * (g / height).sqrt();
    let mut scene = masonry::domino_row("dominoes", n, half, thickness + spacing, push as f32);
    for (k, body) in scene.world.bodies.iter_mut().enumerate() {
        body.material.friction = if k == 0 { ROUGH } else { SMOOTH };
    }
    let angle = libm::asin(spacing / height);
    (scene, Law::Topples { speed: speed(thickness / height, spacing / height) * (g * height).sqrt(), angle })
}

/// Distance from one domino of a row to the next (m).
pub(super) fn pitch(scene: &Scene) -> f64 {
    f64::from(scene.world.bodies[2].position.x) - f64::from(scene.world.bodies[1].position.x)
}

/// Duration of a run (s): one and a half times the duration of the wave. The rest is for its start, and for the last
/// dominoes to come to rest.
pub(super) fn time(scene: &Scene, speed: f64, g: f64) -> f64 {
    let height = 2.0 * f64::from(scene.world.bodies[1].position.y);
    1.5 * scene.world.dynamic_count() as f64 * pitch(scene) / speed + 10.0 * (height / g).sqrt()
}

/// Speed of the wave in an endless row, divided by sqrt(g h), where thickness and spacing are relative to the height h.
/// It follows the frictionless train of van Leeuwen, "The domino effect", American Journal of Physics 78, 721, 2010.
/// Dominoes turn about their edges. Each fallen domino leans on the next one, so the tilt of the first domino of the
/// train determines all others, and energy is conserved. The train hits the next domino without rebound.
fn speed(thickness: f64, spacing: f64) -> f64 {
    /// Dominoes of a train: those further back are at rest.
    const TRAIN: usize = 40;
    /// Intervals of the tilt, and dominoes that fall before the speed is measured.
    const INTERVALS: usize = 200;
    const FALLS: usize = 60;
    let pitch = spacing + thickness;
    // Units: mass, height and gravity are 1. Moment of inertia about the edge.
    let inertia = (1.0 + thickness * thickness) / 3.0;
    // For a train whose first domino has a given tilt: the sum of squares of the derivatives of all tilts by the first
    // tilt, and the potential energy.
    let train = |first: f64| {
        let (mut tilt, mut by, mut squares, mut potential) = (first, 1.0, 0.0, 0.0);
        for _ in 0..TRAIN {
            squares += by * by;
            let (sin, cos) = libm::sincos(tilt);
            potential += 0.5 * (cos + thickness * sin);
            // The edge of the domino behind touches its face: sin(next - tilt) = pitch cos(tilt) - thickness.
            let lean = libm::asin(pitch * cos - thickness);
            by *= 1.0 - pitch * sin / libm::cos(lean);
            tilt += lean;
        }
        (squares, potential)
    };
    let last = libm::asin(spacing);
    let path: Vec<_> = (0..=INTERVALS).map(|k| train(last * k as f64 / INTERVALS as f64)).collect();
    let rate = |energy: f64, k: usize| (2.0 * (energy - path[k].1) / (inertia * path[k].0)).sqrt();
    // While the first domino does not move, only the train behind it has energy. In the collision, the train shares its
    // momentum with it.
    let (mut spin, mut time) = (1.0, f64::NAN);
    for _ in 0..FALLS {
        let energy = 0.5 * inertia * path[0].0 * spin * spin + path[0].1;
        // Midpoint of each interval.
        time = (0..INTERVALS).map(|k| 2.0 * last / INTERVALS as f64 / (rate(energy, k) + rate(energy, k + 1))).sum();
        let behind = path[INTERVALS].0;
        spin = rate(energy, INTERVALS) * behind / (1.0 + behind);
    }
    pitch / time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_slower_where_dominoes_stand_further_apart_and_of_the_order_of_a_fall() {
        let speeds: Vec<f64> = [0.2, 0.3, 0.4, 0.5, 0.6].map(|spacing| speed(0.15, spacing)).into();
        assert!(speeds.windows(2).all(|pair| pair[1] < pair[0]), "{speeds:?}");
        assert!(speeds.iter().all(|v| (0.7..3.0).contains(v)), "{speeds:?}");
    }
}

//! A row of dominoes, and the speed of its wave.

use glam::Vec3;

use super::Law;
use super::draw::Draw;
use crate::scenes::catalogue::masonry;
use crate::scenes::scene::Scene;

/// Friction between dominoes, which the law leaves out. Two materials have the geometric mean: with the floor, the dominoes have friction 1.
const SMOOTH: f32 = 0.01;
const ROUGH: f32 = 100.0;

/// A row on a rough floor.
pub(super) fn row(draw: &mut Draw, g: f64) -> (Scene, Law) {
    let n = draw.whole(30, 60);
    let height = draw.log_uniform(0.1, 1.0);
    let [thickness, spacing] = [draw.between(0.1, 0.2) * height, draw.between(0.2, 0.6) * height];
    let half = Vec3::new(0.5 * thickness as f32, 0.5 * height as f32, 0.25 * height as f32);
    // Twice what lifts the first one over its edge, or more.
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

/// Time in which a row falls (s): one and a half times that of the wave, for its start, and what the last ones take to come to rest.
pub(super) fn time(scene: &Scene, speed: f64, g: f64) -> f64 {
    let height = 2.0 * f64::from(scene.world.bodies[1].position.y);
    1.5 * scene.world.dynamic_count() as f64 * pitch(scene) / speed + 10.0 * (height / g).sqrt()
}

/// Speed of the wave in an endless row, over sqrt(g h), for a thickness and a spacing over the height h: the train of van Leeuwen, "The domino
/// effect", American Journal of Physics 78, 721, 2010, without friction. Dominoes turn about their edges; each that fell leans on the next one,
/// so that the tilt of the first one of the train gives all others and energy stays; and the train meets the next one without rebound.
fn speed(thickness: f64, spacing: f64) -> f64 {
    /// Dominoes of a train: those further back are at rest.
    const TRAIN: usize = 40;
    /// Intervals of the tilt, and dominoes that fall before the speed is taken.
    const INTERVALS: usize = 200;
    const FALLS: usize = 60;
    let pitch = spacing + thickness;
    // For mass, height and gravity of 1: moment of inertia about the edge.
    let inertia = (1.0 + thickness * thickness) / 3.0;
    // Sum of squares of the tilts' derivatives by the first tilt, and potential energy, of a train whose first one has a tilt.
    let train = |first: f64| {
        let (mut tilt, mut by, mut squares, mut potential) = (first, 1.0, 0.0, 0.0);
        for _ in 0..TRAIN {
            squares += by * by;
            let (sin, cos) = libm::sincos(tilt);
            potential += 0.5 * (cos + thickness * sin);
            // The edge of the one behind is on its face: sin(next - tilt) = pitch cos(tilt) - thickness.
            let lean = libm::asin(pitch * cos - thickness);
            by *= 1.0 - pitch * sin / libm::cos(lean);
            tilt += lean;
        }
        (squares, potential)
    };
    let last = libm::asin(spacing);
    let path: Vec<_> = (0..=INTERVALS).map(|k| train(last * k as f64 / INTERVALS as f64)).collect();
    let rate = |energy: f64, k: usize| (2.0 * (energy - path[k].1) / (inertia * path[k].0)).sqrt();
    // Where the first one stands still, the train behind alone has energy; it shares its momentum with the first one when they meet.
    let (mut spin, mut time) = (1.0, f64::NAN);
    for _ in 0..FALLS {
        let energy = 0.5 * inertia * path[0].0 * spin * spin + path[0].1;
        // By the middle of each interval.
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

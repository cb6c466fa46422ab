//! parry's answer for one pair of convex shapes, and a second opinion where the first is known to go wrong.

use parry3d::math::Pose;
use parry3d::query::details::contact_manifold_cuboid_cuboid;
use parry3d::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher};
use parry3d::shape::SharedShape;

/// parry's manifold, with nothing of ours in it.
pub(super) type Found = ContactManifold<(), ()>;

/// Overlap from which an answer is checked, relative to the thinner shape's smallest half extent.
const DEEP: f32 = 0.05;
/// How far the shapes are pushed apart for the second opinion, likewise.
const PUSH: f32 = 0.02;

/// Finds the contact of two convex shapes up to the distance `look`; b's pose is `pos12` as seen from a. `size` is the smallest
/// half extent of the thinner one.
///
/// Hulls that touch exactly, as the stones of an arch do, leave parry's search without a direction, and it can answer with
/// any: overlaps of a meter between stones that only touch. A deep answer is therefore asked for again with the shapes pushed
/// a little apart, along the line of their middles, and the shallower of the two is taken: true overlap stays deep.
pub(super) fn convex_contact(
    (a, b): (&SharedShape, &SharedShape),
    pos12: &Pose,
    look: f32,
    size: f32,
    found: &mut Found,
    again: &mut Found,
) {
    empty(found);
    if let (Some(box_a), Some(box_b)) = (a.as_cuboid(), b.as_cuboid()) {
        return contact_manifold_cuboid_cuboid(pos12, box_a, box_b, look, found);
    }
    // Every pair of convex shapes is supported.
    let ask = |pos12: &Pose, look: f32, found: &mut Found| {
        let _ = DefaultQueryDispatcher.contact_manifold_convex_convex(pos12, &**a, &**b, None, None, look, found);
    };
    ask(pos12, look, found);
    let depth = deepest(found);
    if depth > -DEEP * size || a.as_halfspace().is_some() || b.as_halfspace().is_some() {
        return;
    }
    let middles = *pos12 * b.compute_local_aabb().center() - a.compute_local_aabb().center();
    let Some(away) = middles.try_normalize() else { return };
    let push = PUSH * size;
    let mut apart = *pos12;
    apart.translation += away * push;
    empty(again);
    ask(&apart, look + push, again);
    let pushed = push * again.local_n1.dot(away);
    if deepest(again) - pushed > depth + PUSH * size {
        again.points.iter_mut().for_each(|p| p.dist -= pushed);
        std::mem::swap(found, again);
    }
}

/// Makes a manifold as good as new, but for the memory of its points. parry's own `clear` leaves the normal, from which its search
/// then starts: what one pair touches with would depend on the pair before it, and so on the number of threads.
fn empty(manifold: &mut Found) {
    let mut points = std::mem::take(&mut manifold.points);
    points.clear();
    *manifold = Found { points, ..Found::new() };
}

/// Separation of the deepest point; infinite without points.
fn deepest(manifold: &Found) -> f32 {
    manifold.points.iter().map(|p| p.dist).fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d::math::Vector;

    /// A wedge of a ring between two angles, inner radius 0.9 and outer 1, 0.5 deep.
    fn stone(from: f32, to: f32) -> SharedShape {
        let corner = |angle: f32, radius: f32, z: f32| Vector::new(radius * angle.cos(), radius * angle.sin(), z);
        let mut points = Vec::new();
        for angle in [from, to] {
            for radius in [0.9, 1.0] {
                points.extend([corner(angle, radius, -0.25), corner(angle, radius, 0.25)]);
            }
        }
        SharedShape::convex_hull(&points).expect("a wedge has volume")
    }

    #[test]
    fn stones_that_touch_exactly_touch_and_do_not_overlap() {
        let mut worst = 0.0_f32;
        for count in 7..40 {
            let width = std::f32::consts::PI / count as f32;
            for i in 0..count - 1 {
                let angle = |k: i32| width * k as f32;
                let (a, b) = (stone(angle(i), angle(i + 1)), stone(angle(i + 1), angle(i + 2)));
                let (mut found, mut again) = (Found::new(), Found::new());
                convex_contact((&a, &b), &Pose::IDENTITY, 0.002, 0.05, &mut found, &mut again);
                let depth = deepest(&found);
                assert!(depth.is_finite(), "{count} stones, joint {i}: no contact");
                worst = worst.max(-depth);
            }
        }
        // As exact as parry is for shapes a little apart.
        assert!(worst < 1e-3, "{worst} m of overlap between stones that only touch");
    }

    /// The scratch of a thread goes from pair to pair, and which pair comes before depends on the number of threads.
    #[test]
    fn an_answer_does_not_depend_on_the_pair_before_it() {
        let width = std::f32::consts::PI / 17.0;
        let angle = |k: i32| width * k as f32;
        let answer = |found: &mut Found, again: &mut Found, i: i32| {
            let (a, b) = (stone(angle(i), angle(i + 1)), stone(angle(i + 1), angle(i + 2)));
            convex_contact((&a, &b), &Pose::IDENTITY, 0.002, 0.05, found, again);
            let points = found.points.iter().map(|p| (p.local_p1, p.local_p2, p.dist, p.fid1, p.fid2));
            (found.local_n1, found.local_n2, points.collect::<Vec<_>>())
        };
        let (mut found, mut again) = (Found::new(), Found::new());
        for i in 0..15 {
            let after_another = answer(&mut found, &mut again, i);
            assert_eq!(after_another, answer(&mut Found::new(), &mut Found::new(), i), "joint {i}");
        }
    }

    #[test]
    fn true_overlap_stays_as_deep_as_it_is() {
        let (a, b) = (SharedShape::cylinder(0.5, 0.5), SharedShape::cylinder(0.5, 0.5));
        let (mut found, mut again) = (Found::new(), Found::new());
        let pos12 = Pose::translation(0.0, 0.8, 0.0);
        convex_contact((&a, &b), &pos12, 0.02, 0.5, &mut found, &mut again);
        assert!((deepest(&found) + 0.2).abs() < 1e-3, "{} m", deepest(&found));
    }
}

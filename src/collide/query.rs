//! Parry's result for one pair of convex shapes, and a second computation for cases in which parry is known to be
//! wrong.

use glam::Vec3;
use parry3d::math::Pose;
use parry3d::query::TrackedContact;
use parry3d::shape::{PackedFeatureId, SharedShape};

use super::ascent::ascend;
use super::facet::half_space_contact;
use super::solid::{
    ClipBuffers, ContactQuery, DEEP, EXACT, PUSH, ParryManifold, Solid, add_above, ask, clip_to, has_rim,
};

/// Largest error of a distance along its normal, relative to the smallest half extent of the thinner shape.
pub(super) const TRUE: f32 = 0.01;
/// The same for contacts at a rim.
const RIM: f32 = 0.004;
/// Distance by which solids with a rim are pushed apart, relative to the smallest half extent of the thinner shape.
const APART: f32 = 0.1;
/// One minus the cosine of the angle up to which two directions are equal: 0.6 degrees.
const SAME: f32 = 5e-5;

/// Finds the contact of two convex shapes up to the distance `prediction`. `pos12` is the pose of b in the frame of a.
///
/// For hulls that touch exactly, like the stones of an arch, parry's search has no direction and can return any:
/// overlaps of a meter between stones that only touch. A cone on a cuboid can get the direction to the cuboid's other
/// side. The distance along a normal has a closed form. If a result is deep, or differs from the distance along its own
/// normal, it is compared with two more results: one with the shapes pushed a little apart along the line of their
/// middles, and one across the best face of either shape. No direction gives more than the true distance, so the
/// largest distance wins. The contacts of two cuboids come from [`cuboids`](super::cuboids).
pub(super) fn convex_contact(
    (a, b): (&SharedShape, &SharedShape),
    pos12: &Pose,
    search: ContactQuery,
    buffers: &mut ClipBuffers,
) -> ParryManifold {
    let ContactQuery { prediction, size } = search;
    let mut found = ParryManifold::new();
    // A half-space reaches further than any other shape.
    if let Some(plane) = a.as_halfspace() {
        if half_space_contact(plane.normal, &**b, pos12, buffers, &mut found).is_none() {
            ask((&**a, &**b), pos12, None, search, &mut found);
        }
        return found;
    }
    ask((&**a, &**b), pos12, None, search, &mut found);
    let (Some(map_a), Some(map_b)) = (a.as_support_map(), b.as_support_map()) else { return found };
    let gap = |d: Vec3| {
        let own = pos12.rotation.inverse() * -d;
        *pos12 * map_b.local_support_point(own) - map_a.local_support_point(d)
    };
    let along = |d: Vec3| d.dot(gap(d));
    let is_true = |found: &ParryManifold, distance: f32| {
        if found.points.is_empty() { distance > prediction } else { (deepest(found) - distance).abs() < TRUE * size }
    };
    let mut best = along(found.local_n1);
    let mut found_is_true = is_true(&found, best);
    let rims = has_rim(&**a) || has_rim(&**b);
    if found_is_true && best > -DEEP * size && (found.points.is_empty() || !rims) {
        return found;
    }
    // If the points are wrong, other points along an equally good direction are better.
    let is_better =
        |distance: f32, best: f32, is_true: bool| distance > best + if is_true { PUSH } else { -TRUE } * size;
    let ask_apart = |away: Vec3, push: f32| {
        let mut apart = *pos12;
        apart.translation += away * push;
        let mut again = ParryManifold::new();
        ask((&**a, &**b), &apart, None, ContactQuery { prediction: prediction + push, size }, &mut again);
        let pushed = push * again.local_n1.dot(away);
        again.points.iter_mut().for_each(|p| p.dist -= pushed);
        again
    };
    let is_deep = !found_is_true || best < -DEEP * size;
    let middles = *pos12 * b.compute_local_aabb().center() - a.compute_local_aabb().center();
    if let Some(away) = middles.try_normalize().filter(|_| is_deep) {
        let again = ask_apart(away, PUSH * size);
        let distance = along(again.local_n1);
        if is_better(distance, best, found_is_true) && is_true(&again, distance) {
            (found, best, found_is_true) = (again, distance, true);
        }
    }
    let (Some(solid_a), Some(solid_b)) = (Solid::new(&**a, Pose::IDENTITY), Solid::new(&**b, *pos12)) else {
        return found;
    };
    let mut across = None;
    let mut consider = |d: Vec3, of_b: bool| {
        let distance = along(d);
        // Prefer a face, if the solids are as far apart across it as across any direction.
        let slack = if across.is_none() { TRUE } else { EXACT } * size;
        let is_same = rims && d.dot(found.local_n1) > 1.0 - SAME && distance > best - slack;
        if is_same || is_better(distance, best, found_is_true) {
            (best, found_is_true, across) = (distance, true, Some((d, of_b)));
        }
    };
    solid_a.each_normal(|normal| consider(normal, false));
    solid_b.each_normal(|normal| consider(-normal, true));
    if let Some((d, of_b)) = across {
        let face = if of_b {
            let mut face = face_contact(&solid_b, &solid_a, -d, search, buffers);
            flip(&mut face);
            face
        } else {
            face_contact(&solid_a, &solid_b, d, search, buffers)
        };
        let is_same = d.dot(found.local_n1) > 1.0 - SAME && is_true(&found, along(found.local_n1));
        if !face.points.is_empty() {
            found = face;
        } else if !is_same {
            found = point_contact([&solid_a, &solid_b], d, best, &found, TRUE * size);
            found.points.retain(|point| point.dist <= prediction);
        }
    }
    if !rims {
        return found;
    }
    let (distance, d) = ascend(found.local_n1.normalize_or(Vec3::Y), EXACT * size, gap);
    let is_as_far = |found: &ParryManifold| (deepest(found) - distance).abs() < RIM * size;
    if distance > prediction {
        found.points.clear();
    } else if !is_as_far(&found) {
        // If the solids are far enough apart, the search is exact.
        let apart = ask_apart(d, APART * size - distance.min(0.0));
        let is_true = is_as_far(&apart);
        found = if is_true { apart } else { point_contact([&solid_a, &solid_b], d, distance, &apart, RIM * size) };
    }
    found
}

/// The contact of two solids at one point, with their distance along the unit normal `d`: the nearest point of `found`,
/// if it has points. Both solids are in the frame of the first.
fn point_contact([a, b]: [&Solid; 2], d: Vec3, distance: f32, found: &ParryManifold, exact: f32) -> ParryManifold {
    let nearest = found.points.iter().min_by(|p, q| p.dist.total_cmp(&q.dist)).map(|point| point.local_p1);
    let top = a.furthest(d) + d * a.radius;
    let below = |at: Vec3| at + d * d.dot(top - at);
    let on_b = below(b.furthest(-d));
    let on_a = nearest.map_or(if a.is_near(on_b, exact) { on_b } else { top }, below);
    let on_b = b.pose.inverse_transform_point(on_a + d * distance);
    let unknown = PackedFeatureId::UNKNOWN;
    let mut contact = ParryManifold::new();
    (contact.local_n1, contact.local_n2) = (d, b.pose.rotation.inverse() * -d);
    contact.points.push(TrackedContact::new(on_a, on_b, unknown, unknown, distance));
    contact
}

/// Resets a manifold but keeps the memory of its points. Parry's own `clear` leaves the normal, and the next search
/// starts from it. The contact of one pair would then depend on the pair before it, and so on the number of threads.
pub(super) fn empty(manifold: &mut ParryManifold) {
    let mut points = std::mem::take(&mut manifold.points);
    points.clear();
    *manifold = ParryManifold { points, ..ParryManifold::new() };
}

/// The contact of `other` across the face of `solid` with the unit normal `face`; without points if `other` lies beside
/// the face.
fn face_contact(
    solid: &Solid,
    other: &Solid,
    face: Vec3,
    search: ContactQuery,
    buffers: &mut ClipBuffers,
) -> ParryManifold {
    let ClipBuffers { polygon, patch, unclipped, corners, .. } = buffers;
    solid.feature(face, patch);
    other.feature(-face, polygon);
    clip_to(polygon, unclipped, patch, face);
    other.corners(-face, corners);
    add_above(polygon, corners, patch, face);
    let origin = solid.furthest(face);
    let mut found = ParryManifold::new();
    found.local_n1 = solid.pose.rotation.inverse() * face;
    found.local_n2 = other.pose.rotation.inverse() * -face;
    let contacts = other.contacts(polygon, [face, face, origin]);
    found.points.extend(contacts.filter(|contact| contact.dist <= search.prediction));
    found.points.iter_mut().for_each(|point| point.local_p1 = solid.pose.inverse_transform_point(point.local_p1));
    found
}

/// The contact of `other` with `solid` along the unit normal `normal`, both in the frame of `solid`. If the normal is
/// not a face normal, the solid has a corner or an edge there.
pub(super) fn flush_contact(
    solid: &Solid,
    other: &Solid,
    (normal, is_face): (Vec3, bool),
    search: ContactQuery,
    ClipBuffers { polygon, patch, unclipped, corners, .. }: &mut ClipBuffers,
    found: &mut ParryManifold,
) {
    // Widen it a little, so that a point just between two shapes lies on one of them.
    let exact = EXACT * search.size;
    other.feature(-normal, polygon);
    if is_face {
        solid.feature(normal, patch);
        let middle = patch.iter().map(|corner| corner.0).sum::<Vec3>() / patch.len() as f32;
        patch.iter_mut().for_each(|corner| corner.0 += 1.5 * exact * (corner.0 - middle).normalize_or_zero());
        clip_to(polygon, unclipped, patch, normal);
        other.corners(-normal, corners);
        add_above(polygon, corners, patch, normal);
    }
    found.local_n1 = normal;
    found.local_n2 = other.pose.rotation.inverse() * -normal;
    let at = solid.furthest(normal);
    let contacts = other.contacts(polygon, [normal, normal, at]).filter(|contact| contact.dist <= search.prediction);
    found.points.extend(contacts.filter(|contact| is_face || solid.is_near(contact.local_p1, exact)));
}

/// Exchanges the two shapes.
pub(super) fn flip(found: &mut ParryManifold) {
    std::mem::swap(&mut found.local_n1, &mut found.local_n2);
    std::mem::swap(&mut found.subshape1, &mut found.subshape2);
    for point in &mut found.points {
        std::mem::swap(&mut point.local_p1, &mut point.local_p2);
        std::mem::swap(&mut point.fid1, &mut point.fid2);
    }
}

/// Separation of the deepest point; infinite without points.
fn deepest(manifold: &ParryManifold) -> f32 {
    manifold.points.iter().map(|p| p.dist).fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
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
                let search = ContactQuery { prediction: 0.002, size: 0.05 };
                let found = convex_contact((&a, &b), &Pose::IDENTITY, search, &mut ClipBuffers::default());
                let depth = deepest(&found);
                assert!(depth.is_finite(), "{count} stones, joint {i}: no contact");
                worst = worst.max(-depth);
            }
        }
        // Parry has about this error for shapes that are a little apart.
        assert!(worst < 1e-3, "{worst} m of overlap between stones that only touch");
    }

    /// A thread reuses its scratch memory for pair after pair. The pair before depends on the number of threads.
    #[test]
    fn an_answer_does_not_depend_on_the_pair_before_it() {
        let width = std::f32::consts::PI / 17.0;
        let angle = |k: i32| width * k as f32;
        let answer = |buffers: &mut ClipBuffers, i: i32| {
            let (a, b) = (stone(angle(i), angle(i + 1)), stone(angle(i + 1), angle(i + 2)));
            let search = ContactQuery { prediction: 0.002, size: 0.05 };
            let found = convex_contact((&a, &b), &Pose::IDENTITY, search, buffers);
            let points = found.points.iter().map(|p| (p.local_p1, p.local_p2, p.dist, p.fid1, p.fid2));
            (found.local_n1, found.local_n2, points.collect::<Vec<_>>())
        };
        let mut buffers = ClipBuffers::default();
        for i in 0..15 {
            let after_another = answer(&mut buffers, i);
            assert_eq!(after_another, answer(&mut ClipBuffers::default(), i), "joint {i}");
        }
    }

    /// A cone that stands on its base far from the middle of a floor.
    #[test]
    fn a_base_that_touches_a_wide_floor_does_not_overlap_it() {
        let (floor, cone) = (SharedShape::cuboid(68.5, 1.0, 68.5), SharedShape::cone(2.67e-2, 4.08e-2));
        let mut worst = 0.0_f32;
        for k in 0..1000 {
            let tilt = Vector::new((k as f32).sin(), 0.0, (1.7 * k as f32).cos()) * 4e-6;
            let turn = Quat::from_scaled_axis(tilt) * Quat::from_rotation_y(0.1 * k as f32);
            let at = Vector::new(0.38 + 0.01 * k as f32, 1.0 + 2.67e-2 - 1e-6, -2.92);
            let pos12 = Pose::from_parts(at, turn);
            let search = ContactQuery { prediction: 2e-3, size: 2.67e-2 };
            let found = convex_contact((&floor, &cone), &pos12, search, &mut ClipBuffers::default());
            worst = worst.max(-deepest(&found));
        }
        assert!(worst < 3e-5, "{worst} m");
    }

    #[test]
    fn true_overlap_stays_as_deep_as_it_is() {
        let (a, b) = (SharedShape::cylinder(0.5, 0.5), SharedShape::cylinder(0.5, 0.5));
        let pos12 = Pose::translation(0.0, 0.8, 0.0);
        let search = ContactQuery { prediction: 0.02, size: 0.5 };
        let found = convex_contact((&a, &b), &pos12, search, &mut ClipBuffers::default());
        assert!((deepest(&found) + 0.2).abs() < 1e-3, "{} m", deepest(&found));
    }
}

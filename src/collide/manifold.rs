//! A contact manifold that persists from step to step: at most four points, selected and matched deterministically.

use glam::{Quat, Vec3};

use crate::error::{Result, input};
use crate::math::{self, NormalMovement};
use crate::saved::{Archive, Saved};

/// Largest number of points of a manifold.
pub const MAX_POINTS: usize = 4;

/// One contact point, anchored on both bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ManifoldPoint {
    /// On the surface of a, in a's frame (m).
    pub anchor_a: Vec3,
    /// On the surface of b, in b's frame (m).
    pub anchor_b: Vec3,
    /// From the center of mass of a to the point midway between the surfaces, world axes (m).
    pub r_a: Vec3,
    /// From the center of mass of b to that point (m).
    pub r_b: Vec3,
    /// Distance along the normal when the manifold was computed, negative for overlap (m).
    pub separation: f32,
    /// parry's features of a and b; 0 if unknown.
    pub features: u64,
    /// Index of the same point in the manifold before, or `None` if the point is new.
    pub before: Option<u8>,
}

crate::saved::fields!(ManifoldPoint { anchor_a, anchor_b, r_a, r_b, separation, features, before });

/// The slot of a manifold that has no slot yet.
pub const NO_SLOT: u32 = u32::MAX;

/// The contact of two bodies over one pair of convex subshapes. A manifold without points has ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifold {
    /// Unit normal from a to b, world axes.
    pub normal: Vec3,
    /// Triangles or cells of composite shapes; (0, 0) for convex shapes.
    pub subshapes: (u32, u32),
    /// Radius of curvature of a's surface at the contact, 0 if flat or sharp (m).
    pub radius_a: f32,
    /// Radius of curvature of b's surface at the contact (m).
    pub radius_b: f32,
    /// The slot of its rows while it lasts, or [`NO_SLOT`] before it gets one. The manifold that replaces it keeps the
    /// slot.
    pub slot: u32,
    points: [ManifoldPoint; MAX_POINTS],
    count: u8,
}

impl Saved for Manifold {
    fn blank() -> Self {
        Self::new(Vec3::Y, (0, 0), &[])
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self { normal, subshapes, radius_a, radius_b, slot, points, count } = self;
        normal.walk(archive)?;
        subshapes.walk(archive)?;
        radius_a.walk(archive)?;
        radius_b.walk(archive)?;
        slot.walk(archive)?;
        count.walk(archive)?;
        let own = points.get_mut(..usize::from(*count)).ok_or_else(|| input!("a manifold of {count} points"))?;
        own.iter_mut().try_for_each(|point| point.walk(archive))
    }
}

impl Manifold {
    /// A manifold of at most four of the `candidates`.
    pub(super) fn new(normal: Vec3, subshapes: (u32, u32), candidates: &[ManifoldPoint]) -> Self {
        let mut points = [ManifoldPoint::default(); MAX_POINTS];
        let count = reduce(normal, candidates, &mut points);
        Self { normal, subshapes, radius_a: 0.0, radius_b: 0.0, slot: NO_SLOT, points, count: count as u8 }
    }

    /// Whether another manifold has the same bits, except for slots and the matches to earlier points.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        let numbers = |point: &ManifoldPoint| {
            let ManifoldPoint { anchor_a, anchor_b, r_a, r_b, separation, features, before: _ } = *point;
            let vectors = [anchor_a, anchor_b, r_a, r_b].map(|v| v.to_array().map(f32::to_bits));
            (vectors, separation.to_bits(), features)
        };
        let Self { normal, subshapes, radius_a, radius_b, slot: _, points: _, count: _ } = self;
        let same = |a: f32, b: f32| a.to_bits() == b.to_bits();
        (0..3).all(|k| same(normal[k], other.normal[k]))
            && *subshapes == other.subshapes
            && same(*radius_a, other.radius_a)
            && same(*radius_b, other.radius_b)
            && self.points().iter().map(numbers).eq(other.points().iter().map(numbers))
    }

    /// Its points.
    pub fn points(&self) -> &[ManifoldPoint] {
        &self.points[..self.count as usize]
    }

    /// Ends the manifold: it loses its points, and its slot is free for another one.
    pub(super) fn end(&mut self) {
        self.count = 0;
    }

    /// Keeps the points for which `kept` is true. The points of a reused manifold have the impulses at their own
    /// places.
    pub(super) fn keep(&mut self, kept: &[bool; MAX_POINTS], is_reused: bool) {
        let mut count = 0;
        for k in (0..usize::from(self.count)).filter(|&k| kept[k]) {
            let before = if is_reused { Some(k as u8) } else { self.points[k].before };
            self.points[count] = ManifoldPoint { before, ..self.points[k] };
            count += 1;
        }
        self.count = count as u8;
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.count == 0
    }

    /// Displacement of the points along the normal if the center of b moves by `drift` relative to that of a, and each
    /// body turns.
    pub(super) fn movement(&self, drift: Vec3, turns: [Quat; 2]) -> impl Fn(&ManifoldPoint) -> f32 + use<> {
        let vector = |v: Vec3| math::Vec3::<f32>::load(v.to_array());
        let [turn_a, turn_b] = turns.map(|turn| math::Quat::load(turn.to_array()));
        let normal = vector(self.normal);
        let movement = NormalMovement::new(normal, vector(drift), turn_a, turn_b);
        let movement = movement.round(normal, self.radius_a, self.radius_b);
        move |point| movement.between(vector(point.r_a), vector(point.r_b))
    }

    /// Converts separations at the time of impact to separations at the start of the step. The bodies move by `drift`
    /// and `turns` in between.
    pub(super) fn carry_back(&mut self, drift: Vec3, turns: [Quat; 2]) {
        let movement = self.movement(drift, turns);
        self.points[..self.count as usize].iter_mut().for_each(|point| point.separation -= movement(point));
    }

    /// Raises separations to at least these values.
    pub(super) fn give_way(&mut self, least: [f32; MAX_POINTS]) {
        let points = self.points[..self.count as usize].iter_mut().zip(least);
        points.for_each(|(point, least)| point.separation = point.separation.max(least));
    }

    /// Takes over the slot of the same contact one step earlier. Points match by feature. If that fails, they match by
    /// nearness within `distance` (m): two aligned boxes share no feature after their offset changes sign.
    pub(super) fn succeed(&mut self, old: &Self, distance: f32) {
        self.slot = old.slot;
        let mut taken = [false; MAX_POINTS];
        for point in &mut self.points[..self.count as usize] {
            let same = |o: &ManifoldPoint| o.features == point.features && point.features != 0;
            if let Some(j) = (0..old.points().len()).find(|&j| !taken[j] && same(&old.points[j])) {
                point.before = Some(j as u8);
                taken[j] = true;
            }
        }
        for point in self.points[..self.count as usize].iter_mut().filter(|point| point.before.is_none()) {
            let apart = |o: &ManifoldPoint| {
                let on_a = o.anchor_a.distance_squared(point.anchor_a);
                on_a.min(o.anchor_b.distance_squared(point.anchor_b))
            };
            let free = (0..old.points().len()).filter(|&j| !taken[j]);
            let nearest = free.map(|j| (apart(&old.points[j]), j)).min_by(|x, y| x.0.total_cmp(&y.0));
            if let Some((_, j)) = nearest.filter(|n| n.0 <= distance * distance) {
                point.before = Some(j as u8);
                taken[j] = true;
            }
        }
    }
}

/// Keeps at most four candidates: the deepest, the furthest from it, the one that spans the widest triangle with both,
/// and the one that adds most area. Ties go to the smaller arm, so the order of arrival does not matter.
fn reduce(normal: Vec3, candidates: &[ManifoldPoint], kept: &mut [ManifoldPoint; MAX_POINTS]) -> usize {
    if candidates.len() <= MAX_POINTS {
        kept[..candidates.len()].copy_from_slice(candidates);
        return candidates.len();
    }
    let best = |score: &dyn Fn(&ManifoldPoint) -> f32| {
        let order = |p: &ManifoldPoint, q: &ManifoldPoint| {
            let (p_at, q_at) = (p.r_a.to_array(), q.r_a.to_array());
            score(p).total_cmp(&score(q)).then_with(|| q_at.partial_cmp(&p_at).unwrap_or(std::cmp::Ordering::Equal))
        };
        *candidates.iter().max_by(|p, q| order(p, q)).expect("there are candidates")
    };
    // Twice the signed area of the triangle, seen along the normal.
    let area = |p: Vec3, q: Vec3, r: Vec3| (q - p).cross(r - p).dot(normal);
    let deepest = best(&|p| -p.separation);
    let a = deepest.r_a;
    let furthest = best(&|p| p.r_a.distance_squared(a));
    let b = furthest.r_a;
    let widest = best(&|p| area(a, b, p.r_a).abs());
    let c = widest.r_a;
    let side = area(a, b, c);
    if side == 0.0 {
        // All lie on one line: its ends carry the whole load.
        kept[0] = deepest;
        kept[1] = furthest;
        return 2;
    }
    // Area that a point adds outside the triangle, beyond the edge that separates the point from it.
    let gain = |p: &ManifoldPoint| {
        let s = side.signum();
        let q = p.r_a;
        (-s * area(a, b, q)).max(-s * area(b, c, q)).max(-s * area(c, a, q))
    };
    let last = best(&gain);
    kept[..3].copy_from_slice(&[deepest, furthest, widest]);
    if gain(&last) > 0.0 {
        kept[3] = last;
        return 4;
    }
    3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f32, z: f32, separation: f32) -> ManifoldPoint {
        let at = Vec3::new(x, 0.0, z);
        ManifoldPoint { anchor_a: at, anchor_b: at, r_a: at, separation, ..Default::default() }
    }

    fn before(manifold: &Manifold) -> Vec<Option<u8>> {
        manifold.points().iter().map(|p| p.before).collect()
    }

    fn octagon() -> Vec<ManifoldPoint> {
        let corner = |i: i32| {
            let (s, c) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
            point(c, s, -0.001 * i as f32)
        };
        (0..8).map(corner).collect()
    }

    #[test]
    fn eight_points_become_four_that_span_nearly_all_of_their_area() {
        let m = Manifold::new(Vec3::Y, (0, 0), &octagon());
        assert_eq!(m.points().len(), 4);
        assert!(m.points().iter().any(|p| p.separation == -0.007), "the deepest is kept");
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| m.points()[i].anchor_a);
        // Deepest and furthest are a diagonal, the other two lie on its two sides.
        let area = 0.5 * ((b - a).cross(c - a).length() + (b - a).cross(d - a).length());
        assert!(area > 1.9, "{area} of the 2.83 of the octagon; a square has 2");
    }

    #[test]
    fn the_choice_does_not_depend_on_the_order_of_arrival() {
        let mut points = octagon();
        let sorted = |m: Manifold| {
            let mut v: Vec<_> = m.points().iter().map(|p| p.anchor_a.to_array()).collect();
            v.sort_by(|a, b| a.partial_cmp(b).unwrap());
            v
        };
        let first = sorted(Manifold::new(Vec3::Y, (0, 0), &points));
        for _ in 0..8 {
            points.rotate_left(1);
            points.swap(0, 3);
            assert_eq!(first, sorted(Manifold::new(Vec3::Y, (0, 0), &points)));
        }
    }

    #[test]
    fn points_match_by_feature_then_by_position_and_never_twice() {
        let mut old = Manifold::new(Vec3::Y, (0, 0), &[point(0.0, 0.0, 0.0), point(1.0, 0.0, 0.0)]);
        old.points[0].features = 7;
        // The first moved far but kept its feature, the second kept its position, the third is new.
        let mut moved = [point(0.5, 0.0, 0.0), point(1.001, 0.0, 0.0), point(1.002, 0.0, 0.0)];
        moved[0].features = 7;
        let mut new = Manifold::new(Vec3::Y, (0, 0), &moved);
        new.succeed(&old, 0.01);
        assert_eq!(before(&new), [Some(0), Some(1), None]);
    }

    #[test]
    fn a_manifold_computed_anew_has_the_slot_of_the_old_one() {
        let mut old = Manifold::new(Vec3::Y, (0, 0), &[point(0.0, 0.0, 0.0)]);
        old.slot = 5;
        let mut new = Manifold::new(Vec3::Y, (0, 0), &[point(0.001, 0.0, 0.0)]);
        assert_eq!((new.slot, before(&new)), (NO_SLOT, vec![None]));
        new.succeed(&old, 0.01);
        assert_eq!((new.slot, before(&new)), (5, vec![Some(0)]));
    }

    #[test]
    fn points_that_are_kept_know_where_their_impulses_are() {
        let mut computed = Manifold::new(Vec3::Y, (0, 0), &octagon()[..4]);
        computed.points[3].before = Some(1);
        for (is_reused, expected) in [(false, [None, Some(1)]), (true, [Some(1), Some(3)])] {
            let mut m = computed.clone();
            m.keep(&[false, true, false, true], is_reused);
            assert_eq!(before(&m), expected);
            assert_eq!([0, 1].map(|k| m.points()[k].anchor_a), [1, 3].map(|k| computed.points()[k].anchor_a));
        }
    }

    #[test]
    fn points_in_a_line_become_its_ends() {
        let points = [0.0, 1.0, 2.0, 3.0, 4.0].map(|x| point(x, 0.0, -0.001));
        let m = Manifold::new(Vec3::Y, (0, 0), &points);
        let mut ends: Vec<f32> = m.points().iter().map(|p| p.anchor_a.x).collect();
        ends.sort_by(f32::total_cmp);
        assert_eq!(ends, [0.0, 4.0]);
    }

    #[test]
    fn a_point_that_was_matched_by_its_feature_is_not_matched_again_by_its_place() {
        let mut old = Manifold::new(Vec3::Y, (0, 0), &[point(0.0, 0.0, 0.0)]);
        old.points[0].features = 7;
        let mut moved = [point(0.5, 0.0, 0.0), point(0.001, 0.0, 0.0)];
        moved[0].features = 7;
        let mut new = Manifold::new(Vec3::Y, (0, 0), &moved);
        new.succeed(&old, 0.01);
        assert_eq!(before(&new), [Some(0), None]);
    }
}

//! Convex solids seen from a direction: their support points and faces.

use glam::Vec3;
use parry3d::math::Pose;
use parry3d::query::details::{NormalConstraints, contact_manifold_pfm_pfm};
use parry3d::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher, TrackedContact};
use parry3d::shape::{PackedFeatureId, PolygonalFeature, PolygonalFeatureMap, Shape, SupportMap, TypedShape};

use super::rim::RimScratch;

/// parry's manifold, without data of drystone.
pub(super) type ParryManifold = ContactManifold<(), ()>;

/// Overlap from which a result is checked, relative to the smallest half extent of the thinner shape.
pub(super) const DEEP: f32 = 0.05;
/// Distance by which shapes are pushed apart for a second result, relative to the smallest half extent of the thinner
/// shape.
pub(super) const PUSH: f32 = 0.02;
/// Smallest half extent (m) of the thinner shape of a pair that is large compared with parry's tolerances. They are
/// absolute: parry treats sides as parallel if they span less than 3.5 cm², and its search for a direction stops at a
/// triangle of 11 cm².
pub(super) const SMALL: f32 = 1.0 / 64.0;
/// Error of a distance, relative to the smallest half extent of the thinner shape.
pub(super) const EXACT: f32 = 1e-3;

/// Range of one query.
#[derive(Clone, Copy)]
pub(super) struct ContactQuery {
    /// Largest distance of a contact (m).
    pub prediction: f32,
    /// Smallest half extent of the thinner shape (m).
    pub size: f32,
}

/// A corner of a polygon, and the number that identifies it from step to step.
pub(super) type Corner = (Vec3, u32);

/// Reusable memory for clipped polygons.
#[derive(Default)]
pub(super) struct ClipBuffers {
    pub polygon: Vec<Corner>,
    pub patch: Vec<Corner>,
    pub unclipped: Vec<Corner>,
    pub corners: Vec<Corner>,
    pub rim: RimScratch,
}

/// Keeps the part of `polygon` with n · x <= `limit`. New corners are numbered by their edge and by `cut`.
pub(super) fn clip(polygon: &mut Vec<Corner>, unclipped: &mut Vec<Corner>, normal: Vec3, limit: f32, cut: u32) {
    std::mem::swap(polygon, unclipped);
    polygon.clear();
    let beyond = |corner: Corner| normal.dot(corner.0) - limit;
    for (i, &from) in unclipped.iter().enumerate() {
        let to = unclipped[(i + 1) % unclipped.len()];
        if beyond(from) <= 0.0 {
            polygon.push(from);
        }
        if (beyond(from) <= 0.0) != (beyond(to) <= 0.0) {
            // Cut from the inside out: a segment is a polygon with two corners, and both directions must cut it at the
            // same place.
            let (inside, outside) = if beyond(from) <= 0.0 { (from, to) } else { (to, from) };
            let share = beyond(inside) / (beyond(inside) - beyond(outside));
            let number = inside.1.wrapping_mul(31).wrapping_add(outside.1).wrapping_mul(8).wrapping_add(cut + 1);
            polygon.push((inside.0.lerp(outside.0, share), number));
        }
    }
    polygon.dedup_by_key(|corner| corner.0);
    if polygon.len() > 1 && polygon[0].0 == polygon[polygon.len() - 1].0 {
        polygon.pop();
    }
}

/// Keeps the part of `polygon` that lies above or below the polygon `base`, as seen along `normal`.
pub(super) fn clip_to(polygon: &mut Vec<Corner>, unclipped: &mut Vec<Corner>, base: &[Corner], normal: Vec3) {
    each_side(base, normal, |i, out, limit| clip(polygon, unclipped, out, limit, i));
}

/// Calls `with` on the number and the half-space n · x <= limit of each side of the prism over `base` along `normal`.
fn each_side(base: &[Corner], normal: Vec3, mut with: impl FnMut(u32, Vec3, f32)) {
    let next = |i: usize| base[(i + 1) % base.len()].0;
    // Parry's faces run around in either direction.
    let around: Vec3 = base.iter().enumerate().map(|(i, at)| (at.0 - base[0].0).cross(next(i) - base[0].0)).sum();
    let normal = if around.dot(normal) < 0.0 { -normal } else { normal };
    for (i, from) in base.iter().enumerate() {
        let out = (next(i) - from.0).cross(normal);
        with(i as u32, out, out.dot(from.0));
    }
}

/// Adds the corners of `more` that lie above or below `base`, as seen along `normal`, and are not in `polygon` yet.
pub(super) fn add_above(polygon: &mut Vec<Corner>, more: &[Corner], base: &[Corner], normal: Vec3) {
    for corner in more {
        let mut is_new = polygon.iter().all(|old| old.1 != corner.1);
        each_side(base, normal, |_, out, limit| is_new &= out.dot(corner.0) <= limit);
        if is_new {
            polygon.push(*corner);
        }
    }
}

/// A flat polygon.
pub(super) struct Patch<'a>(pub &'a [Corner]);

impl SupportMap for Patch<'_> {
    fn local_support_point(&self, d: Vec3) -> Vec3 {
        let furthest = self.0.iter().max_by(|p, q| p.0.dot(d).total_cmp(&q.0.dot(d)));
        furthest.map_or(Vec3::ZERO, |corner| corner.0)
    }
}

/// Factor by which a pair is enlarged for parry, if its thinner shape has the smallest half extent `size` (m): 1 from
/// [`SMALL`] on, otherwise a power of two, which causes no rounding.
pub(super) fn magnification(size: f32) -> f32 {
    const LEAST: f32 = 1.0 / (1 << 20) as f32;
    if size < SMALL { f32::from_bits(0x7f00_0000 - (size.max(LEAST).to_bits() & 0x7f80_0000)) } else { 1.0 }
}

/// A solid, enlarged by `by`.
pub(super) struct Magnified<'a, M: ?Sized> {
    pub map: &'a M,
    pub by: f32,
}

impl<M: SupportMap + ?Sized> SupportMap for Magnified<'_, M> {
    fn local_support_point(&self, d: Vec3) -> Vec3 {
        self.map.local_support_point(d) * self.by
    }
}

impl<M: PolygonalFeatureMap + ?Sized> PolygonalFeatureMap for Magnified<'_, M> {
    fn local_support_feature(&self, d: Vec3, feature: &mut PolygonalFeature) {
        self.map.local_support_feature(d, feature);
        feature.vertices.iter_mut().for_each(|corner| *corner *= self.by);
    }

    fn local_support_feature_toward(&self, d: Vec3, hint: Vec3, feature: &mut PolygonalFeature) {
        self.map.local_support_feature_toward(d, hint / self.by, feature);
        feature.vertices.iter_mut().for_each(|corner| *corner *= self.by);
    }
}

/// The center of a ball.
pub(super) struct Point;

impl SupportMap for Point {
    fn local_support_point(&self, _: Vec3) -> Vec3 {
        Vec3::ZERO
    }
}

impl PolygonalFeatureMap for Point {
    fn local_support_feature(&self, _: Vec3, feature: &mut PolygonalFeature) {
        *feature = PolygonalFeature { num_vertices: 1, ..PolygonalFeature::default() };
    }
}

/// A convex shape at a pose: a core that is rounded by `radius`.
pub(super) struct Solid<'a> {
    shape: &'a dyn Shape,
    pub map: &'a dyn PolygonalFeatureMap,
    pub radius: f32,
    pub pose: Pose,
}

impl<'a> Solid<'a> {
    /// Returns `None` for a ball.
    pub fn new(shape: &'a dyn Shape, pose: Pose) -> Option<Self> {
        let (map, radius) = shape.as_polygonal_feature_map()?;
        Some(Self { shape, map, radius, pose })
    }

    /// The same, with a ball as a rounded point.
    pub fn or_point(shape: &'a dyn Shape, pose: Pose) -> Option<Self> {
        let (map, radius) = features(shape, true)?;
        Some(Self { shape, map, radius, pose })
    }

    /// The support point of the solid in the direction `d`.
    pub fn furthest(&self, d: Vec3) -> Vec3 {
        self.pose * self.map.local_support_point(self.pose.rotation.inverse() * d)
    }

    /// Whether a point is in the solid, or no further from it than `distance`.
    pub fn is_near(&self, point: Vec3, distance: f32) -> bool {
        self.shape.distance_to_point(&self.pose, point, true) <= distance
    }

    /// Writes the face or edge of the solid that is most perpendicular to `d` at its support point.
    pub fn feature(&self, d: Vec3, polygon: &mut Vec<Corner>) {
        polygon.clear();
        let own = self.pose.rotation.inverse() * d;
        let Some(hull) = self.shape.as_convex_polyhedron() else {
            let mut feature = PolygonalFeature::default();
            self.map.local_support_feature(own, &mut feature);
            let corners = feature.vertices.iter().zip(feature.vids).take(feature.num_vertices);
            return polygon.extend(corners.map(|(&at, id)| (self.pose * at, id.0)));
        };
        // Parry returns only the first four corners of the face: a prism with eight sides would tip over them into the
        // floor.
        let points = hull.points();
        let furthest = (0..points.len()).max_by(|&i, &j| points[i].dot(own).total_cmp(&points[j].dot(own)));
        let Some(vertex) = furthest.map(|i| hull.vertices()[i]) else { return };
        let first = vertex.first_adj_face_or_edge as usize;
        let around = &hull.faces_adj_to_vertex()[first..first + vertex.num_adj_faces_or_edge as usize];
        let faces = around.iter().map(|&i| &hull.faces()[i as usize]);
        let Some(face) = faces.max_by(|f, g| f.normal.dot(own).total_cmp(&g.normal.dot(own))) else { return };
        let first = face.first_vertex_or_edge as usize;
        let corners = &hull.vertices_adj_to_face()[first..first + face.num_vertices_or_edges as usize];
        polygon.extend(corners.iter().map(|&i| (self.pose * points[i as usize], PackedFeatureId::vertex(i).0)));
    }

    /// Writes the corners beside the feature in the direction `d` that can touch next when the solid turns: tip and rim
    /// of a cone, both rims of a cylinder.
    pub fn corners(&self, d: Vec3, corners: &mut Vec<Corner>) {
        corners.clear();
        let own = self.pose.rotation.inverse() * d;
        let rim = |radius: f32| radius * Vec3::new(own.x, 0.0, own.z).normalize_or(Vec3::X);
        // The numbers are those of parry's features.
        let pair = |low: Vec3, high: Vec3| {
            [(low, 1), (high, 11)].map(|(at, i)| (self.pose * at, PackedFeatureId::vertex(i).0))
        };
        match self.shape.as_typed_shape() {
            TypedShape::Cylinder(c) => {
                corners.extend(pair(rim(c.radius) - c.half_height * Vec3::Y, rim(c.radius) + c.half_height * Vec3::Y));
            }
            TypedShape::Cone(c) => {
                corners.extend(pair(rim(c.radius) - c.half_height * Vec3::Y, c.half_height * Vec3::Y))
            }
            _ => {}
        }
    }

    /// Calls `with` on the normal of each flat face.
    pub fn each_normal(&self, mut with: impl FnMut(Vec3)) {
        let mut with = |own: Vec3| with(self.pose.rotation * own);
        match self.shape.as_typed_shape() {
            TypedShape::ConvexPolyhedron(hull) => hull.faces().iter().for_each(|face| with(face.normal)),
            TypedShape::Cuboid(_) => {
                Vec3::AXES.into_iter().for_each(|axis| [axis, -axis].into_iter().for_each(&mut with))
            }
            TypedShape::Cylinder(_) => [Vec3::Y, Vec3::NEG_Y].into_iter().for_each(with),
            TypedShape::Cone(_) => with(Vec3::NEG_Y),
            _ => {}
        }
    }

    /// The corners of `polygon`, a feature of the solid, as contacts along `normal` with the plane of `face` through
    /// `origin`. The first points lie in that plane. The second points lie on the solid, in its own frame.
    pub fn contacts<'b>(
        &'b self,
        polygon: &'b [Corner],
        [normal, face, origin]: [Vec3; 3],
    ) -> impl Iterator<Item = TrackedContact<()>> + 'b {
        polygon.iter().map(move |&(at, number)| {
            let height = face.dot(at - origin) / face.dot(normal);
            let on_surface = self.pose.inverse_transform_point(at - normal * self.radius);
            let features = [PackedFeatureId::face(0), PackedFeatureId(number)];
            TrackedContact::new(at - normal * height, on_surface, features[0], features[1], height - self.radius)
        })
    }
}

/// Whether a shape has a round rim. Parry's search stops too early on rims, and its other points can lie on the far side.
pub(super) fn has_rim(shape: &dyn Shape) -> bool {
    shape.as_cylinder().is_some() || shape.as_cone().is_some()
}

/// The core that a shape touches with, and its rounding radius. For a ball parry needs a search only beside a hull.
fn features(shape: &dyn Shape, has_hull: bool) -> Option<(&dyn PolygonalFeatureMap, f32)> {
    let ball = shape.as_ball().filter(|_| has_hull).map(|ball| (&Point as &dyn PolygonalFeatureMap, ball.radius));
    ball.or(shape.as_polygonal_feature_map())
}

/// Parry's result, with normals of a within `cone`. Every pair of convex shapes is supported.
pub(super) fn ask(
    (a, b): (&dyn Shape, &dyn Shape),
    pos12: &Pose,
    cone: Option<&dyn NormalConstraints>,
    ContactQuery { prediction, size }: ContactQuery,
    found: &mut ParryManifold,
) {
    let by = magnification(size);
    let has_hull = a.as_convex_polyhedron().is_some() || b.as_convex_polyhedron().is_some();
    let features = (features(a, has_hull), features(b, has_hull));
    let (true, (Some((a, radius_a)), Some((b, radius_b)))) = (by > 1.0, features) else {
        let _ = DefaultQueryDispatcher.contact_manifold_convex_convex(pos12, a, b, cone, None, prediction, found);
        return;
    };
    let pos12 = Pose::from_parts(pos12.translation * by, pos12.rotation);
    let [a, b] = [a, b].map(|map| Magnified { map, by });
    contact_manifold_pfm_pfm(&pos12, &a, radius_a * by, cone, &b, radius_b * by, None, prediction * by, found);
    for point in &mut found.points {
        (point.local_p1, point.local_p2, point.dist) = (point.local_p1 / by, point.local_p2 / by, point.dist / by);
    }
}

//! Tests of contacts against the true distance: the largest gap between the two shapes along any direction.

use glam::{DVec3, Quat, Vec3};
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;
use parry3d::shape::{SharedShape, SupportMap, Triangle, TypedShape};
use rayon::prelude::*;

use super::facet::{Normals, half_space_contact, triangle_contact};
use super::query::convex_contact;
use super::solid::{ClipBuffers, ContactQuery, ParryManifold, Solid};
use super::testing::Random;

/// Shapes of about a tenth of `scale` (m) with flat faces, edges, rims and tips.
fn solids(scale: f32) -> Vec<(&'static str, SharedShape)> {
    let prism = |sides: usize| -> Vec<Vec3> {
        let corner = |i: usize, y: f32| {
            let (s, c) = (i as f32 / sides as f32 * std::f32::consts::TAU).sin_cos();
            scale * Vec3::new(0.1 * c, y, 0.1 * s)
        };
        (0..sides).flat_map(|i| [corner(i, -0.06), corner(i, 0.06)]).collect()
    };
    vec![
        ("cuboid", SharedShape::cuboid(0.1 * scale, 0.07 * scale, 0.12 * scale)),
        ("capsule", SharedShape::capsule_y(0.1 * scale, 0.06 * scale)),
        ("cylinder", SharedShape::cylinder(0.08 * scale, 0.1 * scale)),
        ("cone", SharedShape::cone(0.1 * scale, 0.1 * scale)),
        ("prism", SharedShape::convex_hull(&prism(9)).expect("a prism")),
    ]
}

/// Half of the smallest side of all of them, over their size.
const SIZE: f32 = 0.06;
/// Sizes (m): ordinary shapes, and shapes of 0.4 mm.
const SIZES: [f32; 2] = [1.0, 1.0 / 256.0];

/// The largest gap over directions: an even grid first, then refinement around the best one.
fn true_distance(along: impl Fn(Vec3) -> f32) -> f32 {
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let spread = (0..2000).map(|i| {
        let y = 1.0 - (i as f32 + 0.5) / 1000.0;
        let (s, c) = (golden * i as f32).sin_cos();
        Vec3::new(c, 0.0, s) * (1.0 - y * y).sqrt() + Vec3::Y * y
    });
    let mut sorted: Vec<(f32, Vec3)> = spread.map(|d| (along(d), d)).collect();
    sorted.sort_by(|p, q| q.0.total_cmp(&p.0));
    let mut random = Random(7);
    let refined = sorted[..6].iter().map(|&(mut best, mut direction)| {
        let mut reach = 0.05;
        for _ in 0..400 {
            let d = (direction + reach * random.vector()).normalize();
            let distance = along(d);
            if distance > best {
                (best, direction) = (distance, d);
            } else {
                reach *= 0.98;
            }
        }
        best
    });
    refined.fold(f32::NEG_INFINITY, f32::max)
}

fn deepest(found: &ParryManifold) -> f32 {
    found.points.iter().map(|p| p.dist).fold(f32::INFINITY, f32::min)
}

/// Whether a contact has the true distance of the shapes. Returns `None` if they are further apart than a tenth of the
/// prediction, or deeper than a tenth of their size.
fn is_true(
    what: &str,
    found: &ParryManifold,
    distance: f32,
    ContactQuery { prediction, size }: ContactQuery,
) -> Option<bool> {
    if !(-0.1 * size..0.1 * prediction).contains(&distance) {
        return None;
    }
    let claimed = deepest(found);
    let is_true = (claimed - distance).abs() < 0.03 * size;
    if !is_true {
        println!("{what}: {claimed} m, and they are {distance} m apart");
    }
    Some(is_true)
}

/// The contact of a triangle with two sides.
fn contact_of(corners: [Vec3; 3], solid: &Solid, near: &Aabb, search: ContactQuery, found: &mut ParryManifold) {
    let buffers = &mut ClipBuffers::default();
    let normals = Normals { sides: &|| None, open: &mut |_, _, _, _| None, peak: &|_, _| None };
    triangle_contact(corners, normals, solid, near, search, buffers, found);
}

#[test]
fn a_triangle_is_as_far_from_a_solid_as_the_contact_says() {
    SIZES.into_iter().for_each(compare_triangles);
}

fn compare_triangles(s: f32) {
    let (mut random, mut compared) = (Random(1), Vec::new());
    let search = ContactQuery { prediction: 0.02 * s, size: SIZE * s };
    for (name, shape) in solids(s) {
        for case in 0..1500 {
            let corners = [0; 3].map(|_| 0.3 * s * random.vector());
            let pose = Pose::from_parts(0.15 * s * random.vector(), random.rotation());
            let solid = Solid::new(&*shape, pose).expect("no ball");
            let triangle = Triangle::new(corners[0], corners[1], corners[2]);
            if triangle.area() < 0.01 * s * s {
                continue;
            }
            let along = |d: Vec3| d.dot(solid.furthest(-d) - triangle.local_support_point(d)) - solid.radius;
            let near = shape.compute_aabb(&pose).loosened(search.prediction + search.size);
            let mut found = ParryManifold::new();
            contact_of(corners, &solid, &near, search, &mut found);
            let distance = true_distance(along);
            compared.extend(is_true(&format!("{name} {case}"), &found, distance, search));
        }
    }
    assert!(compared.len() > 250 && compared.iter().all(|is_true| *is_true), "{} compared", compared.len());
}

/// Parry's search returns a direction along which the cylinder overlaps by 0.23 m, and the face normal gives 0.17 m.
/// But the cylinder lies beside the triangle: its rim touches only the corner.
#[test]
fn a_cylinder_that_touches_the_corner_of_a_triangle_does_not_overlap_it() {
    let shape = SharedShape::cylinder(0.3092692, 0.3597973);
    let rotation = Quat::from_xyzw(-0.23126306, 0.07194007, 0.9665501, -0.08439781);
    let solid = Solid::new(&*shape, Pose::from_parts(Vec3::ZERO, rotation)).expect("no ball");
    let corners = [
        Vec3::new(-0.9351425, -0.080924034, 1.0832865),
        Vec3::new(-0.18514252, -0.38092405, 1.0832865),
        Vec3::new(-0.18514252, -0.28092405, 0.33328652),
    ];
    let search = ContactQuery { prediction: 0.012370767, size: 0.3092692 };
    let near = shape.compute_aabb(&solid.pose).loosened(search.prediction + search.size);
    let mut found = ParryManifold::new();
    contact_of(corners, &solid, &near, search, &mut found);
    let [a, b, c] = corners;
    let triangle = Triangle::new(a, b, c);
    let distance = true_distance(|d| d.dot(solid.furthest(-d) - triangle.local_support_point(d)));
    assert!(distance.abs() < 2e-4, "{distance} m");
    assert!((deepest(&found) - distance).abs() < 1e-3, "{} m, and they are {distance} m apart", deepest(&found));
}

#[test]
fn two_solids_are_as_far_apart_as_the_contact_says() {
    SIZES.into_iter().for_each(compare_solids);
}

fn compare_solids(s: f32) {
    // Pairs without a round rim, and pairs with one.
    let (mut random, mut compared) = (Random(2), [Vec::new(), Vec::new()]);
    let has_rim = |name: &str| ["cylinder", "cone"].contains(&name);
    let search = ContactQuery { prediction: 0.02 * s, size: SIZE * s };
    let mut others = solids(s);
    others.push(("block", SharedShape::cuboid(0.4 * s, 0.2 * s, 0.4 * s)));
    let mut seconds = solids(s);
    if s < 1.0 {
        // Parry's result for larger balls beside hulls is up to 3.5 mm off.
        seconds.push(("ball", SharedShape::ball(0.06 * s)));
    }
    for (name, a) in &others {
        for (name_b, b) in &seconds {
            for case in 0..200 {
                let direction = random.vector().normalize();
                let rotation = random.rotation();
                // The distance at which they touch along some direction, more or less.
                let reach = |shape: &SharedShape, d: Vec3| {
                    shape.as_support_map().expect("convex").local_support_point(d).dot(d)
                };
                let touching = reach(a, direction) + reach(b, rotation.inverse() * -direction);
                let pos12 = Pose::from_parts(direction * (touching + 0.01 * s * random.next()), rotation);
                let (map_a, map_b) = (a.as_support_map().expect("convex"), b.as_support_map().expect("convex"));
                let along = |d: Vec3| {
                    d.dot(
                        pos12 * map_b.local_support_point(pos12.rotation.inverse() * -d) - map_a.local_support_point(d),
                    )
                };
                let found = convex_contact((a, b), &pos12, search, &mut ClipBuffers::default());
                let distance = true_distance(along);
                let what = format!("{name} and {name_b} {case}");
                let rims = usize::from(has_rim(name) || has_rim(name_b));
                compared[rims].extend(is_true(&what, &found, distance, search));
            }
        }
    }
    let [plain, rims] = compared.map(|all| [all.len(), all.iter().filter(|is_true| !**is_true).count()]);
    println!("{s} times the size: {} of {} without rims wrong, {} of {} with", plain[1], plain[0], rims[1], rims[0]);
    assert!(plain[0] > 100 && rims[0] > 100 && plain[1] == 0);
    assert_eq!(rims[1], 0, "{} of {} with rims wrong", rims[1], rims[0]);
}

/// The furthest point of a solid in a direction, in its own frame.
fn furthest(shape: &SharedShape, d: DVec3) -> DVec3 {
    let rim = |radius: f32| f64::from(radius) * DVec3::new(d.x, 0.0, d.z).normalize_or_zero();
    let end = |half_height: f32| f64::from(half_height) * DVec3::Y;
    let best = |corners: &mut dyn Iterator<Item = DVec3>| {
        corners.max_by(|p, q| p.dot(d).total_cmp(&q.dot(d))).expect("a corner")
    };
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => f64::from(ball.radius) * d.normalize(),
        TypedShape::Cuboid(cuboid) => cuboid.half_extents.as_dvec3() * d.signum(),
        TypedShape::Capsule(capsule) => {
            let ends = [capsule.segment.a, capsule.segment.b].map(|end| end.as_dvec3());
            best(&mut ends.into_iter()) + f64::from(capsule.radius) * d.normalize()
        }
        TypedShape::Cylinder(c) => end(c.half_height) * d.y.signum() + rim(c.radius),
        TypedShape::Cone(c) => best(&mut [end(c.half_height), rim(c.radius) - end(c.half_height)].into_iter()),
        TypedShape::ConvexPolyhedron(hull) => best(&mut hull.points().iter().map(|p| p.as_dvec3())),
        _ => unreachable!("no such solid here"),
    }
}

/// The largest gap over directions, in double precision: a dense grid first, then refinement around each of the best.
fn sampled_distance(along: impl Fn(DVec3) -> f64, directions: &[DVec3]) -> f64 {
    let mut sorted: Vec<(f64, DVec3)> = directions.iter().map(|&d| (along(d), d)).collect();
    sorted.sort_by(|p, q| q.0.total_cmp(&p.0));
    let mut random = Random(7);
    let mut starts: Vec<(f64, DVec3)> = Vec::new();
    for (distance, d) in sorted {
        if starts.len() < 8 && starts.iter().all(|start| start.1.dot(d) < 0.995) {
            starts.push((distance, d));
        }
    }
    let refined = starts.into_iter().map(|(mut best, mut direction)| {
        let mut reach = 0.05;
        while reach > 1e-6 {
            let d = (direction + reach * random.vector().as_dvec3()).normalize();
            let distance = along(d);
            if distance > best {
                (best, direction) = (distance, d);
            } else {
                reach *= 0.97;
            }
        }
        best
    });
    refined.fold(f64::NEG_INFINITY, f64::max)
}

/// Contacts of cylinders and cones of 0.1 m with every solid are within 0.5 mm of the true distance.
#[test]
fn rims_are_as_far_apart_as_dense_sampling_says() {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let spread = (0..10_000).map(|i| {
        let y = 1.0 - (f64::from(i) + 0.5) / 5_000.0;
        let (s, c) = (golden * f64::from(i)).sin_cos();
        DVec3::new(c, 0.0, s) * (1.0 - y * y).sqrt() + DVec3::Y * y
    });
    let directions: Vec<DVec3> = spread.collect();
    let search = ContactQuery { prediction: 0.02, size: SIZE };
    let all = [solids(1.0), vec![("ball", SharedShape::ball(0.06))]].concat();
    let round = all.iter().filter(|(name, _)| ["cylinder", "cone"].contains(name));
    let pairs: Vec<_> = round.flat_map(|a| all.iter().map(move |b| (a, b))).collect();
    let case = |case: usize| {
        let (mut random, ((name, a), (name_b, b))) = (Random(1000 * case as u64), pairs[case % pairs.len()]);
        let (direction, rotation) = (random.vector().normalize(), random.rotation());
        let reach = |shape: &SharedShape, d: Vec3| furthest(shape, d.as_dvec3()).dot(d.as_dvec3()) as f32;
        let touching = reach(a, direction) + reach(b, rotation.inverse() * -direction);
        let pos12 = Pose::from_parts(direction * (touching + 0.005 * (random.next() - 1.0)), rotation);
        let (at, turn) = (pos12.translation.as_dvec3(), pos12.rotation.as_dquat().normalize());
        let along = |d: DVec3| d.dot(at + turn * furthest(b, turn.inverse() * -d) - furthest(a, d));
        let distance = sampled_distance(along, &directions);
        // Keep shallow overlaps, and distances below a tenth of the prediction.
        if !(-0.1 * f64::from(SIZE)..0.002).contains(&distance) {
            return None;
        }
        let found = convex_contact((a, b), &pos12, search, &mut ClipBuffers::default());
        let error = (f64::from(deepest(&found)) - distance).abs();
        if error > 5e-4 {
            println!("{name} and {name_b} {case}: {} m, and they are {distance} m apart", deepest(&found));
        }
        Some(error)
    };
    let errors: Vec<f64> = (0..5500).into_par_iter().filter_map(case).collect();
    let wrong = errors.iter().filter(|error| error.is_nan() || **error > 5e-4).count();
    let worst = errors.iter().copied().fold(0.0, f64::max);
    println!("{wrong} of {} wrong, the worst by {:.2} mm", errors.len(), 1e3 * worst);
    assert!(errors.len() >= 1000 && wrong == 0, "{wrong} of {} wrong, the worst by {worst} m", errors.len());
}

/// A cone or cylinder on its side has contacts at both ends.
#[test]
fn what_lies_on_its_side_touches_with_both_ends() {
    let search = ContactQuery { prediction: 0.02, size: SIZE };
    // The side of the cone lies level if its axis is turned by the half angle at its tip.
    let level = std::f32::consts::FRAC_PI_2 + (0.1_f32 / 0.2).atan();
    for (name, shape, tilt) in [
        ("cone", SharedShape::cone(0.1, 0.1), level),
        ("cylinder", SharedShape::cylinder(0.08, 0.1), std::f32::consts::FRAC_PI_2),
    ] {
        for turn in [0.0, 0.4, 1.3, 2.9] {
            let rotation = Quat::from_rotation_y(turn) * Quat::from_rotation_z(tilt);
            let lowest = shape.as_support_map().expect("convex").local_support_point(rotation.inverse() * Vec3::NEG_Y);
            let height = -(rotation * lowest).y - 1e-4;
            let pose = Pose::from_parts(Vec3::Y * height, rotation);
            let (mut plane, mut face) = (ParryManifold::new(), ParryManifold::new());
            half_space_contact(Vec3::Y, &*shape, &pose, &mut ClipBuffers::default(), &mut plane).expect("no ball");
            let solid = Solid::new(&*shape, pose).expect("no ball");
            let corners = [Vec3::new(-3.0, 0.0, -3.0), Vec3::new(0.0, 0.0, 3.0), Vec3::new(3.0, 0.0, -3.0)];
            let near = shape.compute_aabb(&pose).loosened(search.prediction + search.size);
            contact_of(corners, &solid, &near, search, &mut face);
            for (floor, found) in [("half-space", plane), ("triangle", face)] {
                let touching: Vec<Vec3> =
                    found.points.iter().filter(|p| p.dist < 2e-3).map(|p| pose * p.local_p2).collect();
                let span =
                    touching.iter().flat_map(|p| touching.iter().map(move |q| p.distance(*q))).fold(0.0, f32::max);
                assert!(span > 0.15, "{name} on a {floor}, turned by {turn}: {span} m of contact, {touching:?}");
            }
        }
    }
}

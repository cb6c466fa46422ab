//! Compares contacts of cuboids with parry's, bit by bit.

use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::query::TrackedContact;
use parry3d::query::details::contact_manifold_cuboid_cuboid;
use parry3d::shape::Cuboid;

use super::*;
use crate::collide::testing::Random;

impl Random {
    /// A rotation by quarter turns, mostly with a tiny rotation in addition.
    fn nearly_right(&mut self) -> Quat {
        let quarter = |x: f32| (3.0 * x) as i32 as f32 * std::f32::consts::FRAC_PI_2;
        let right = Vec3::new(self.next(), self.next(), self.next()).to_array().map(quarter);
        let tiny = self.vector() * 10.0_f32.powf(-4.5 + 3.5 * self.next()) * if self.next() > -0.8 { 1.0 } else { 0.0 };
        let turned = Quat::from_euler(glam::EulerRot::XYZ, right[0], right[1], right[2]);
        (Quat::from_scaled_axis(tiny) * turned).normalize()
    }

    fn axis(&mut self) -> Vec3 {
        Vec3::AXES[(3.0 * (0.5 + 0.499 * self.next())) as usize]
    }

    fn body_at(&mut self, position: Vec3, rotation: Quat) -> BodyState {
        BodyState { position, rotation, ..BodyState::default() }
    }
}

/// How two cuboids lie.
#[derive(Clone, Copy)]
enum Placing {
    Any,
    /// Nearly parallel, face to face.
    Faces,
    /// Nearly parallel, edge to edge or corner to corner.
    Edges,
}

/// Two cuboids at about the distance at which they touch. Some have equal sizes, or sizes and distances that are round
/// numbers, so that several directions are equally good and corners lie on sides.
fn two(random: &mut Random, placing: Placing) -> ([BodyState; 2], [CuboidPlace; 2]) {
    let size = |random: &mut Random| {
        let any = Vec3::splat(1.05) + random.vector();
        if random.next() > 0.0 { any } else { (any * 4.0).ceil() * 0.25 }
    };
    let half = if random.next() > 0.0 { [size(random); 2] } else { [size(random), size(random)] };
    let base = if random.next() > 0.5 { Quat::IDENTITY } else { random.rotation() };
    let (rotation, mut between) = match placing {
        Placing::Any => (random.rotation(), random.vector() * (half[0].length() + half[1].length())),
        Placing::Faces => {
            let axis = random.axis();
            let across = random.vector() * (half[0] + half[1]) * (Vec3::ONE - axis);
            let gap = 0.02 * random.next() * if random.next() > -0.5 { 1.0 } else { 0.0 };
            let signed = axis * random.next().signum();
            (random.nearly_right(), across + signed * ((half[0] + half[1]).dot(axis) + gap))
        }
        Placing::Edges => {
            let along = random.axis() * if random.next() > 0.0 { random.next().abs() } else { 0.0 };
            let side = random.vector().signum();
            (random.nearly_right(), side * (half[0] + half[1] + 0.03 * random.vector()) * (Vec3::ONE - along))
        }
    };
    if random.next() > 0.7 {
        between = (between * 8.0).round() * 0.125;
    }
    let at = 5.0 * random.vector();
    let bodies = [random.body_at(at, base), random.body_at(at + base * between, (base * rotation).normalize())];
    let local =
        if random.next() > 0.8 { (0.1 * random.vector(), random.rotation()) } else { (Vec3::ZERO, Quat::IDENTITY) };
    let places = [CuboidPlace::new(half[0], local.0, local.1), CuboidPlace::new(half[1], Vec3::ZERO, Quat::IDENTITY)];
    (bodies, places)
}

/// Compares `count` pairs with parry, bit by bit, and returns how many touch. The pairs are those of [`two`], made
/// smaller by the power of two `smaller`. Parry gets each pair enlarged until its tolerances have no effect.
fn compare(set: InstructionSet, count: u32, placing: Placing, smaller: f32) -> usize {
    let mut random = Random(match placing {
        Placing::Faces => 1 << 40,
        Placing::Any => 1 << 41,
        Placing::Edges => 1 << 42,
    });
    let (mut scratch, mut touching, mut points) = (CuboidScratch::default(), 0, 0);
    for batch in 0..count.div_ceil(1000) {
        let (mut bodies, mut cuboids, mut pairs) = (Vec::new(), Vec::new(), Vec::new());
        for number in 0..1000 {
            let (mut two, mut places) = two(&mut random, placing);
            two.iter_mut().for_each(|body| body.position /= smaller);
            places.iter_mut().for_each(|place| {
                *place = CuboidPlace::new(place.half / smaller, place.position / smaller, place.rotation)
            });
            bodies.extend(two);
            cuboids.extend(places);
            let ids = [2 * number, 2 * number + 1];
            let prediction = 0.05 * (1.0 + random.next()) / smaller;
            pairs.push(CuboidPair { bodies: ids, cuboids: ids, prediction, number });
        }
        let mut found: Vec<Option<ParryManifold>> = vec![None; 1000];
        cuboid_contacts(set, &bodies, &cuboids, &pairs, &mut scratch, &mut |number, write| {
            let mut one = ParryManifold::new();
            write(&mut one);
            found[number as usize] = Some(one);
        });
        for pair in &pairs {
            let [a, b] = pair.bodies.map(|i| i as usize);
            // Parry uses this length in place of a distance of zero.
            let larger = f32::EPSILON / cuboids[a].least.min(cuboids[b].least);
            let pose = |i: usize| {
                let body = Pose::from_parts(larger * bodies[i].position, bodies[i].rotation);
                body * Pose::from_parts(larger * cuboids[i].position, cuboids[i].rotation)
            };
            let pos12 = pose(a).inv_mul(&pose(b));
            let [box_a, box_b] = [a, b].map(|i| Cuboid::new(larger * cuboids[i].half));
            let mut expected = ParryManifold::new();
            contact_manifold_cuboid_cuboid(&pos12, &box_a, &box_b, larger * pair.prediction, &mut expected);
            for point in &mut expected.points {
                (point.local_p1, point.local_p2, point.dist) =
                    (point.local_p1 / larger, point.local_p2 / larger, point.dist / larger);
            }
            let none = ParryManifold::new();
            let found = found[pair.number as usize].as_ref().unwrap_or(&none);
            let bits = |m: &ParryManifold| -> Vec<u32> {
                let vector = |v: Vec3| v.to_array().map(f32::to_bits);
                let point = |p: &TrackedContact<()>| {
                    let [a, b] = [vector(p.local_p1), vector(p.local_p2)];
                    [&a[..], &b, &[p.dist.to_bits(), p.fid1.0, p.fid2.0]].concat()
                };
                let normals = [vector(m.local_n1), vector(m.local_n2)].concat();
                if m.points.is_empty() {
                    Vec::new()
                } else {
                    [normals, m.points.iter().flat_map(point).collect()].concat()
                }
            };
            let what = format!("batch {batch}, pair {}: {pos12:?} {box_a:?} {box_b:?}", pair.number);
            assert_eq!(bits(found), bits(&expected), "{what}\n{:?}\n{:?}", found.points, expected.points);
            touching += usize::from(!found.points.is_empty());
            points += found.points.len();
        }
    }
    println!("{touching} of {count} touch, {points} points");
    touching
}

#[test]
fn cuboids_touch_as_parry_says_bit_by_bit() {
    for set in InstructionSet::each() {
        assert!(compare(set, 50_000, Placing::Any, 1.0) > 5_000);
    }
}

#[test]
fn nearly_parallel_cuboids_touch_as_parry_says_bit_by_bit() {
    for set in InstructionSet::each() {
        assert!(compare(set, 50_000, Placing::Faces, 1.0) > 20_000);
    }
}

#[test]
fn cuboids_at_edges_and_corners_touch_as_parry_says_bit_by_bit() {
    for set in InstructionSet::each() {
        assert!(compare(set, 20_000, Placing::Edges, 1.0) > 5_000);
    }
}

/// Cuboids of 0.4 to 16 mm, and of 0.1 to 4 micrometers.
#[test]
fn small_cuboids_touch_as_parry_says_of_large_ones_bit_by_bit() {
    for smaller in [256.0, (1 << 20) as f32] {
        for set in InstructionSet::each() {
            assert!(compare(set, 20_000, Placing::Any, smaller) > 2_000);
            assert!(compare(set, 20_000, Placing::Faces, smaller) > 8_000);
        }
    }
}

/// A million pairs of either kind: `cargo test --release --lib collide::cuboids -- --ignored`. Without `--release`
/// parry stops at one of the nearly parallel pairs: a debug assertion requires that a distance between two faces is not
/// negative, and rounding makes it negative.
#[test]
#[ignore = "half a minute"]
fn a_million_cuboids_touch_as_parry_says_bit_by_bit() {
    assert!(compare(InstructionSet::default(), 1_000_000, Placing::Any, 1.0) > 100_000);
    assert!(compare(InstructionSet::default(), 1_000_000, Placing::Faces, 1.0) > 400_000);
}

//! Scenes of boxes: piles, pyramids, walls.

use glam::{Quat, Vec3};

use super::common::{centered, floor, lifted, unit_box};
use crate::scene::Scene;
use drystone::stages::random::SplitMix64;
use drystone::{Body, Result, Shape, World};

/// A heap of `n` cubes of 1 m; every other one has `ratio` times the density.
pub(super) fn pile(n: usize, jitter: f64, seed: u64, ratio: f32) -> Result<Scene> {
    let bodies = [unit_box(), unit_box().density(1000.0 * ratio)];
    heap("pile", n, jitter, seed, |i, _| Ok(bodies[i % 2].clone()))
}

/// The same heap with random bodies: 0.2 to 1 m long along each axis, with densities of 200 to 5000 kg/m³. Boxes take
/// turns with the other `kinds` of shapes.
pub(super) fn pile_mixed(n: usize, jitter: f64, seed: u64, kinds: usize) -> Result<Scene> {
    heap("pile-mixed", n, jitter, seed, |i, random| {
        let [x, y, z, density] = [(0.1, 0.5), (0.1, 0.5), (0.1, 0.5), (200.0, 5000.0)]
            .map(|(least, most)| (least + (most - least) * 0.5 * (1.0 + random.symmetric())) as f32);
        let shape = match i % kinds {
            0 => Shape::cuboid(x, y, z),
            1 => Shape::ball(x),
            2 => Shape::capsule(0.5 * y, 0.5 * x),
            3 => Shape::cylinder(y, x),
            4 => Shape::cone(y, x),
            // An octahedron whose edges all differ.
            _ => Shape::convex_hull(
                &[
                    (1.0, 0.0, 0.2),
                    (-1.0, 0.2, 0.0),
                    (0.2, 1.0, 0.0),
                    (0.0, -1.0, 0.2),
                    (0.0, 0.2, 1.0),
                    (0.2, 0.0, -1.0),
                ]
                .map(|corner| Vec3::from(corner) * Vec3::new(x, y, z)),
            )?,
        };
        Ok(Body::dynamic().shape(shape).density(density))
    })
}

/// `n` bodies of at most 1 m on a 1.2 m grid, each shifted by up to `jitter` and turned a little, above a floor between
/// four walls.
fn heap(
    name: &str,
    n: usize,
    jitter: f64,
    seed: u64,
    mut body: impl FnMut(usize, &mut SplitMix64) -> Result<Body>,
) -> Result<Scene> {
    const PITCH: f64 = 1.2;
    const CLEARANCE: f64 = 0.7;
    const LOWEST: f64 = 0.65;
    // Half of the shift between one layer and the next.
    const SHIFT: f64 = 0.15;
    let side = libm::cbrt(n as f64).round() as usize;
    let layers = n.div_ceil(side * side);

    let half = ((side - 1) as f64 / 2.0 * PITCH + 0.5 + SHIFT + CLEARANCE) as f32;
    let top = (layers as f64 * PITCH) as f32 + 4.0;
    let mut world = floor(half + 1.0, half + 1.0);
    let (along_z, along_x) = (Shape::cuboid(0.5, top / 2.0, half + 1.0), Shape::cuboid(half, top / 2.0, 0.5));
    for s in [half + 0.5, -half - 0.5] {
        world.insert(Body::fixed().named("wall").shape(along_z.clone()).position(s, top / 2.0, 0.0));
        world.insert(Body::fixed().named("wall").shape(along_x.clone()).position(0.0, top / 2.0, s));
    }

    let mut random = SplitMix64::new(seed);
    for i in 0..n {
        let (column, row, layer) = (i % side, i / side % side, i / (side * side));
        let shift = if layer % 2 == 0 { SHIFT } else { -SHIFT };
        let x = centered(column, side) * PITCH + shift + jitter * random.symmetric();
        let y = layer as f64 * PITCH + LOWEST + jitter * random.symmetric();
        let z = centered(row, side) * PITCH + shift + jitter * random.symmetric();
        let turn = small_turn(&mut random);
        world.insert(body(i, &mut random)?.position(x as f32, y as f32, z as f32).rotation(turn));
    }
    let container = Some((Vec3::new(-half, 0.0, -half), Vec3::new(half, top, half)));
    Ok(Scene { container, ..Scene::new(name, world, 600) })
}

/// A random rotation by up to 0.08 rad. Plain f64 arithmetic gives the same bits on every platform.
fn small_turn(random: &mut SplitMix64) -> Quat {
    // Tangent of half the largest angle.
    const REACH: f64 = 0.04;
    let axis = [(); 3].map(|()| random.symmetric());
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let tangent = REACH * random.symmetric();
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let [x, y, z] = axis.map(|x| (x / length * tangent * cosine) as f32);
    Quat::from_xyzw(x, y, z, cosine as f32)
}

/// Distance between centers of neighbors in a row of a pyramid (m).
const PYRAMID_PITCH: f64 = 1.1;

/// Rows of boxes, each one shorter than the row below it, 0.1 m between neighbors, `gap` of a height between rows.
pub(super) fn pyramid(base: usize, gap: f32) -> Scene {
    let mut world = floor(base as f32 + 10.0, 10.0);
    add_pyramid(&mut world, base, [0.0; 2], gap);
    Scene::new("pyramid", world, 300).standing()
}

/// `n` such pyramids on a square grid. They are near each other but do not touch.
pub(super) fn many_pyramids(n: usize, base: usize) -> Scene {
    const DEPTH: f64 = 2.0;
    let side = (n as f64).sqrt().ceil() as usize;
    let width = base as f64 * PYRAMID_PITCH + 1.0;
    let half = side as f64 / 2.0;
    let mut world = floor((half * width) as f32 + 10.0, (half * DEPTH) as f32 + 10.0);
    for i in 0..n {
        add_pyramid(&mut world, base, [centered(i % side, side) * width, centered(i / side, side) * DEPTH], 0.0);
    }
    Scene::new("many-pyramids", world, 300).standing()
}

/// Adds a pyramid. The middle of its lowest row is at `x` and `z`, and gaps are as in [`lifted`].
fn add_pyramid(world: &mut World, base: usize, [x, z]: [f64; 2], gap: f32) {
    let body = unit_box();
    for row in 0..base {
        let boxes = base - row;
        for column in 0..boxes {
            let x = x + centered(column, boxes) * PYRAMID_PITCH;
            world.insert(body.clone().position(x as f32, row as f32 + 0.5 + lifted(row, gap), z as f32));
        }
    }
}

/// Rows of bricks of 1 x 0.5 x 0.5 m with 0.05 m between neighbors. Every other row is shifted by half a brick and ends
/// flush in half bricks, so that every brick is held on both sides. `gap` of a height is below each row.
pub(super) fn wall(rows: usize, columns: usize, gap: f32) -> Scene {
    const GAP: f64 = 0.05;
    const PITCH: f64 = 1.0 + GAP;
    // Two of them and the gap between them are as long as a brick.
    const HALF_BRICK: f64 = (1.0 - GAP) / 2.0;
    let mut world = floor(columns as f32 * 0.6 + 10.0, 10.0);
    let brick = |length: f64| Body::dynamic().shape(Shape::cuboid(length as f32 / 2.0, 0.25, 0.25));
    let (whole, half) = (brick(1.0), brick(HALF_BRICK));
    let end = (columns as f64 * PITCH - GAP - HALF_BRICK) / 2.0;
    for row in 0..rows {
        let y = row as f32 * 0.5 + 0.25 + 0.5 * lifted(row, gap);
        let mut lay = |body: &Body, x: f64| world.insert(body.clone().position(x as f32, y, 0.0));
        if row % 2 == 0 {
            (0..columns).for_each(|k| _ = lay(&whole, centered(k, columns) * PITCH));
        } else {
            lay(&half, -end);
            (0..columns - 1).for_each(|k| _ = lay(&whole, centered(k, columns - 1) * PITCH));
            lay(&half, end);
        }
    }
    Scene::new("wall", world, 600).standing()
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::BodyKind;

    /// Lower and upper corner of a body with one cuboid.
    fn bounds(body: &Body) -> (Vec3, Vec3) {
        let half = body.colliders[0].shape.as_cuboid().expect("a cuboid");
        let axes = glam::Mat3::from_quat(body.rotation);
        let reach = axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z;
        (body.position - reach, body.position + reach)
    }

    fn heaped(n: usize, jitter: f64, seed: u64) -> Scene {
        pile(n, jitter, seed, 1.0).expect("a scene")
    }

    fn no_two_overlap(scene: &Scene) {
        let boxes: Vec<_> = scene.world.bodies.iter().map(bounds).collect();
        for (i, a) in boxes.iter().enumerate() {
            for b in &boxes[i + 1..] {
                let overlap = a.1.min(b.1) - a.0.max(b.0);
                assert!(overlap.min_element() <= 1e-4, "{}: {a:?} {b:?}", scene.name);
            }
        }
    }

    #[test]
    fn no_two_bodies_overlap_at_the_start() {
        for scene in [
            heaped(1000, 0.03, 1),
            heaped(500, 0.04, 7),
            pile_mixed(500, 0.04, 2, 1).expect("a scene"),
            pyramid(6, 0.0),
            pyramid(6, 0.1),
            many_pyramids(5, 3),
            wall(6, 4, 0.0),
            wall(6, 4, 0.005),
        ] {
            no_two_overlap(&scene);
        }
    }

    fn bits(scene: &Scene) -> Vec<u32> {
        let numbers =
            scene.world.bodies.iter().flat_map(|b| [b.position.extend(0.0).to_array(), b.rotation.to_array()]);
        numbers.flatten().map(f32::to_bits).collect()
    }

    #[test]
    fn the_same_parameters_give_the_same_bits() {
        assert_eq!(bits(&heaped(300, 0.03, 5)), bits(&heaped(300, 0.03, 5)));
        assert_ne!(bits(&heaped(300, 0.03, 5)), bits(&heaped(300, 0.03, 6)));
    }

    #[test]
    fn the_bits_of_a_pile_are_pinned() {
        let hash = bits(&heaped(1000, 0.03, 1))
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        assert_eq!(hash, 0x9dc1_022d_d8b0_f206, "{hash:#x}");
    }

    #[test]
    fn a_pile_is_turned_and_shifted_no_further_than_promised() {
        let scene = heaped(500, 0.0, 3);
        let boxes: Vec<_> = scene.world.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic).collect();
        assert!(boxes.iter().all(|b| b.rotation.is_normalized() && b.rotation.to_axis_angle().1 <= 0.08));
        assert!(boxes.iter().any(|b| b.rotation.to_axis_angle().1 > 0.07));
        // One layer is 8 x 8; the next is 0.3 m off.
        let shift = boxes[0].position - boxes[64].position;
        assert!((shift - Vec3::new(0.3, -1.2, 0.3)).length() < 1e-5, "{shift}");
    }

    #[test]
    fn piles_of_every_size_have_all_their_boxes_inside_the_container() {
        for n in [1, 2, 3, 7, 64, 100, 5000] {
            let scene = heaped(n, 0.03, 1);
            assert_eq!((scene.world.dynamic_count(), scene.escaped(&scene.world)), (n, 0));
        }
    }

    #[test]
    fn a_mixed_pile_has_all_sizes_and_densities_in_its_range() {
        let scene = pile_mixed(1000, 0.03, 1, 1).expect("a scene");
        assert_eq!((scene.world.dynamic_count(), scene.escaped(&scene.world)), (1000, 0));
        let boxes: Vec<_> = scene.world.dynamic().collect();
        let spans = |what: &dyn Fn(&Body) -> f32, least: f32, most: f32| {
            let values = boxes.iter().map(|b| what(b));
            let (low, high) = values.fold((f32::MAX, 0.0_f32), |(low, high), x| (low.min(x), high.max(x)));
            let margin = 0.02 * (most - least);
            assert!(low >= least && high <= most, "{low} to {high}");
            assert!(low < least + margin && high > most - margin, "{low} to {high}");
        };
        let half = |b: &Body| b.colliders[0].shape.as_cuboid().expect("a cuboid");
        (0..3).for_each(|axis| spans(&|b: &Body| half(b)[axis], 0.1, 0.5));
        spans(&|b: &Body| b.mass.mass / (8.0 * half(b).element_product()), 199.99, 5000.01);
    }

    #[test]
    fn a_pile_of_six_kinds_has_each_in_turn_and_no_body_reaches_out_of_its_cell() {
        let scene = pile_mixed(600, 0.03, 1, 6).expect("a scene");
        let boxes: Vec<_> = scene.world.dynamic().map(|b| b.colliders[0].shape.as_cuboid()).collect();
        assert!(boxes.iter().enumerate().all(|(i, half)| half.is_some() == (i % 6 == 0)));
        let names: std::collections::BTreeSet<_> =
            scene.world.dynamic().map(|b| format!("{:?}", b.colliders[0].shape.parry().shape_type())).collect();
        assert_eq!(names.len(), 6, "{names:?}");
        for body in scene.world.dynamic() {
            let reach = body.colliders[0].shape.parry().compute_local_aabb();
            assert!(reach.mins.min_element() >= -0.5 && reach.maxs.max_element() <= 0.5, "{body:?}");
        }
        // The boxes are those of a pile of boxes alone.
        let alone = pile_mixed(600, 0.03, 1, 1).expect("a scene");
        let alone: Vec<_> = alone.world.dynamic().map(|b| b.colliders[0].shape.as_cuboid()).collect();
        assert!(boxes.iter().zip(&alone).all(|(mixed, alone)| mixed.is_none() || mixed == alone));
    }

    #[test]
    fn gaps_lift_each_row_by_one_more_share_of_its_height() {
        let heights = |scene: &Scene| scene.world.dynamic().map(|b| b.position.y).collect::<Vec<_>>();
        for ([built, dropped], height) in
            [([pyramid(3, 0.0), pyramid(3, 0.1)], 1.0_f32), ([wall(3, 2, 0.0), wall(3, 2, 0.1)], 0.5)]
        {
            for (low, high) in heights(&built).into_iter().zip(heights(&dropped)) {
                // The middle of row k is half a height above k heights.
                let row = low / height - 0.5;
                assert!((high - low - 0.1 * height * (row + 1.0)).abs() < 1e-6, "{low} and {high}");
            }
        }
    }

    #[test]
    fn every_row_of_a_wall_ends_flush() {
        let scene = wall(2, 3, 0.0);
        let right = |row: &[Body]| row.iter().map(|b| bounds(b).1.x).fold(0.0, f32::max);
        let bricks = &scene.world.bodies[1..];
        assert!((right(&bricks[..3]) - right(&bricks[3..])).abs() < 1e-6);
    }
}

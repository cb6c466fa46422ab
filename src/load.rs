//! The load on the heaviest interface of a world, and the number of substeps that keep its overlap small.
//!
//! A soft contact at rest overlaps by s = F/(m w²), where F is the force on one of its points, m is the effective mass
//! of the point, and w is 2 pi times the contact frequency, which depends on the length of a substep
//! (docs/derivation.md, section 5). The overlap of a standing structure therefore falls with the square of the number
//! of substeps, and is known before the first step.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3, Vec3};
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use rayon::prelude::*;

use crate::config::{SolverConfig, Stabilization};
use crate::constants::LEVEL;
use crate::error::{Error, Result, input};
use crate::math::rotation::product;
use crate::world::{Body, BodyHandle, BodyKind, World, placed, pose};

/// Largest number of substeps that the settings accept.
const MAX_SUBSTEPS: f64 = 4096.0;
/// The load of one body on another.
///
/// ```
/// use drystone::{Body, Shape, SolverConfig, World, glam::Vec3, load::Load};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// for k in 0..3 {
///     world.insert(Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 0.5 + k as f32, 0.0));
/// }
/// let config = SolverConfig::default();
/// let interfaces = Load::all(&world, &config, |_, _| true);
/// assert_eq!(interfaces.len(), 3);
/// let load = Load::heaviest(&world, &config).expect("bodies bear bodies");
/// assert!(load.force >= 2.0 * 9810.0 * 0.999);
/// // Substeps for an overlap of 0.1 mm at most.
/// let substeps = load.substeps(1e-4, 1.0 / 60.0, &config)?;
/// assert!(load.overlap(substeps, 1.0 / 60.0, &config) <= 1e-4 && load.overlap(substeps - 1, 1.0 / 60.0, &config) > 1e-4);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Load {
    /// The upper body.
    pub upper: BodyHandle,
    /// The body that supports it.
    pub lower: BodyHandle,
    /// Force between the two (N).
    pub force: f64,
    /// Overlap times the square of w (m/s²): the force on one point over its effective mass.
    pub stress: f64,
    /// Distance between the boxes around the two, along gravity (m).
    pub gap: f64,
}

impl Load {
    /// The interface of `world` with the deepest overlap, if the world stands as it is or falls straight down; `None`
    /// if no body supports another.
    ///
    /// Every body passes its weight, and the load on it, to the bodies beneath it. Their shares are proportional to the
    /// areas of their bounding boxes that lie beneath its own. A ball touches at one point, and other shapes at four
    /// corners.
    pub fn heaviest(world: &World, config: &SolverConfig) -> Option<Self> {
        let deeper = |a: Self, b: Self| if b.stress > a.stress { b } else { a };
        Self::all(world, config, |_, _| true).into_iter().reduce(deeper)
    }

    /// The wanted interfaces of `world`, with loads as in [`Self::heaviest`]. `is_wanted` gets the upper body and the
    /// gap of each (m).
    pub fn all(world: &World, config: &SolverConfig, is_wanted: impl Fn(BodyHandle, f64) -> bool) -> Vec<Self> {
        let ups: Vec<DMat3> = (0..world.world_count()).map(|part| up(world.gravity_of(part))).collect();
        let up_of = |i: usize| ups[world.bodies.worlds()[i] as usize];
        let boxes = upright_boxes(world, up_of);
        let ground = Ground::new(&boxes, world);
        // A body that gravity lifts presses on nothing beneath it.
        let weight = |(&part, b): (&u32, &Body)| {
            let gravity = world.gravity_of(part as usize).as_dvec3().length();
            f64::from(b.mass.mass) * gravity * f64::from(b.gravity_scale).max(0.0)
        };
        let mut borne: Vec<f64> = world.bodies.worlds().iter().zip(&world.bodies).map(weight).collect();
        let mut from_the_top: Vec<usize> =
            (0..boxes.len()).filter(|&i| world.bodies[i].kind == BodyKind::Dynamic && !boxes[i].is_empty()).collect();
        from_the_top.sort_by(|&i, &j| boxes[j].low.y.total_cmp(&boxes[i].low.y).then(i.cmp(&j)));
        let below: Vec<_> = from_the_top.par_iter().with_min_len(64).map(|&upper| ground.supports(upper)).collect();
        let mut all = Vec::new();
        for (upper, below) in from_the_top.into_iter().zip(below) {
            let total: f64 = below.iter().map(|s| s.1).sum();
            for (lower, area) in below {
                let force = borne[upper] * area / total;
                borne[lower] += force;
                let gap = boxes[upper].low.y - boxes[lower].high.y;
                let [Some(above), Some(below)] = [upper, lower].map(|body| world.bodies.handle(body)) else { continue };
                if is_wanted(above, gap) {
                    let stress = stress(world, (&boxes, up_of(upper)), upper, lower, force, config);
                    all.push(Self { upper: above, lower: below, force, stress, gap });
                }
            }
        }
        all
    }

    /// Overlap with `substeps` in a step of `dt` seconds (m).
    pub fn overlap(&self, substeps: u32, dt: f32, config: &SolverConfig) -> f64 {
        let w = TAU * f64::from(config.contact_frequency) * f64::from(substeps) / f64::from(dt);
        self.stress / (w * w)
    }

    /// Fewest substeps of a step of `dt` seconds that keep the overlap within `max_overlap` (m).
    ///
    /// # Errors
    /// The number is larger than the settings accept, or contacts are not soft and their overlap has no known limit.
    pub fn substeps(&self, max_overlap: f64, dt: f32, config: &SolverConfig) -> Result<u32> {
        if config.stabilization != Stabilization::Soft {
            return Err(Error::input("a limit on penetration needs soft contacts: set stabilization=soft"));
        }
        let substeps = (self.overlap(1, dt, config) / max_overlap).sqrt().ceil().max(1.0);
        if substeps <= MAX_SUBSTEPS {
            return Ok(substeps as u32);
        }
        let (upper, lower, force) = (self.upper.index(), self.lower.index(), self.force);
        Err(input!(
            "penetration of {:.3e} mm: body {upper} presses on body {lower} with {force:.3e} N, which asks for {substeps} \
             substeps, more than {MAX_SUBSTEPS}; shorten the step",
            max_overlap * 1e3
        ))
    }
}

/// Force on one point, over its effective mass and over the square of the factor on its frequency.
fn stress(
    world: &World,
    (boxes, up): (&[Box3], DMat3),
    upper: usize,
    lower: usize,
    force: f64,
    config: &SolverConfig,
) -> f64 {
    let overlap = boxes[upper].overlap_from_above(&boxes[lower]);
    let one_point = [upper, lower].iter().any(|&i| world.bodies[i].solids().all(|c| c.shape.is_ball()));
    let at = if one_point { overlap.center() } else { overlap.high };
    let at = up.transpose() * DVec3::new(at.x, boxes[upper].low.y, at.z);
    let normal = up.transpose() * DVec3::Y;
    let inverse_mass: f64 = [upper, lower].iter().map(|&i| inverse_mass_at(&world.bodies[i], at, normal)).sum();
    let ratio = if world.bodies[lower].kind == BodyKind::Dynamic { 1.0 } else { config.fixed_contact_frequency_ratio };
    force / if one_point { 1.0 } else { 4.0 } * inverse_mass / f64::from(ratio * ratio)
}

/// Inverse effective mass of a point of a body along `normal` (1/kg).
fn inverse_mass_at(body: &Body, at: DVec3, normal: DVec3) -> f64 {
    if body.kind != BodyKind::Dynamic {
        return 0.0;
    }
    let turn = (at - body.center_of_mass().as_dvec3()).cross(normal);
    let inverse_inertia: DMat3 = body.mass.world_inverse_inertia(body.rotation).as_dmat3();
    1.0 / f64::from(body.mass.mass) + turn.dot(inverse_inertia * turn)
}

/// Rotation of a world that turns its gravity to -Y.
fn up(gravity: Vec3) -> DMat3 {
    let up = -gravity.as_dvec3().normalize_or(DVec3::NEG_Y);
    DMat3::from_quat(glam::DQuat::from_rotation_arc(up, DVec3::Y))
}

/// A box along the axes of a world turned by [`up`].
#[derive(Clone, Copy)]
struct Box3 {
    low: DVec3,
    high: DVec3,
}

impl Box3 {
    fn is_empty(&self) -> bool {
        !self.low.cmple(self.high).all()
    }

    fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    fn overlap_from_above(&self, other: &Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }
}

/// The bounding box of each body, turned by `up_of`; empty without shapes. A half-space is as wide as the world.
fn upright_boxes(world: &World, up_of: impl Fn(usize) -> DMat3) -> Vec<Box3> {
    let empty = Box3 { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };
    let of = |(i, b): (usize, &Body)| {
        let turn = up_of(i).as_mat3();
        let rotation = glam::Quat::from_mat3(&turn);
        b.solids().fold(empty, |all, c| {
            let at = placed(pose(turn * b.position, product(rotation, b.rotation)), pose(c.position, c.rotation));
            let (low, high) = if c.shape.is_half_space() {
                (DVec3::NEG_INFINITY, DVec3::new(f64::INFINITY, at.translation.y.into(), f64::INFINITY))
            } else {
                let aabb = c.shape.0.compute_aabb(&at);
                (aabb.mins.as_dvec3(), aabb.maxs.as_dvec3())
            };
            Box3 { low: all.low.min(low), high: all.high.max(high) }
        })
    };
    world.bodies.iter().enumerate().map(of).collect()
}

/// Depths of the searches that follow if a search to the depth of one height of the body found no support, in heights
/// of the body. The last search has no limit.
const DEPTHS: [f64; 2] = [4.0, 16.0];
/// Farther than any body is (m), and small enough for areas in single precision.
const FAR: f64 = 1e15;

fn aabb(low: DVec3, high: DVec3) -> Aabb {
    Aabb::new(low.max(DVec3::splat(-FAR)).as_vec3(), high.min(DVec3::splat(FAR)).as_vec3())
}

/// The boxes of all bodies with shapes, for searches of the bodies beneath a body of the same world.
struct Ground<'a> {
    boxes: &'a [Box3],
    /// The world of each body. For each world, a tree over its boxes, and the body of each leaf.
    worlds: &'a [u32],
    trees: Vec<(Bvh, Vec<usize>)>,
}

impl<'a> Ground<'a> {
    fn new(boxes: &'a [Box3], world: &'a World) -> Self {
        let tree = |own: Vec<BodyHandle>| {
            let own: Vec<usize> = own.into_iter().map(BodyHandle::index).filter(|&i| !boxes[i].is_empty()).collect();
            // parry assumes that a tree with one or two leaves has the leaves 0 and 1.
            let leaves = own.iter().map(|&i| aabb(boxes[i].low, boxes[i].high)).enumerate();
            (Bvh::from_iter(BvhBuildStrategy::Binned, leaves), own)
        };
        Self { boxes, worlds: world.bodies.worlds(), trees: world.worlds().into_iter().map(tree).collect() }
    }

    /// The bodies that support `upper`, with the areas of their boxes beneath its own.
    ///
    /// The search goes no deeper than the boxes that it finds as supports. In a pile, the column beneath a body has
    /// dozens of boxes.
    fn supports(&self, upper: usize) -> Vec<(usize, f64)> {
        let above = &self.boxes[upper];
        let height = above.high.y - above.low.y;
        let mut deeper = DEPTHS.iter().map(|depth| above.low.y - depth * height);
        let mut floor = above.low.y - height;
        loop {
            let mut below = self.boxes_between(upper, floor);
            let top = below.iter().map(|s| self.boxes[s.0].high.y).fold(f64::NEG_INFINITY, f64::max);
            let level = top - LEVEL * height;
            if floor > level {
                floor = if below.is_empty() { deeper.next().unwrap_or(f64::NEG_INFINITY) } else { level };
                continue;
            }
            below.retain(|s| self.boxes[s.0].high.y >= level);
            return below;
        }
    }

    /// The bodies whose boxes end above `floor` and below the middle of `upper`, and lie beneath it, with the shared
    /// areas.
    fn boxes_between(&self, upper: usize, floor: f64) -> Vec<(usize, f64)> {
        let above = &self.boxes[upper];
        let middle = above.low.y + 0.5 * (above.high.y - above.low.y);
        let area = |i: usize| {
            let shared = above.overlap_from_above(&self.boxes[i]);
            (shared.high.x - shared.low.x).max(0.0) * (shared.high.z - shared.low.z).max(0.0)
        };
        let column = aabb(above.low.with_y(floor), above.high.with_y(middle));
        let lower = |i: &usize| *i != upper && self.boxes[*i].high.y < middle;
        let (tree, own) = &self.trees[self.worlds[upper] as usize];
        let near = tree.intersect_aabb(&column).map(|leaf| own[leaf as usize]).filter(lower);
        let mut below: Vec<_> = near.map(|i| (i, area(i))).filter(|s| s.1 > 0.0).collect();
        below.sort_unstable_by_key(|s| s.0);
        below
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn a_few_bodies_behind_others_without_shapes_have_their_loads() {
        for gone in 0..4 {
            let mut world = World::new();
            for _ in 0..gone {
                world.insert(Body::fixed());
            }
            world.insert(Body::fixed().shape(crate::Shape::cuboid(5.0, 0.5, 5.0)));
            assert!(Load::heaviest(&world, &SolverConfig::default()).is_none());
            world.insert(Body::dynamic().shape(crate::Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, 1.0, 0.0));
            let load = Load::heaviest(&world, &SolverConfig::default()).expect("a load");
            assert_eq!([load.upper, load.lower].map(BodyHandle::index), [gone + 1, gone]);
        }
    }

    /// Boxes of many sizes in a high and narrow space, so that bodies rest on near bodies, on far ones and on nothing.
    #[test]
    fn the_search_for_what_bears_finds_it_at_any_depth() {
        let mut random = SplitMix64::new(7);
        let mut number = |low: f32, high: f32| low + (high - low) * (0.5 + 0.5 * random.symmetric() as f32);
        let mut world = World::new();
        for height in [3.0, 30.0, 300.0, 3000.0].repeat(50) {
            let half = number(0.01, 1.0);
            let at = [number(-3.0, 3.0), number(0.0, height), number(-3.0, 3.0)];
            world.insert(
                Body::dynamic().shape(crate::Shape::cuboid(half, 0.3 * half, half)).position(at[0], at[1], at[2]),
            );
        }
        // So far away that rounding leaves boxes without a height.
        for y in [1e12, 1.1e12, 1e20, 1.1e20] {
            world.insert(Body::dynamic().shape(crate::Shape::cuboid(0.5, 0.5, 0.5)).position(0.0, y, 0.0));
        }
        let boxes = upright_boxes(&world, |_| up(world.gravity));
        let ground = Ground::new(&boxes, &world);
        let (mut alone, mut deep) = (0, 0);
        for upper in 0..boxes.len() {
            let height = boxes[upper].high.y - boxes[upper].low.y;
            let all = ground.boxes_between(upper, f64::NEG_INFINITY);
            let top = all.iter().map(|s| boxes[s.0].high.y).fold(f64::NEG_INFINITY, f64::max);
            let bearing: Vec<_> = all.into_iter().filter(|s| boxes[s.0].high.y >= top - LEVEL * height).collect();
            assert_eq!(ground.supports(upper), bearing, "{upper}");
            alone += usize::from(bearing.is_empty());
            deep += usize::from(top < boxes[upper].low.y - height && !bearing.is_empty());
        }
        assert!(alone > 3 && deep > 50, "{alone} rest on nothing, {deep} on what lies deep below");
    }

    #[test]
    fn a_world_has_loads_whatever_the_indices_of_its_bodies() {
        let pair = |world: &mut World| {
            let floor = crate::Shape::cuboid(1.0, 0.5, 1.0);
            world.insert(Body::fixed().shape(floor.clone()).position(0.0, -0.5, 0.0));
            world.insert(Body::dynamic().shape(floor).position(0.0, 0.5, 0.0));
        };
        let (mut one, mut world) = (World::new(), World::new());
        pair(&mut one);
        let gone = world.insert(Body::fixed());
        pair(&mut world);
        world.remove(gone);
        world.beside(&one);
        let loads = Load::all(&world, &SolverConfig::default(), |_, _| true);
        let pairs = loads.iter().map(|load| [load.upper, load.lower].map(BodyHandle::index));
        assert_eq!(pairs.collect::<Vec<_>>(), [[2, 1], [4, 3]]);
    }

    #[test]
    fn gravity_may_point_anywhere_and_a_floor_may_be_a_half_space() {
        let mut world = World::new();
        world.gravity = glam::Vec3::new(9.81, 0.0, 0.0);
        world.insert(Body::fixed().shape(crate::Shape::half_space(glam::Vec3::NEG_X)));
        for x in [-0.5, -1.5] {
            world.insert(Body::dynamic().shape(crate::Shape::cuboid(0.5, 0.5, 0.5)).position(x, 3.0, 0.0));
        }
        let load = Load::heaviest(&world, &SolverConfig::default()).expect("a load");
        assert_eq!([load.upper, load.lower].map(BodyHandle::index), [2, 1]);
        assert!((load.force - 9810.0).abs() < 0.1);
        let lowest = |world: &World| {
            let loads = Load::all(world, &SolverConfig::default(), |_, _| true);
            *loads
                .iter()
                .find(|load| [load.upper, load.lower].map(BodyHandle::index) == [1, 0])
                .expect("the floor bears")
        };
        world.bodies[2].gravity_scale = 3.0;
        assert!((lowest(&world).force - 4.0 * 9810.0).abs() < 0.1);
        // A body that gravity lifts presses on nothing.
        world.bodies[2].gravity_scale = -1.0;
        let load = lowest(&world);
        assert!((load.force - 9810.0).abs() < 0.1);
        // Each world has its own up.
        let mut sideways = world.clone();
        sideways.gravity = glam::Vec3::new(0.0, 0.0, 1.0);
        sideways.beside(&world);
        let loads = Load::all(&sideways, &SolverConfig::default(), |_, _| true);
        let in_second: Vec<_> = loads.iter().filter(|load| load.upper.index() > 2).collect();
        assert_eq!(in_second.len(), 2);
        assert!(in_second.iter().any(|of| of.force == load.force && of.stress == load.stress), "{loads:?}");
        world.gravity = glam::Vec3::ZERO;
        assert_eq!(Load::heaviest(&world, &SolverConfig::default()).map(|l| l.force), Some(0.0));
    }
}

//! The colliders of a world at their present poses, for queries.

use glam::Vec4;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;
use rayon::prelude::*;

use super::collider::{is_in_range, is_placed};
use super::tree::{NOWHERE, Tree};
use crate::world::{Collider, MAX_LENGTH, World, placed, pose};

/// A collider: its body, and its index there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    pub body: u32,
    pub collider: u32,
}

impl Place {
    /// The collider and its pose in the world. Returns `None` if it was removed, or is farther away than
    /// [`MAX_LENGTH`].
    pub fn find(self, world: &World) -> Option<(&Collider, Pose)> {
        let body = world.bodies.get(self.body as usize)?;
        let collider = body.colliders.get(self.collider as usize)?;
        is_placed(body.position, body.rotation, MAX_LENGTH)
            .then(|| (collider, placed(pose(body.position, body.rotation), pose(collider.position, collider.rotation))))
    }
}

/// Colliders with their boxes in the tree of a detection.
pub(super) struct TreeColliders<'a> {
    pub tree: &'a Tree,
    pub places: Vec<Place>,
    pub boxes: &'a [Aabb],
}

/// The colliders of one world.
pub(crate) struct Places {
    tree: Tree,
    places: Vec<Place>,
    /// The half-spaces, which have no box, in ascending order.
    pub planes: Vec<Place>,
}

impl Places {
    /// The colliders of each world. `standing` returns those of a world that has a tree, and `count` returns how many
    /// colliders of a body are among them, from the first.
    pub(super) fn of<'a>(
        world: &World,
        count: impl Fn(usize) -> usize,
        standing: impl Fn(usize) -> Option<TreeColliders<'a>> + Sync,
    ) -> Vec<Self> {
        let mut new = vec![Vec::new(); world.world_count()];
        for (i, (body, &part)) in world.bodies.iter().zip(world.bodies.worlds()).enumerate() {
            let colliders = count(i) as u32..body.colliders.len() as u32;
            new[part as usize].extend(colliders.map(|collider| Place { body: i as u32, collider }));
        }
        let places = new.into_par_iter().enumerate().map(|(part, new)| Self::with(world, part, standing(part), &new));
        places.collect()
    }

    /// The colliders of each world, in a new tree.
    pub fn of_world(world: &World) -> Vec<Self> {
        Self::of(world, |_| 0, |_| None)
    }

    fn with(world: &World, part: usize, standing: Option<TreeColliders>, new: &[Place]) -> Self {
        let none = Tree::default();
        let TreeColliders { tree, mut places, boxes } =
            standing.unwrap_or(TreeColliders { tree: &none, places: Vec::new(), boxes: &[] });
        places.extend(new);
        let now = |(k, place): (usize, &Place)| {
            let is_here = world.bodies.worlds().get(place.body as usize) == Some(&(part as u32));
            let found = is_here.then(|| place.find(world)).flatten();
            let bounded = found.filter(|(collider, _)| !collider.shape.is_half_space());
            let aabb = bounded.map(|(collider, pose)| collider.shape.0.compute_aabb(&pose)).filter(is_in_range);
            let is_stray = aabb.is_some_and(|aabb| !boxes.get(k).is_some_and(|fat| contains(fat, &aabb)));
            (aabb.unwrap_or(NOWHERE), is_stray)
        };
        let now = places.par_iter().enumerate().with_min_len(256).map(now);
        let (now, strays): (Vec<Aabb>, Vec<bool>) = now.unzip();
        let is_plane = |place: &Place| {
            world.bodies.worlds().get(place.body as usize) == Some(&(part as u32))
                && place.find(world).is_some_and(|(collider, _)| collider.shape.is_half_space())
        };
        let unbounded = now.iter().zip(&places).filter(|(aabb, _)| **aabb == NOWHERE).map(|(_, place)| *place);
        let mut planes: Vec<Place> = unbounded.filter(is_plane).collect();
        planes.sort_unstable();
        let tree = tree.for_boxes(&now, strays.iter().filter(|stray| **stray).count());
        Self { tree, places, planes }
    }

    /// Visits the colliders that have a box, like [`Tree::nearest`].
    pub fn nearest(
        &self,
        limit: f32,
        bound: impl Fn(&[Vec4; 3], &[Vec4; 3]) -> Vec4,
        mut visit: impl FnMut(Place, f32) -> f32,
    ) {
        self.tree.nearest(limit, bound, |i, bound| visit(self.places[i as usize], bound));
    }
}

fn contains(outer: &Aabb, inner: &Aabb) -> bool {
    (outer.mins.cmple(inner.mins) & outer.maxs.cmpge(inner.maxs)).all()
}

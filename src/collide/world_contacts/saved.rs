//! The contacts of one world as bytes.
//!
//! Most of this data can be recomputed: a manifold follows from the poses of its bodies when it was computed, and from
//! the distance of the prediction. Poses are saved by centers of mass, so a manifold is recomputed only if the center
//! of each body is its origin; other manifolds are saved in full. Test builds also recompute manifolds while saving,
//! and compare all bits.

mod pairs;
mod places;
mod remake;

use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Pose;

use super::{ColliderRange, FAT, WorldContacts};
use crate::collide::collider::{ColliderInfo, CuboidPlace};
use crate::collide::tree::NOWHERE;
use crate::error::{Result, ensure};
use crate::saved::{Archive, Saved};
use crate::world::{Body, Collider, World};

/// A body and its colliders.
pub(in crate::collide) struct PlacedBody<'a> {
    pub index: u32,
    pub colliders: ColliderRange,
    /// The present body, if it is in the world.
    pub body: Option<&'a Body>,
    /// Whether its colliders are those of the body in the world.
    pub is_current: bool,
}

impl WorldContacts {
    /// The places of colliders, and pending work for the next detection.
    pub fn walk_places<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self {
            colliders,
            leaving,
            vacant,
            cuboids,
            fat,
            moved,
            before,
            tree: _,
            planes,
            sensors,
            strayed: _,
            pairs: _,
            keys: _,
            found: _,
            ended,
            changed,
            look_again,
        } = self;
        let count = archive.count(colliders.len())?;
        if A::READS {
            colliders.resize(count, ColliderInfo::gone());
            cuboids.resize(count, CuboidPlace::default());
            fat.resize(count, NOWHERE);
            moved.resize(count, false);
            before.resize(count, NOWHERE);
        }
        leaving.walk(archive)?;
        vacant.walk(archive)?;
        planes.walk(archive)?;
        sensors.walk(archive)?;
        ended.walk(archive)?;
        changed.walk(archive)?;
        look_again.walk(archive)?;
        let exists =
            |range: &ColliderRange| range.first.checked_add(range.count).is_some_and(|end| end as usize <= count);
        let vacancies =
            vacant.iter().flat_map(|(&count, all)| all.iter().map(move |&first| ColliderRange { first, count }));
        let all = vacancies.chain(leaving.iter().copied()).all(|range| exists(&range));
        let planes = planes.iter().all(|plane| (plane.collider as usize) < count);
        let sensors = sensors.iter().all(|&sensor| (sensor as usize) < count);
        ensure(all && planes && sensors, || format!("a place beyond the last of {count} colliders"))
    }

    /// The colliders, their boxes and their pairs.
    pub fn walk_contacts<A: Archive>(
        &mut self,
        bodies: &[PlacedBody],
        world: &World,
        base: [f32; 2],
        archive: &mut A,
    ) -> Result<()> {
        let mut are_current = vec![false; self.colliders.len()];
        let mut known = 0;
        for PlacedBody { index, colliders, body, is_current } in bodies {
            known = known.max(index + 1);
            let places = colliders.first as usize..(colliders.first as usize).saturating_add(colliders.count as usize);
            ensure(places.end <= self.colliders.len(), || format!("body {index} has colliders {places:?}"))?;
            let own = body.filter(|_| *is_current).map(|body| &body.colliders[..]);
            ensure(own.is_none_or(|own| own.len() == places.len()), || format!("body {index} has other colliders"))?;
            if A::READS {
                own.into_iter().flatten().try_for_each(Collider::check)?;
            }
            for (k, place) in places.enumerate() {
                if A::READS {
                    let info = own.map(|own| ColliderInfo::new(*index, k as u32, &own[k]));
                    self.colliders[place] =
                        info.unwrap_or_else(|| ColliderInfo { body: *index, ..ColliderInfo::gone() });
                    self.cuboids[place] = CuboidPlace::of(&self.colliders[place]);
                }
                are_current[place] = own.is_some();
            }
        }
        let guess = |place: usize| {
            let info = &self.colliders[place];
            let body = world.bodies.get(info.body as usize).filter(|_| are_current[place] && !info.unbounded);
            let around = |body: &Body| {
                info.aabb(Pose::from_parts(body.position, body.rotation)).loosened((FAT * info.size).max(0.0))
            };
            body.map_or(NOWHERE, around)
        };
        let boxes = archive.chunks(self.fat.len(), 6, |range, columns| {
            let mut boxes = Vec::new();
            for place in range {
                let (mut fat, guess) = (self.fat[place], guess(place));
                for k in 0..3 {
                    columns.near(k, &mut fat.mins[k], guess.mins[k])?;
                    columns.near(3 + k, &mut fat.maxs[k], fat.mins[k] + (guess.maxs[k] - guess.mins[k]))?;
                }
                if columns.reads() {
                    boxes.push(fat);
                }
            }
            Ok(boxes)
        })?;
        if A::READS {
            self.fat = boxes.into_iter().flatten().collect::<Vec<Aabb>>();
        }
        self.walk_pairs(&are_current, known, world, base, archive)
    }
}

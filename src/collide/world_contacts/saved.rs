//! The contacts of one world as bytes.
//!
//! Most of it follows from little: a manifold from where its bodies were when it was computed, and from the distance up to which contacts
//! were predicted. The places of bodies tell the centers of mass, so that only manifolds of bodies whose center is their origin are made
//! again from that, and the others are written as they are. Builds for tests make them again when they are saved, too, and compare all bits.
//! Where a body was is near where it is, and the same for some of its pairs.

use glam::{Quat, Vec3};
use parry3d::bounding_volume::BoundingVolume;
use parry3d::math::Pose;
use rayon::prelude::*;

use super::{ColliderRange, FAT, WorldContacts};
use crate::collide::collider::{BodyState, ColliderInfo, CuboidPlace, FARTHEST};
use crate::collide::cuboids::{CuboidPair, CuboidScratch, cuboid_contacts};
use crate::collide::manifold::Manifold;
use crate::collide::pair::{Pair, PairScratch, Side};
use crate::collide::pairs::{NEVER, Pairs, Placed, Track};
use crate::collide::tree::NOWHERE;
use crate::error::{Result, ensure, input};
use crate::lanes::InstructionSet;
use crate::saved::{Archive, Saved};
use crate::world::{Body, World};

/// A body and its colliders.
pub(in crate::collide) struct PlacedBody<'a> {
    pub index: u32,
    pub colliders: ColliderRange,
    /// The body as it is in the world now, if it is there.
    pub body: Option<&'a Body>,
    /// Whether its colliders are those that it has in the world.
    pub is_current: bool,
}

/// How a pair is written.
#[derive(Clone, Copy, Default)]
struct Flags {
    is_swapped: bool,
    takes_part: bool,
    /// Sizes and bodies are those of the colliders.
    is_plain: bool,
    /// The manifolds were computed at some time.
    is_computed: bool,
    /// The manifolds follow from the rest.
    are_remade: bool,
    /// How many manifolds there are; 3 for more than 2.
    manifolds: u8,
}

impl Saved for Flags {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self { is_swapped, takes_part, is_plain, is_computed, are_remade, manifolds } = self;
        let all = [is_swapped, takes_part, is_plain, is_computed, are_remade];
        let mut bits = (0..).zip(&all).map(|(k, flag)| u8::from(**flag) << k).sum::<u8>() | *manifolds << 5;
        bits.walk(archive)?;
        *manifolds = bits >> 5 & 3;
        (0..).zip(all).for_each(|(k, flag)| *flag = bits >> k & 1 == 1);
        Ok(())
    }
}

/// Pairs that one task makes again.
const PAIRS_A_TASK: usize = 512;

/// Where bodies were, body by body the latest first.
struct Places {
    /// The latest of each body, one more than its index; 0 if there is none.
    latest: Vec<u32>,
    /// Each with the one before it, likewise.
    all: Vec<(Placed, u32)>,
}

/// Places of a body that are looked through for one that is there already.
const MOST_PLACES: u8 = 14;

impl Places {
    /// How many places before the latest one of a body this is, from 1 on; 0 if it is new.
    fn back(&self, body: u32, place: &Placed) -> u8 {
        let mut at = self.latest[body as usize];
        for back in 1..=MOST_PLACES {
            let Some((own, before)) = self.all.get((at as usize).wrapping_sub(1)) else { return 0 };
            if bytemuck::bytes_of(own) == bytemuck::bytes_of(place) {
                return back;
            }
            at = *before;
        }
        0
    }

    fn get(&self, body: u32, back: u8) -> Result<Placed> {
        let mut at = self.latest[body as usize];
        for _ in 1..back {
            at = self.all.get((at as usize).wrapping_sub(1)).map_or(0, |place| place.1);
        }
        let place = self.all.get((at as usize).wrapping_sub(1));
        Ok(place.ok_or_else(|| input!("body {body} was nowhere"))?.0)
    }

    fn walk<A: Archive>(
        &mut self,
        bodies: [u32; 2],
        then: &mut [Placed; 2],
        world: &World,
        archive: &mut A,
    ) -> Result<()> {
        let [a, b] = [0, 1].map(|k| self.back(bodies[k], &then[k]));
        let mut backs = a | b << 4;
        backs.walk(archive)?;
        for ((body, then), back) in bodies.into_iter().zip(then).zip([backs & 15, backs >> 4]) {
            if back > 0 {
                *then = self.get(body, back)?;
                continue;
            }
            let now = world.bodies.get(body as usize);
            let center = now.map_or(Vec3::ZERO, Body::center_of_mass);
            let rotation = now.map_or_else(Default::default, |body| body.rotation);
            archive.near_vector(&mut then.center, center)?;
            walk_rotation(&mut then.rotation, rotation, archive)?;
            let mut is_centered = then.is_centered == 1.0;
            is_centered.walk(archive)?;
            *then = Placed { is_centered: f32::from(is_centered), ..*then };
            let latest = &mut self.latest[body as usize];
            self.all.push((*then, *latest));
            *latest = self.all.len() as u32;
        }
        Ok(())
    }
}

/// A rotation near another. Its length is known, so that the component which is largest there follows from the others but for rounding.
fn walk_rotation<A: Archive>(rotation: &mut Quat, near: Quat, archive: &mut A) -> Result<()> {
    let (mut own, near) = (rotation.to_array(), near.to_array());
    let largest = (1..4).fold(0, |best, k| if near[k].abs() > near[best].abs() { k } else { best });
    let mut square = 1.0;
    for k in (0..4).filter(|&k| k != largest) {
        archive.near(&mut own[k], near[k])?;
        square -= f64::from(own[k]) * f64::from(own[k]);
    }
    archive.near(&mut own[largest], (square.max(0.0).sqrt() as f32).copysign(near[largest]))?;
    *rotation = Quat::from_array(own);
    Ok(())
}

impl WorldContacts {
    /// The places of colliders, and what waits for the next detection.
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
        let mut guesses = vec![NOWHERE; self.colliders.len()];
        let mut are_current = vec![false; self.colliders.len()];
        let mut known = 0;
        for PlacedBody { index, colliders, body, is_current } in bodies {
            known = known.max(index + 1);
            let places = colliders.first as usize..(colliders.first as usize).saturating_add(colliders.count as usize);
            ensure(places.end <= self.colliders.len(), || format!("body {index} has colliders {places:?}"))?;
            let own = body.filter(|_| *is_current).map(|body| (body, &body.colliders[..]));
            ensure(own.is_none_or(|own| own.1.len() == places.len()), || format!("body {index} has other colliders"))?;
            for (k, place) in places.enumerate() {
                if A::READS {
                    let info = own.map(|(_, own)| ColliderInfo::new(*index, k as u32, &own[k]));
                    self.colliders[place] =
                        info.unwrap_or_else(|| ColliderInfo { body: *index, ..ColliderInfo::gone() });
                    self.cuboids[place] = CuboidPlace::of(&self.colliders[place]);
                }
                let info = &self.colliders[place];
                if let Some((body, _)) = own.filter(|_| !info.unbounded) {
                    guesses[place] =
                        info.aabb(Pose::from_parts(body.position, body.rotation)).loosened(FAT * info.size);
                }
                are_current[place] = own.is_some();
            }
        }
        for (fat, guess) in self.fat.iter_mut().zip(&guesses) {
            archive.near_vector(&mut fat.mins, guess.mins)?;
            archive.near_vector(&mut fat.maxs, fat.mins + (guess.maxs - guess.mins))?;
        }
        self.walk_pairs(&are_current, known, world, base, archive)
    }

    fn walk_pairs<A: Archive>(
        &mut self,
        are_current: &[bool],
        known: u32,
        world: &World,
        [share, added]: [f32; 2],
        archive: &mut A,
    ) -> Result<()> {
        let mut are_remade = vec![false; if A::READS { 0 } else { self.pairs.len() }];
        let count = archive.count(self.pairs.len())?;
        let mut pairs = Pairs::default();
        let mut places = Places { latest: vec![0; known as usize], all: Vec::new() };
        let mut slots: Vec<u32> = Vec::new();
        let mut last = 0;
        if A::READS {
            self.keys.resize(count, (0, 0));
            are_remade.resize(count, false);
        }
        // The first of the slots of each pair that is made again, and one past the last.
        let mut slots_of = vec![0_u32];
        for (i, remade) in are_remade.iter_mut().enumerate() {
            let mut flags = Flags::default();
            let (mut i_key, mut manifolds) = (self.keys[i], 0);
            if !A::READS {
                let (pair, track) = self.pairs.with_track(i);
                let plain = Track::of(&Pair::new(pair.collider_a, pair.collider_b, &self.colliders), &self.colliders);
                let are_current = are_current[i_key.0 as usize] && are_current[i_key.1 as usize];
                let is_plain = are_current && is_plain(pair, track, &plain);
                *remade = is_plain && self.is_remade(i);
                flags = Flags {
                    is_swapped: pair.collider_a > pair.collider_b,
                    takes_part: pair.takes_part,
                    is_plain,
                    is_computed: track.predicted != NEVER,
                    are_remade: *remade,
                    manifolds: pair.manifolds.len().min(3) as u8,
                };
                manifolds = pair.manifolds.len();
            }
            flags.walk(archive)?;
            archive.index(&mut i_key.0, last)?;
            archive.index(&mut i_key.1, i_key.0)?;
            last = i_key.0;
            self.keys[i] = i_key;
            manifolds = if flags.manifolds < 3 { flags.manifolds.into() } else { archive.count(manifolds)? };
            if !A::READS {
                let (pair, track) = self.pairs.with_track(i);
                let (mut pair, mut track) = (PairRest::of(pair, track), *track);
                if !flags.is_plain {
                    pair.walk(archive)?;
                }
                walk_track(&mut track, flags, share * pair.size + added, &mut places, world, archive)?;
                let own = &mut self.pairs[i].manifolds;
                if flags.are_remade {
                    own.iter_mut().try_for_each(|own| own.slot.walk(archive))?;
                } else {
                    own.iter_mut().try_for_each(|own| own.walk(archive))?;
                }
                continue;
            }
            let exist = (i_key.0.max(i_key.1) as usize) < self.colliders.len();
            ensure(exist, || format!("pair {i} is of colliders {i_key:?} of {}", self.colliders.len()))?;
            let (a, b) = if flags.is_swapped { (i_key.1, i_key.0) } else { i_key };
            let mut pair = Pair::new(a, b, &self.colliders);
            let mut track = Track::of(&pair, &self.colliders);
            if !flags.is_plain {
                let mut rest = PairRest::blank();
                rest.walk(archive)?;
                (pair.body_a, pair.body_b, pair.size) = (rest.bodies[0], rest.bodies[1], rest.size);
                (track.bodies, track.size, track.reach_b, track.unbounded) =
                    (rest.bodies, rest.size, rest.reach_b, rest.unbounded);
            }
            ensure(track.bodies.iter().all(|&body| body < known), || {
                format!("pair {i} is of bodies {:?}", track.bodies)
            })?;
            (pair.takes_part, track.takes_part) = (flags.takes_part, f32::from(flags.takes_part));
            walk_track(&mut track, flags, share * pair.size + added, &mut places, world, archive)?;
            *remade = flags.are_remade && flags.is_plain && flags.is_computed;
            if flags.are_remade {
                for _ in 0..manifolds {
                    let mut slot = 0;
                    slot.walk(archive)?;
                    slots.push(slot);
                }
            } else {
                for _ in 0..manifolds {
                    let mut own = Manifold::blank();
                    own.walk(archive)?;
                    pair.manifolds.push(own);
                }
            }
            slots_of.push(slots.len() as u32);
            pairs.push(pair, track);
        }
        let remade: Vec<u32> = (0..count as u32).filter(|&i| are_remade[i as usize]).collect();
        if A::READS {
            self.pairs = pairs;
            return self.remake(&remade, &slots, &slots_of);
        }
        debug_assert!(self.are_same_again(&remade), "a manifold does not follow from where its bodies were");
        Ok(())
    }

    /// Whether the manifolds of a pair follow from the rest, where its colliders and all that follows from them are as they were.
    fn is_remade(&self, i: usize) -> bool {
        let then = self.pairs.computed_at(i);
        then.is_some_and(|then| then.iter().all(|place| place.is_centered == 1.0))
            && !self.pairs[i].manifolds.is_empty()
    }

    /// Whether the manifolds of pairs come out with the same bits when they are made again.
    fn are_same_again(&self, pairs: &[u32]) -> bool {
        pairs.par_chunks(PAIRS_A_TASK).all(|chunk| {
            let mut same = 0;
            self.make_again(chunk, |k, now| {
                let then = &self.pairs[chunk[k] as usize].manifolds;
                let is_same = now.len() == then.len() && now.iter().zip(then).all(|(now, then)| now.is_as(then));
                same += usize::from(is_same);
            });
            same == chunk.len()
        })
    }

    /// Makes the manifolds of these pairs again and gives them their slots.
    fn remake(&mut self, wanted: &[u32], slots: &[u32], slots_of: &[u32]) -> Result<()> {
        let can_be = |&i: &u32| {
            let (_, Track { predicted, then, .. }) = self.pairs.with_track(i as usize);
            let is_near = |place: &Placed| {
                place.center.abs().max_element() <= FARTHEST && (place.rotation.length_squared() - 1.0).abs() < 0.1
            };
            then.iter().all(is_near) && *predicted >= 0.0
        };
        ensure(wanted.iter().all(can_be), || "a pair was computed where nothing can be".to_owned())?;
        let again = wanted.par_chunks(PAIRS_A_TASK).flat_map_iter(|chunk| {
            let mut all = vec![Vec::new(); chunk.len()];
            self.make_again(chunk, |k, now| all[k] = std::mem::take(now));
            all
        });
        let again: Vec<Vec<Manifold>> = again.collect();
        for (manifolds, &i) in again.into_iter().zip(wanted) {
            let i = i as usize;
            let own = &slots[slots_of[i] as usize..slots_of[i + 1] as usize];
            ensure(own.len() == manifolds.len(), || {
                format!("pair {i} has {} manifolds, not {}", manifolds.len(), own.len())
            })?;
            self.pairs[i].manifolds = manifolds;
            self.pairs[i].manifolds.iter_mut().zip(own).for_each(|(manifold, &slot)| manifold.slot = slot);
        }
        Ok(())
    }

    /// Makes the manifolds of pairs again where their bodies were, and calls `with` on the place of each in the chunk and on them; not on pairs
    /// of cuboids that do not touch.
    fn make_again(&self, chunk: &[u32], mut with: impl FnMut(usize, &mut Vec<Manifold>)) {
        let Some(&first) = chunk.first() else { return };
        let mut scratch = PairScratch::default();
        let mut again = self.pairs[first as usize].clone();
        let begin = |pair: &Pair, again: &mut Pair| {
            let Pair { body_a, body_b, manifolds: _, colliders, collider_a, collider_b, size, takes_part } = *pair;
            let mut manifolds = std::mem::take(&mut again.manifolds);
            manifolds.clear();
            *again = Pair { body_a, body_b, manifolds, colliders, collider_a, collider_b, size, takes_part };
        };
        let mut states = Vec::with_capacity(2 * chunk.len());
        let mut cuboids = Vec::with_capacity(chunk.len());
        for (number, &i) in chunk.iter().enumerate() {
            let (pair, track) = self.pairs.with_track(i as usize);
            let state = |&Placed { rotation, center, .. }: &Placed| BodyState {
                rotation,
                center,
                position: center,
                ..BodyState::default()
            };
            states.extend(track.then.iter().map(state));
            let places = [pair.collider_a, pair.collider_b];
            if places.iter().all(|&c| self.cuboids[c as usize].is_cuboid()) {
                let bodies = [0, 1].map(|side| (2 * number + side) as u32);
                cuboids.push(CuboidPair {
                    bodies,
                    cuboids: places,
                    prediction: track.predicted,
                    number: number as u32,
                });
            } else {
                begin(pair, &mut again);
                again.compute(self.sides_of(pair, &states[2 * number..]), track.predicted, &mut scratch);
                with(number, &mut again.manifolds);
            }
        }
        let set = InstructionSet::default();
        cuboid_contacts(set, &states, &self.cuboids, &cuboids, &mut CuboidScratch::default(), |number, write| {
            let number = number as usize;
            let (pair, track) = self.pairs.with_track(chunk[number] as usize);
            begin(pair, &mut again);
            again.take_over(self.sides_of(pair, &states[2 * number..]), track.predicted, write, &mut scratch);
            with(number, &mut again.manifolds);
        });
    }

    fn sides_of<'a>(&'a self, pair: &Pair, states: &'a [BodyState]) -> [Side<'a>; 2] {
        let side = |collider: u32, state: &'a BodyState| (&self.colliders[collider as usize], state);
        [side(pair.collider_a, &states[0]), side(pair.collider_b, &states[1])]
    }
}

/// What a pair has of its colliders.
struct PairRest {
    bodies: [u32; 2],
    size: f32,
    reach_b: f32,
    unbounded: f32,
}

crate::saved::fields!(PairRest { bodies, size, reach_b, unbounded });

impl PairRest {
    fn of(pair: &Pair, track: &Track) -> Self {
        Self { bodies: [pair.body_a, pair.body_b], size: pair.size, reach_b: track.reach_b, unbounded: track.unbounded }
    }
}

/// Whether a pair has of its colliders what it would have if it began now.
fn is_plain(pair: &Pair, track: &Track, plain: &Track) -> bool {
    let rest = |track: &Track| [track.size, track.reach_b, track.unbounded].map(f32::to_bits);
    track.bodies == plain.bodies
        && [pair.body_a, pair.body_b] == plain.bodies
        && pair.size.to_bits() == plain.size.to_bits()
        && rest(track) == rest(plain)
}

/// Where the bodies of a pair were, and how far ahead its contacts were sought.
fn walk_track<A: Archive>(
    track: &mut Track,
    flags: Flags,
    guess: f32,
    places: &mut Places,
    world: &World,
    archive: &mut A,
) -> Result<()> {
    if !flags.is_computed {
        track.predicted = NEVER;
        return Ok(());
    }
    archive.near(&mut track.predicted, guess)?;
    places.walk(track.bodies, &mut track.then, world, archive)
}

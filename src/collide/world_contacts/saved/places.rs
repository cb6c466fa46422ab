//! The poses of bodies when their pairs were computed. Several pairs of a body were often computed in the same step,
//! and its poses in different steps are near each other.

use rayon::prelude::*;

use crate::collide::pairs::{NEVER, Pairs, Placed, Track};
use crate::error::{Result, input};
use crate::saved::{Archive, Columns};
use crate::world::{Body, World};

/// Column indices: which pose, the center, and two for the rotation.
const WHICH: usize = 0;
const CENTER: usize = 1;
const ROTATION: usize = 4;

/// Number of poses of a body that are searched for an equal one.
const MAX_PLACES: usize = 14;

/// The sides of the computed pairs, body by body. Side `k` of pair `i` has the number `2 i + k`.
struct Sides {
    /// The first entry of each body, and the end of the last one.
    begins: Vec<u32>,
    all: Vec<u32>,
    /// The index of each side in `all`.
    places: Vec<u32>,
}

impl Sides {
    fn of(tracks: &[Track], bodies: usize) -> Self {
        let computed = || {
            tracks.iter().enumerate().filter(|(_, track)| track.predicted != NEVER).map(|(i, track)| (i, track.bodies))
        };
        let mut begins = vec![0; bodies + 1];
        computed().for_each(|(_, own)| own.iter().for_each(|&body| begins[body as usize + 1] += 1));
        (0..bodies).for_each(|body| begins[body + 1] += begins[body]);
        let (mut next, mut places) = (begins.clone(), vec![0; 2 * tracks.len()]);
        let mut all = vec![0; begins[bodies] as usize];
        for (i, own) in computed() {
            for (side, body) in (2 * i..).zip(own) {
                let place = &mut next[body as usize];
                (all[*place as usize], places[side]) = (side as u32, *place);
                *place += 1;
            }
        }
        Self { begins, all, places }
    }
}

/// Writes or reads the poses of the bodies of all pairs.
pub(super) fn walk_places_then<A: Archive>(
    pairs: &mut Pairs,
    bodies: usize,
    world: &World,
    archive: &mut A,
) -> Result<()> {
    let tracks = &pairs.tracks;
    let Sides { begins, all, places } = Sides::of(tracks, bodies);
    let read = archive.chunks(bodies, ROTATION + 2, |range, columns| {
        let mut read = Vec::new();
        let mut known = Vec::new();
        for body in range {
            known.clear();
            for &side in &all[begins[body] as usize..begins[body + 1] as usize] {
                let mut place = tracks[side as usize / 2].then[side as usize % 2];
                walk_place(&mut place, &mut known, world.bodies.get(body), columns)?;
                if columns.reads() {
                    read.push(place);
                }
            }
        }
        Ok(read)
    })?;
    if A::READS {
        let read: Vec<Placed> = read.into_iter().flatten().collect();
        let give = |(track, own): (&mut Track, &[u32])| {
            if track.predicted != NEVER {
                track.then = [0, 1].map(|k| read[own[k] as usize]);
            }
        };
        pairs.tracks.par_iter_mut().zip(places.par_chunks(2)).with_min_len(512).for_each(give);
    }
    Ok(())
}

/// Writes or reads a pose. It is one of the `known` poses of the body, or joins them. 0 and 1 mark a new pose: with 1,
/// the center is at the origin. Higher numbers count back to a known one.
fn walk_place(place: &mut Placed, known: &mut Vec<Placed>, now: Option<&Body>, columns: &mut Columns) -> Result<()> {
    let is_same = |own: &Placed| bytemuck::bytes_of(own) == bytemuck::bytes_of(place);
    let back = known.iter().rev().take(MAX_PLACES).position(is_same);
    let mut which = back.map_or(u8::from(place.is_centered == 1.0), |back| back as u8 + 2);
    columns.byte(WHICH, &mut which)?;
    if let Some(back) = usize::from(which).checked_sub(2) {
        let own = known.iter().rev().nth(back).ok_or_else(|| input!("a place {back} back of {}", known.len()))?;
        *place = *own;
        return Ok(());
    }
    let (center, rotation) = match (known.last(), now) {
        (Some(last), _) => (last.center, last.rotation),
        (None, Some(body)) => (body.center_of_mass(), body.rotation),
        (None, None) => Default::default(),
    };
    for k in 0..3 {
        columns.near(CENTER + k, &mut place.center[k], center[k])?;
    }
    columns.near_rotation(ROTATION, &mut place.rotation, rotation)?;
    place.is_centered = f32::from(which);
    known.push(*place);
    Ok(())
}

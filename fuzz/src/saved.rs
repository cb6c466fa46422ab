//! Saved states and recordings with damage that their hash does not reveal.

use drystone::{Cpu, Simulation};
use drystone_scenes::{Recorder, RecordingIntervals, Replay, Scene};

use crate::borne;

/// Bytes before the content of a saved run: magic, version, hash of the content.
const HEADER: usize = 8 + 4 + 8;

/// The hash of a saved run, or of a part of a recording.
fn hash_of(content: &[u8]) -> [u8; 8] {
    let (words, rest) = content.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let words = words.iter().chain([&last]).map(|word| u64::from_le_bytes(*word));
    let mix = |hash: u64, word: u64| (hash.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    words.fold(content.len() as u64, mix).to_le_bytes()
}

/// Recomputes the hash of the header, as an attacker would.
fn fit(bytes: &mut [u8]) {
    if let Some((header, content)) = bytes.split_first_chunk_mut::<HEADER>() {
        header[12..].copy_from_slice(&hash_of(content));
    }
}

/// The same for each part of a recording. Parts follow magic and version: kind, length, hash, content.
fn fit_parts(bytes: &mut [u8]) {
    let Some((_, mut rest)) = bytes.split_at_mut_checked(8 + 4) else { return };
    while let Some((header, after)) = rest.split_first_chunk_mut::<17>() {
        let length = header[1..9].iter().rev().fold(0, |sum: u64, &byte| sum << 8 | u64::from(byte));
        let cut = usize::try_from(length).ok().and_then(|length| after.split_at_mut_checked(length));
        let Some((content, after)) = cut else { return };
        if content.starts_with(b"drystone") {
            fit(content);
        }
        header[9..].copy_from_slice(&hash_of(content));
        rest = after;
    }
}

/// A saved run with a recomputed hash.
pub fn state(data: &[u8]) {
    let mut bytes = data.to_vec();
    fit(&mut bytes);
    let Some(mut simulation) = borne(Simulation::load(&bytes, Box::new(Cpu::new()))) else { return };
    for _ in 0..3 {
        if borne(simulation.step(1.0 / 60.0)).is_none() {
            return;
        }
    }
}

fn begun(spec: &str, steps: usize) -> Simulation {
    let scene = Scene::find_spec(spec).expect("a scene");
    let mut simulation = Simulation::new(scene.world).expect("a world");
    (0..steps).for_each(|_| drop(simulation.step(scene.dt).expect("a step")));
    simulation
}

const SPECS: [(&str, usize); 4] = [("tower:n=2", 3), ("tower:n=2", 90), ("pile:n=5", 40), ("four-bar", 5)];

pub fn states() -> Vec<Vec<u8>> {
    SPECS.iter().map(|&(spec, steps)| begun(spec, steps).save()).collect()
}

pub fn replay(data: &[u8]) {
    let mut bytes = data.to_vec();
    fit_parts(&mut bytes);
    let Some(mut replay) = borne(Replay::read(&bytes)) else { return };
    let Some(mut simulation) = borne(replay.begin(Box::new(Cpu::new()))) else { return };
    for _ in 0..replay.len().min(20) {
        if borne(replay.step(&mut simulation)).is_none() {
            return;
        }
    }
}

pub fn replays() -> Vec<Vec<u8>> {
    let recorded = |&(spec, steps): &(&str, usize)| {
        let mut simulation = begun(spec, steps);
        let mut recorder =
            Recorder::new(Vec::new(), spec, &mut simulation, RecordingIntervals::default()).expect("memory");
        for _ in 0..6 {
            recorder.step(&mut simulation, 1.0 / 60.0).expect("a step");
        }
        recorder.finish().expect("memory")
    };
    SPECS.iter().map(recorded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_that_is_made_to_fit_is_the_one_that_is_asked_for() {
        for good in states() {
            let mut bytes = good.clone();
            bytes[12..HEADER].fill(0);
            assert!(Simulation::load(&bytes, Box::new(Cpu::new())).is_err());
            fit(&mut bytes);
            assert_eq!(bytes, good);
        }
        for good in replays() {
            let mut bytes = good.clone();
            // The hash of the first part.
            bytes[21..29].fill(0);
            assert!(Replay::read(&bytes).is_err());
            fit_parts(&mut bytes);
            assert_eq!(bytes, good);
        }
    }
}

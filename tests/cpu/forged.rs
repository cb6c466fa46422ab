//! Saved runs that someone forged, whose hash fits: one clear line, or steps without a panic.

use drystone::{Cpu, Simulation};
use drystone_scenes::Scene;

/// Bytes before the content: magic, version, hash of the content.
const HEADER: usize = 8 + 4 + 8;

fn saved(spec: &str, steps: usize) -> Vec<u8> {
    let scene = Scene::find_spec(spec).expect("a scene");
    let mut simulation = Simulation::new(scene.world).expect("a world");
    (0..steps).for_each(|_| drop(simulation.step(scene.dt).expect("a step")));
    simulation.save()
}

/// Makes the hash of the header fit the content, as someone would who means harm.
fn fit(bytes: &mut [u8]) {
    let (header, content) = bytes.split_first_chunk_mut::<HEADER>().expect("a header");
    let (words, rest) = content.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let words = words.iter().chain([&last]).map(|word| u64::from_le_bytes(*word));
    let mix = |hash: u64, word: u64| (hash.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    header[12..].copy_from_slice(&words.fold(content.len() as u64, mix).to_le_bytes());
}

/// What becomes of a byte.
const CHANGES: [fn(u8) -> u8; 3] = [|byte| byte ^ 1, |byte| byte ^ 0x80, |_| 0xff];

/// How far a forged run gets: refused when it is loaded, refused in one of three steps, or not at all.
fn borne(bytes: &[u8]) -> usize {
    let one_line = |error: drystone::Error| {
        let line = error.to_string();
        assert!(!line.is_empty() && !line.contains(char::is_control) && line.len() < 1000, "{line:?}");
    };
    match Simulation::load(bytes, Box::new(Cpu::new())) {
        Err(error) => {
            one_line(error);
            0
        }
        Ok(mut simulation) => {
            let failed = (0..3).find_map(|_| simulation.step(1.0 / 60.0).err());
            failed.map_or(2, |error| {
                one_line(error);
                1
            })
        }
    }
}

#[test]
fn every_byte_of_a_saved_run_may_be_forged() {
    for (spec, steps) in [("tower:n=2", 3), ("tower:n=1", 90)] {
        let good = saved(spec, steps);
        let mut again = good.clone();
        fit(&mut again);
        assert!(again == good && borne(&good) == 2, "{spec}: the hash is another one");
        let mut ends = [0; 3];
        for place in HEADER..good.len() {
            for change in CHANGES {
                let mut bytes = good.clone();
                bytes[place] = change(bytes[place]);
                fit(&mut bytes);
                ends[borne(&bytes)] += 1;
            }
        }
        // Many are refused, and many are other worlds, which are as good.
        assert!(ends[0] > 50 && ends[2] > 50, "{spec}: {ends:?}");
    }
}

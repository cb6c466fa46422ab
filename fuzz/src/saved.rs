//! Saved states and recordings, damaged behind the hash that finds damage.

use drystone::{Cpu, Recorder, RecordingIntervals, Replay, Scene, Simulation, SolverConfig};

use crate::good;

/// A saved run whose hash is made to fit, as someone would who means harm.
pub fn state(data: &[u8]) {
    let bytes = data.to_vec();
    let Some(mut simulation) = good(Simulation::load(&bytes, Box::new(Cpu::new()))) else { return };
    for _ in 0..3 {
        if good(simulation.step(1.0 / 60.0)).is_none() {
            return;
        }
    }
}

fn begun(spec: &str, steps: usize) -> Simulation {
    let scene = Scene::find_spec(spec).expect("a scene");
    let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Cpu::new())).expect("a world");
    (0..steps).for_each(|_| drop(simulation.step(scene.dt).expect("a step")));
    simulation
}

const SPECS: [(&str, usize); 4] = [("tower:n=2", 3), ("tower:n=2", 90), ("pile:n=5", 40), ("four-bar", 5)];

pub fn states() -> Vec<Vec<u8>> {
    SPECS.iter().map(|&(spec, steps)| begun(spec, steps).save()).collect()
}

pub fn replay(data: &[u8]) {
    let Some(mut replay) = good(Replay::read(data)) else { return };
    let Some(mut simulation) = good(replay.begin(Box::new(Cpu::new()))) else { return };
    for _ in 0..replay.len().min(20) {
        if good(replay.step(&mut simulation)).is_none() {
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

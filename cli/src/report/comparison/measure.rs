//! Contenders step one scene in turns, so that whatever slows the machine down meets all of them, and are scored by what
//! they get wrong.

use serde::{Deserialize, Serialize};

use super::contender::{Contender, Setting};
use super::origin::Origin;
use crate::report::rounds::{Clock, interleave, quartiles};
use drystone::metrics::{Penetration, drift, in_place_count, rms_speed};
use drystone::stats::quantile;
use drystone::{Error, Result, Scene, SolverConfig, World};

/// Steps of one contender before it is the next one's turn.
const BLOCK: u32 = 10;

/// One contender on one scene: what it cost and what it got wrong. Everything is of the second half of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the scene.
    pub scene: String,
    /// Hash of what is in it: rows may be compared only if it is the same.
    pub hash: String,
    /// Names the run by when it began: rows may be put in a ratio only if it is the same.
    pub run: String,
    /// Fingerprint of the program that ran.
    pub build: String,
    /// Commit that it was built from.
    pub commit: String,
    /// What it ran on.
    pub machine: String,
    /// Threads.
    pub threads: usize,
    /// Dynamic bodies.
    pub bodies: usize,
    /// Steps of the whole run.
    pub steps: u32,
    /// Name of the engine.
    pub engine: String,
    /// What it runs on.
    pub backend: String,
    /// Substeps of a step.
    pub substeps: u32,
    /// Sweeps of a substep.
    pub sweeps: u32,
    /// What is done with the sweeps.
    pub method: String,
    /// Friction rule.
    pub friction: String,
    /// What else is not at its default.
    pub more: String,
    /// What times are of: `processor` time of the process where one thread does everything, `wall` time with several threads and
    /// on a GPU.
    pub clock: String,
    /// Time of a step, median over the blocks (ms).
    pub ms: f64,
    /// Its lower and upper quartile (ms).
    pub ms_low: f64,
    /// Upper quartile.
    pub ms_high: f64,
    /// Ratio to the first contender of the run in the same blocks, median.
    pub ratio: f64,
    /// Its lower quartile.
    pub ratio_low: f64,
    /// Its upper quartile.
    pub ratio_high: f64,
    /// Deepest overlap (m).
    pub penetration_max: f64,
    /// Overlap that 95 % of the contacts do not exceed, median over the blocks (m).
    pub penetration_p95: f64,
    /// Mean overlap, median over the blocks (m).
    pub penetration_mean: f64,
    /// Root mean square speed, median over the blocks (m/s).
    pub speed_rms: f64,
    /// Largest horizontal distance of a body from where it began, at the end (m).
    pub drift: f64,
    /// Bodies that are in place at the end; none if the scene does not stand.
    pub in_place: Option<usize>,
    /// Largest distance between the anchors of a joint (m); none without joints.
    pub joint_gap: Option<f64>,
    /// Kinetic and potential energy gained over the whole run (J).
    pub energy_gained: f64,
    /// Whether all numbers stayed finite.
    pub finite: bool,
}

impl Row {
    /// What the row is of.
    pub fn setting(&self) -> Setting {
        let Self { engine, backend, substeps, sweeps, method, friction, more, .. } = self.clone();
        Setting { engine, backend, substeps, sweeps, method, friction, more }
    }

    /// How long it took relative to another row.
    pub fn time_ratio(&self, other: &Self) -> Result<f64> {
        for (what, own, others) in [("run", &self.run, &other.run), ("scene hash", &self.hash, &other.hash)] {
            if own != others {
                let names = [self, other].map(|row| format!("{} on {}", row.setting().label(), row.scene));
                return Err(Error::input(format!("no ratio of {} to {}: {what} {own}, {others}", names[0], names[1])));
            }
        }
        Ok(self.ratio / other.ratio)
    }

    /// Whether everything that should stand does, and all numbers are finite.
    pub fn holds(&self) -> bool {
        self.finite && self.in_place.is_none_or(|n| n == self.bodies)
    }
}

/// Times and errors of one contender while it is measured.
#[derive(Default)]
struct Lane {
    ms: Vec<f64>,
    penetration: Vec<Penetration>,
    speed: Vec<f64>,
    gap: Vec<f64>,
    finite: bool,
}

/// Runs all contenders over the steps of `scene`; the rows are in their order. `after_block` is called after
/// every block of every contender, [`blocks`] times a contender.
pub fn measure(
    scene: &Scene,
    contenders: &mut [Box<dyn Contender + '_>],
    origin: &Origin,
    after_block: &mut dyn FnMut(),
) -> Result<Vec<Row>> {
    let blocks = blocks(scene.steps) as usize;
    let run = Origin::now();
    let lane = |contender| (contender, Lane { finite: true, ..Lane::default() });
    let mut lanes: Vec<_> = contenders.iter_mut().map(lane).collect();
    interleave(blocks, &mut lanes, |block, (contender, lane)| {
        if lane.finite {
            let clock = Clock::of(&contender.setting().backend);
            let begin = clock.now();
            for _ in 0..BLOCK {
                contender.step().map_err(|e| Error::input(format!("{}: {e}", contender.setting().label())))?;
            }
            let ms = (clock.now() - begin).as_secs_f64() * 1e3 / f64::from(BLOCK);
            let world = contender.world();
            lane.finite = world.first_non_finite().is_none();
            if lane.finite && 2 * block >= blocks {
                lane.ms.push(ms);
                lane.penetration.push(Penetration::of_world(world, &SolverConfig::default()));
                lane.speed.push(rms_speed(world));
                lane.gap.push(world.joint_gap().into());
            }
        }
        after_block();
        Ok(())
    })?;
    let first = lanes[0].1.ms.clone();
    Ok(lanes.iter_mut().map(|(c, lane)| row(scene, c.setting(), c.world(), lane, &first, origin, &run)).collect())
}

/// Blocks of a run of so many steps.
pub fn blocks(steps: u32) -> u32 {
    steps.div_ceil(BLOCK).max(2)
}

/// Steps that each contender takes on the scene.
pub(super) fn steps(scene: &Scene) -> u32 {
    blocks(scene.steps) * BLOCK
}

fn row(scene: &Scene, setting: Setting, world: &World, lane: &Lane, first: &[f64], origin: &Origin, run: &str) -> Row {
    let ratios: Vec<f64> = lane.ms.iter().zip(first).map(|(ms, first)| ms / first).collect();
    let [ms_low, ms, ms_high] = quartiles(&lane.ms);
    let [ratio_low, ratio, ratio_high] = quartiles(&ratios);
    let middle = |of: fn(&Penetration) -> f64| quantile(&lane.penetration.iter().map(of).collect::<Vec<_>>(), 0.5);
    let energy = |w: &World| w.kinetic_energy() + w.potential_energy();
    let clock = Clock::of(&setting.backend).name().into();
    let Setting { engine, backend, substeps, sweeps, method, friction, more } = setting;
    Row {
        scene: scene.name.clone(),
        hash: scene.content_hash(),
        run: run.into(),
        build: origin.build.clone(),
        commit: origin.commit.clone(),
        machine: origin.machine.clone(),
        threads: origin.threads,
        bodies: scene.world.dynamic_count(),
        steps: steps(scene),
        engine,
        backend,
        substeps,
        sweeps,
        method,
        friction,
        more,
        clock,
        ms,
        ms_low,
        ms_high,
        ratio,
        ratio_low,
        ratio_high,
        penetration_max: quantile(&lane.penetration.iter().map(|p| p.max).collect::<Vec<_>>(), 1.0),
        penetration_p95: middle(|p| p.p95),
        penetration_mean: middle(|p| p.mean),
        speed_rms: quantile(&lane.speed, 0.5),
        drift: drift(&scene.world, world),
        in_place: scene.stands.then(|| in_place_count(&scene.world, world)),
        joint_gap: (!world.joints.is_empty()).then(|| quantile(&lane.gap, 1.0)),
        energy_gained: energy(world) - energy(&scene.world),
        finite: lane.finite,
    }
}

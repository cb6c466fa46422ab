//! Times and errors of contenders that step one scene in turns, so that a slow phase of the machine affects all of them.

use serde::{Deserialize, Serialize};

use super::contender::{Contender, Setting};
use super::origin::Origin;
use super::windows::{WindowRow, windows};
use crate::hard::energy;
use crate::report::rounds::{Clock, interleave, quartiles, thirds};
use crate::report::scene_hash::content_hash;
use drystone::glam::{Quat, Vec3};
use drystone::metrics::{Penetration, drift, in_place_count, rms_speed};
use drystone::stats::{median, quantile};
use drystone::{Error, Result, Scene, SolverConfig, World};

/// Steps of a contender in each of its turns.
pub(super) const BLOCK: u32 = 10;

/// Time and errors of one contender on one scene, over the second half of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub scene: String,
    pub hash: String,
    /// Start of the run; only rows of one run have time ratios.
    pub run: String,
    /// As in [`Origin`].
    pub build: String,
    pub commit: String,
    pub machine: String,
    pub threads: usize,
    pub bodies: usize,
    pub steps: u32,
    /// As in [`Setting`]; CSV has no nested fields.
    pub engine: String,
    pub backend: String,
    pub substeps: u32,
    pub sweeps: u32,
    pub method: String,
    pub friction: String,
    pub more: String,
    /// `processor` or `wall` time, as in [`Clock`].
    pub clock: String,
    /// Time of a step: median and quartiles over the blocks (ms).
    pub ms: f64,
    pub ms_low: f64,
    pub ms_high: f64,
    /// Ratio to the first contender in the same blocks: median and quartiles.
    pub ratio: f64,
    pub ratio_low: f64,
    pub ratio_high: f64,
    /// Deepest overlap, the overlap that 95 % of the contacts do not exceed, and the mean: medians over the blocks, but for the first (m).
    pub penetration_max: f64,
    pub penetration_p95: f64,
    pub penetration_mean: f64,
    /// Root mean square speed, median over the blocks (m/s): of the velocities that the engine reports, or of the motion in the last step
    /// of a block, whichever is less. Poses in f32 resolve no less than 0.03 mm/s, and velocities of PhysX's TGS are not those at
    /// which bodies move: 67 mm/s in a pyramid whose boxes move at 0.6 mm/s.
    pub speed_rms: f64,
    /// Largest horizontal distance of a body from its first position, at the end (m).
    pub drift: f64,
    /// Bodies in place at the end; none if the scene does not stand.
    pub in_place: Option<usize>,
    /// Largest distance between the anchors of a joint (m); none without joints.
    pub joint_gap: Option<f64>,
    /// Kinetic and potential energy gained over the whole run (J).
    pub energy_gained: f64,
    pub finite: bool,
    /// The thirds of the run that the contender finished; none in rows that were read from a file.
    #[serde(skip)]
    pub windows: Vec<WindowRow>,
}

impl Row {
    pub fn setting(&self) -> Setting {
        let Self { engine, backend, substeps, sweeps, method, friction, more, .. } = self.clone();
        Setting { engine, backend, substeps, sweeps, method, friction, more }
    }

    pub fn time_ratio(&self, other: &Self) -> Result<f64> {
        for (what, own, others) in [("run", &self.run, &other.run), ("scene hash", &self.hash, &other.hash)] {
            if own != others {
                let names = [self, other].map(|row| format!("{} on {}", row.setting().label(), row.scene));
                return Err(Error::input(format!("no ratio of {} to {}: {what} {own}, {others}", names[0], names[1])));
            }
        }
        Ok(self.ratio / other.ratio)
    }

    /// Whether all bodies of a scene that stands are in place, and all numbers are finite.
    pub fn holds(&self) -> bool {
        self.finite && self.in_place.is_none_or(|n| n == self.bodies)
    }
}

/// Measurements of one contender.
#[derive(Default)]
pub(super) struct Lane {
    /// Time of each step (ms), of complete blocks with finite bodies.
    pub steps: Vec<f64>,
    /// Errors at the end of the blocks of the second half, and of the last block of each third, with the number of the block.
    pub errors: Vec<(usize, Errors)>,
    pub finite: bool,
}

#[derive(Default)]
pub(super) struct Errors {
    pub penetration: Penetration,
    pub speed: f64,
    pub drift: f64,
    pub in_place: Option<usize>,
    pub gap: f64,
}

/// Runs all contenders over the steps of `scene`; the rows are in their order. `after_block` is called [`blocks`] times per contender.
pub fn measure(
    scene: &Scene,
    contenders: &mut [Box<dyn Contender + '_>],
    origin: &Origin,
    after_block: &mut dyn FnMut(),
) -> Result<Vec<Row>> {
    let blocks = blocks(scene.steps) as usize;
    let ends = thirds(blocks).map(|third| third.end - 1);
    let run = Origin::now();
    let lane = |contender| (contender, Lane { finite: true, ..Lane::default() });
    let mut lanes: Vec<_> = contenders.iter_mut().map(lane).collect();
    interleave(blocks, &mut lanes, |block, (contender, lane)| {
        if lane.finite {
            let clock = Clock::of(&contender.setting().backend);
            let mut times = Vec::with_capacity(BLOCK as usize);
            let mut step = |contender: &mut Box<dyn Contender + '_>| {
                let begin = clock.now();
                contender.step().map_err(|e| Error::input(format!("{}: {e}", contender.setting().label())))?;
                times.push((clock.now() - begin).as_secs_f64() * 1e3);
                Ok::<_, Error>(())
            };
            (1..BLOCK).try_for_each(|_| step(contender))?;
            let before = poses(contender.world());
            step(contender)?;
            let world = contender.world();
            lane.finite = world.first_non_finite().is_none();
            if lane.finite {
                lane.steps.extend(times);
            }
            if lane.finite && (2 * block >= blocks || ends.contains(&block)) {
                let errors = Errors {
                    penetration: Penetration::of_world(world, &SolverConfig::default()),
                    speed: rms_speed(world).min(moved(world, &before, scene.dt)),
                    drift: drift(&scene.world, world),
                    in_place: scene.stands.then(|| in_place_count(&scene.world, world)),
                    gap: world.joint_gap().into(),
                };
                lane.errors.push((block, errors));
            }
        }
        after_block();
        Ok(())
    })?;
    let first = lanes[0].1.late_blocks(blocks);
    let mut rows: Vec<_> =
        lanes.iter_mut().map(|(c, lane)| row(scene, c.setting(), c.world(), lane, &first, origin, &run)).collect();
    let lanes: Vec<_> = lanes.into_iter().map(|(_, lane)| lane).collect();
    let of_each = windows(&rows, &lanes, &thirds(blocks));
    rows.iter_mut().zip(of_each).for_each(|(row, windows)| row.windows = windows);
    Ok(rows)
}

impl Lane {
    /// Mean time of a step in each block of the second half (ms).
    fn late_blocks(&self, blocks: usize) -> Vec<f64> {
        let late = self.steps.chunks(BLOCK as usize).skip(blocks.div_ceil(2));
        late.map(|steps| steps.iter().sum::<f64>() / f64::from(BLOCK)).collect()
    }
}

fn poses(world: &World) -> Vec<(Vec3, Quat)> {
    world.bodies.iter().map(|body| (body.center_of_mass(), body.rotation)).collect()
}

/// Root mean square speed at which the bodies moved in one step from the poses `before` (m/s).
fn moved(world: &World, before: &[(Vec3, Quat)], dt: f32) -> f64 {
    let mut world = world.clone();
    for (body, &(center, rotation)) in world.bodies.iter_mut().zip(before) {
        body.linear_velocity = (body.center_of_mass() - center) / dt;
        body.angular_velocity = (body.rotation * rotation.inverse()).to_scaled_axis() / dt;
    }
    rms_speed(&world)
}

/// Blocks of a run with this number of steps: at least one in each third.
pub fn blocks(steps: u32) -> u32 {
    steps.div_ceil(BLOCK).max(3)
}

pub(super) fn steps(scene: &Scene) -> u32 {
    blocks(scene.steps) * BLOCK
}

fn row(scene: &Scene, setting: Setting, world: &World, lane: &Lane, first: &[f64], origin: &Origin, run: &str) -> Row {
    let blocks = blocks(scene.steps) as usize;
    let times = lane.late_blocks(blocks);
    let ratios: Vec<f64> = times.iter().zip(first).map(|(ms, first)| ms / first).collect();
    let [ms_low, ms, ms_high] = quartiles(&times);
    let [ratio_low, ratio, ratio_high] = quartiles(&ratios);
    let late = || lane.errors.iter().filter(|(block, _)| 2 * block >= blocks).map(|(_, errors)| errors);
    let all = |of: fn(&Errors) -> f64| late().map(of).collect::<Vec<_>>();
    let clock = Clock::of(&setting.backend).name().into();
    let Setting { engine, backend, substeps, sweeps, method, friction, more } = setting;
    Row {
        scene: scene.name.clone(),
        hash: content_hash(scene),
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
        penetration_max: quantile(&all(|e| e.penetration.max), 1.0),
        penetration_p95: median(&all(|e| e.penetration.p95)),
        penetration_mean: median(&all(|e| e.penetration.mean)),
        speed_rms: median(&all(|e| e.speed)),
        drift: drift(&scene.world, world),
        in_place: scene.stands.then(|| in_place_count(&scene.world, world)),
        joint_gap: (!world.joints.is_empty()).then(|| quantile(&all(|e| e.gap), 1.0)),
        energy_gained: energy(world) - energy(&scene.world),
        finite: lane.finite,
        windows: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drystone::Body;
    use drystone::world::Shape;

    /// An engine whose ball moves at 2 m/s and turns, and whose velocities are `reported` times those.
    struct Reports {
        world: World,
        reported: f32,
    }

    impl Contender for Reports {
        fn setting(&self) -> Setting {
            Setting::drystone("cpu", &SolverConfig::default())
        }

        fn step(&mut self) -> Result<()> {
            let body = &mut self.world.bodies[0];
            body.position.x += 2.0 / 60.0;
            body.rotation = Quat::from_rotation_y(3.0 / 60.0) * body.rotation;
            body.linear_velocity = Vec3::X * 2.0 * self.reported;
            body.angular_velocity = Vec3::Y * 3.0 * self.reported;
            Ok(())
        }

        fn world(&mut self) -> &World {
            &self.world
        }
    }

    #[test]
    fn the_speed_is_the_lesser_of_the_reported_one_and_that_of_the_motion() {
        let mut world = World::new();
        world.add(Body::dynamic().shape(Shape::ball(0.5)));
        let scene = Scene::new("flight", world.clone(), 40);
        let origin = Origin { build: String::new(), commit: String::new(), machine: String::new(), threads: 1 };
        let mut all =
            [1.0, 5.0, 0.5].map(|reported| Box::new(Reports { world: world.clone(), reported }) as Box<dyn Contender>);
        let rows = measure(&scene, &mut all, &origin, &mut || ()).unwrap();
        // v² + I/m w² with I = 2/5 m r².
        let speed = (4.0_f64 + 0.1 * 9.0).sqrt();
        for (row, share) in rows.iter().zip([1.0, 1.0, 0.5]) {
            assert!(
                (row.speed_rms / (share * speed) - 1.0).abs() < 1e-4,
                "{} m/s, not {}",
                row.speed_rms,
                share * speed
            );
        }
    }
}

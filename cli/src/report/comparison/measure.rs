//! Measures times and errors of contenders that step one scene in turns, so that a slow phase of the machine affects
//! all of them.

use super::contender::{Contender, Setting};
use super::origin::Origin;
use super::row::{BLOCK, Errors, Lane, Row};
use super::windows::windows;
use crate::hard::energy;
use crate::report::rounds::{Clock, interleave, quartiles, thirds};
use crate::report::scene_hash::content_hash;
use drystone::glam::{Quat, Vec3};
use drystone::metrics::{Penetration, drift, in_place_count, rms_speed};
use drystone::stats::{median, quantile};
use drystone::{Error, Result, SolverConfig, World};
use drystone_scenes::Scene;

/// Runs all contenders over the steps of `scene`, and returns their rows in the same order. Calls `after_block`
/// [`blocks`] times per contender.
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

/// Number of blocks of a run with this number of steps: at least one in each third.
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

    /// An engine whose ball moves at 2 m/s and turns. It reports `reported` times these velocities.
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
        world.insert(Body::dynamic().shape(Shape::ball(0.5)));
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

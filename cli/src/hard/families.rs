//! Families of worlds instead of single cases: each world is checked against its law, and the passing shares are
//! counted.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use cpu_time::ThreadTime;
use drystone::stats::{largest, median};
use drystone::{Error, Result, Simulation, StepStats, World, metrics};
use drystone_scenes::{Family, Law, Member, Scene};
use glam::Vec3;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{Check, Checks, LEAST, Setup, energy, passes};

/// The results of a world of a family.
#[derive(Clone, Debug)]
pub struct Judged {
    pub seed: u64,
    pub checks: Vec<Check>,
    /// Processor time of the median step, divided by the number of movable bodies (ms).
    pub ms: f64,
    /// Processor time of all steps divided by the simulated time (s/s).
    pub seconds: f64,
}

/// The worlds of one family.
#[derive(Clone, Debug)]
pub struct FamilyShare {
    pub family: Family,
    /// In the order of seeds.
    pub worlds: Vec<Judged>,
}

impl FamilyShare {
    pub fn passed(&self) -> usize {
        self.worlds.iter().filter(|world| passes(&world.checks)).count()
    }

    pub fn failures(&self) -> impl Iterator<Item = &Judged> {
        self.worlds.iter().filter(|world| !passes(&world.checks))
    }

    pub fn share(&self) -> f64 {
        self.passed() as f64 / self.worlds.len() as f64
    }

    /// The 95 % confidence interval of the share.
    pub fn interval(&self) -> [f64; 2] {
        wilson(self.passed(), self.worlds.len())
    }

    /// Processor time of a step, divided by the number of movable bodies (ms): the median over the worlds.
    pub fn ms(&self) -> f64 {
        median(&self.worlds.iter().map(|world| world.ms).collect::<Vec<_>>())
    }
}

/// The 95 % confidence interval of a share, if `passed` of `count` draws passed (E. B. Wilson, "Probable inference, the
/// law of succession, and statistical inference", 1927).
pub fn wilson(passed: usize, count: usize) -> [f64; 2] {
    /// 97.5 % of a normal distribution are below this number of standard deviations.
    const Z: f64 = 1.959_964;
    let n = count as f64;
    let (share, z2) = (passed as f64 / n, Z * Z);
    let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    // If all or none pass, rounding can leave the range.
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

/// `count` seeds, starting at `first`.
///
/// # Errors
/// Seeds end at 2^53: up to there, a double represents every whole number.
pub fn seeds(first: u64, count: u32) -> Result<Vec<u64>> {
    let end = first.saturating_add(count.into());
    if end > 1 << 53 {
        return Err(Error::input(format!("--seed {first}: the last of {count} seeds must be at most 2^53")));
    }
    Ok((first..end).collect())
}

/// Judges worlds, one at a time on each thread of the machine. It calls `done` after each world.
///
/// # Errors
/// A world cannot be run, or `done` returns an error.
pub fn judge_all(
    worlds: &[(Family, u64)],
    setup: &Setup,
    done: impl Fn(Family, &Judged) -> Result<()> + Sync,
) -> Result<Vec<(Family, Judged)>> {
    let (next, judged) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || -> Result<()> {
        let pool = one_thread()?;
        while let Some(&(family, seed)) = worlds.get(next.fetch_add(1, Ordering::Relaxed)) {
            let Member { scene, law } = family.member(seed)?;
            let world = pool.install(|| judge(&scene, &law, setup)).map_err(|e| e.within(family.spec(seed)))?;
            let world = Judged { seed, ..world };
            done(family, &world)?;
            judged.lock().expect("no panic").push((family, world));
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().expect("no panic"))
    })?;
    Ok(judged.into_inner().expect("no panic"))
}

/// The results by family, without families that have none.
pub fn shares(families: &[Family], judged: &[(Family, Judged)]) -> Vec<FamilyShare> {
    let share = |&family: &Family| {
        let own = judged.iter().filter(|(of, _)| *of == family);
        let mut worlds: Vec<_> = own.map(|(_, world)| world.clone()).collect();
        worlds.sort_by_key(|world| world.seed);
        FamilyShare { family, worlds }
    };
    families.iter().map(share).filter(|share| !share.worlds.is_empty()).collect()
}

/// Makes a pool of one thread. The steps of a world use the threads of the pool that they run in.
///
/// # Errors
/// The system refuses to start a thread.
pub fn one_thread() -> Result<ThreadPool> {
    ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| Error::input(format!("a thread: {e}")))
}

/// Speed at which a body counts as at rest, divided by that of a fall by its size: its kinetic energy lifts it by 1e-4
/// of the size.
const AT_REST: f64 = 0.01;
/// Largest displacement of a body that sticks (m).
const CREEP: f64 = 1e-3;
/// Relative error of an acceleration.
const ACCELERATION: f64 = 0.02;
/// Relative error of the speed of a wave of dominoes. The law neglects friction, and a step takes up to a quarter of
/// the time from one domino to the next: over 40 worlds the median error was 1.4 % and the largest 5.5 %.
const WAVE: f64 = 0.1;
/// Gap of a joint relative to the length of a link, and energy gain relative to the energy that a swing releases, as in
/// case H6.
const GAP: f64 = 0.01;
const GAIN: f64 = 1e-3;

/// Kinetic energy of a pile relative to the energy that its fall released. It is not zero, because nothing resists
/// rolling.
const SETTLED: f64 = 1e-3;

/// Runs a scene and checks it against a law.
///
/// # Errors
/// The scene cannot be run.
pub fn judge(scene: &Scene, law: &Law, setup: &Setup) -> Result<Judged> {
    judge_while(scene, law, setup, |_, _| Ok(()))
}

/// The same, but calls `look` after each step. The time of these calls does not count.
///
/// # Errors
/// The scene cannot be run, or `look` returns an error, which ends the run.
pub fn judge_while(
    scene: &Scene,
    law: &Law,
    setup: &Setup,
    mut look: impl FnMut(&Simulation, &StepStats) -> Result<()>,
) -> Result<Judged> {
    let start = &scene.world;
    let mut simulation = setup.simulation(start.clone())?;
    let mut watch = Watch::new(start);
    let mut times = Vec::with_capacity(scene.steps as usize);
    for step in 1..=scene.steps {
        let begin = ThreadTime::now();
        let stats = simulation.step(scene.dt)?;
        times.push(1e3 * begin.elapsed().as_secs_f64());
        watch.look(law, &simulation.world, f64::from(step) * f64::from(scene.dt));
        look(&simulation, &stats)?;
    }
    let end = &simulation.world;
    let mut checks = Checks::default();
    match law {
        Law::Stands => {
            let fallen = start.dynamic_count() - metrics::in_place_count(start, end);
            checks.at_most("bodies out of place", fallen as f64, 0.0);
            checks.at_most("fastest body at the end, over a fall by the size of one", speed(end), AT_REST);
        }
        Law::Sticks => checks.at_most("displacement of the block [mm]", 1e3 * way(start, end), 1e3 * CREEP),
        Law::Slides(acceleration) => {
            let time = f64::from(scene.steps) * f64::from(scene.dt);
            let exact = *acceleration * time;
            let off = only(end).linear_velocity.as_dvec3().distance(exact) / exact.length();
            checks.at_most("acceleration, relative error", off, ACCELERATION);
        }
        Law::Topples { speed, .. } => {
            let upright = watch.leaned.iter().filter(|time| time.is_none()).count();
            checks.at_most("dominoes that do not fall", upright as f64, 0.0);
            let measured = watch.wave(start);
            checks.at_most("speed of the wave, relative error", super::off(measured, *speed), WAVE);
        }
        Law::Swings { link, energy } => {
            checks.at_most("largest gap of a joint over the length of a link", watch.gap / link, GAP);
            checks.at_most("energy gained over the potential energy of the swing", watch.gained / energy, GAIN);
        }
        Law::Settles => {
            checks.at_most("bodies outside", scene.escaped(end) as f64, 0.0);
            // Without a fall there is no released energy to compare with, and the check fails.
            let freed = (energy(start) - end.potential_energy()).max(0.0);
            checks.at_most(
                "kinetic energy at the end over the energy of the fall",
                end.kinetic_energy() / freed,
                SETTLED,
            );
        }
        _ => return Err(Error::input(format!("{law:?}: no judge knows this law"))),
    }
    checks.finite("", end);
    let seconds = 1e-3 * times.iter().sum::<f64>() / (f64::from(scene.steps) * f64::from(scene.dt));
    Ok(Judged { seed: 0, checks: checks.0, ms: median(&times) / start.dynamic_count() as f64, seconds })
}

/// Quantities over all steps that laws refer to.
struct Watch {
    /// Energy at the start (J), and the largest gain (J).
    energy: f64,
    gained: f64,
    /// Largest gap of a joint (m).
    gap: f64,
    /// Time at which each dynamic body first leaned (s).
    leaned: Vec<Option<f64>>,
}

impl Watch {
    fn new(start: &World) -> Self {
        Self { energy: energy(start), gained: LEAST, gap: 0.0, leaned: vec![None; start.dynamic_count()] }
    }

    fn look(&mut self, law: &Law, world: &World, time: f64) {
        match law {
            Law::Swings { .. } => {
                self.gap = largest(self.gap, [world.joint_gap().into()]);
                self.gained = largest(self.gained, [energy(world) - self.energy]);
            }
            Law::Topples { angle, .. } => {
                for (body, leaned) in world.dynamic().zip(&mut self.leaned) {
                    if leaned.is_none() && f64::from((body.rotation * Vec3::Y).y) < angle.cos() {
                        *leaned = Some(time);
                    }
                }
            }
            _ => {}
        }
    }

    /// Speed of the wave (m/s), between the first third of the row, where the push still affects it, and the last five
    /// dominoes, which have few others beyond them. NaN if the wave does not get that far.
    fn wave(&self, start: &World) -> f64 {
        let (first, last) = (self.leaned.len() / 3, self.leaned.len().saturating_sub(6));
        let place = |k: usize| start.dynamic().nth(k).map_or(f64::NAN, |body| body.position.x.into());
        let (Some(begin), Some(end)) = (self.leaned[first], self.leaned[last]) else { return f64::NAN };
        (place(last) - place(first)) / (end - begin)
    }
}

/// The only movable body.
fn only(world: &World) -> &drystone::Body {
    world.dynamic().next().expect("a block")
}

fn way(start: &World, end: &World) -> f64 {
    only(start).position.as_dvec3().distance(only(end).position.as_dvec3())
}

/// Speed of a fall by the size of a body, which is twice its smallest half extent (m/s).
fn fall(world: &World, body: &drystone::Body) -> f64 {
    (f64::from(world.gravity.length()) * 2.0 * f64::from(body.smallest_half_extent())).sqrt()
}

/// The largest speed of a body, divided by the speed of a fall by its size.
fn speed(world: &World) -> f64 {
    largest(0.0, world.dynamic().map(|body| body.linear_velocity.as_dvec3().length() / fall(world, body)))
}

#[cfg(test)]
mod tests {
    use drystone::{Backend, Cpu, SolverConfig};

    use super::*;

    fn judged(scene: &Scene, law: &Law) -> Vec<Check> {
        let open = || Ok(Box::new(Cpu::new()) as Box<dyn Backend>);
        judge(scene, law, &Setup { config: SolverConfig::default().without_sleep(), open: &open })
            .expect("a run")
            .checks
    }

    /// The first member of a family whose law fits.
    fn first(family: Family, fits: impl Fn(&Member) -> bool) -> Member {
        (1..100).map(|seed| family.member(seed).expect("a member")).find(fits).expect("one of a hundred")
    }

    #[test]
    fn a_tower_stands_within_its_limit_and_is_found_out_beyond() {
        let Member { mut scene, law } = first(Family::LeanedTowers, |m| m.scene.world.dynamic_count() < 10);
        assert!(passes(&judged(&scene, &law)));
        // From 80 to 120 % of the limit.
        for body in scene.world.bodies.iter_mut().skip(1) {
            body.position *= Vec3::new(1.5, 1.0, 1.5);
        }
        assert!(!passes(&judged(&scene, &law)));
    }

    #[test]
    fn an_arch_that_is_too_thin_is_found_out() {
        let arch = |spec: &str| judged(&Scene::find_spec(spec).expect("an arch"), &Law::Stands);
        assert!(!passes(&arch("arch:voussoirs=31,thickness=0.09")));
        assert!(passes(&arch("arch:voussoirs=15,thickness=0.2")));
    }

    #[test]
    fn a_block_that_slides_does_not_stick_and_one_that_sticks_does_not_slide() {
        for family in [Family::Slopes, Family::PushedBlocks] {
            let sticks = first(family, |m| m.law == Law::Sticks);
            let slides = first(family, |m| m.law != Law::Sticks);
            assert!(
                passes(&judged(&sticks.scene, &sticks.law)) && passes(&judged(&slides.scene, &slides.law)),
                "{family}"
            );
            assert!(!passes(&judged(&slides.scene, &sticks.law)), "{family}");
            assert!(!passes(&judged(&sticks.scene, &slides.law)), "{family}");
            // Off by twice the tolerance, and by a share of that for the error of the run itself.
            let Law::Slides(acceleration) = slides.law else { panic!("{:?}", slides.law) };
            assert!(!passes(&judged(&slides.scene, &Law::Slides(1.05 * acceleration))), "{family}");
        }
    }

    #[test]
    fn dominoes_that_stay_or_fall_at_another_speed_are_found_out() {
        let Member { mut scene, law } = Family::Dominoes.member(1).expect("a member");
        assert!(passes(&judged(&scene, &law)));
        let Law::Topples { speed, angle } = law else { panic!("{law:?}") };
        assert!(!passes(&judged(&scene, &Law::Topples { speed: 1.25 * speed, angle })));
        // The first domino gets no push.
        scene.world.bodies[1] = scene.world.bodies[1].clone().velocity(Vec3::ZERO, Vec3::ZERO);
        assert!(!passes(&judged(&scene, &law)));
    }

    #[test]
    fn a_joint_that_opens_and_energy_that_grows_are_found_out() {
        let Member { mut scene, law } = first(Family::Chains, |m| m.scene.world.dynamic_count() < 20);
        assert!(passes(&judged(&scene, &law)));
        let Law::Swings { link, energy } = law else { panic!("{law:?}") };
        assert!(!passes(&judged(&scene, &Law::Swings { link: 1e-6 * link, energy })));
        // The last domino is pulled up all the time.
        let last = scene.world.bodies.len() - 1;
        let weight = scene.world.bodies[last].mass.mass * scene.world.gravity;
        scene.world.bodies[last].force = -5.0 * weight;
        assert!(!passes(&judged(&scene, &law)));
    }

    #[test]
    fn a_pile_that_leaks_or_moves_is_found_out() {
        let Member { mut scene, law } = first(Family::Piles, |m| m.scene.world.dynamic_count() < 30);
        assert!(passes(&judged(&scene, &law)));
        let early = Scene { steps: scene.steps / 20, ..scene.clone() };
        assert!(!passes(&judged(&early, &law)), "it still falls");
        scene.world.remove(scene.world.bodies.handle(0).expect("the floor"));
        assert!(!passes(&judged(&scene, &law)), "the floor is gone");
    }

    /// Newcombe, "Two-sided confidence intervals for the single proportion", 1998, table I: 81 of 263, 15 of 148, 0 of
    /// 20, 1 of 29.
    #[test]
    fn intervals_are_those_of_the_literature() {
        for (passed, count, [least, most]) in [
            (81, 263, [0.2553, 0.3662]),
            (15, 148, [0.0624, 0.1605]),
            (0, 20, [0.0, 0.1611]),
            (1, 29, [0.0061, 0.1718]),
        ] {
            let [a, b] = wilson(passed, count);
            assert!((a - least).abs() < 1e-4 && (b - most).abs() < 1e-4, "{passed} of {count}: {a} to {b}");
        }
        assert_eq!(wilson(20, 20)[1], 1.0);
    }
}

//! Compares sweeps with the limits of memory and arithmetic, measured in the same turns.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use drystone::stages::plan::Kernel;
use drystone::stages::plan::StepPlan;
use drystone::stages::problem::StepProblem;
use drystone::{Backend, Cpu, Result, Simulation, SolverConfig};
use drystone_scenes::Scene;

use super::rates::{peak, triad};
use super::settled;
use crate::report::rounds::interleave;

/// A pile with contacts that fit into the cache of a core, a pile with contacts that fit into a shared cache, and a
/// pyramid of 500,500 boxes with contacts in memory.
pub const LIMITS: [&str; 3] = ["pile:n=1000", "pile:n=20000", "pyramid:base=1000"];
pub const LIMITS_QUICK: [&str; 2] = ["pile:n=1000", "pyramid:base=100"];

/// Mean number of scalar operations per point and sweep, for a contact of four points with friction between bodies with
/// equal moments of inertia. A test counts them.
pub const OPERATIONS: f64 = 249.5;

/// A sweep over all contacts of a scene at rest. Rates are the best of all turns, because disturbances only slow a turn
/// down.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LimitRow {
    pub scene: String,
    pub threads: usize,
    pub boxes: usize,
    pub manifolds: usize,
    pub points: usize,
    /// Time per manifold (ns).
    pub ns: f64,
    /// Contact points swept per second by all threads together.
    pub sweeps: f64,
    /// Bytes of all data that a sweep of the lanes reads or writes, each counted once.
    pub held: usize,
    /// Bytes per manifold that a sweep of the lanes reads and writes, with a body counted for each of its contacts;
    /// then the same for the kernels over plain rows.
    pub lane_bytes: f64,
    pub kernel_bytes: f64,
    /// Scalar operations per manifold.
    pub operations: f64,
    /// Bytes per second of a = b + s c over three arrays of `held` bytes in total, and the rate of `lane_bytes`
    /// relative to it.
    pub triad: f64,
    pub of_triad: f64,
    /// Multiplications and additions per second in registers alone, and the rate of `operations` relative to it.
    pub peak: f64,
    pub of_peak: f64,
}

impl LimitRow {
    fn with_shares(self, seconds: f64) -> Self {
        let rate = self.manifolds as f64 / seconds;
        Self {
            ns: 1e9 / rate,
            sweeps: self.points as f64 / seconds,
            of_triad: rate * self.lane_bytes / self.triad,
            of_peak: rate * self.operations / self.peak,
            ..self
        }
    }
}

/// A scene with its problem and one number of threads: the row so far, and the least times of [`FEW`] and [`MANY`]
/// sweeps.
struct Limit<'a> {
    problem: &'a StepProblem,
    pool: rayon::ThreadPool,
    row: LimitRow,
    least: [f64; 2],
}

/// Measures the scenes `specs` with each number of `threads`.
pub fn limits(
    specs: &[String],
    threads: &[usize],
    turns: usize,
    after_turn: &mut dyn FnMut(),
) -> Result<Vec<LimitRow>> {
    let problems = specs.iter().map(|spec| problem(spec)).collect::<Result<Vec<_>>>()?;
    let mut all = Vec::new();
    for (spec, (boxes, problem)) in specs.iter().zip(&problems) {
        for &threads in threads {
            let row = LimitRow { scene: spec.clone(), threads, boxes: *boxes, ..count(problem)? };
            all.push(Limit { problem, pool: super::pool(threads)?, row, least: [f64::INFINITY; 2] });
        }
    }
    interleave(turns, &mut all, |_, Limit { problem, pool, row, least }| {
        let mut cpu = Cpu::new();
        for (least, sweeps) in least.iter_mut().zip([FEW, MANY]) {
            *least = least.min(pool.install(|| seconds(&mut cpu, problem, sweeps))?);
        }
        row.peak = row.peak.max(peak(pool));
        row.triad = row.triad.max(triad(pool, row.held / row.threads));
        after_turn();
        Ok(())
    })?;
    let swept = |Limit { problem, row, least: [few, many], .. }: Limit| {
        let sweeps = |sweeps| swept_contacts(problem, &plan(problem, sweeps)) as f64 / row.manifolds as f64;
        let seconds = (many - few) / (sweeps(MANY) - sweeps(FEW));
        row.with_shares(seconds)
    };
    Ok(all.into_iter().map(swept).collect())
}

/// The next step of a scene at rest, and its number of boxes. A scene without a container is at rest from the start.
fn problem(spec: &str) -> Result<(usize, StepProblem)> {
    let config = SolverConfig::default().without_sleep();
    let scene = Scene::find_spec(spec)?;
    let (boxes, dt) = (scene.world.dynamic_count(), scene.dt);
    let mut simulation = if scene.container.is_some() {
        settled(spec, &config)?.0
    } else {
        let mut simulation = Simulation::with(scene.world, config, Box::new(Cpu::new()))?;
        (0..3).try_for_each(|_| simulation.step(dt).map(drop))?;
        simulation
    };
    Ok((boxes, simulation.next_problem(dt)?.0))
}

/// Contacts, bytes and operations of a sweep.
fn count(problem: &StepProblem) -> Result<LimitRow> {
    let manifolds = problem.swept_contacts().count();
    let points = problem.swept_contacts().map(|contact| contact.point_count as usize).sum();
    let plan = plan(problem, 1);
    let mut cpu = Cpu::new();
    cpu.run(&mut problem.clone(), &plan.passes)?;
    let swept = plan.passes.iter().zip(plan.bytes_of_passes(problem));
    let (mut kernel, mut kernel_bytes) = (None, 0);
    for (pass, bytes) in swept.filter(|(pass, _)| matches!(pass.kernel, Kernel::SolveContacts(_))) {
        (kernel, kernel_bytes) = (Some(pass.kernel), kernel_bytes + bytes);
    }
    let a_manifold = |x: f64| x / manifolds as f64;
    let kernel_bytes = kernel_bytes as f64 / swept_contacts(problem, &plan) as f64;
    Ok(LimitRow {
        manifolds,
        points,
        held: cpu.bytes_of_contacts(),
        lane_bytes: kernel.map_or(0.0, |kernel| a_manifold(cpu.bytes_of_sweep(kernel) as f64)),
        kernel_bytes,
        operations: a_manifold(OPERATIONS * points as f64),
        ..LimitRow::default()
    })
}

/// Number of contacts that the sweeps of a plan visit in total.
fn swept_contacts(problem: &StepProblem, plan: &StepPlan) -> usize {
    let sweeps = plan.passes.iter().filter(|pass| matches!(pass.kernel, Kernel::SolveContacts(_)));
    sweeps.map(|pass| problem.rows_of(&pass.colors).len()).sum()
}

/// A plan with this number of biased sweeps in each substep of the problem.
fn plan(problem: &StepProblem, sweeps: u32) -> StepPlan {
    let config = SolverConfig::default().without_sleep().with(|c| {
        c.iterations = sweeps;
        c.relax = 0;
    });
    StepPlan::new(&config, problem)
}

/// Two numbers of sweeps. The difference of their times has no work outside of sweeps.
const FEW: u32 = 1;
const MANY: u32 = 4;

fn seconds(cpu: &mut Cpu, problem: &StepProblem, sweeps: u32) -> Result<f64> {
    let plan = plan(problem, sweeps);
    let mut problem = problem.clone();
    let begin = Instant::now();
    cpu.run(&mut problem, &plan.passes)?;
    Ok(begin.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use std::ops::{Add, Mul, Neg, Sub};
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;
    use drystone::config::FrictionRule;
    use drystone::stages::kernels::solve_contact;
    use drystone::stages::kernels::{Impulse, Pair, Point, Rules};
    use drystone::stages::math::Lane;

    #[test]
    fn the_number_of_operations_is_that_of_the_kernel() {
        assert_eq!(OPERATIONS, operations());
    }

    /// Operations per point and sweep of a contact of four points with friction, counted in the kernel.
    fn operations() -> f64 {
        static COUNT: AtomicU64 = AtomicU64::new(0);

        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        struct Counted(f32);

        fn counted(x: f32) -> Counted {
            COUNT.fetch_add(1, Ordering::Relaxed);
            Counted(x)
        }

        macro_rules! count {
            ($($operator:ident $function:ident),*) => {$(
                impl $operator for Counted {
                    type Output = Self;
                    fn $function(self, o: Self) -> Self {
                        counted(self.0.$function(o.0))
                    }
                }
            )*};
        }
        count!(Add add, Sub sub, Mul mul);

        impl Neg for Counted {
            type Output = Self;
            fn neg(self) -> Self {
                counted(-self.0)
            }
        }

        impl Lane for Counted {
            type Mask = bool;
            fn constant(x: f64) -> Self {
                Self(x as f32)
            }
            fn gt(self, o: Self) -> bool {
                counted(self.0).0 > o.0
            }
            fn and(a: bool, b: bool) -> bool {
                a && b
            }
            fn mask(value: bool) -> bool {
                value
            }
            fn any(mask: bool) -> bool {
                mask
            }
            fn select(if_false: Self, if_true: Self, mask: bool) -> Self {
                counted(if mask { if_true.0 } else { if_false.0 })
            }
            fn inverse_sqrt(self) -> Self {
                counted(self.0.inverse_sqrt())
            }
            fn inverse_power(self) -> Self {
                counted(self.0.inverse_power())
            }
        }

        let rules = Rules { biased: true, friction: FrictionRule::Disc, isotropic: true, ..Rules::default() };
        let (points, mut impulses) = ([Point::<Counted>::default(); 4], [Impulse::default(); 4]);
        let before = COUNT.load(Ordering::Relaxed);
        let mut pair = Pair::default();
        solve_contact(
            rules,
            &Default::default(),
            &mut pair,
            &Default::default(),
            &mut (&points[..], &mut impulses[..]),
        );
        (COUNT.load(Ordering::Relaxed) - before) as f64 / 4.0
    }

    // The values of the shares depend on the load of the machine.
    #[test]
    fn every_limit_is_measured_for_every_scene_and_number_of_threads() {
        let specs = ["pile:n=200".to_owned(), "pyramid:base=10".to_owned()];
        let rows = limits(&specs, &[1, 2], 3, &mut || ()).expect("a measurement");
        assert_eq!(
            rows.iter().map(|r| (r.boxes, r.threads)).collect::<Vec<_>>(),
            [(200, 1), (200, 2), (55, 1), (55, 2)]
        );
        for row in &rows {
            assert!(row.ns > 0.0 && row.sweeps > 0.0 && row.of_peak > 0.0 && row.of_triad > 0.0, "{row:?}");
        }
        let pyramid = &rows[2];
        // A plan has the substeps of its problem, eight here, for any settings.
        let (_, problem) = problem("pyramid:base=10").expect("a scene");
        assert_eq!([1, 3].map(|n| swept_contacts(&problem, &plan(&problem, n))), [800, 2400]);
        assert_eq!((pyramid.manifolds, pyramid.points, pyramid.operations), (100, 400, 4.0 * OPERATIONS));
        // Four points of 48 bytes, four impulses of 16 bytes, read and written, at least two bodies of 64 bytes read,
        // and their velocities written.
        for row in &rows {
            let least = row.points as f64 / row.manifolds as f64 * 80.0 + 2.0 * 96.0;
            assert!(row.lane_bytes > least && row.lane_bytes < 4.0 * least, "{row:?}");
            assert!(row.kernel_bytes > least && row.kernel_bytes < 4.0 * least, "{row:?}");
            assert!((row.held as f64) < row.lane_bytes * row.manifolds as f64, "{row:?}");
        }
    }

    #[test]
    fn shares_are_of_what_the_machine_can_do() {
        let row = LimitRow {
            threads: 2,
            manifolds: 1000,
            points: 4000,
            lane_bytes: 600.0,
            operations: 1200.0,
            triad: 2.4e9,
            peak: 4.8e9,
            ..LimitRow::default()
        };
        // A million manifolds per second.
        let row = row.with_shares(1e-3);
        assert_eq!((row.ns, row.sweeps, row.of_triad, row.of_peak), (1000.0, 4e6, 0.25, 0.25));
    }
}

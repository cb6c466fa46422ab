//! Sweeps compared with the limits of memory and arithmetic, measured in the same turns.

use std::hint::black_box;
use std::ops::Range;
use std::sync::Barrier;
use std::time::Instant;

use serde::Serialize;

use drystone::stages::backend::{InstructionSet, Lanes, WIDTH, Work};
use drystone::{Backend, Cpu, Result, SolverConfig, StepPlan, StepProblem};

use super::settled;
use crate::report::rounds::interleave;

/// Bytes that a sweep of the lanes streams per point of a manifold of four: the row of the point, its impulses read and written, and a
/// quarter of the header. Bodies are not counted; those of a small pile stay in a cache.
pub const BYTES: f64 = 48.0 + 2.0 * 16.0 + (40.0 + 8.0) / 4.0;

/// Operations on single numbers per point and sweep of a contact of four points with friction: the mean, counted by a test.
const OPERATIONS: f64 = 299.5;

/// The best rates of all turns: disturbances only slow a turn down.
#[derive(Clone, Debug, Serialize)]
pub struct LimitRow {
    pub threads: usize,
    pub manifolds: usize,
    pub points: usize,
    /// Contact points swept per second by all threads together.
    pub sweeps: f64,
    pub operations: f64,
    /// Multiplications and additions on registers alone (1/s).
    pub peak: f64,
    /// The size of the three arrays of a = b + s c together (bytes), and its rate (bytes/s).
    pub triads: Vec<(usize, f64)>,
}

impl LimitRow {
    /// Rate of operations in the sweeps over the peak.
    pub fn of_peak(&self) -> f64 {
        self.sweeps * self.operations / self.peak
    }

    /// Rate of bytes in the sweeps over that of a triad.
    pub fn of_triad(&self, rate: f64) -> f64 {
        self.sweeps * BYTES / rate
    }
}

/// Sizes of the triads (bytes): within the cache of a core, within a shared cache, and beyond.
const SIZES: [usize; 3] = [768 << 10, 12 << 20, 384 << 20];

/// Measures a settled pile of `boxes` with each number of `threads`.
pub fn limits(boxes: usize, threads: &[usize], turns: usize, after_turn: &mut dyn FnMut()) -> Result<Vec<LimitRow>> {
    let config = SolverConfig::default().without_sleep();
    let (mut simulation, _, dt) = settled(&format!("pile:n={boxes}"), &config)?;
    let problem = simulation.next_problem(dt)?.0;
    let row = |threads: usize| LimitRow {
        threads,
        manifolds: problem.swept_contacts().count(),
        points: problem.swept_contacts().map(|contact| contact.point_count as usize).sum(),
        sweeps: 0.0,
        operations: OPERATIONS,
        peak: 0.0,
        triads: SIZES.map(|size| (size, 0.0)).to_vec(),
    };
    let participant = |&threads: &usize| Ok((super::pool(threads)?, row(threads), [f64::INFINITY; 2]));
    let mut all = threads.iter().map(participant).collect::<Result<Vec<_>>>()?;
    interleave(turns, &mut all, |_, (pool, row, best)| {
        let mut cpu = Cpu::new();
        for (best, sweeps) in best.iter_mut().zip([FEW, MANY]) {
            *best = best.min(pool.install(|| seconds(&mut cpu, &problem, sweeps))?);
        }
        row.peak = row.peak.max(peak(pool));
        for (size, rate) in &mut row.triads {
            *rate = rate.max(triad(pool, *size / row.threads));
        }
        after_turn();
        Ok(())
    })?;
    let swept = |(_, mut row, [few, many]): (_, LimitRow, [f64; 2])| {
        row.sweeps = f64::from(MANY - FEW) * row.points as f64 / (many - few);
        row
    };
    Ok(all.into_iter().map(swept).collect())
}

/// The times of these two numbers of sweeps are subtracted, which cancels the work outside sweeps.
const FEW: u32 = 4;
const MANY: u32 = 24;

fn seconds(cpu: &mut Cpu, problem: &StepProblem, sweeps: u32) -> Result<f64> {
    let config = SolverConfig::default().without_sleep().with(|c| {
        c.substeps = 1;
        c.iterations = sweeps;
        c.relax = 0;
    });
    let plan = StepPlan::new(&config, problem);
    let mut problem = problem.clone();
    let begin = Instant::now();
    cpu.run(&mut problem, &plan.passes)?;
    Ok(begin.elapsed().as_secs_f64())
}

fn peak(pool: &rayon::ThreadPool) -> f64 {
    const ROUNDS: usize = 1_000_000;
    let begin = Instant::now();
    pool.broadcast(|_| InstructionSet::default().run(&Chains, 0..ROUNDS));
    let done = pool.current_num_threads() * ROUNDS * 2 * CHAINS * WIDTH;
    done as f64 / begin.elapsed().as_secs_f64()
}

/// Independent chains of each operation: enough for all units of a processor.
const CHAINS: usize = 6;

/// Multiplications and additions on registers alone, not fused, as in the kernels.
struct Chains;

impl Work for Chains {
    #[inline(always)]
    fn over<L: Lanes>(&self, rounds: Range<usize>) {
        let (factor, summand) = (black_box(L::constant(0.999_999)), black_box(L::constant(1e-3)));
        let (mut products, mut sums) = ([L::constant(1.0); CHAINS], [L::constant(1.0); CHAINS]);
        for _ in rounds {
            for chain in 0..CHAINS {
                products[chain] = products[chain] * factor;
                sums[chain] = sums[chain] + summand;
            }
        }
        black_box((products, sums));
    }
}

/// Bytes per second of all threads together from the first start to the last end. Each thread has its own arrays of `size` bytes.
fn triad(pool: &rayon::ThreadPool, size: usize) -> f64 {
    let length = size / 12;
    let rounds = (64 << 20) / size + 2;
    let all_ready = Barrier::new(pool.current_num_threads());
    let times = pool.broadcast(|_| {
        let (mut a, b, c) = (vec![0.0_f32; length], vec![1.0_f32; length], vec![2.0_f32; length]);
        all_ready.wait();
        let begin = Instant::now();
        for _ in 0..rounds {
            let (b, c) = (black_box(&b), black_box(&c));
            for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                *a = b + 3.0 * c;
            }
            black_box(&mut a);
        }
        (begin, Instant::now())
    });
    let (begin, end) = (times.iter().map(|t| t.0).min(), times.iter().map(|t| t.1).max());
    let seconds = begin.zip(end).map_or(f64::NAN, |(begin, end)| (end - begin).as_secs_f64());
    (times.len() * rounds * 12 * length) as f64 / seconds
}

#[cfg(test)]
mod tests {
    use std::ops::{Add, Mul, Neg, Sub};
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;
    use drystone::config::FrictionRule;
    use drystone::stages::kernels::contact::solve_contact;
    use drystone::stages::kernels::{Impulse, Pair, Point, Rules};
    use drystone::stages::math::Lane;

    #[test]
    fn the_number_of_operations_is_that_of_the_kernel() {
        assert_eq!(OPERATIONS, operations());
    }

    /// Operations per point of one sweep of a contact of four points with friction, counted by the kernel.
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

        let rules = Rules { biased: true, friction: FrictionRule::Disc, accumulated: true, ..Rules::default() };
        let (points, mut impulses) = ([Point::<Counted>::default(); 4], [Impulse::default(); 4]);
        let before = COUNT.load(Ordering::Relaxed);
        let mut pair = Pair::default();
        solve_contact(rules, &Default::default(), &mut pair, &Default::default(), &points, &mut impulses);
        (COUNT.load(Ordering::Relaxed) - before) as f64 / 4.0
    }

    // The shares themselves depend on the load of the machine.
    #[test]
    fn every_limit_is_measured_for_every_number_of_threads() {
        let rows = limits(200, &[1, 2], 3, &mut || ()).expect("a measurement");
        assert_eq!(rows.iter().map(|r| r.threads).collect::<Vec<_>>(), [1, 2]);
        for row in rows {
            assert!(row.points > 500 && row.sweeps > 0.0 && row.peak > 0.0, "{row:?}");
            assert_eq!(row.of_peak(), row.sweeps * row.operations / row.peak);
            assert!(row.triads.iter().all(|t| t.1 > 0.0), "{row:?}");
        }
    }

    #[test]
    fn shares_are_of_what_the_machine_can_do() {
        let row = LimitRow {
            threads: 2,
            manifolds: 1,
            points: 4,
            sweeps: 1e6,
            operations: 300.0,
            peak: 1.2e9,
            triads: vec![],
        };
        assert_eq!(row.of_peak(), 0.25);
        assert_eq!(row.of_triad(4e6 * BYTES), 0.25);
    }
}

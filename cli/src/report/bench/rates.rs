//! Measures the memory bandwidth and the arithmetic rate of the machine.

use std::hint::black_box;
use std::ops::Range;
use std::sync::Barrier;
use std::time::Instant;

use drystone::stages::backend::{InstructionSet, Lanes, WIDTH, Work};

/// Multiplications and additions per second in registers alone, of all threads in total.
pub(super) fn peak(pool: &rayon::ThreadPool) -> f64 {
    const ROUNDS: usize = 1_000_000;
    let begin = Instant::now();
    pool.broadcast(|_| InstructionSet::default().run(&Chains, 0..ROUNDS));
    let done = pool.current_num_threads() * ROUNDS * 2 * CHAINS * WIDTH;
    done as f64 / begin.elapsed().as_secs_f64()
}

/// Independent chains of each operation, enough for all units of a processor.
const CHAINS: usize = 6;

/// Multiplications and additions in registers alone, not fused, as in the kernels.
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

/// Bytes per second of a = b + s c over three arrays, of all threads in total, from the first start to the last end.
/// Each thread has its own arrays, of `size` bytes in total.
pub(super) fn triad(pool: &rayon::ThreadPool, size: usize) -> f64 {
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

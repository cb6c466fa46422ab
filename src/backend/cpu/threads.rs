//! Threads that stay awake for one run of a plan: a leader and its helpers.
//!
//! A color can be 20 us of work, and waking a sleeping thread costs half of that. Therefore helpers look for work
//! without a pause until the run ends, and between runs there are no helpers. One atomic number hands out work: the
//! leader takes chunks from the front and helpers take chunks from the back, so that each thread finds much of its own
//! data in its cache. The leader can do everything alone: it waits only for chunks that helpers have taken.

#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, AtomicUsize, Ordering};

/// Work over a range. It lives on the stack of [`Threads::spread`].
struct Job<'a> {
    work: &'a (dyn Fn(Range<usize>) + Sync),
    range: Range<usize>,
    chunks: usize,
}

impl Job<'_> {
    fn run(&self, chunk: usize) {
        let cut = |i: usize| self.range.start + self.range.len() * i / self.chunks;
        (self.work)(cut(chunk)..cut(chunk + 1));
    }
}

/// A number on a cache line of its own.
#[derive(Default)]
#[repr(align(128))]
struct CachePadded<T>(T);

/// A leader and its helpers.
#[derive(Default)]
pub(super) struct Threads {
    helpers: usize,
    /// Open chunks: the first one in the upper half, one past the last in the lower half.
    open: CachePadded<AtomicU64>,
    /// Number of finished chunks.
    finished: CachePadded<AtomicUsize>,
    job: AtomicPtr<Job<'static>>,
    over: AtomicBool,
}

/// Smallest number of groups of sixteen in a chunk: about a microsecond of work, ten times the cost of taking a chunk.
/// Miri has small problems.
const GROUPS_PER_CHUNK: usize = if cfg!(miri) { 1 } else { 4 };
/// Number of chunks for each thread, so that one slow thread does not delay all.
const CHUNKS_PER_THREAD: usize = 4;
/// Number of checks for work before a thread yields the processor. Miri runs threads in turns, so repeated checks are
/// useless there.
const LOOKS_BEFORE_YIELD: u32 = if cfg!(miri) { 1 } else { 4000 };

impl Threads {
    /// Leads a run in which no pass has more than `widest` groups, with the threads of the current pool.
    pub fn lead<R: Send>(widest: usize, lead: impl FnOnce(&Self) -> R + Send) -> R {
        let count = rayon::current_num_threads();
        if count == 1 || widest < 2 * GROUPS_PER_CHUNK {
            return lead(&Self::default());
        }
        let threads = Self { helpers: count - 1, ..Self::default() };
        threads.beside_helpers(threads.helpers, || {
            // Helpers leave when the leader returns or panics.
            let _end = OnDrop(|| threads.over.store(true, Ordering::Release));
            lead(&threads)
        })
    }

    /// Runs `lead`, with helpers in parallel.
    fn beside_helpers<R: Send>(&self, helpers: usize, lead: impl FnOnce() -> R + Send) -> R {
        fn beside<R: Send>(threads: &Threads, helpers: usize, lead: &mut (dyn FnMut() -> R + Send)) -> R {
            if helpers == 0 {
                return lead();
            }
            rayon::join(|| beside(threads, helpers - 1, lead), || threads.help()).0
        }
        let mut lead = Some(lead);
        beside(self, helpers, &mut || (lead.take().expect("called once"))())
    }

    /// Runs `work` over groups of sixteen, in chunks if there are enough groups.
    pub fn spread(&self, groups: Range<usize>, work: &(dyn Fn(Range<usize>) + Sync)) {
        self.spread_in_chunks(groups, GROUPS_PER_CHUNK, work);
    }

    /// Runs `work` over items. Each item is large enough for a chunk.
    pub fn spread_each(&self, items: Range<usize>, work: &(dyn Fn(Range<usize>) + Sync)) {
        self.spread_in_chunks(items, 1, work);
    }

    fn spread_in_chunks(&self, range: Range<usize>, least: usize, work: &(dyn Fn(Range<usize>) + Sync)) {
        let chunks = (range.len() / least).min(CHUNKS_PER_THREAD * (self.helpers + 1));
        if self.helpers == 0 || chunks < 2 {
            return work(range);
        }
        let job = Job { work, range, chunks };
        self.job.store((&raw const job).cast_mut().cast(), Ordering::Relaxed);
        self.finished.0.store(0, Ordering::Relaxed);
        self.open.0.store(chunks as u64, Ordering::Release);
        // The job lives until all chunks that were taken are done, even if one of them panics here.
        let _all = OnDrop(|| {
            let [first, end] = halves(self.open.0.swap(0, Ordering::Relaxed));
            let taken = chunks - (end - first);
            wait(|| self.finished.0.load(Ordering::Acquire) == taken);
        });
        while let Some(chunk) = self.take(|[first, end]| [first + 1, end], |[first, _]| first) {
            let _done = OnDrop(|| self.finish());
            job.run(chunk);
        }
    }

    /// Looks for work until the run is over.
    fn help(&self) {
        let mut chunk = None;
        loop {
            wait(|| {
                chunk = self.take(|[first, end]| [first, end - 1], |[_, end]| end - 1);
                chunk.is_some() || self.over.load(Ordering::Acquire)
            });
            let Some(chunk) = chunk else { return };
            let _done = OnDrop(|| self.finish());
            // SAFETY: the leader does not leave `spread`, where the job is, before the chunk that was taken is done.
            unsafe { &*self.job.load(Ordering::Relaxed) }.run(chunk);
        }
    }

    fn finish(&self) {
        self.finished.0.fetch_add(1, Ordering::Release);
    }

    /// Takes an open chunk, if there is one. `which` chooses it, and `rest` returns the chunks that stay open.
    fn take(&self, rest: fn([usize; 2]) -> [usize; 2], which: fn([usize; 2]) -> usize) -> Option<usize> {
        let mut open = self.open.0.load(Ordering::Relaxed);
        loop {
            let [first, end] = halves(open);
            if first >= end {
                return None;
            }
            let [rest_first, rest_end] = rest([first, end]);
            let rest = (rest_first as u64) << 32 | rest_end as u64;
            match self.open.0.compare_exchange_weak(open, rest, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => return Some(which([first, end])),
                Err(now) => open = now,
            }
        }
    }
}

fn halves(open: u64) -> [usize; 2] {
    [(open >> 32) as usize, (open & 0xffff_ffff) as usize]
}

/// Repeats a check until `done`. After a while it yields the processor between two checks.
fn wait(mut done: impl FnMut() -> bool) {
    let mut looks = 0;
    while !done() {
        looks += 1;
        if looks < LOOKS_BEFORE_YIELD { std::hint::spin_loop() } else { std::thread::yield_now() }
    }
}

/// Calls a function when it goes out of scope.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Shared;

    fn with_threads(threads: usize, test: impl FnOnce() + Send) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(test);
    }

    #[test]
    fn every_group_is_done_once_whatever_the_number_of_threads() {
        for count in [1, 2, 3, 8] {
            with_threads(count, || {
                Threads::lead(1 << 20, |threads| {
                    let rounds = if cfg!(miri) { 5 } else { 200 };
                    for groups in [0..0, 3..4, 5..37, 0..1000, 7..5007].into_iter().cycle().take(rounds) {
                        let done: Vec<_> = (0..groups.end).map(|_| AtomicUsize::new(0)).collect();
                        threads.spread(groups.clone(), &|range| {
                            for i in range {
                                done[i].fetch_add(1, Ordering::Relaxed);
                            }
                        });
                        let right = |(i, n): (usize, &AtomicUsize)| {
                            n.load(Ordering::Relaxed) == usize::from(groups.contains(&i))
                        };
                        assert!(done.iter().enumerate().all(right), "{count} threads, {groups:?}");
                    }
                });
            });
        }
    }

    /// Plain memory. The leader writes it before it hands out a job, and helpers write it before they finish a chunk.
    /// Miri reports a race if the memory ordering of the hand-over is too weak.
    #[test]
    fn each_side_sees_what_the_other_wrote_before_the_hand_over() {
        with_threads(2, || {
            Threads::lead(1000, |threads| {
                let mut numbers = vec![0_usize; 64];
                for round in 1..20 {
                    let shared = Shared::new(&mut numbers);
                    threads.spread(0..64, &|range| {
                        // SAFETY: `Threads::spread` cuts the range.
                        unsafe { shared.slice(range) }.iter_mut().for_each(|number| *number += round);
                        // Lets a helper run.
                        std::thread::yield_now();
                    });
                    assert_eq!(numbers, [round * (round + 1) / 2; 64]);
                    numbers.reverse();
                }
            });
        });
    }

    #[test]
    fn several_leaders_share_one_pool() {
        const ROUNDS: usize = if cfg!(miri) { 3 } else { 100 };
        with_threads(2, || {
            rayon::scope(|scope| {
                for _ in 0..4 {
                    scope.spawn(|_| {
                        let sum = AtomicUsize::new(0);
                        Threads::lead(1000, |threads| {
                            for _ in 0..ROUNDS {
                                threads.spread(0..1000, &|range| {
                                    sum.fetch_add(range.len(), Ordering::Relaxed);
                                });
                            }
                        });
                        assert_eq!(sum.into_inner(), 1000 * ROUNDS);
                    });
                }
            });
        });
    }

    #[test]
    fn a_panic_reaches_the_caller_and_no_thread_hangs() {
        with_threads(2, || {
            let caught = std::panic::catch_unwind(|| {
                Threads::lead(1000, |threads| threads.spread(0..1000, &|range| assert!(!range.contains(&700))));
            });
            assert!(caught.is_err());
        });
    }
}

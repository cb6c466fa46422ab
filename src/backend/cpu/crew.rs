//! Threads that stay awake for one run of a plan.
//!
//! A color can be 20 us of work, and waking a thread that sleeps costs half of that. So the helpers of a run look for work
//! all the time until it ends, and between runs there are none. Work is handed out by one atomic number: the leader takes
//! chunks from the front and helpers from the back, so that each finds much of what it wrote in its own cache. The leader never
//! depends on a helper that has not come: it can do everything alone, and waits only for chunks that are being worked on.

#![allow(unsafe_code)]

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, AtomicUsize, Ordering};

/// What is to be done, on the stack of [`Crew::spread`].
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
struct Apart<T>(T);

/// A leader and its helpers.
#[derive(Default)]
pub(super) struct Crew {
    helpers: usize,
    /// Chunks that nobody has taken yet: the first in the upper half, one past the last in the lower.
    open: Apart<AtomicU64>,
    /// Chunks that are done.
    finished: Apart<AtomicUsize>,
    job: AtomicPtr<Job<'static>>,
    over: AtomicBool,
}

/// Groups of sixteen that a chunk has at least: about a microsecond of work, ten times what it costs to take it.
const CHUNK: usize = 4;
/// Chunks a thread, so that one that is held up does not hold up all.
const CHUNKS_PER_THREAD: usize = 4;
/// How often a thread looks for work before it lets others have the processor.
const PATIENCE: u32 = 4000;

impl Crew {
    /// Leads a run in which no pass goes over more than `widest` groups, with the threads of the pool that this thread
    /// belongs to.
    pub fn lead<R: Send>(widest: usize, lead: impl FnOnce(&Self) -> R + Send) -> R {
        let threads = rayon::current_num_threads();
        if threads == 1 || widest < 2 * CHUNK {
            return lead(&Self::default());
        }
        let crew = Self { helpers: threads - 1, ..Self::default() };
        crew.beside_helpers(crew.helpers, || {
            // Helpers leave whether the leader returns or panics.
            let _end = OnDrop(|| crew.over.store(true, Ordering::Release));
            lead(&crew)
        })
    }

    /// Runs `lead` beside some helpers.
    fn beside_helpers<R: Send>(&self, helpers: usize, lead: impl FnOnce() -> R + Send) -> R {
        fn beside<R: Send>(crew: &Crew, helpers: usize, lead: &mut (dyn FnMut() -> R + Send)) -> R {
            if helpers == 0 {
                return lead();
            }
            rayon::join(|| beside(crew, helpers - 1, lead), || crew.help()).0
        }
        let mut lead = Some(lead);
        beside(self, helpers, &mut || (lead.take().expect("called once"))())
    }

    /// Runs `work` over `groups`, cut into chunks if there are enough of them.
    pub fn spread(&self, groups: Range<usize>, work: &(dyn Fn(Range<usize>) + Sync)) {
        self.cut(groups, CHUNK, work);
    }

    /// Runs `work` over parts, each of which is worth a thread.
    pub fn spread_parts(&self, parts: Range<usize>, work: &(dyn Fn(Range<usize>) + Sync)) {
        self.cut(parts, 1, work);
    }

    /// Runs `work` over `groups` in chunks of at least so many.
    fn cut(&self, groups: Range<usize>, least: usize, work: &(dyn Fn(Range<usize>) + Sync)) {
        let chunks = (groups.len() / least).min(CHUNKS_PER_THREAD * (self.helpers + 1));
        if self.helpers == 0 || chunks < 2 {
            return work(groups);
        }
        let job = Job { work, range: groups, chunks };
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

    /// Takes a chunk that nobody has taken, if there is one: `rest` is what then remains, `which` the one that is taken.
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

/// Looks again and again until `done`; after a while it lets other threads have the processor in between.
fn wait(mut done: impl FnMut() -> bool) {
    let mut looks = 0;
    while !done() {
        looks += 1;
        if looks < PATIENCE { std::hint::spin_loop() } else { std::thread::yield_now() }
    }
}

/// Does something when it goes out of scope.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_threads(threads: usize, test: impl FnOnce() + Send) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(test);
    }

    #[test]
    fn every_group_is_done_once_whatever_the_number_of_threads() {
        for threads in [1, 2, 3, 8] {
            with_threads(threads, || {
                Crew::lead(1 << 20, |crew| {
                    for groups in [0..0, 3..4, 5..37, 0..1000, 7..5007].into_iter().cycle().take(200) {
                        let done: Vec<_> = (0..groups.end).map(|_| AtomicUsize::new(0)).collect();
                        crew.spread(groups.clone(), &|range| {
                            for i in range {
                                done[i].fetch_add(1, Ordering::Relaxed);
                            }
                        });
                        let right = |(i, n): (usize, &AtomicUsize)| {
                            n.load(Ordering::Relaxed) == usize::from(groups.contains(&i))
                        };
                        assert!(done.iter().enumerate().all(right), "{threads} threads, {groups:?}");
                    }
                });
            });
        }
    }

    #[test]
    fn several_crews_share_one_pool() {
        with_threads(2, || {
            rayon::scope(|scope| {
                for _ in 0..4 {
                    scope.spawn(|_| {
                        let sum = AtomicUsize::new(0);
                        Crew::lead(1000, |crew| {
                            for _ in 0..100 {
                                crew.spread(0..1000, &|range| {
                                    sum.fetch_add(range.len(), Ordering::Relaxed);
                                });
                            }
                        });
                        assert_eq!(sum.into_inner(), 100_000);
                    });
                }
            });
        });
    }

    #[test]
    fn a_panic_reaches_the_caller_and_no_thread_hangs() {
        with_threads(2, || {
            let caught = std::panic::catch_unwind(|| {
                Crew::lead(1000, |crew| crew.spread(0..1000, &|range| assert!(!range.contains(&700))));
            });
            assert!(caught.is_err());
        });
    }
}

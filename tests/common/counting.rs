//! Counts what the threads of a pool ask of the system for memory. Other tests may run beside.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts what is asked of the system.
struct Counting;

thread_local! {
    /// The counter of the pool that this thread belongs to.
    static ASKED: Cell<Option<&'static AtomicUsize>> = const { Cell::new(None) };
}

// SAFETY: does what `System` does.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if let Ok(Some(asked)) = ASKED.try_with(Cell::get) {
            asked.fetch_add(1, Ordering::Relaxed);
        }
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Runs `work` in a pool of `threads` threads whose calls for memory are counted.
pub fn in_pool<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    let asked: &'static AtomicUsize = Box::leak(Box::default());
    let counted = move |_| ASKED.set(Some(asked));
    rayon::ThreadPoolBuilder::new().num_threads(threads).start_handler(counted).build().expect("a pool").install(work)
}

/// The calls for memory so far of the pool that this thread belongs to.
pub fn asked() -> usize {
    ASKED.get().expect("a thread of a pool whose calls are counted").load(Ordering::Relaxed)
}

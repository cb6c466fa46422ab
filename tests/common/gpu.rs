//! Needs of a test of a GPU, and the outcome of a test whose needs are not met.
//!
//! Such a test fails, and its line says what is missing and what was found instead. A person who knows that a machine lacks
//! something says so: `DRYSTONE_ADAPTER=none` leaves out every test of a GPU, and `DRYSTONE_WITHOUT=exact`, `clock` or
//! `exact,clock` those that need exact mode or a clock. Tests that are left out are reported as ignored.

use std::ops::Deref;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use drystone::backend::gpu::{AdapterChoice, AdapterSummary, adapters};
use drystone::stages::backend::CheckedStep;
use drystone::stages::problem::Carry;
use drystone::stats::{KernelTime, Traffic};
use drystone::{Backend, Gpu};

use super::harness;

/// A need of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// An adapter, which compiles plain WGSL.
    Adapter,
    /// An adapter with exact mode.
    Exact,
    /// An adapter that times kernels.
    Clock,
}

impl Need {
    /// The word for it in `DRYSTONE_WITHOUT`, and the thing in words.
    fn feature(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Adapter => None,
            Self::Exact => Some(("exact", "exact mode")),
            Self::Clock => Some(("clock", "a clock that times kernels")),
        }
    }

    /// Why a person leaves out the tests with this need, given the values of `DRYSTONE_ADAPTER` and `DRYSTONE_WITHOUT`; none
    /// where these tests are to run.
    ///
    /// # Errors
    /// `DRYSTONE_WITHOUT` has an unknown word.
    pub fn left_out(self, adapter: &str, without: &str) -> Result<Option<String>, String> {
        let words: Vec<&str> = without.split(',').map(str::trim).filter(|word| !word.is_empty()).collect();
        if let Some(word) = words.iter().find(|word| !["exact", "clock"].contains(word)) {
            return Err(format!("DRYSTONE_WITHOUT={without}: {word:?} is unknown; known are exact and clock"));
        }
        if adapter.eq_ignore_ascii_case("none") {
            return Ok(Some(format!("DRYSTONE_ADAPTER={adapter}")));
        }
        let named = self.feature().is_some_and(|(word, _)| words.contains(&word));
        Ok(named.then(|| format!("DRYSTONE_WITHOUT={without}")))
    }

    /// The line with which a test of this need fails on the adapter that was found; none where the adapter has what is needed.
    pub fn refusal(self, found: Option<&AdapterSummary>) -> Option<String> {
        let Some(found) = found else {
            return Some(
                "this test needs an adapter, and there is none; ./tests/run installs the software adapter, \
                DRYSTONE_ADAPTER=none ignores all tests of a GPU"
                    .into(),
            );
        };
        let has = match self {
            Self::Exact => found.takes_spirv,
            Self::Clock => found.clock,
            Self::Adapter => true,
        };
        let (word, thing) = self.feature().filter(|_| !has)?;
        Some(format!("this test needs {thing}, which {found} lacks; DRYSTONE_WITHOUT={word} ignores such tests"))
    }

    /// Fails with the line that says what is missing, and nothing but that line, unless the best adapter has what is needed.
    pub fn assert_met(self) {
        static FOUND: OnceLock<Option<AdapterSummary>> = OnceLock::new();
        let found = FOUND.get_or_init(|| adapters().into_iter().next());
        if let Some(line) = self.refusal(found.as_ref()) {
            std::panic::resume_unwind(Box::new(line));
        }
    }
}

/// The best adapter in exact mode, on a device that may have compiled some kernels already.
pub fn exact() -> Lent {
    lent(Need::Exact)
}

/// The best adapter, whose driver compiles plain WGSL; likewise.
pub fn plain() -> Lent {
    lent(Need::Adapter)
}

/// The best adapter in exact mode, on a new device: for a test of what a device costs, or of one that it changes.
pub fn own_exact() -> Gpu {
    open(Need::Exact)
}

/// The best adapter with plain WGSL, likewise.
pub fn own_plain() -> Gpu {
    open(Need::Adapter)
}

/// `gpu` with its kernels timed from now on, and the bytes that it copies in a second.
pub fn timed(mut gpu: Gpu) -> (Gpu, f64) {
    Need::Clock.assert_met();
    let bandwidth = gpu.time_kernels().expect("it copies").expect("its adapter has a clock");
    (gpu, bandwidth)
}

fn open(need: Need) -> Gpu {
    assert!(harness::runs(), "a test of a GPU stands in a binary with `harness = false`, which can ignore the test");
    need.assert_met();
    Gpu::new(AdapterChoice::Best, need == Need::Exact).unwrap_or_else(|e| panic!("{e}"))
}

/// Devices that no test has: plain ones, and those in exact mode. To open a device and to compile its kernels takes longer than most tests.
static POOL: [Mutex<Vec<Gpu>>; 2] = [const { Mutex::new(Vec::new()) }; 2];

fn pool(is_exact: bool) -> MutexGuard<'static, Vec<Gpu>> {
    POOL[usize::from(is_exact)].lock().unwrap_or_else(PoisonError::into_inner)
}

/// Closes the devices of the pool: a driver may not like to end with the program while it has some.
pub fn close() {
    [false, true].into_iter().for_each(|is_exact| pool(is_exact).clear());
}

fn lent(need: Need) -> Lent {
    let waiting = pool(need == Need::Exact).pop();
    Lent { gpu: Some(waiting.unwrap_or_else(|| open(need))), is_spoiled: false }
}

/// A device of the pool, which goes back there. One that failed, or whose test failed, does not.
pub struct Lent {
    /// None once it went back.
    gpu: Option<Gpu>,
    is_spoiled: bool,
}

impl Lent {
    fn gpu(&mut self) -> &mut Gpu {
        self.gpu.as_mut().expect("it goes back when it is dropped")
    }

    fn noted<T>(&mut self, result: drystone::Result<T>) -> drystone::Result<T> {
        self.is_spoiled |= result.is_err();
        result
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(gpu) = self.gpu.take().filter(|_| !self.is_spoiled && !std::thread::panicking()) {
            pool(gpu.is_exact()).push(gpu);
        }
    }
}

impl Deref for Lent {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        self.gpu.as_ref().expect("it goes back when it is dropped")
    }
}

impl Backend for Lent {
    fn name(&self) -> &'static str {
        self.deref().name()
    }

    fn adapter(&self) -> String {
        self.deref().adapter()
    }

    fn run_checked(&mut self, step: CheckedStep) -> drystone::Result<()> {
        let done = self.gpu().run_checked(step);
        self.noted(done)
    }

    fn step(&mut self, step: CheckedStep, carry: &Carry) -> drystone::Result<()> {
        let done = self.gpu().step(step, carry);
        self.noted(done)
    }

    fn keeps_rows(&self) -> bool {
        self.deref().keeps_rows()
    }

    fn successor(&mut self) -> Option<Box<dyn Backend>> {
        self.gpu().successor()
    }

    fn traffic(&self) -> Traffic {
        self.deref().traffic()
    }

    /// Refused: a device that takes times would go on with that in other tests.
    fn time_kernels(&mut self) -> drystone::Result<Option<f64>> {
        panic!("a test that times kernels has a device of its own")
    }

    fn kernel_times(&self) -> &[KernelTime] {
        self.deref().kernel_times()
    }
}

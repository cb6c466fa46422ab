//! What a test needs of a GPU, and what becomes of a test where that is missing.
//!
//! Such a test fails, and its line says what is missing and what was found instead. A person who knows that a machine lacks
//! something says so: `DRYSTONE_ADAPTER=none` leaves out every test of a GPU, and `DRYSTONE_WITHOUT=exact`, `clock` or
//! `exact,clock` those that need exact mode or a clock. Tests that are left out are reported as ignored.

use std::sync::OnceLock;

use drystone::backend::gpu::{AdapterChoice, AdapterSummary, adapters};
use drystone::{Backend, Gpu};

use super::harness;

/// What a test needs.
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

/// The best adapter in exact mode.
pub fn exact() -> Gpu {
    open(Need::Exact)
}

/// The best adapter, whose driver compiles plain WGSL.
pub fn plain() -> Gpu {
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

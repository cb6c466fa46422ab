//! The share of their cases that slow tests run.

/// Whether tests run all of their cases: `DRYSTONE_FULL=1`, as every night.
pub fn is_full() -> bool {
    std::env::var_os("DRYSTONE_FULL").is_some_and(|full| full == "1")
}

/// The distance from one case to the next that a test runs: `n`, or 1 if all run.
pub fn one_in(n: usize) -> usize {
    if is_full() { 1 } else { n }
}

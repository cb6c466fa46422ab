//! Measurements held against what paper says.

/// Difference relative to what is expected.
fn off(measured: f64, expected: f64) -> f64 {
    ((measured - expected) / expected).abs()
}

/// Whether a measurement is within `tolerance` of what is expected, relative to it; NaN is not.
pub fn is_near(measured: f64, expected: f64, tolerance: f64) -> bool {
    off(measured, expected) <= tolerance
}

/// Refuses a measurement that is not. `--nocapture` shows all of them.
#[track_caller]
pub fn holds(what: &str, measured: f64, expected: f64, tolerance: f64) {
    let off = off(measured, expected);
    measured!("{what}: {measured:.7} measured, {expected:.7} expected, {off:.1e} off");
    assert!(is_near(measured, expected, tolerance), "{what}: {measured}, not {expected}: {off:.1e} off");
}

/// Refuses an error above its bound, which is stated beside the one measured.
#[track_caller]
pub fn below(what: &str, error: f64, bound: f64) {
    measured!("{what}: {error:.1e} off");
    assert!(error < bound, "{what}: {error:.1e} off, bound {bound:.0e}");
}

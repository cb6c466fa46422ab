//! Numbers as text.

/// A number with three digits.
pub fn number(x: f64) -> String {
    if !x.is_finite() || x == 0.0 {
        return if x.is_nan() { "-".into() } else { x.to_string() };
    }
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{x:.digits$}")
}

//! Memory of this process, as reported by Linux.

/// Resets the peak, and returns the resident memory (B). `None` if the system does not report it.
pub(super) fn begin() -> Option<f64> {
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    status("VmRSS:")
}

/// Peak of the resident memory since [`begin`] (B).
pub(super) fn peak() -> Option<f64> {
    status("VmHWM:")
}

fn status(key: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let number = text.lines().find_map(|line| line.strip_prefix(key))?.trim().strip_suffix(" kB")?;
    number.parse::<f64>().ok().map(|kib| kib * 1024.0)
}

//! Checks whether a request fits into the available memory. The error is one line in advance, instead of an abort after
//! minutes.

use std::fmt::Display;
use std::path::Path;

use crate::error::{Error, Result};

/// Smallest number of bytes for a simulated body, including rows and a copy of the scene. Measured: 2.1 kB in a grid of
/// joints, 4 kB in a pile that still falls.
pub const BODY: f64 = 2000.0;

/// Refuses a world or film that takes more memory than the machine has. If the available memory is unknown, every
/// request passes.
///
/// # Errors
/// One line names `what`, the required and the available memory.
pub fn check(bytes: f64, what: impl Display) -> Result<()> {
    match available().filter(|&there| bytes > there) {
        Some(there) => Err(Error::TooLarge(format!(
            "{what}: at least {:.1} GB of memory needed, {:.1} GB available",
            bytes * 1e-9,
            there * 1e-9
        ))),
        None => Ok(()),
    }
}

/// Memory that is still available to this process (B), as reported by Linux and by the limits of process and container;
/// `None` elsewhere.
fn available() -> Option<f64> {
    let kib = |bytes: f64| bytes * 1024.0;
    let machine = number_after("/proc/meminfo", "MemAvailable:").map(kib);
    let process = number_after("/proc/self/limits", "Max address space");
    let container = number_after("/sys/fs/cgroup/memory.max", "");
    [machine, process, container].into_iter().flatten().reduce(f64::min)
}

/// Resident memory of this process (B), as reported by Linux; `None` elsewhere.
pub fn resident() -> Option<f64> {
    number_after("/proc/self/status", "VmRSS:").map(|kib| kib * 1024.0)
}

/// The number after a word at the start of a line. `None` without the file, the line or a number, as in `unlimited`.
fn number_after(path: impl AsRef<Path>, head: &str) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    text.lines().find_map(|line| line.strip_prefix(head))?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_is_let_through_and_what_cannot_fit_is_not() {
        assert!(check(1e3, "little").is_ok());
        if cfg!(target_os = "linux") {
            let message = check(1e18, "much").expect_err("an exabyte").to_string();
            assert!(message.starts_with("much: at least 1000000000.0 GB of memory needed, "), "{message}");
        }
    }
}

//! Files that are there whole or not at all.

use std::path::Path;

use crate::error::{Error, Result};

/// Writes a file under another name beside it, then moves it there: a reader finds all of it, or what was there before.
///
/// # Errors
/// It cannot be written; what was there before is still there.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.part", std::process::id()));
    let written = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|e| {
        // It may not even be there.
        let _ = std::fs::remove_file(&beside);
        Error::file(path)(e)
    })
}

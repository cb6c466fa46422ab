//! What commands print, and files that take the place of others.

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::Path;

use comfy_table::{Table, presets};
use drystone::{Error, Result};

/// A table without lines.
pub(super) fn plain_table() -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table
}

/// Runs what writes a file, and says so if the file took the place of another.
pub(super) fn replacing<T>(path: &Path, write: impl FnOnce() -> Result<T>) -> Result<T> {
    let was_there = path.is_file();
    let written = write()?;
    if was_there {
        say(format_args!("{}: replaced what was there", path.display()));
    }
    Ok(written)
}

/// Prints to standard output, and a line break. That the reader of a pipe has seen enough is no error.
pub(super) fn print(text: impl Display) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::file("standard output")(e)),
        _ => Ok(()),
    }
}

/// Prints a line to standard error. Nothing depends on a reader of it: `eprintln!` would panic without one.
pub(super) fn say(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Prints a value as JSON on one line.
pub(super) fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(serde_json::to_string(value).expect("reports serialize"))
}

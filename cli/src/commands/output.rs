//! Output of the commands.

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::Path;

use comfy_table::{Table, presets};
use drystone::{Error, Result};

pub(super) fn plain_table() -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table
}

/// Calls `write` and prints a note if it replaced an existing file.
pub(super) fn replacing<T>(path: &Path, write: impl FnOnce() -> Result<T>) -> Result<T> {
    let was_there = path.is_file();
    let written = write()?;
    if was_there {
        say(format_args!("{}: replaced what was there", path.display()));
    }
    Ok(written)
}

/// Prints a line to standard output. A closed pipe is no error.
pub(super) fn print(text: impl Display) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::file("standard output")(e)),
        _ => Ok(()),
    }
}

/// Prints a line to standard error; unlike `eprintln!` without panicking if nothing reads it.
pub(super) fn say(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

pub(super) fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(serde_json::to_string(value).expect("reports serialize"))
}

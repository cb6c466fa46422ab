//! Output of the commands.

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;

use comfy_table::{Table, presets};
use drystone::{Error, Result};

pub(super) fn plain_table() -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table
}

/// Calls `write`, and prints a note if it replaced an existing file.
pub(super) fn replacing<T>(path: &Path, write: impl FnOnce() -> Result<T>) -> Result<T> {
    let was_there = path.is_file();
    let written = write()?;
    if was_there {
        say(format_args!("{}: replaced an existing file", path.display()));
    }
    Ok(written)
}

const STANDARD_OUTPUT: &str = "standard output";

/// Prints a line to standard output.
pub(super) fn print(text: impl Display) -> Result<()> {
    writeln!(std::io::stdout(), "{text}").map_err(Error::file(STANDARD_OUTPUT))
}

/// Whether the reader of standard output is gone, as after `head`.
pub(super) fn is_closed_pipe(error: &Error) -> bool {
    matches!(error, Error::File { path, source } if path == Path::new(STANDARD_OUTPUT) && source.kind() == ErrorKind::BrokenPipe)
}

/// Prints a line to standard error. Unlike `eprintln!`, it does not panic if nothing reads it.
pub(super) fn say(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Prints the last line of a command that ends early. The line replaces a progress bar.
pub(super) fn say_last(text: impl Display) {
    let clear = if std::io::stderr().is_terminal() { "\r\x1b[K" } else { "" };
    say(format_args!("{clear}drystone: {text}"));
}

pub(super) fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(serde_json::to_string(value).expect("reports serialize"))
}

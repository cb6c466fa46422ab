//! Errors with a reason outside the numbers: the caller's input, or the machine.
//!
//! Trouble *in* the numbers (a body that left the finite range, a contact without a color) is not an
//! error where a step made it: it is counted in [`StepStats`](crate::stats::StepStats) and shown. A number out of
//! range that a caller sets is one.

use std::path::PathBuf;

/// One line that names what is wrong and where.
///
/// ```
/// use drystone::{Error, Result};
///
/// fn refused() -> Result<()> {
///     Err(Error::input("must be above 0").within("scene.json"))
/// }
/// let error = refused().expect_err("it is refused");
/// assert_eq!((error.to_string().as_str(), error.exit_code()), ("scene.json: must be above 0", 2));
/// let missing = std::fs::read("no such file").map_err(Error::file("no such file")).expect_err("no file");
/// assert!(matches!(missing, Error::File { .. }) && missing.to_string().starts_with("no such file: "));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The caller's input cannot be used: a scene file, a setting, a parameter.
    #[error("{}", one_line(.0))]
    Input(String),
    /// A file could not be read or written.
    #[error("{}: {source}", one_line(.path.display()))]
    File {
        /// The file as the caller named it.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// No adapter, or one that cannot do what is asked.
    #[error("{0}")]
    Adapter(String),
    /// The device was lost in the course of the work.
    #[error("{0}")]
    Lost(String),
    /// The problem is larger than the adapter's buffers or than its memory.
    #[error("{0}")]
    TooLarge(String),
    /// A computation came to an end that should not be: a mistake of this library or of parry.
    #[error("{}", one_line(.0))]
    Panicked(String),
}

impl Error {
    /// An [`Error::Input`] from anything that prints.
    pub fn input(message: impl std::fmt::Display) -> Self {
        Self::Input(message.to_string())
    }

    /// Says where an [`Error::Input`] is: `place: message`.
    pub fn within(self, place: impl std::fmt::Display) -> Self {
        match self {
            Self::Input(message) => Self::Input(format!("{place}: {message}")),
            other => other,
        }
    }

    /// Wraps an I/O error with the path it happened on.
    pub fn file(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }

    /// Exit code of the command line: 1 for a mistake of the program, 2 for the caller's input, 3 for the machine.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Panicked(_) => 1,
            Self::Input(_) | Self::File { .. } => 2,
            Self::Adapter(_) | Self::Lost(_) | Self::TooLarge(_) => 3,
        }
    }
}

/// A text as one line, whatever a file or a caller has in it.
fn one_line(text: impl std::fmt::Display) -> String {
    text.to_string().replace(char::is_control, " ")
}

/// An [`Error::Input`] with a text as of `format!`.
macro_rules! input {
    ($($text:tt)*) => { $crate::error::Error::Input(format!($($text)*)) };
}
pub(crate) use input;

/// Refuses the caller's input with a message unless a condition holds.
pub(crate) fn ensure(holds: bool, message: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::Input(message())) }
}

/// The result of every fallible call of this library.
pub type Result<T> = std::result::Result<T, Error>;

//! Errors with a cause outside the numbers: the caller's input, or the machine.
//!
//! Trouble *in* the numbers that a step causes is not an error: a body that left the finite range, or a contact without
//! a color. [`StepStats`](crate::stats::StepStats) counts it. A number out of range that a caller sets is an error.

use std::path::PathBuf;

/// An error. Its message is one line that names the problem and its place.
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
    /// The caller's input cannot be used: a scene file, a setting, or a parameter.
    #[error("{}", one_line(.0))]
    Input(String),
    /// A file could not be read or written.
    #[error("{}: {source}", one_line(.path.display()))]
    File {
        /// The path of the file, as the caller wrote it.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// There is no adapter, or it cannot do the requested work.
    #[error("{0}")]
    Adapter(String),
    /// The device was lost during the work.
    #[error("{0}")]
    Lost(String),
    /// The problem is larger than the adapter's buffers or memory.
    #[error("{0}")]
    TooLarge(String),
    /// A computation panicked. This is a defect of this library or of parry.
    #[error("{}", one_line(.0))]
    Panicked(String),
}

impl Error {
    /// An [`Error::Input`] with a message.
    pub fn input(message: impl std::fmt::Display) -> Self {
        Self::Input(message.to_string())
    }

    /// Adds the place to an [`Error::Input`]: `place: message`.
    pub fn within(self, place: impl std::fmt::Display) -> Self {
        match self {
            Self::Input(message) => Self::Input(format!("{place}: {message}")),
            other => other,
        }
    }

    /// Wraps an I/O error with the path of the file.
    pub fn file(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }

    /// Whether a device was lost.
    pub(crate) fn is_lost(&self) -> bool {
        matches!(self, Self::Lost(_))
    }

    /// Exit code of the command line: 1 for a defect of the program, 2 for the caller's input, 3 for the machine.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Panicked(_) => 1,
            Self::Input(_) | Self::File { .. } => 2,
            Self::Adapter(_) | Self::Lost(_) | Self::TooLarge(_) => 3,
        }
    }
}

/// A text on one line, even if a file or a caller put line breaks into it.
fn one_line(text: impl std::fmt::Display) -> String {
    text.to_string().replace(char::is_control, " ")
}

/// An [`Error::Input`] with a text, like `format!`.
#[doc(hidden)]
#[macro_export]
macro_rules! input {
    ($($text:tt)*) => { $crate::Error::Input(format!($($text)*)) };
}
pub use input;

/// Returns the caller's input error with a message unless a condition holds.
pub fn ensure(holds: bool, message: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::Input(message())) }
}

/// The result of every fallible call of this library.
pub type Result<T> = std::result::Result<T, Error>;

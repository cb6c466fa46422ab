//! Converts a panic in contact detection to an error of the step.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// A caught panic.
pub(crate) struct Panic {
    /// The bodies whose contact was computed.
    pub bodies: Option<[u32; 2]>,
    pub text: String,
}

impl Panic {
    fn of(payload: Box<dyn Any + Send>) -> Self {
        let text = |other: &(dyn Any + Send)| text_of(other).unwrap_or("a panic without a message").to_owned();
        payload.downcast::<Self>().map_or_else(|other| Self { bodies: None, text: text(&*other) }, |known| *known)
    }
}

/// The message of a panic, if it has one.
pub fn text_of(payload: &(dyn Any + Send)) -> Option<&str> {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied())
}

/// Calls `compute`. A panic in it continues with the bodies attached, up to [`caught`].
pub(crate) fn blaming<T>(bodies: [u32; 2], compute: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(compute)).unwrap_or_else(|payload| {
        let panic = Panic { bodies: Some(bodies), ..Panic::of(payload) };
        resume_unwind(Box::new(panic))
    })
}

/// Calls `compute`. Its threads can panic. The caller then has to rebuild incomplete data.
pub(crate) fn caught<T>(compute: impl FnOnce() -> T) -> Result<T, Panic> {
    catch_unwind(AssertUnwindSafe(compute)).map_err(Panic::of)
}

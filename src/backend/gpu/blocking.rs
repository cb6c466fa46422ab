//! Waits for a device.

use crate::error::{Error, Result};

/// Blocks this thread until the future completes.
///
/// # Errors
/// Those of the future; or this is a web page, which cannot block.
pub fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    if cfg!(target_family = "wasm") {
        let instead = "use the functions whose names end in _async";
        return Err(Error::Adapter(format!("a web page cannot block on a device: {instead}")));
    }
    pollster::block_on(future)
}

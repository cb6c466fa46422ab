//! How a test comes by a GPU.

use drystone::Gpu;
use drystone::backend::gpu::{AdapterChoice, adapters};

/// The best adapter, opened exactly if `exact` asks for that and the adapter can.
///
/// `None` only where `DRYSTONE_ADAPTER=none` says that no adapter is wanted. Where one is wanted and there is none, the
/// test fails.
pub fn gpu(exact: bool) -> Option<Gpu> {
    if std::env::var("DRYSTONE_ADAPTER").is_ok_and(|name| name == "none") {
        eprintln!("not run: DRYSTONE_ADAPTER=none says that no GPU is wanted");
        return None;
    }
    let exact = exact && adapters().first().is_some_and(|a| a.exact);
    let opened = Gpu::new(AdapterChoice::Best, exact);
    Some(opened.unwrap_or_else(|e| panic!("{e}; or set DRYSTONE_ADAPTER=none to test without a GPU")))
}

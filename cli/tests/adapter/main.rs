//! The command where it opens an adapter.

#[macro_use]
#[path = "../../../tests/common/mod.rs"]
mod common;

mod adapter;
mod conform;
#[cfg(feature = "view")]
mod render;
mod tumbling;

fn main() -> std::process::ExitCode {
    common::harness::run([
        adapter::tests(),
        conform::tests(),
        #[cfg(feature = "view")]
        render::tests(),
        tumbling::tests(),
    ])
}

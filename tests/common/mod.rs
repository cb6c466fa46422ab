//! What several test files share. Each file uses a part of it.
#![allow(dead_code)]

pub mod contacts;
pub mod difference;
pub mod gpu;
pub mod kernels;
pub mod random;
pub mod tolerance;

use drystone::Backend;

/// Opens the backend that a test runs on.
pub type Open = fn() -> Box<dyn Backend>;

/// Makes three tests of each: on the reference, on the lanes of the CPU and on the GPU, exact where the adapter can.
#[allow(unused_macros)]
macro_rules! on_every_backend {
    ($($name:ident,)*) => {
        mod reference {
            $(#[test] fn $name() { super::$name(|| Box::new(drystone::Reference::<f32>::new())); })*
        }
        mod cpu {
            $(#[test] fn $name() { super::$name(|| Box::new(drystone::Cpu::new())); })*
        }
        mod gpu {
            $(#[test] fn $name() {
                if crate::common::gpu::gpu(true).is_some() {
                    super::$name(|| Box::new(crate::common::gpu::gpu(true).expect("opened just now")));
                }
            })*
        }
    };
}

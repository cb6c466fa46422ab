//! What several test files share. Each file uses a part of it.
#![allow(dead_code)]

pub mod difference;
pub mod gpu;
pub mod kernels;
pub mod random;
pub mod tolerance;

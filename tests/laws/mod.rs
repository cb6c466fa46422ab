//! Random worlds, and the laws that they are held against.

pub mod draw;
pub mod measures;
pub mod run;
pub mod shrink;

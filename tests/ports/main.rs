//! Scenes and unit tests of other engines, written anew with the figures that those engines ask for.

mod box3d;
mod game;
mod jolt;
mod rapier;
mod rapier_tests;
mod repro;
mod scene;

//! Scenes for [`drystone`]: a world, the length of a step, and the expected outcome.
//!
//! | To | call |
//! |---|---|
//! | find a scene by name | [`Scene::find`], [`CATALOGUE`] |
//! | draw a hard case with a known law | [`Family`] |
//! | let bodies come and leave | [`Spawners`] |
//! | drive a character or a vehicle by input | [`Driver`] |
//! | record a run and replay it | [`Recorder`], [`Replay`] |
//! | read and write scene files | `SceneFile`, `load`, `schema` |
//!
//! # Features
//!
//! - `serde`: scene files and their JSON Schema; a replay's difference serializes.

#![deny(unsafe_code)]
#![warn(missing_docs)]

mod catalogue;
mod driver;
#[cfg(feature = "serde")]
mod file;
mod find;
mod recording;
mod scene;
mod spawner;
mod spawners;

pub use catalogue::{CATALOGUE, Entry, Family, Law, Member, Parameter};
pub use driver::Driver;
#[cfg(feature = "serde")]
pub use file::{
    AdditionalMassFile, AxisFile, BodyFile, BodyRef, DriverFile, Geometry, JointFile, JointKind, LeavesFile, MassFile,
    MaterialFile, MotorFile, SceneFile, ShapeFile, SpawnerFile, SpringFile, load, schema,
};
pub use recording::{Recorder, RecordingIntervals, Replay, ReplayDifference};
pub use scene::{Group, Scene};
pub use spawner::{Leaves, Spawner};
pub use spawners::Spawners;

//! Scenes: a world, the length of a step, and what should hold at the end.

mod catalogue;
#[cfg(feature = "serde")]
mod file;
mod find;
mod scene;
mod spawner;

pub use catalogue::{CATALOGUE, Entry, Parameter};
#[cfg(feature = "serde")]
pub use file::{
    BodyFile, BodyRef, Geometry, JointFile, LeavesFile, MassFile, SceneFile, ShapeFile, SpawnerFile, load, schema,
};
pub use scene::{Group, Scene};
pub use spawner::{Leaves, Spawner, Spawners};

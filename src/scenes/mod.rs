//! Scenes: a world, the length of a step, and the expected outcome.

mod catalogue;
#[cfg(feature = "serde")]
mod file;
mod find;
mod scene;
mod spawner;
mod spawners;

pub use catalogue::{CATALOGUE, Entry, Family, Law, Member, Parameter};
#[cfg(feature = "serde")]
pub use file::{
    AdditionalMassFile, AxisFile, BodyFile, BodyRef, Geometry, JointFile, JointKind, LeavesFile, MassFile,
    MaterialFile, MotorFile, SceneFile, ShapeFile, SpawnerFile, SpringFile, load, schema,
};
pub use scene::{Group, Scene};
pub use spawner::{Leaves, Spawner};
pub use spawners::Spawners;

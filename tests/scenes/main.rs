//! The scenes of the catalogue and of files, and the promises of presets.

mod catalogue;
mod presets;
#[cfg(feature = "serde")]
mod scene_file;
#[cfg(feature = "serde")]
mod scene_file_joints;
#[cfg(feature = "serde")]
mod spawners;
mod vehicle;

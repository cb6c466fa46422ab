//! The scenes of the catalogue and of files, and the promises of presets.

mod catalogue;
mod driver;
mod load;
mod presets;
mod scene_file;
mod scene_file_joints;
mod spawners;
mod vehicle;

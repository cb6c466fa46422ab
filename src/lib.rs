pub mod config;
pub mod error;
pub mod scenes;
pub mod world;

pub use config::SolverConfig;
pub use error::{Error, Result};
pub use scenes::Scene;
pub use world::{Body, BodyKind, Material, Shape, World};

//! Scenes: a world, how long a step is, and what should hold at the end.

mod basics;
mod boxes;
mod catalogue;
#[cfg(feature = "serde")]
mod check;
mod drop;
mod drum;
mod entries;
#[cfg(feature = "serde")]
mod file;
mod hash;
#[cfg(feature = "serde")]
mod joint;
mod jointed;
mod masonry;
mod parts;
mod stacks;
mod worlds;

pub use catalogue::{Entry, Parameter};
pub use entries::CATALOGUE;
#[cfg(feature = "serde")]
pub use file::{BodyFile, Geometry, MassFile, SceneFile, ShapeFile, load, schema};
#[cfg(feature = "serde")]
pub use joint::{BodyRef, JointFile};

use std::ops::Range;
use std::path::Path;

use glam::Vec3;

use crate::error::{Error, Result};
use crate::suggest::hint;
use crate::world::{BodyKind, World};

/// A world with everything a run needs to know about it.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name of the catalogue entry, or of the file.
    pub name: String,
    /// The bodies.
    pub world: World,
    /// Length of a step (s).
    pub dt: f32,
    /// Steps of a run that asks for none.
    pub steps: u32,
    /// Lower and upper corner of the space that no dynamic body should leave (m), if the scene has one.
    pub container: Option<(Vec3, Vec3)>,
    /// Whether every dynamic body should still be in place at the end.
    pub stands: bool,
    /// What stands or falls together; empty if the scene does not say.
    pub groups: Vec<Group>,
}

/// Bodies that stand or fall together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Name for people.
    pub name: String,
    /// Their indices.
    pub bodies: Range<usize>,
}

impl Scene {
    /// A scene at 60 steps a second, without a container, of which nothing is said to stand.
    pub fn new(name: impl Into<String>, world: World, steps: u32) -> Self {
        Self { name: name.into(), world, dt: 1.0 / 60.0, steps, container: None, stands: false, groups: Vec::new() }
    }

    /// Says that every dynamic body should still be in place at the end.
    pub fn standing(mut self) -> Self {
        self.stands = true;
        self
    }

    /// Finds a scene by its catalogue name, else reads the file of that name, for which the feature `serde` is needed.
    /// `parameters` are `key=value`.
    ///
    /// # Errors
    /// Neither a known name nor a readable scene file; an unknown parameter or an impossible value.
    pub fn find(name_or_path: &str, parameters: &[String]) -> Result<Self> {
        match CATALOGUE.iter().find(|e| e.name == name_or_path) {
            Some(entry) => entry.build(parameters),
            None => load_or_suggest(name_or_path, parameters),
        }
    }

    /// Dynamic bodies whose centre of mass is outside the container.
    pub fn escaped(&self, world: &World) -> usize {
        let Some((low, high)) = self.container else { return 0 };
        let dynamic = world.bodies.iter().filter(|b| b.kind == BodyKind::Dynamic);
        dynamic.map(|b| b.center_of_mass()).filter(|c| !(c.cmpge(low).all() && c.cmple(high).all())).count()
    }
}

/// Reads a scene file, or says that there is neither a scene nor a file of that name.
fn load_or_suggest(name_or_path: &str, parameters: &[String]) -> Result<Scene> {
    let path = Path::new(name_or_path);
    if !path.is_file() && path.extension().is_none_or(|e| e != "json") {
        let hint = hint(name_or_path, CATALOGUE.iter().map(|e| e.name), "`drystone scenes` lists the scenes");
        return Err(Error::input(format!("{name_or_path:?} is neither a scene nor a scene file{hint}")));
    }
    match parameters.first() {
        Some(p) => Err(Error::input(format!("{name_or_path}: a scene file takes no parameter, such as {p:?}"))),
        None => load(path),
    }
}

#[cfg(not(feature = "serde"))]
fn load(path: &Path) -> Result<Scene> {
    Err(Error::input(format!(
        "{}: a scene file: drystone was built without the feature serde, which reads it",
        path.display()
    )))
}

//! A scene: a world, the length of a step, and the expected outcome.

use glam::Vec3;

use super::driver::Driver;
use super::spawner::{Leaves, Spawner};
use drystone::stages::error::ensure;
use drystone::{BodyHandle, Result, World};

/// A world, with the data that a run needs.
///
/// ```
/// use drystone::{Body, Shape, World, glam::Vec3};
/// use drystone_scenes::Scene;
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
/// let mut scene = Scene::new("a ball", world, 60).standing();
/// scene.container = Some((Vec3::splat(-1.0), Vec3::splat(1.0)));
/// assert!(scene.stands && scene.escaped(&scene.world) == 0);
/// let mut after = scene.world.clone();
/// after.bodies[ball].position.x = 3.0;
/// assert_eq!(scene.escaped(&after), 1);
/// ```
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name of the catalogue entry, or of the file.
    pub name: String,
    /// The bodies.
    pub world: World,
    /// Length of a step (s).
    pub dt: f32,
    /// Default number of steps of a run.
    pub steps: u32,
    /// Lower and upper corner of the space that no dynamic body should leave (m), or `None`.
    pub container: Option<(Vec3, Vec3)>,
    /// Whether every dynamic body should still be in place at the end.
    pub stands: bool,
    /// Groups of bodies that stand or fall together; empty if the scene has none.
    pub groups: Vec<Group>,
    /// Spawners, which add bodies while the scene runs; [`Spawners`](super::Spawners) runs them.
    pub spawners: Vec<Spawner>,
    /// Bodies of the world that leave while the scene runs.
    pub leaving: Vec<(BodyHandle, Leaves)>,
    /// Drives a body of the scene by input, or `None`. A scene file does not keep it.
    pub driver: Option<Driver>,
}

/// Bodies that stand or fall together.
///
/// ```
/// use drystone_scenes::{Group, Scene};
///
/// let towers = Scene::find("tallest", &["n=4".into(), "step=2".into()])?;
/// let Group { name, bodies } = &towers.groups[1];
/// assert_eq!((name.as_str(), bodies.len()), ("4 cubes", 4));
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Name for reports.
    pub name: String,
    /// Its bodies.
    pub bodies: Vec<BodyHandle>,
}

impl Scene {
    /// A scene with 60 steps a second, without a container. Its bodies need not stand.
    pub fn new(name: impl Into<String>, world: World, steps: u32) -> Self {
        Self {
            name: name.into(),
            world,
            dt: 1.0 / 60.0,
            steps,
            container: None,
            stands: false,
            groups: Vec::new(),
            spawners: Vec::new(),
            leaving: Vec::new(),
            driver: None,
        }
    }

    /// Marks the scene as one in which every dynamic body should still be in place at the end.
    pub fn standing(mut self) -> Self {
        self.stands = true;
        self
    }

    /// The world, for a [`Batch`](drystone::batch::Batch), whose worlds keep their bodies.
    ///
    /// ```
    /// use drystone_scenes::Scene;
    ///
    /// assert_eq!(Scene::find("tower", &[])?.constant_world()?.dynamic_count(), 10);
    /// assert!(Scene::find("galton", &[])?.constant_world().is_err(), "its balls come by themselves");
    /// # Ok::<(), drystone::Error>(())
    /// ```
    ///
    /// # Errors
    /// The scene has spawners or leaving bodies.
    pub fn constant_world(&self) -> Result<&World> {
        let comes_and_goes = !self.spawners.is_empty() || !self.leaving.is_empty();
        ensure(!comes_and_goes, || {
            format!("{}: the scene has spawners or leaving bodies, which a batch does not support", self.name)
        })?;
        Ok(&self.world)
    }

    /// Number of dynamic bodies whose center of mass is outside the container.
    pub fn escaped(&self, world: &World) -> usize {
        let Some((low, high)) = self.container else { return 0 };
        world.dynamic().map(|b| b.center_of_mass()).filter(|c| !(c.cmpge(low).all() && c.cmple(high).all())).count()
    }
}

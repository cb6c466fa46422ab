//! Bodies that a scene adds and removes while it runs.

use drystone::Body;

/// Adds equal bodies at a regular interval, at the same place with the same velocity. A spawner waits while its place
/// overlaps a body that the new one would push, unless that body is fixed.
///
/// ```
/// use drystone::{Body, Shape, World};
/// use drystone_scenes::{Leaves, Scene, Spawner};
///
/// let ball = Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 5.0, 0.0);
/// let leaves = Leaves { below: Some(0.0), after: None };
/// let mut scene = Scene::new("rain", World::new(), 600);
/// scene.spawners.push(Spawner { leaves, count: Some(20), ..Spawner::new(ball, 10) });
/// assert_eq!((scene.spawners[0].first, scene.spawners[0].every), (0, 10));
/// ```
#[derive(Clone, Debug)]
pub struct Spawner {
    /// The body at its start.
    pub body: Body,
    /// When each of these bodies leaves.
    pub leaves: Leaves,
    /// Steps before the first body.
    pub first: u32,
    /// Smallest number of steps from one body to the next; 0 counts as 1.
    pub every: u32,
    /// Total number of bodies, or `None` for no limit.
    pub count: Option<u32>,
    /// Index of the world that they enter, if several stand beside each other. If there is no such world, no bodies are
    /// added.
    pub world: usize,
}

impl Spawner {
    /// A spawner that adds a body before the first step, and one every `every` steps.
    pub fn new(body: Body, every: u32) -> Self {
        Self { body, leaves: Leaves::default(), first: 0, every, count: None, world: 0 }
    }
}

/// When a body leaves its world; never by default.
///
/// ```
/// use drystone_scenes::Leaves;
///
/// assert_eq!(Leaves::default(), Leaves { below: None, after: None });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leaves {
    /// It leaves as soon as its center of mass is below this height (m).
    pub below: Option<f32>,
    /// It leaves after this time (s).
    pub after: Option<f32>,
}

//! Bodies that come and go while a scene runs.

use crate::world::Body;

/// Brings bodies that are alike: one every so many steps, at the same place with the same velocity. It waits while that place holds a body
/// that is not fixed and that the new one would push.
///
/// ```
/// use drystone::{Body, Scene, Shape, World, scenes::{Leaves, Spawner}};
///
/// let ball = Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 5.0, 0.0);
/// let leaves = Leaves { below: Some(0.0), after: None };
/// let mut scene = Scene::new("rain", World::new(), 600);
/// scene.spawners.push(Spawner { leaves, count: Some(20), ..Spawner::new(ball, 10) });
/// assert_eq!((scene.spawners[0].first, scene.spawners[0].every), (0, 10));
/// ```
#[derive(Clone, Debug)]
pub struct Spawner {
    /// The body as it comes.
    pub body: Body,
    /// When each of them leaves.
    pub leaves: Leaves,
    /// Steps before the first comes.
    pub first: u32,
    /// Steps from one to the next, at least; 0 is taken as 1.
    pub every: u32,
    /// How many come in all; none for no end.
    pub count: Option<u32>,
    /// Which of the worlds beside each other they come into; none come where there is no such world.
    pub world: usize,
}

impl Spawner {
    /// A spawner that brings a body before the first step, and one after every `every` steps.
    pub fn new(body: Body, every: u32) -> Self {
        Self { body, leaves: Leaves::default(), first: 0, every, count: None, world: 0 }
    }
}

/// When a body leaves its world; never by default.
///
/// ```
/// use drystone::scenes::Leaves;
///
/// assert_eq!(Leaves::default(), Leaves { below: None, after: None });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leaves {
    /// As soon as its center of mass is below this height (m).
    pub below: Option<f32>,
    /// After this time (s).
    pub after: Option<f32>,
}

//! The bodies of a scene come and go while it runs.

use super::scene::Scene;
use super::spawner::{Leaves, Spawner};
use crate::world::{Body, BodyHandle, World};

/// Lets the bodies of a scene come and go. The calls alone decide which index a body has.
///
/// ```
/// use drystone::scenes::{Leaves, Spawner, Spawners};
/// use drystone::{Body, Reference, Scene, Shape, Simulation, SolverConfig, World};
///
/// let mut scene = Scene::new("rain", World::new(), 60);
/// let drop = Body::dynamic().shape(Shape::ball(0.1)).position(0.0, 1.0, 0.0);
/// scene.spawners.push(Spawner { leaves: Leaves { below: Some(0.0), after: None }, ..Spawner::new(drop, 10) });
/// let mut spawners = Spawners::new(&scene);
/// let mut simulation = Simulation::new(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// for _ in 0..60 {
///     spawners.before_step(&mut simulation.world, scene.dt);
///     simulation.step(scene.dt)?;
/// }
/// // A drop falls by a meter in 27 steps.
/// assert_eq!((spawners.came(), spawners.left()), (6, 4));
/// assert_eq!(simulation.world.bodies.count(), 2);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Spawners {
    spawners: Vec<Spawner>,
    /// Bodies that came by each.
    brought: Vec<u32>,
    /// Bodies that may leave.
    staying: Vec<Staying>,
    steps: u32,
    left: u32,
}

/// A body that may leave.
#[derive(Clone, Copy, Debug)]
struct Staying {
    body: BodyHandle,
    leaves: Leaves,
    /// Steps before it came.
    came: u32,
}

impl Staying {
    /// How long it has been there (s).
    fn age(&self, steps: u32, dt: f32) -> f64 {
        f64::from(steps - self.came) * f64::from(dt)
    }

    /// Whether it leaves, being where it is.
    fn is_due(&self, body: &Body, steps: u32, dt: f32) -> bool {
        // A time is a whole number of steps only within rounding.
        let is_late = |after: f32| self.age(steps, dt) >= f64::from(after) * (1.0 - 1e-6);
        self.leaves.below.is_some_and(|below| body.center_of_mass().y < below) || self.leaves.after.is_some_and(is_late)
    }
}

impl Spawners {
    /// Those of a scene that has not run yet.
    pub fn new(scene: &Scene) -> Self {
        let staying = |&(body, leaves): &(usize, Leaves)| {
            Some(Staying { body: scene.world.bodies.handle(body)?, leaves, came: 0 })
        };
        Self {
            spawners: scene.spawners.clone(),
            brought: vec![0; scene.spawners.len()],
            staying: scene.leaving.iter().filter_map(staying).collect(),
            ..Self::default()
        }
    }

    /// Takes out the bodies that leave before a step of `dt` seconds, then brings those that come. A scene without either costs nothing.
    pub fn before_step(&mut self, world: &mut World, dt: f32) {
        let (steps, left) = (self.steps, &mut self.left);
        self.staying.retain(|staying| match world.body(staying.body) {
            Some(body) if staying.is_due(body, steps, dt) => {
                world.remove(staying.body);
                *left += 1;
                false
            }
            body => body.is_some(),
        });
        for (spawner, brought) in self.spawners.iter().zip(&mut self.brought) {
            if steps_to_next(spawner, *brought, steps) == Some(0) {
                *brought += 1;
                let body = world.insert_in(spawner.world, spawner.body.clone());
                if spawner.leaves != Leaves::default() {
                    self.staying.push(Staying { body, leaves: spawner.leaves, came: steps });
                }
            }
        }
        self.steps += 1;
    }

    /// Bodies that came so far.
    pub fn came(&self) -> u32 {
        self.brought.iter().sum()
    }

    /// Bodies that left so far.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// What a scene needs to go on from here: the spawners, and the bodies that leave.
    ///
    /// ```
    /// # use drystone::{Body, Scene, World, scenes::{Spawner, Spawners}};
    /// let mut scene = Scene::new("rain", World::new(), 60);
    /// scene.spawners.push(Spawner { count: Some(3), ..Spawner::new(Body::fixed(), 10) });
    /// let mut spawners = Spawners::new(&scene);
    /// (0..15).for_each(|_| spawners.before_step(&mut scene.world, scene.dt));
    /// let (left, _) = spawners.remaining(scene.dt);
    /// assert_eq!((left[0].first, left[0].count), (5, Some(1)));
    /// ```
    pub fn remaining(&self, dt: f32) -> (Vec<Spawner>, Vec<(usize, Leaves)>) {
        let spawner = |(spawner, brought): (&Spawner, &u32)| {
            let first = steps_to_next(spawner, *brought, self.steps)?;
            Some(Spawner { first, count: spawner.count.map(|count| count - brought), ..spawner.clone() })
        };
        let leaving = |staying: &Staying| {
            let after =
                staying.leaves.after.map(|after| (f64::from(after) - staying.age(self.steps, dt)).max(0.0) as f32);
            (staying.body.index(), Leaves { after, ..staying.leaves })
        };
        let spawners = self.spawners.iter().zip(&self.brought).filter_map(spawner).collect();
        (spawners, self.staying.iter().map(leaving).collect())
    }
}

/// Steps until the next body of a spawner comes; none if all came.
fn steps_to_next(spawner: &Spawner, brought: u32, steps: u32) -> Option<u32> {
    let is_done = spawner.count.is_some_and(|count| brought >= count);
    let next = u64::from(spawner.first) + u64::from(brought) * u64::from(spawner.every.max(1));
    if is_done { None } else { u32::try_from(next - u64::from(steps)).ok() }
}

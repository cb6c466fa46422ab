//! Adds and removes the bodies of a scene while it runs.

use super::scene::Scene;
use super::spawner::{Leaves, Spawner};
use drystone::queries::{Filter, Queries};
use drystone::stages::world::{placed, pose};
use drystone::{Body, BodyHandle, BodyKind, World};

/// Adds and removes the bodies of a scene. The index of a body depends only on the calls.
///
/// ```
/// use drystone_scenes::{Leaves, Spawner, Spawners};
/// use drystone::{Body, Shape, Simulation, World};
/// use drystone_scenes::Scene;
///
/// let mut scene = Scene::new("rain", World::new(), 60);
/// let drop = Body::dynamic().shape(Shape::ball(0.05)).position(0.0, 1.0, 0.0);
/// scene.spawners.push(Spawner { leaves: Leaves { below: Some(0.0), after: None }, ..Spawner::new(drop, 10) });
/// let mut spawners = Spawners::new(&scene);
/// let mut simulation = Simulation::new(scene.world)?;
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
    /// Number of bodies that each spawner added.
    brought: Vec<u32>,
    /// Step number before which the next body of each spawner is due.
    due: Vec<u32>,
    /// Bodies that can leave.
    staying: Vec<Staying>,
    steps: u32,
    left: u32,
}

/// A body that can leave.
#[derive(Clone, Copy, Debug)]
struct Staying {
    body: BodyHandle,
    leaves: Leaves,
    /// Number of steps before it was added.
    came: u32,
}

impl Staying {
    /// Age of the body (s).
    fn age(&self, steps: u32, dt: f32) -> f64 {
        f64::from(steps - self.came) * f64::from(dt)
    }

    /// Whether the body leaves at its present place.
    fn is_due(&self, body: &Body, steps: u32, dt: f32) -> bool {
        // A time is a whole number of steps only within rounding.
        let is_late = |after: f32| self.age(steps, dt) >= f64::from(after) * (1.0 - 1e-6);
        self.leaves.below.is_some_and(|below| body.center_of_mass().y < below) || self.leaves.after.is_some_and(is_late)
    }
}

impl Spawners {
    /// The spawners of a scene before its first step.
    pub fn new(scene: &Scene) -> Self {
        let staying = |&(body, leaves): &(BodyHandle, Leaves)| Staying { body, leaves, came: 0 };
        Self {
            spawners: scene.spawners.clone(),
            brought: vec![0; scene.spawners.len()],
            due: scene.spawners.iter().map(|spawner| spawner.first).collect(),
            staying: scene.leaving.iter().map(staying).collect(),
            ..Self::default()
        }
    }

    /// Removes the bodies that leave before a step of `dt` seconds, then adds new bodies, spawner by spawner. If the
    /// place of a new body is occupied, it enters before the first step with a free place, and the interval to the next
    /// body counts from then. A scene without spawners and leaving bodies costs nothing. Each due body costs time in
    /// proportion to the number of bodies.
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
        for ((spawner, brought), due) in self.spawners.iter().zip(&mut self.brought).zip(&mut self.due) {
            if *due <= steps && !is_done(spawner, *brought) && is_free(spawner, world) {
                let Ok(body) = world.insert_in(spawner.world, spawner.body.clone()) else { continue };
                *brought += 1;
                *due = steps.saturating_add(spawner.every.max(1));
                if spawner.leaves != Leaves::default() {
                    self.staying.push(Staying { body, leaves: spawner.leaves, came: steps });
                }
            }
        }
        self.steps += 1;
    }

    /// Number of bodies that were added so far.
    pub fn came(&self) -> u32 {
        self.brought.iter().sum()
    }

    /// Number of bodies that left so far.
    pub fn left(&self) -> u32 {
        self.left
    }

    /// The spawners and the leaving bodies that a scene needs to continue from here.
    ///
    /// ```
    /// # use drystone::{Body, World};
    /// # use drystone_scenes::{Scene, Spawner, Spawners};
    /// let mut scene = Scene::new("rain", World::new(), 60);
    /// scene.spawners.push(Spawner { count: Some(3), ..Spawner::new(Body::fixed(), 10) });
    /// let mut spawners = Spawners::new(&scene);
    /// (0..15).for_each(|_| spawners.before_step(&mut scene.world, scene.dt));
    /// let (left, _) = spawners.remaining(scene.dt);
    /// assert_eq!((left[0].first, left[0].count), (5, Some(1)));
    /// ```
    pub fn remaining(&self, dt: f32) -> (Vec<Spawner>, Vec<(BodyHandle, Leaves)>) {
        let spawner = |((spawner, &brought), due): ((&Spawner, &u32), &u32)| {
            let (first, count) = (due.saturating_sub(self.steps), spawner.count.map(|count| count - brought));
            (!is_done(spawner, brought)).then(|| Spawner { first, count, ..spawner.clone() })
        };
        let leaving = |staying: &Staying| {
            let after =
                staying.leaves.after.map(|after| (f64::from(after) - staying.age(self.steps, dt)).max(0.0) as f32);
            (staying.body, Leaves { after, ..staying.leaves })
        };
        let spawners = self.spawners.iter().zip(&self.brought).zip(&self.due).filter_map(spawner).collect();
        (spawners, self.staying.iter().map(leaving).collect())
    }
}

/// Whether a spawner has added all its bodies.
fn is_done(spawner: &Spawner, brought: u32) -> bool {
    spawner.count.is_some_and(|count| brought >= count)
}

/// Whether the next body of a spawner overlaps no body that it would push, except fixed ones.
fn is_free(spawner: &Spawner, world: &World) -> bool {
    let Spawner { body, world: part, .. } = spawner;
    let may_leave = |_, other: &Body| match other.kind {
        BodyKind::Fixed => false,
        BodyKind::Kinematic => body.kind == BodyKind::Dynamic,
        _ => true,
    };
    let filter = Filter::default().groups(body.groups).world(*part).only(&may_leave);
    let queries = Queries::of(world);
    body.colliders.iter().filter(|collider| !collider.sensor).all(|collider| {
        let own = placed(pose(body.position, body.rotation), pose(collider.position, collider.rotation));
        queries.intersecting(&collider.shape, own.translation, own.rotation, &filter).is_empty()
    })
}

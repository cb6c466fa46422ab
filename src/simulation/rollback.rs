//! The last states of a simulation, to go back to.

use std::collections::VecDeque;

use super::{Simulation, Snapshot};
use crate::error::{Result, input};

/// The last states of a simulation, at most so many: a game goes back to the step that another player's input belongs to, and steps again.
///
/// Memory is taken in the first lap only, as long as no more bodies and contacts come.
///
/// ```
/// use drystone::{Body, Reference, Rollback, Shape, Simulation, SolverConfig, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let ball = world.add(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
/// let mut simulation = Simulation::new(world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
/// let mut rollback = Rollback::new(8);
/// for _ in 0..20 {
///     rollback.push(&simulation);
///     simulation.step(1.0 / 60.0)?;
/// }
/// // The ball was pushed three steps ago, as it turns out.
/// rollback.back(3, &mut simulation)?;
/// simulation.world.bodies[ball].linear_velocity.x = 1.0;
/// for _ in 0..3 {
///     rollback.push(&simulation);
///     simulation.step(1.0 / 60.0)?;
/// }
/// assert!(simulation.world.bodies[ball].position.x > 0.04 && rollback.len() == 8);
/// # Ok::<(), drystone::Error>(())
/// ```
pub struct Rollback {
    capacity: usize,
    /// The last one is the latest.
    states: VecDeque<Snapshot>,
    /// Memory of states that are forgotten.
    spare: Vec<Snapshot>,
}

impl Rollback {
    /// Room for so many states, at least one.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Self { capacity, states: VecDeque::with_capacity(capacity), spare: Vec::with_capacity(capacity) }
    }

    /// Most states that it keeps.
    ///
    /// ```
    /// let rollback = drystone::Rollback::new(8);
    /// assert!(rollback.capacity() == 8 && rollback.is_empty());
    /// ```
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Number of states, and so of steps to go back at most.
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether it has no state.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Keeps the state of now, before a step. Where there is no more room, the oldest state goes.
    pub fn push(&mut self, simulation: &Simulation) {
        let is_full = self.states.len() == self.capacity;
        let memory = if is_full { self.states.pop_front() } else { self.spare.pop() };
        let state = match memory {
            Some(mut state) => {
                simulation.snapshot_into(&mut state);
                state
            }
            None => simulation.snapshot(),
        };
        self.states.push_back(state);
    }

    /// Goes back to the state that was pushed `steps` pushes ago, and forgets it and those that were pushed since: whoever steps again pushes
    /// again. 0 steps change nothing.
    ///
    /// # Errors
    /// There are not so many states; nothing is changed then.
    pub fn back(&mut self, steps: usize, simulation: &mut Simulation) -> Result<()> {
        let all = self.states.len();
        let kept = all.checked_sub(steps).ok_or_else(|| input!("{steps} steps back: {all} states are there"))?;
        if let Some(state) = self.states.get(kept) {
            simulation.restore(state);
        }
        self.spare.extend(self.states.drain(kept..));
        Ok(())
    }
}

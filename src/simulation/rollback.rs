//! The last states of a simulation, for rollback.

use std::collections::VecDeque;

use super::{Simulation, Snapshot};
use crate::error::{Result, input};

/// Keeps the last states of a simulation, up to a fixed number. A networked game restores the state to which late input
/// of another player belongs, and steps again.
///
/// After every place was used once, it allocates memory only if the number of bodies or contacts grows.
///
/// ```
/// use drystone::{Body, Reference, Rollback, Shape, Simulation, SolverConfig, World, glam::Vec3};
///
/// let mut world = World::new();
/// world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)));
/// let ball = world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
/// let mut simulation = Simulation::new(world)?;
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
    /// The last entry is the latest state.
    states: VecDeque<Snapshot>,
    /// Memory of discarded states, for reuse.
    spare: Vec<Snapshot>,
}

impl Rollback {
    /// Room for `capacity` states, at least one.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Self { capacity, states: VecDeque::with_capacity(capacity), spare: Vec::with_capacity(capacity) }
    }

    /// The largest number of states.
    ///
    /// ```
    /// let rollback = drystone::Rollback::new(8);
    /// assert!(rollback.capacity() == 8 && rollback.is_empty());
    /// ```
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Number of states. It is also the largest number of steps to go back.
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether no state is kept.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Keeps the present state. Call it before a step. If there is no more room, the oldest state is discarded.
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

    /// Restores the state from `steps` pushes ago, and discards it together with all later states: push again for each
    /// repeated step. 0 steps change nothing.
    ///
    /// # Errors
    /// There are fewer states than `steps`. Nothing is changed then.
    pub fn back(&mut self, steps: usize, simulation: &mut Simulation) -> Result<()> {
        let all = self.states.len();
        let kept =
            all.checked_sub(steps).ok_or_else(|| input!("cannot go back {steps} steps: only {all} states are kept"))?;
        if let Some(state) = self.states.get(kept) {
            simulation.restore(state);
        }
        self.spare.extend(self.states.drain(kept..));
        Ok(())
    }
}

//! Other engines on drystone's scenes: each takes the same [`World`](drystone::World), steps it by itself and gives poses and
//! velocities back, so that drystone's own [`race`](drystone::report::front::race) times and scores all of them.
//!
//! What is the same for all: shapes, masses and inertias, friction (geometric mean) and restitution (larger), joints,
//! gravity, forces, the length of a step. Nothing sleeps and nothing is damped. Everything else (speculative margins, reuse of
//! contacts, friction model, restitution threshold) is what an engine does unless told otherwise.

mod box3d;
mod entrant;
mod rapier;

pub use entrant::{Engine, Entrant};

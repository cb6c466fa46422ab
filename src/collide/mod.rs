//! Collision detection: parry's tree over boxes, then persistent manifolds. The only module that asks parry for contacts.
//!
//! The tree holds fattened boxes, and only a collider that left its fattened box changes the tree. Pairs live in slots, in the
//! order in which they were found, so that every later stage is deterministic for any number of threads. Each of several worlds
//! beside each other has its own tree and pairs, so that the pairs of a world do not depend on the other worlds.

mod collider;
mod cuboids;
mod detector;
#[cfg(test)]
mod distances;
mod facet;
mod lane_pose;
mod manifold;
mod narrow;
mod pair;
mod pairs;
mod query;
mod report;
mod reuse;
mod solid;
mod world_contacts;

pub use detector::Detector;
pub use manifold::{MAX_POINTS, Manifold, ManifoldPoint, NO_SLOT};
pub use pair::Pair;
pub use pairs::Placed;
pub(crate) use report::Change;
pub use report::{Activity, DetectStats};

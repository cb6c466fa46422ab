//! Collision detection: a tree over boxes, then persistent manifolds. No other module asks parry for contacts.
//!
//! The tree holds fattened boxes. A collider gets a new box only when it leaves its fattened box. Two colliders are a
//! pair while their fattened boxes overlap. New pairs of a step are sorted by their colliders, so every later stage is
//! deterministic for any number of threads. Several worlds beside each other have separate trees and pairs, so the
//! pairs of a world do not depend on other worlds.

mod ascent;
mod clearance;
mod collider;
mod cone;
mod cuboids;
mod detector;
#[cfg(test)]
mod distances;
mod facet;
mod flush;
mod guard;
mod lane_pose;
mod manifold;
mod narrow;
mod pair;
mod pairs;
mod path;
mod places;
mod query;
mod report;
mod reuse;
mod rim;
mod sensors;
mod solid;
mod sweep;
mod teleport;
#[cfg(test)]
mod testing;
mod tree;
mod world_contacts;

pub(crate) use clearance::{Clearance, clearances};
pub use collider::Activity;
pub use detector::Detector;
pub(crate) use detector::{ColliderSide, PairFilter};
pub use manifold::{MAX_POINTS, Manifold, ManifoldPoint, NO_SLOT};
pub use pair::Pair;
pub use pairs::Placed;
pub(crate) use places::{Place, Places};
pub(crate) use report::Change;
pub use report::DetectStats;

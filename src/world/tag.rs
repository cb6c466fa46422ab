//! Which world a handle is of.

use std::cmp::Ordering;
use std::hash::{Hash, Hasher};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// The number of a [`World::new`](super::World::new) in this process; 0 for any world. All tags are equal, so that no order, no hash and no
/// bit of a step follows from one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorldTag(u32);

impl WorldTag {
    /// A tag that no other world has; that of any world after 4 billion of them.
    pub fn next() -> Self {
        static LAST: AtomicU32 = AtomicU32::new(0);
        Self(LAST.fetch_update(Relaxed, Relaxed, |last| last.checked_add(1)).map_or(0, |last| last + 1))
    }

    /// Whether a handle with one tag may be of a world with the other.
    pub fn fits(self, other: Self) -> bool {
        self.0 == 0 || other.0 == 0 || self.0 == other.0
    }
}

impl PartialEq for WorldTag {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Eq for WorldTag {}

impl Hash for WorldTag {
    fn hash<H: Hasher>(&self, _: &mut H) {}
}

impl PartialOrd for WorldTag {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for WorldTag {
    fn cmp(&self, _: &Self) -> Ordering {
        Ordering::Equal
    }
}

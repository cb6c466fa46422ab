//! The tag that tells the handles of unrelated worlds apart.

use std::cmp::Ordering;
use std::hash::{Hash, Hasher};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// The number of a [`World::new`](super::World::new) in this process; 0 matches any world. All tags compare equal, so
/// no order, hash or bit of a step depends on a tag.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorldTag(u32);

impl WorldTag {
    /// A new tag. After 4 billion worlds it is the tag that matches any world.
    pub fn next() -> Self {
        static LAST: AtomicU32 = AtomicU32::new(0);
        Self(LAST.fetch_update(Relaxed, Relaxed, |last| last.checked_add(1)).map_or(0, |last| last + 1))
    }

    /// Whether handles with the two tags can belong to the same world.
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

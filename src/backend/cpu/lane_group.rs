//! Sixteen constraints side by side.

use std::ops::Range;

use crate::lanes::{WIDTH, Wide};

/// Sixteen constraints of one color with the same number of impulses.
#[derive(Clone, Copy, Default)]
pub(super) struct LaneGroup {
    pub a: BodyLanes,
    pub b: BodyLanes,
    /// Rows of the problem, one for each lane; `NO_ROW` for an empty lane.
    pub rows: [u32; WIDTH],
    pub header: [Wide; 11],
    /// The index of its first impulse, and of its first point.
    pub first: u32,
    /// Number of impulses, including the patch if there are patches.
    pub count: u32,
}

/// The row of an empty lane.
pub(super) const NO_ROW: u32 = u32::MAX;

/// Sixteen bodies.
#[derive(Clone, Copy, Default)]
pub(super) struct BodyLanes {
    /// The places of their states.
    pub places: [u32; WIDTH],
    /// The movable ones, one bit for each lane.
    pub movable: u16,
    /// Whether any of them has locked axes.
    pub has_locks: bool,
}

impl LaneGroup {
    /// The indices of its impulses.
    #[inline(always)]
    pub fn impulses(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Whether every lane has a constraint. Lanes are filled from the first.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.rows[WIDTH - 1] != NO_ROW
    }
}

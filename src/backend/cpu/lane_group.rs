//! Sixteen constraints side by side.

use std::ops::Range;

use crate::lanes::{WIDTH, Wide};

/// Sixteen constraints of one color with as many impulses each.
#[derive(Clone, Copy, Default)]
pub(super) struct LaneGroup {
    pub a: BodyLanes,
    pub b: BodyLanes,
    /// Rows of the problem, one a lane; `NO_ROW` for a lane without a constraint.
    pub rows: [u32; WIDTH],
    pub header: [Wide; 11],
    /// The first of its impulses, and of its points.
    pub first: u32,
    /// Impulses; one of them is the patch, if there are patches.
    pub count: u32,
}

/// The row of a lane without a constraint.
pub(super) const NO_ROW: u32 = u32::MAX;

/// Sixteen bodies.
#[derive(Clone, Copy, Default)]
pub(super) struct BodyLanes {
    /// Where their states are.
    pub places: [u32; WIDTH],
    /// Which of them can move, a bit a lane.
    pub movable: u16,
}

impl LaneGroup {
    /// Where its impulses are.
    #[inline(always)]
    pub fn impulses(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Whether every lane has a constraint; lanes are filled from the first.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.rows[WIDTH - 1] != NO_ROW
    }
}

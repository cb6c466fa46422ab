//! The report of a detection about pairs.

use super::pair::Pair;

/// One thing that a detection changed.
pub(crate) enum Change<'a> {
    /// A pair with a manifold in this slot came apart.
    Ended(u32),
    /// A pair is new or in another place, takes part or no longer takes part, or its manifolds were computed.
    Pair {
        /// Its world, and its place there.
        place: [u32; 2],
        pair: &'a mut Pair,
        /// Whether its manifolds were computed.
        computed: bool,
    },
}

/// Counts of one detection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DetectStats {
    /// Pairs whose boxes overlap.
    pub pairs: usize,
    /// Pairs whose manifolds were computed; the others were reused.
    pub computed: usize,
    /// Whether what touches, or with how many points, is other than before.
    pub reshaped: bool,
}

impl DetectStats {
    /// Both together.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            pairs: self.pairs + other.pairs,
            computed: self.computed + other.computed,
            reshaped: self.reshaped | other.reshaped,
        }
    }
}

//! The changes and counts that a detection reports.

use super::pair::Pair;

/// One change of a detection.
pub(crate) enum Change<'a> {
    /// The pair with a manifold in this slot came apart.
    Ended(u32),
    /// A pair is new or moved, starts or stops taking part, or its manifolds were computed.
    Pair {
        /// Its world, and its index there.
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
    /// Number of pairs whose boxes overlap.
    pub pairs: usize,
    /// Number of pairs whose manifolds were computed; the others were reused.
    pub computed: usize,
    /// Whether the touching subshapes or the number of points changed.
    pub reshaped: bool,
}

impl DetectStats {
    /// The sum of both.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            pairs: self.pairs + other.pairs,
            computed: self.computed + other.computed,
            reshaped: self.reshaped | other.reshaped,
        }
    }
}

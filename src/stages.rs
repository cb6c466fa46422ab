//! The stages of a step, and code that the command shares with the library.
//!
//! Tests, measurements and backends need these parts. A program that steps a [`Simulation`](crate::Simulation) does not
//! need them. They change from version to version.

/// Contacts: tree over boxes, then persistent manifolds.
pub mod collide {
    pub use crate::collide::*;
}

/// The substeps of each island.
pub mod effort {
    pub use crate::effort::*;
}

/// Colors: no body occurs twice in one color.
pub mod graph {
    pub use crate::graph::*;
}

/// A step as a value: plain rows.
pub mod problem {
    pub use crate::problem::*;
}

/// The order of work as data: a list of passes.
pub mod plan {
    pub use crate::plan::*;
}

/// The effect of a pass on its rows. Every function of a shader has a twin of the same name here.
pub mod kernels {
    pub use crate::kernels::*;
}

/// The arithmetic of kernels, for one number or many.
pub mod math {
    pub use crate::math::*;
}

/// The invariants that backends rely on.
pub mod backend {
    pub use crate::backend::calibrate::crossover;
    pub use crate::backend::checked::CheckedStep;
    pub use crate::lanes::{InstructionSet, Lanes, WIDTH, Work};

    /// The compute shaders: texts, buffers, layouts.
    #[cfg(feature = "gpu")]
    pub mod shader {
        pub use crate::backend::gpu::bindings::Binding;
        pub use crate::backend::gpu::reflect::Reflected;
        pub use crate::backend::gpu::resident::{ResidentParams, WrittenContact};
        pub use crate::backend::gpu::rows::{JOINT_BLOCK, JOINT_NODE, SCRATCH_ROW};
        #[cfg(not(target_family = "wasm"))]
        pub use crate::backend::gpu::spirv_exact::exact_spirv;
        pub use crate::backend::gpu::wgsl::{ENTRY_POINT, Program, WORKGROUP};
        pub use crate::backend::gpu::wgsl_exact::exact_wgsl;
    }
}

/// The random number generator that scenes and tests share.
pub mod random {
    pub use crate::random::SplitMix64;
}

/// Compares two backends on the same scene.
pub mod compare {
    pub use crate::compare::*;
}

/// The parts of [`conform`](crate::conform) that tests share: random problems, all kernels, differences.
#[cfg(feature = "gpu")]
pub mod conform {
    /// Differences of worlds and rows.
    pub mod difference {
        pub use crate::conform::difference::*;
    }
    /// Every kernel, in one pass each.
    pub mod passes {
        pub use crate::conform::passes::*;
    }
    /// Random problems.
    pub mod random {
        pub use crate::conform::random::*;
    }
}

/// Checks whether a request fits into memory.
pub mod memory {
    pub use crate::memory::*;
}

/// Suggests the known name that is nearest to an unknown one.
pub mod suggest {
    pub use crate::suggest::*;
}

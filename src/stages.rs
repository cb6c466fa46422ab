//! The stages of a step one by one, and what the command shares with the library.
//!
//! Tests, measurements and backends need these parts; a program that steps a [`Simulation`](crate::Simulation) does not. They change
//! from version to version.

/// Contacts: tree over boxes, then persistent manifolds.
pub mod collide {
    pub use crate::collide::*;
}

/// The substeps of each island.
pub mod effort {
    pub use crate::effort::*;
}

/// Colors: no body twice in one.
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

/// What a pass does to its rows; every function of a shader has a double of the same name here.
pub mod kernels {
    pub use crate::kernels::*;
}

/// The arithmetic of kernels, over one number or many.
pub mod math {
    pub use crate::math::*;
}

/// What backends rely on.
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

/// The generator of random numbers that scenes and tests share.
pub mod random {
    pub use crate::random::SplitMix64;
}

/// Two backends on the same scene.
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
    /// Every kernel by one pass each.
    pub mod passes {
        pub use crate::conform::passes::*;
    }
    /// Random problems.
    pub mod random {
        pub use crate::conform::random::*;
    }
}

/// Whether what is asked for fits into memory.
pub mod memory {
    pub use crate::memory::*;
}

/// The known name that is nearest to one that is not known.
pub mod suggest {
    pub use crate::suggest::*;
}

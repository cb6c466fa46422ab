//! The stages of a step, and code that the other packages share with the engine.
//!
//! Tests, measurements and backends need these parts. A program that steps a [`Simulation`](crate::Simulation) does not
//! need them. They change from version to version.

/// Contacts: tree over boxes, then persistent manifolds.
pub mod collide {
    pub use crate::collide::Detector;
}

/// The substeps of each island.
pub mod effort {
    pub use crate::effort::Effort;
}

/// Colors: no body occurs twice in one color.
pub mod graph {
    pub use crate::graph::{Coloring, ConstraintGraph, Edge, IMMOVABLE};
}

/// A step as a value: plain rows.
pub mod problem {
    pub use crate::math::effective_mass::tangent_mass;
    pub use crate::problem::carry::{Carry, Preload, Written};
    pub use crate::problem::effective::{EffectiveMass, InverseMass};
    pub use crate::problem::softness::softness;
    pub use crate::problem::{
        AxisRow, BodyRow, ContactRow, ContactRows, ContactSummary, ConvergenceRow, DampingRow, FreeRow, ImpulseRow,
        InertiaRow, JointImpulseRow, JointRow, JointRows, JointSystems, MassRow, MomentumRow, NO_LIMIT, NodeRow,
        Params, PassRow, PointRow, Softness, StepProblem, Substep, TorqueRow, TurningRow, begin, lay_out,
    };
}

/// The order of work as data: a list of passes.
pub mod plan {
    pub use crate::plan::{Kernel, Pass, StepPlan};
}

/// The effect of a pass on its rows. Every function of a shader has a twin of the same name here.
pub mod kernels {
    pub use crate::kernels::axis::{Frames, axis_motion};
    pub use crate::kernels::contact::{
        current_separation, normal_movement, restitute_contact, solve_contact, warm_start,
    };
    pub use crate::kernels::friction::{solve_friction, solve_twist};
    pub use crate::kernels::joint::joint_column;
    pub use crate::kernels::momentum::StepLength;
    pub use crate::kernels::pair::{relative_movement, relative_velocity};
    pub use crate::kernels::{
        Axis, Body, Contact, Impulse, Joint, KernelRows, Mass, Momentum, Pair, Point, Rules, SoftnessOf, StepParams,
        Sym3,
    };
}

/// The arithmetic of kernels, for one number or many.
pub mod math {
    pub use crate::math::rotation::{about, arc, product, unit};
    pub use crate::math::{Lane, Quat, Vec3, vec3};
}

/// The invariants that backends rely on.
pub mod backend {
    pub use crate::backend::calibrate::step_times;
    pub use crate::backend::checked::CheckedStep;
    #[cfg(feature = "gpu")]
    pub use crate::backend::gpu::blocking::block_on;
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
        pub use crate::backend::gpu::wgsl::{ENTRY_POINT, Program, Target};
        pub use crate::backend::gpu::wgsl_exact::exact_wgsl;
    }
}

/// The random number generator that scenes and tests share.
pub mod random {
    pub use crate::random::SplitMix64;
}

/// The caller's part in a run, and hashes: for recordings.
pub mod input {
    pub use crate::saved::hash_of;
    pub use crate::simulation::hashes;
    pub use crate::simulation::input::{InputReader, InputWriter, StepInput};
}

/// One-line refusals.
pub mod error {
    pub use crate::error::{ensure, input};
    pub use crate::panics::text_of;
}

/// Poses of shapes.
pub mod world {
    pub use crate::world::shape::{placed, pose};
}

/// Checks whether a request fits into memory.
pub mod memory {
    pub use crate::memory::*;
}

/// Suggests the known name that is nearest to an unknown one.
pub mod suggest {
    pub use crate::suggest::*;
}

//! The buffers of shaders, in one table. The WGSL declarations, the pipeline layouts and the binding numbers come from
//! it.

/// The use of a buffer by programs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Access {
    /// All threads read the same few numbers.
    Uniform,
    /// Each dispatch reads numbers at its own offset.
    UniformAtOffset,
    /// Programs only read the rows.
    Read,
    /// Kernels of plans read the rows, and the programs that begin a step on the device write them.
    ReadByPlans,
    /// Every program can write the rows.
    Write,
}

macro_rules! bindings {
    ($($(#[$doc:meta])* $binding:ident $name:literal: $wgsl:literal, $access:ident;)*) => {
        /// A buffer of shaders. Its binding number is its index in this list.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u32)]
        pub enum Binding {
            $($(#[$doc])* $binding),*
        }

        impl Binding {
            /// All bindings, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$binding),*];

            /// Name, WGSL type and access.
            fn declared(self) -> (&'static str, &'static str, Access) {
                match self {
                    $(Self::$binding => ($name, $wgsl, Access::$access)),*
                }
            }
        }
    };
}

bindings! {
    /// Numbers that are the same for all rows.
    Params "params": "Params", Uniform;
    /// The colors of a pass, and the substep of its block.
    PassRow "pass_row": "PassRow", UniformAtOffset;
    /// Velocities and movements of the bodies; read back.
    Bodies "bodies": "array<Body>", Write;
    /// Masses of the bodies.
    Masses "masses": "array<Mass>", Write;
    /// Angular accelerations of the bodies by torques.
    Torques "torques": "array<Torque>", Read;
    /// Effects of damping on the bodies.
    Dampings "dampings": "array<Damping>", Read;
    /// Principal inertia of the bodies with unequal moments.
    Inertias "inertias": "array<Inertia>", Read;
    /// Manifolds.
    Contacts "contacts": "array<Contact>", ReadByPlans;
    /// Points of the manifolds.
    Points "points": "array<Point>", ReadByPlans;
    /// Impulses of the points; read back.
    Impulses "impulses": "array<Impulse>", Write;
    /// Their sums over the substeps; read back if the problem has room for them.
    Totals "totals": "array<Impulse>", Write;
    /// The start of each color, and the rows of the colors.
    Colors "colors": "array<u32>", Read;
    /// Joints.
    Joints "joints": "array<Joint>", Read;
    /// Axes of joints.
    Axes "axes": "array<Axis>", Read;
    /// Impulses of the joints and of their axes; read back.
    JointImpulses "joint_impulses": "array<JointImpulse>", Write;
    /// Their sums over the substeps; read back if the problem has room for them.
    JointTotals "joint_totals": "array<JointImpulse>", Write;
    /// The lists of the joint systems.
    JointSystems "joint_systems": "array<u32>", Read;
    /// Inertia of their bodies at the start of the step.
    Turning "turning": "array<Turning>", Read;
    /// Whether the sweeps still move anything; read back.
    Convergence "convergence": "Convergence", Write;
    /// Extrapolation of accelerated sweeps; read back.
    Momentum "momentum": "Momentum", Write;
    /// Velocities without the impulses of the substep. This buffer and the next three stay on the device: every step
    /// writes them before it reads them.
    Free "free": "array<Free>", Write;
    /// Velocities before the last accelerated sweep.
    VelocitiesBefore "velocities_before": "array<Free>", Write;
    /// Impulses before the last accelerated sweep, and at its start.
    ImpulseSteps "impulse_steps": "array<ImpulseStep>", Write;
    /// Sums over the changes of impulses.
    Lengths "lengths": "array<vec2f>", Write;
    /// The joints of systems during factorization. This buffer and the next two also stay on the device.
    JointNodes "joint_nodes": "array<JointNode>", Write;
    /// The factors of systems.
    JointBlocks "joint_blocks": "array<JointBlock>", Write;
    /// The velocity errors of joints, then their corrections.
    JointChanges "joint_changes": "array<JointImpulse>", Write;
    /// Numbers for the programs that begin a step on the device.
    Resident "resident": "ResidentParams", Uniform;
    /// Contacts whose rows the host recomputed.
    Written "written": "array<Written>", Read;
    /// The manifolds of these contacts.
    WrittenContacts "written_contacts": "array<WrittenContact>", Read;
    /// The arms of their points.
    WrittenArms "written_arms": "array<f32>", Read;
    /// Separations of the points at the start of the step.
    Separations "separations": "array<f32>", Read;
    /// The passes of a plan in one dispatch.
    Passes "passes": "array<vec4u, PASS_ROWS>", Uniform;
}

impl Binding {
    /// Its name in shaders and messages.
    pub fn name(self) -> &'static str {
        self.declared().0
    }

    /// Whether each dispatch reads at its own offset.
    pub(super) fn has_offset(self) -> bool {
        self.declared().2 == Access::UniformAtOffset
    }
}

/// The declarations of all buffers, for a kernel of a plan or for a program that begins a step.
pub(super) fn declarations(of_plan: bool) -> String {
    let declaration = |&binding: &Binding| {
        let (name, wgsl, access) = binding.declared();
        let space = match access {
            Access::Uniform | Access::UniformAtOffset => "uniform",
            Access::Read => "storage, read",
            Access::ReadByPlans if of_plan => "storage, read",
            Access::ReadByPlans | Access::Write => "storage, read_write",
        };
        format!("@group(0) @binding({}) var<{space}> {name}: {wgsl};\n", binding as u32)
    };
    Binding::ALL.iter().map(declaration).collect()
}

// The rows of a StepProblem. src/problem/rows.rs has the layout, names and units, and tests/cpu/shaders.rs compares the
// layouts.

struct Body { v: vec3f, w: vec3f, dp: vec3f, time: f32, dq: vec4f }

struct Free { v: vec3f, w: vec3f }

struct Mass {
    inv_inertia_x: vec3f, inv_mass: f32,
    inv_inertia_yz: vec3f, locks: f32,
    acceleration: vec3f,
}

struct Torque { angular_acceleration: vec3f }

struct Damping { linear_gain: vec3f, linear_loss: f32, angular_gain: vec3f, angular_loss: f32 }

struct Inertia { principal: vec3f, body: u32, inv_principal: vec3f, frame: vec4f }

struct Contact {
    normal: vec3f, friction: f32,
    tangent: vec3f, restitution: f32,
    body_a: u32, body_b: u32, first_point: u32, point_count: u32,
    radius_a: f32, radius_b: f32, preload: f32, substep_share: f32,
}

struct Point {
    r_a: vec3f, separation: f32,
    r_b: vec3f, normal_mass: f32,
    tangent_mass: f32, pull: f32, slip_1: f32, slip_2: f32,
}

struct Joint { r_a: vec3f, body_a: u32, r_b: vec3f, body_b: u32, gap: vec3f, is_loose: f32, first_axis: u32, axis_count: u32, frame_a: vec4f, frame_b: vec4f }

struct Axis {
    direction: vec3f, coordinate: f32,
    gap: f32, left: f32, speed: f32, max_impulse: f32,
    rate: f32, mass_scale: f32, impulse_scale: f32, start: f32,
}

struct JointImpulse { linear: vec3f }

// Up to three rows of a joint while its system is factored. `right` is the right-hand side, then the correction. Twin:
// src/kernels/joint_system.rs.
struct JointNode {
    along: mat3x3f,
    about_a: mat3x3f, about_b: mat3x3f,
    turn_a: mat3x3f, turn_b: mat3x3f,
    right: vec3f, softness: f32,
    mass_a: f32, mass_b: f32, locks_a: f32, locks_b: f32,
}

// A block of L, or the factors of a pivot, and the block of L D.
struct JointBlock { lower: mat3x3f, upper: mat3x3f }

struct Turning { inv_inertia_x: vec3f, body: u32, inv_inertia_yz: vec3f }

struct Convergence { moving: atomic<u32>, done: u32, sweeps: u32, planned: u32 }

struct Impulse { normal: f32, tangent_1: f32, tangent_2: f32, bounce: f32 }

struct ImpulseStep { before: vec3f, begin: vec3f }

struct Momentum { t: f32, factor: f32, square: f32, restarts: u32 }

struct Softness { bias_rate: f32, mass_scale: f32, impulse_scale: f32, push_limit: f32 }

struct Params {
    restitution_threshold: f32, slop: f32, relaxation: f32, tolerance: f32,
    body_count: u32, point_count: u32, joint_count: u32, patches: u32,
    axis_count: u32,
    // Always 0. Shader compilers cannot know this, and the exact mode in WGSL relies on it.
    zero: u32,
}

// The colors that one dispatch sweeps in order, and the substep of their block. The buffer `colors` holds the start of
// each color, then the end of the last, then the rows of the colors.
struct PassRow {
    first: u32, end: u32,
    substep: f32, inverse_substep: f32,
    movable: Softness,
    fixed: Softness,
    joint: Softness,
}

struct Preload { movable_compliance: f32, fixed_compliance: f32, share: f32, warm_start: u32 }

// Parameters of the programs that begin a step on the device. Layout: src/backend/gpu/resident.rs.
struct ResidentParams {
    preload: Preload,
    body_count: u32,
    // Number of contacts that take part, and the start of their rows in `colors`.
    contact_count: u32, order: u32,
    written_count: u32,
    // 1 if the host sent all points.
    has_points: u32,
    // 1 if friction at points has two directions.
    tangents: u32,
    // Always 0. Shader compilers cannot know this, and the exact mode in WGSL relies on it.
    zero: u32,
}

// A contact whose rows the host computed anew. One byte for each point holds the number that the point had before.
struct Written { row: u32, points_before: u32 }

// The manifold of such a contact.
struct WrittenContact {
    normal: vec3f, friction: f32,
    restitution: f32, radius_a: f32, radius_b: f32, substep_share: f32,
    body_a: u32, body_b: u32, point_count: u32,
}

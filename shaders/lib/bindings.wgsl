// Where the rows of a StepProblem are bound. A kernel's layout holds only the bindings it uses.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> pass_colors: PassColors;
@group(0) @binding(2) var<storage, read_write> bodies: array<Body>;
@group(0) @binding(3) var<storage, read> masses: array<Mass>;
@group(0) @binding(4) var<storage, read> inertias: array<Inertia>;
@group(0) @binding(5) var<storage, read> contacts: array<Contact>;
@group(0) @binding(6) var<storage, read> points: array<Point>;
@group(0) @binding(7) var<storage, read_write> impulses: array<Impulse>;
@group(0) @binding(8) var<storage, read> colors: array<u32>;
@group(0) @binding(9) var<storage, read> joints: array<Joint>;
@group(0) @binding(10) var<storage, read_write> joint_impulses: array<JointImpulse>;
@group(0) @binding(11) var<storage, read_write> convergence: Convergence;
@group(0) @binding(12) var<storage, read_write> momentum: Momentum;
// These stay on the device: every step writes them before it reads them.
@group(0) @binding(13) var<storage, read_write> free: array<Free>;
@group(0) @binding(14) var<storage, read_write> velocities_before: array<Free>;
@group(0) @binding(15) var<storage, read_write> impulse_steps: array<ImpulseStep>;
@group(0) @binding(16) var<storage, read_write> lengths: array<vec2f>;

const WORKGROUP: u32 = 64u;

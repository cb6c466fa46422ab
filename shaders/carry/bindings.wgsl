// Where the kernels that begin a step from the rows of the step before find them. Rows that a plan knows as well have the numbers of
// lib/bindings.wgsl. Layouts: src/problem/carry.rs and src/backend/gpu/carry.rs, held together by tests/shaders.rs.

struct Preload { movable_compliance: f32, fixed_compliance: f32, share: f32, warm_start: u32 }

struct Carry {
    preload: Preload,
    body_count: u32,
    // How many contacts take part, and where their rows stand in `colors`.
    contact_count: u32, order: u32,
    written_count: u32,
    // 1 if a patch follows the points of every contact; if the points were sent.
    patches: u32, has_points: u32,
}

// A contact whose rows were written again, and which of the points that it had each of its points is, a byte each.
struct Written { row: u32, points_before: u32 }

@group(0) @binding(2) var<storage, read_write> bodies: array<Body>;
@group(0) @binding(3) var<storage, read> masses: array<Mass>;
@group(0) @binding(5) var<storage, read_write> contacts: array<Contact>;
@group(0) @binding(6) var<storage, read_write> points: array<Point>;
@group(0) @binding(7) var<storage, read_write> impulses: array<Impulse>;
@group(0) @binding(8) var<storage, read> colors: array<u32>;
@group(0) @binding(17) var<uniform> carry: Carry;
@group(0) @binding(18) var<storage, read> written: array<Written>;
@group(0) @binding(19) var<storage, read> written_contacts: array<Contact>;
@group(0) @binding(20) var<storage, read> written_points: array<Point>;
@group(0) @binding(21) var<storage, read> separations: array<f32>;

const WORKGROUP: u32 = 64u;
const MAX_POINTS: u32 = 4u;

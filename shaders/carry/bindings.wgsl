// Where the kernels that bring the rows of one step to the places of the next find them. Rows that a plan knows as well have
// the numbers of lib/bindings.wgsl. Layouts: src/problem/carry.rs and src/backend/gpu/carry.rs, held together by tests/shaders.rs.

struct Preload { movable_compliance: f32, fixed_compliance: f32, share: f32, warm_start: u32 }

struct Carry {
    preload: Preload,
    body_count: u32, contact_count: u32, contacts_before: u32,
    // 1 if a patch follows the points of every contact; if the points were sent.
    patches: u32, has_points: u32,
}

// Where a contact was: after those of the step before stand the ones that were computed since.
struct Place { contact: u32, first_point: u32 }

// Where a contact that was computed since, and its points, were in the step before.
struct Origin { row: u32, contact: u32, points: array<u32, 4> }

@group(0) @binding(2) var<storage, read_write> bodies: array<Body>;
@group(0) @binding(3) var<storage, read> masses: array<Mass>;
@group(0) @binding(5) var<storage, read_write> contacts: array<Contact>;
@group(0) @binding(6) var<storage, read_write> points: array<Point>;
@group(0) @binding(7) var<storage, read_write> impulses: array<Impulse>;
@group(0) @binding(17) var<uniform> carry: Carry;
@group(0) @binding(18) var<storage, read> places: array<Place>;
@group(0) @binding(19) var<storage, read> origins: array<Origin>;
@group(0) @binding(20) var<storage, read> contacts_before: array<Contact>;
@group(0) @binding(21) var<storage, read> points_before: array<Point>;
@group(0) @binding(22) var<storage, read> impulses_before: array<Impulse>;
@group(0) @binding(23) var<storage, read> separations: array<f32>;

const WORKGROUP: u32 = 64u;
const NO_ROW: u32 = 0xffffffffu;

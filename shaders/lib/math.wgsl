// Arithmetic with the same bits everywhere. It uses only + - * and comparisons, in a written order.
// Twins: src/math.rs.

fn larger(a: f32, b: f32) -> f32 { return select(b, a, a > b); }

fn smaller(a: f32, b: f32) -> f32 { return select(b, a, b > a); }

fn dot3(a: vec3f, b: vec3f) -> f32 { return a.x * b.x + a.y * b.y + a.z * b.z; }

fn cross3(a: vec3f, b: vec3f) -> vec3f {
    return vec3f(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

// 1/sqrt(x) for normal positive x: a guess from the exponent, then three Newton steps (about 1 ulp).
fn inverse_sqrt(x: f32) -> f32 {
    let half_x = 0.5 * x;
    var y = bitcast<f32>(0x5f375a86u - (bitcast<u32>(x) >> 1u));
    y = y * (1.5 - half_x * y * y);
    y = y * (1.5 - half_x * y * y);
    y = y * (1.5 - half_x * y * y);
    return y;
}

// One over the power of two in x. Its product with x has the size 1 to 2. For normal x of either sign below 2^127.
fn inverse_power(x: f32) -> f32 { return bitcast<f32>(0x7f000000u - (bitcast<u32>(x) & 0x7f800000u)); }

// 1/x, of either sign. It is scaled, so that no square leaves single precision.
fn reciprocal(x: f32) -> f32 {
    let scale = inverse_power(x);
    let scaled = x * scale;
    let y = inverse_sqrt(scaled * scaled);
    return scaled * (y * y) * scale;
}

// The inverse inertia of a body, times a vector. Twin: Sym3::times in src/problem/arithmetic.rs.
fn inv_inertia_times(m: Mass, u: vec3f) -> vec3f {
    let p = m.inv_inertia_x;
    let q = m.inv_inertia_yz;
    return vec3f(
        p.x * u.x + p.y * u.y + p.z * u.z,
        p.y * u.x + q.x * u.y + q.y * u.z,
        p.z * u.x + q.y * u.y + q.z * u.z,
    );
}

fn quat_mul(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    );
}

// The movement of the arm r by the rotation q: q r - r, without the cancellation of this difference.
fn turned(q: vec4f, r: vec3f) -> vec3f {
    let axis = q.xyz;
    let t = cross3(axis, r);
    return (t * q.w + cross3(axis, t)) * 2.0;
}

// The inverse rotation.
fn conjugate(q: vec4f) -> vec4f { return vec4f(-q.xyz, q.w); }

// The rotation by the vector r (rad), from the series of cos and sinc of half the angle, to 1e-5 at 4 rad. A longer
// vector turns by 4 rad, because the series would leave the unit quaternions, and soon the finite numbers.
fn exp_rotation(r: vec3f) -> vec4f {
    let half = r * 0.5;
    let square = dot3(half, half);
    let too_long = square > 4.0;
    let u = half * select(1.0, 2.0 * inverse_sqrt(square), too_long);
    let s = select(square, 4.0, too_long);
    let cosine = 1.0 + s * (-0.5 + s * (4.1666668e-2 + s * (-1.3888889e-3 + s * (2.4801587e-5 + s * -2.7557319e-7))));
    let sinc = 1.0 + s * (-1.6666667e-1 + s * (8.3333338e-3 + s * (-1.9841270e-4 + s * (2.7557319e-6 + s * -2.5052108e-8))));
    return vec4f(u.x * sinc, u.y * sinc, u.z * sinc, cosine);
}

// A nearly unit quaternion, brought closer to unit length by one Newton step.
fn renormalized(q: vec4f) -> vec4f {
    let s = 1.5 - 0.5 * (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return vec4f(q.x * s, q.y * s, q.z * s, q.w * s);
}

// The parts of the inverse of a symmetric block.
struct Cofactors { x: vec3f, y: vec3f, z: vec3f, determinant: f32, scale: f32 }

// The cofactors of the symmetric block with these columns. The block is first scaled to a trace of 1 to 2. If its
// determinant is below `stiffening`, this number is added to the diagonal. Twin: src/kernels/joint.rs.
fn cofactors(column_x: vec3f, column_y: vec3f, column_z: vec3f, stiffening: f32) -> Cofactors {
    let scale = inverse_power(column_x.x + column_y.y + column_z.z);
    var x = column_x * scale;
    var y = column_y * scale;
    var z = column_z * scale;
    let is_thin = stiffening > dot3(x, cross3(y, z));
    let more = select(0.0, stiffening, is_thin);
    x.x = x.x + more;
    y.y = y.y + more;
    z.z = z.z + more;
    let c_x = cross3(y, z);
    return Cofactors(c_x, cross3(z, x), cross3(x, y), dot3(x, c_x), scale);
}

// A vector without its components along the axes of `locks`: the sum of 1 for x, 2 for y and 4 for z.
fn unlocked(locks: f32, v: vec3f) -> vec3f {
    let z = locks > 3.5;
    let rest = locks - select(0.0, 4.0, z);
    let y = rest > 1.5;
    let x = rest - select(0.0, 2.0, y) > 0.5;
    return vec3f(select(v.x, 0.0, x), select(v.y, 0.0, y), select(v.z, 0.0, z));
}

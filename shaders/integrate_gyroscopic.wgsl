// integrate_gyroscopic: one thread changes the spin of one body with unequal moments of inertia, by the implicit
// midpoint rule, and turns the body by the midpoint spin in place of the spin. With `is_from_start` velocities are
// changes since the step began, and `free` stays.
// Reads inertias. Writes bodies and free; one thread for each body.
// Twin: src/kernels/integrate.rs.

// Solves rows x = g by Cramer's rule.
fn solve_3x3(row_0: vec3f, row_1: vec3f, row_2: vec3f, g: vec3f) -> vec3f {
    let c_0 = cross3(row_1, row_2);
    let c_1 = cross3(row_2, row_0);
    let c_2 = cross3(row_0, row_1);
    return (c_0 * g.x + c_1 * g.y + c_2 * g.z) * reciprocal(dot3(row_0, c_0));
}

// The correction of one step of Newton's method on change + h I^-1 (m x I m) = 0, where m is the midpoint spin.
fn newton_step(inertia: Inertia, h: f32, m: vec3f, change: vec3f) -> vec3f {
    let p = inertia.principal;
    let k = inertia.inv_principal;
    let l = p * m;
    let residual = change + k * (cross3(m, l) * h);
    let f = k * (h * 0.5);
    let row_0 = vec3f(1.0, f.x * (l.z - m.z * p.y), f.x * (m.y * p.z - l.y));
    let row_1 = vec3f(f.y * (m.z * p.x - l.z), 1.0, f.y * (l.x - m.x * p.z));
    let row_2 = vec3f(f.z * (l.y - m.y * p.x), f.z * (m.x * p.y - l.x), 1.0);
    return solve_3x3(row_0, row_1, row_2, residual);
}

// The change of a spin in the time h, by `steps` steps of Newton's method. The unknown is the spin after h. With
// `is_from_start` the unknown is the change itself.
fn spin_change(is_from_start: bool, steps: u32, inertia: Inertia, h: f32, spin: vec3f) -> vec3f {
    if is_from_start {
        var change = vec3f(0.0);
        for (var step = 0u; step < steps; step++) {
            change = change - newton_step(inertia, h, spin + change * 0.5, change);
        }
        return change;
    }
    var next = spin;
    for (var step = 0u; step < steps; step++) {
        next = next - newton_step(inertia, h, (spin + next) * 0.5, next - spin);
    }
    return next - spin;
}

// Square of the largest angle (rad) at which two Newton steps leave only rounding errors.
const SLOW: f32 = 0.0625;

// The change of the angular velocity w of a body that spins fast about its principal axes x, y, z, in the time `step`.
// `square` is (h W)^2.
fn fast_turn(
    is_from_start: bool, inertia: Inertia, step: f32, square: f32, x: vec3f, y: vec3f, z: vec3f, spin: vec3f, w: vec3f,
) -> vec3f {
    var h = step;
    if square > 1.0 { h = step * inverse_sqrt(square); }
    let change = spin_change(is_from_start, 4u, inertia, h, spin);
    let turn = x * change.x + y * change.y + z * change.z;
    // Axes that are not quite of unit length stretch a large change, always in the same direction. The scale brings the
    // energy back. With the ratio E of the energies after and before, the result has E (3 - E)^2 / 4 of the energy
    // before, which is never more. A spin stays if its energy is NaN or would at least triple.
    let changed = w + turn;
    let after = vec3f(dot3(x, changed), dot3(y, changed), dot3(z, changed));
    let energy = dot3(inertia.principal * spin, spin);
    let energy_after = dot3(inertia.principal * after, after);
    let scale = (energy - energy_after) * reciprocal(energy + energy);
    return select(vec3f(0.0), turn + changed * scale, 1.0 > scale * scale);
}

fn turn_spin(is_from_start: bool, i: u32) {
    let inertia = inertias[i];
    let p = inertia.principal;
    let k = inertia.inv_principal;

    // The present principal axes.
    let q = quat_mul(bodies[inertia.body].dq, inertia.frame);
    let x = turned(q, vec3f(1.0, 0.0, 0.0)) + vec3f(1.0, 0.0, 0.0);
    let y = turned(q, vec3f(0.0, 1.0, 0.0)) + vec3f(0.0, 1.0, 0.0);
    let z = turned(q, vec3f(0.0, 0.0, 1.0)) + vec3f(0.0, 0.0, 1.0);

    var w = bodies[inertia.body].w;
    if is_from_start { w = free[inertia.body].w + w; }
    let spin = vec3f(dot3(x, w), dot3(y, w), dot3(z, w));

    // (h W)^2
    let a = vec3f((p.y - p.z) * k.x, (p.z - p.x) * k.y, (p.x - p.y) * k.z);
    let rates = vec3f(a.y * a.z, a.z * a.x, a.x * a.y);
    let sizes = vec3f(larger(rates.x, -rates.x), larger(rates.y, -rates.y), larger(rates.z, -rates.z));
    let angle = spin * pass_row.substep;
    let square = dot3(sizes, angle * angle);

    // The time in which the rule turns a body by the angle x = h |w|: h tan(x/2)/(x/2), with s = x^2.
    let s = dot3(angle, angle);
    let is_calm = 1.0 > larger(square, s);
    let ratio = 1.0 + s * (8.3333336e-2 + s * (8.333334e-3 + s * (8.432540e-4 + s * (8.542769e-5 + s * 8.655504e-6))));
    let step = pass_row.substep * select(1.0, ratio, is_calm);

    var turn: vec3f;
    if SLOW > square {
        // Only the change is turned back. Otherwise rounding of the axes would stretch a spin that nothing changes.
        let change = spin_change(is_from_start, 2u, inertia, step, spin);
        turn = x * change.x + y * change.y + z * change.z;
    } else {
        turn = fast_turn(is_from_start, inertia, step, square, x, y, z, spin, w);
    }

    // A calm body goes back by the rotation that it has made with w, and takes Cayley's rotation about the midpoint.
    let middle = (w + turn * 0.5) * (step * 0.5);
    let scale = inverse_sqrt(1.0 + dot3(middle, middle));
    let rotation = quat_mul(exp_rotation(w * -pass_row.substep), vec4f(middle * scale, scale));
    let change = turn + select(vec3f(0.0), turned(rotation, w + turn), is_calm);
    if !is_from_start { free[inertia.body].w += change; }
    bodies[inertia.body].w += change;
    if is_calm { bodies[inertia.body].dq = renormalized(quat_mul(rotation, bodies[inertia.body].dq)); }
}

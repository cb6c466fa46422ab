// extrapolate: before an accelerated sweep, every velocity and impulse continues in the direction of the last sweeps.
// Before the first sweep the kernel only stores them. In impulse_steps joints follow the points, and axes follow the
// joints.
// Reads momentum, or sets it before the first sweep. Writes bodies, impulses, joint_impulses, velocities_before,
// impulse_steps; one thread for each row.
// Twin: src/kernels/momentum.rs.

fn extrapolated(is_first: bool, now: vec3f, before: vec3f) -> vec3f {
    if is_first { return now; }
    return now + (now - before) * momentum.factor;
}

// Extrapolates an impulse, and stores its former value and its new start.
fn extrapolated_impulse(is_first: bool, i: u32, now: vec3f) -> vec3f {
    let begin = extrapolated(is_first, now, impulse_steps[i].before);
    impulse_steps[i] = ImpulseStep(now, begin);
    return begin;
}

fn extrapolate(is_first: bool, measured: bool, first: u32, stride: u32) {
    if is_converged(measured) { return; }
    if is_first && first == 0u { momentum = Momentum(1.0, 0.0, 3.4028234663852886e38, momentum.restarts); }
    for (var i = first; i < params.body_count; i += stride) {
        let now = Free(bodies[i].v, bodies[i].w);
        bodies[i].v = extrapolated(is_first, now.v, velocities_before[i].v);
        bodies[i].w = extrapolated(is_first, now.w, velocities_before[i].w);
        velocities_before[i] = now;
    }
    for (var i = first; i < params.point_count; i += stride) {
        let impulse = impulses[i];
        let r = extrapolated_impulse(is_first, i, vec3f(impulse.normal, impulse.tangent_1, impulse.tangent_2));
        impulses[i] = Impulse(r.x, r.y, r.z, impulse.bounce);
    }
    for (var i = first; i < params.joint_count + params.axis_count; i += stride) {
        joint_impulses[i].linear = extrapolated_impulse(is_first, params.point_count + i, joint_impulses[i].linear);
    }
}

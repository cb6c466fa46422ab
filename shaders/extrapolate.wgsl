// extrapolate: before an accelerated sweep every velocity and impulse goes on in the direction in which the last sweeps moved
// it; before the first it only remembers where it is. Joints stand after the points in impulse_steps.
// Reads momentum, or begins it. Writes bodies, impulses, joint_impulses, velocities_before, impulse_steps; one thread a row.
// Double: src/kernels/momentum.rs.

override FIRST: bool = false;
override MEASURED: bool = false;

fn extrapolated(now: vec3f, before: vec3f) -> vec3f {
    if FIRST { return now; }
    return now + (now - before) * momentum.factor;
}

// Goes on with an impulse, and remembers where it was and where it begins.
fn extrapolated_impulse(i: u32, now: vec3f) -> vec3f {
    let begin = extrapolated(now, impulse_steps[i].before);
    impulse_steps[i] = ImpulseStep(now, begin);
    return begin;
}

@compute @workgroup_size(WORKGROUP)
fn extrapolate(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    if MEASURED {
        if convergence.done != 0u { return; }
    }
    if FIRST && id.x == 0u { momentum = Momentum(1.0, 0.0, 3.4028234663852886e38, momentum.restarts); }
    let stride = groups.x * WORKGROUP;
    for (var i = id.x; i < params.body_count; i += stride) {
        let now = Free(bodies[i].v, bodies[i].w);
        bodies[i].v = extrapolated(now.v, velocities_before[i].v);
        bodies[i].w = extrapolated(now.w, velocities_before[i].w);
        velocities_before[i] = now;
    }
    for (var i = id.x; i < params.point_count; i += stride) {
        let impulse = impulses[i];
        let r = extrapolated_impulse(i, vec3f(impulse.normal, impulse.tangent_1, impulse.tangent_2));
        impulses[i] = Impulse(r.x, r.y, r.z, impulse.peak);
    }
    for (var i = id.x; i < params.joint_count; i += stride) {
        joint_impulses[i].linear = extrapolated_impulse(params.point_count + i, joint_impulses[i].linear);
    }
}

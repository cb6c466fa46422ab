// measure_step: one workgroup sums over the impulses of IMPULSES_PER_CHUNK points, joints or axes. The first sum is the
// squared step of a sweep. The second is the product of this step with the change since the result of the sweep before.
// Reads impulses, joint_impulses, impulse_steps. Writes lengths; one workgroup for each pair of sums.
// Twin: src/kernels/momentum.rs.

fn step_length(i: u32) -> vec2f {
    var now: vec3f;
    if i < params.point_count {
        let impulse = impulses[i];
        now = vec3f(impulse.normal, impulse.tangent_1, impulse.tangent_2);
    } else {
        now = joint_impulses[i - params.point_count].linear;
    }
    let d = now - impulse_steps[i].begin;
    return vec2f(dot3(d, d), dot3(d, now - impulse_steps[i].before));
}

fn measure_step(thread: u32, group: u32, groups: u32) {
    let count = params.point_count + params.joint_count + params.axis_count;
    for (var first = group * IMPULSES_PER_CHUNK; first < count; first += groups * IMPULSES_PER_CHUNK) {
        var own = vec2f();
        for (var i = first + thread; i < min(first + IMPULSES_PER_CHUNK, count); i += WORKGROUP) { own += step_length(i); }
        let sum = workgroup_sum(thread, own);
        if thread == 0u { lengths[first / IMPULSES_PER_CHUNK] = sum; }
    }
}

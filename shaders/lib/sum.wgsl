// Sums over a workgroup. Twin: workgroup_sum in src/kernels/momentum.rs.

var<workgroup> sums: array<vec2f, WORKGROUP>;

// The sum of the numbers `own` of all threads, in halves. Every thread of the workgroup must call it.
fn workgroup_sum(thread: u32, own: vec2f) -> vec2f {
    sums[thread] = own;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if thread < half { sums[thread] += sums[thread + half]; }
    }
    workgroupBarrier();
    let sum = sums[0];
    workgroupBarrier();
    return sum;
}

// sum_impulses: one thread adds the impulses of one manifold in a substep to the sums of earlier substeps. The first
// substep begins the sums.
// Reads contacts, impulses. Writes totals; one thread for each manifold. Twin: src/kernels/contact.rs.

fn sum_contact(is_first: bool, i: u32) {
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count + params.patches;
    for (var k = contact.first_point; k < end; k++) {
        let now = impulses[k];
        let before = totals[k];
        let normal = now.normal + larger(now.bounce, 0.0);
        let sum = Impulse(before.normal + normal, before.tangent_1 + now.tangent_1, before.tangent_2 + now.tangent_2, 0.0);
        if is_first { totals[k] = Impulse(normal, now.tangent_1, now.tangent_2, 0.0); } else { totals[k] = sum; }
    }
}

// clear_impulses: one thread sets the impulses of one manifold to zero, for plans that clamp each correction by itself.
// Reads contacts. Writes impulses; one thread a manifold. Double: src/kernels/contact.rs.

fn clear_contact(i: u32) {
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count + params.patches;
    for (var k = contact.first_point; k < end; k++) { impulses[k] = Impulse(0.0, 0.0, 0.0, impulses[k].peak); }
}

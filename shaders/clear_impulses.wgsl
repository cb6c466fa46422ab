// clear_impulses: one thread clears the impulses of one manifold, for plans that clamp each correction.
// Reads contacts. Writes impulses; one thread for each manifold. Twin: src/kernels/contact.rs.

fn clear_contact(i: u32) {
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count + params.patches;
    for (var k = contact.first_point; k < end; k++) { impulses[k] = Impulse(0.0, 0.0, 0.0, 0.0); }
}

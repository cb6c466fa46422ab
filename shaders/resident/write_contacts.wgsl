// write_contacts: one thread computes the rows of one manifold that the host found anew, and moves its impulses to the
// new points and tangents.
// Reads masses, written, written_contacts, written_arms. Writes contacts, points, impulses; one thread for each
// manifold.
// Twins: Writer::write_header, patch_of, bring_impulses and retangented in src/problem/write.rs, write_masses in
// src/problem/prepare.rs.

// Rules and materials are those of the step before. If they change, no row stays on the device.
fn retangented(before: Contact, now: Contact, impulse: Impulse) -> Impulse {
    let friction = before.tangent * impulse.tangent_1 + cross3(before.normal, before.tangent) * impulse.tangent_2;
    let tangent_2 = cross3(now.normal, now.tangent);
    return Impulse(impulse.normal, dot3(friction, now.tangent), dot3(friction, tangent_2), 0.0);
}

// The two arms of a point are six numbers, and a manifold has room for those of MAX_POINTS.
fn written_arm(at: u32) -> vec3f { return vec3f(written_arms[at], written_arms[at + 1u], written_arms[at + 2u]); }

// Writes the points of a contact, and the patch that follows them.
fn write_points(contact: Contact, i: u32) {
    let a = masses[contact.body_a];
    let b = masses[contact.body_b];
    let first = contact.first_point;
    var middle_a = vec3f();
    var middle_b = vec3f();
    var count = 0.0;
    for (var k = 0u; k < contact.point_count; k++) {
        let r_a = written_arm(6u * (MAX_POINTS * i + k));
        let r_b = written_arm(6u * (MAX_POINTS * i + k) + 3u);
        let own = point_masses(resident.tangents == 1u, contact, a, b, r_a, r_b);
        points[first + k] = Point(r_a, 0.0, r_b, own.normal, own.tangent, 0.0, 0.0, 0.0);
        middle_a += r_a;
        middle_b += r_b;
        count += 1.0;
    }
    if params.patches == 0u { return; }
    let share = inverse_or_zero(count);
    middle_a = middle_a * share;
    middle_b = middle_b * share;
    for (var k = first; k < first + contact.point_count; k++) {
        let lever = points[k].r_a - middle_a;
        points[k].slip_1 = square_root(dot3(lever, lever));
    }
    let own = point_masses(true, contact, a, b, middle_a, middle_b);
    let twist = twist_mass(contact, a, b);
    points[first + contact.point_count] = Point(middle_a, 0.0, middle_b, twist, own.tangent, 0.0, 0.0, 0.0);
}

fn write_contact(i: u32) {
    let row = written[i].row;
    let points_before = written[i].points_before;
    let is_new = points_before == 0xffffffffu;
    let before = contacts[row];
    let own = written_contacts[i];
    let first = row * (MAX_POINTS + params.patches);
    let now = Contact(
        own.normal, own.friction,
        tangent_of(own.normal), own.restitution,
        own.body_a, own.body_b, first, own.point_count,
        own.radius_a, own.radius_b, select(before.preload, 0.0, is_new), own.substep_share,
    );
    contacts[row] = now;
    if resident.has_points == 0u { write_points(now, i); }
    let nothing = Impulse(0.0, 0.0, 0.0, 0.0);
    var old = array(nothing, nothing, nothing, nothing);
    var patch_impulse = nothing;
    if !is_new {
        for (var k = 0u; k < before.point_count; k++) { old[k] = retangented(before, now, impulses[first + k]); }
        if params.patches == 1u { patch_impulse = retangented(before, now, impulses[first + before.point_count]); }
    }
    for (var k = 0u; k < now.point_count; k++) {
        let at = (points_before >> (8u * k)) & 0xffu;
        if at < MAX_POINTS { impulses[first + k] = old[at]; } else { impulses[first + k] = nothing; }
    }
    if params.patches == 1u { impulses[first + now.point_count] = patch_impulse; }
}

// write_contacts: one thread writes the rows of one manifold that the host computed anew, and moves its impulses to the new points
// and tangents.
// Reads written, written_contacts, written_points. Writes contacts, points, impulses; one thread a manifold.
// Doubles: Writer::bring_impulses and retangented in src/problem/write.rs.

// Rules and materials are those of the step before: where they change, no row stays on the device.
fn retangented(before: Contact, now: Contact, impulse: Impulse) -> Impulse {
    let friction = before.tangent * impulse.tangent_1 + cross3(before.normal, before.tangent) * impulse.tangent_2;
    let tangent_2 = cross3(now.normal, now.tangent);
    return Impulse(impulse.normal, dot3(friction, now.tangent), dot3(friction, tangent_2), 0.0);
}

fn write_contact(i: u32) {
    let row = written[i].row;
    let points_before = written[i].points_before;
    let is_new = points_before == 0xffffffffu;
    let before = contacts[row];
    var now = written_contacts[i];
    now.preload = select(before.preload, 0.0, is_new);
    contacts[row] = now;
    let first = now.first_point;
    let stride = MAX_POINTS + params.patches;
    if resident.has_points == 0u {
        for (var k = 0u; k < now.point_count + params.patches; k++) { points[first + k] = written_points[i * stride + k]; }
    }
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

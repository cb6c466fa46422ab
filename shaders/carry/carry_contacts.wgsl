// carry_contacts: one thread brings the rows of one manifold from where they were in the step before to where they stand now.
// Reads places, origins, contacts_before, points_before, impulses_before. Writes contacts, points, impulses; one thread a
// manifold. Doubles: Writer::write in src/problem/contacts.rs, give_back in src/problem/store.rs.

// An impulse of a manifold that was computed since, along the tangents that it has now.
// Rules and materials are those of the step before: where they change, no row is carried on the device.
fn turned_impulse(before: Contact, now: Contact, impulse: Impulse) -> Impulse {
    let friction = before.tangent * impulse.tangent_1 + cross3(before.normal, before.tangent) * impulse.tangent_2;
    let tangent_2 = cross3(now.normal, now.tangent);
    return Impulse(impulse.normal, dot3(friction, now.tangent), dot3(friction, tangent_2), 0.0);
}

fn carry_contact(i: u32) {
    let place = places[i];
    var contact = contacts_before[place.contact];
    let first = contact.first_point;
    let count = contact.point_count + carry.patches;
    contact.first_point = place.first_point;
    for (var k = 0u; k < count; k++) {
        if carry.has_points == 0u { points[place.first_point + k] = points_before[first + k]; }
        impulses[place.first_point + k] = impulses_before[first + k];
    }
    // Computed since: what has an origin has its impulse from there.
    if place.contact >= carry.contacts_before {
        var origin = origins[place.contact - carry.contacts_before];
        if origin.contact != NO_ROW {
            let before = contacts_before[origin.contact];
            contact.preload = before.preload;
            for (var k = 0u; k < contact.point_count; k++) {
                if origin.points[k] != NO_ROW {
                    let impulse = impulses_before[origin.points[k]];
                    impulses[place.first_point + k] = turned_impulse(before, contact, impulse);
                }
            }
            if carry.patches == 1u {
                let whole = impulses_before[before.first_point + before.point_count];
                impulses[place.first_point + contact.point_count] = turned_impulse(before, contact, whole);
            }
        }
    }
    contacts[i] = contact;
}

@compute @workgroup_size(WORKGROUP)
fn carry_contacts(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < carry.contact_count; i += groups.x * WORKGROUP) { carry_contact(i); }
}

// begin_contacts: one thread writes the separations of the points of one manifold, and its preload, which follows from
// the impulses of the step before.
// Reads colors, separations, masses. Writes contacts, points, impulses; one thread for each manifold.
// Twins: Over::begin in src/problem/prepare.rs, yielding and preloaded in src/problem/carry.rs.

fn yielding(share: f32, both_movable: bool, pressed: f32) -> f32 {
    let compliance = select(resident.preload.fixed_compliance, resident.preload.movable_compliance, both_movable);
    return pressed * (compliance * share);
}

fn preloaded(before: f32, sag: f32) -> f32 {
    // The preload ends with the load.
    return smaller(before + resident.preload.share * (sag - before), 2.0 * sag);
}

fn begin_contact(at: u32) {
    let i = colors[resident.order + at];
    let contact = contacts[i];
    let end = contact.first_point + contact.point_count;
    let a = masses[contact.body_a].inv_mass;
    let b = masses[contact.body_b].inv_mass;
    let both_movable = a > 0.0 && b > 0.0;
    var pressed = 0.0;
    var mass = 0.0;
    for (var k = contact.first_point; k < end; k++) {
        pressed += impulses[k].normal;
        mass += points[k].normal_mass;
    }
    let yields = yielding(contact.substep_share, both_movable, pressed);
    contacts[i].preload = preloaded(contact.preload, yields * reciprocal(mass));
    for (var k = 0u; k < contact.point_count; k++) {
        points[contact.first_point + k].separation = separations[MAX_POINTS * at + k];
    }
    for (var k = contact.first_point; k < end + params.patches; k++) {
        if resident.preload.warm_start == 1u {
            impulses[k].bounce = 0.0;
        } else {
            impulses[k] = Impulse(0.0, 0.0, 0.0, 0.0);
        }
    }
}

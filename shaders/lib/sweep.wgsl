// One manifold. Doubles: src/kernels/contact.rs.

fn sweep_normals(pair: ptr<function, Pair>, contact: Contact) {
    let softness = pair_softness(pair);
    let movement = normal_movement(pair, contact);
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        var impulse = impulses[k];
        solve_normal(pair, contact, points[k], softness, movement, &impulse);
        impulses[k] = impulse;
    }
}

fn sweep_friction(pair: ptr<function, Pair>, contact: Contact) {
    let end = contact.first_point + contact.point_count;
    if PATCH {
        var pressed = 0.0;
        var lever = 0.0;
        for (var k = contact.first_point; k < end; k++) {
            pressed += impulses[k].normal;
            lever += impulses[k].normal * points[k].slip_1;
        }
        var impulse = impulses[end];
        solve_twist(pair, contact, points[end], lever, &impulse);
        solve_friction(pair, contact, points[end], pressed, &impulse);
        impulses[end] = impulse;
    } else {
        for (var k = contact.first_point; k < end; k++) {
            var impulse = impulses[k];
            solve_friction(pair, contact, points[k], impulse.normal, &impulse);
            impulses[k] = impulse;
        }
    }
}

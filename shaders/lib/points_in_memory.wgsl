// The points of a manifold stay in memory during a sweep. A software adapter compiles and runs loops over them faster
// than points_in_registers.wgsl.

struct Held { count: u32 }

fn load_points(rules: Rules, contact: Contact) -> Held { return Held(contact.point_count); }

fn store_points(rules: Rules, contact: Contact, held: ptr<function, Held>) {}

fn sweep_normals(rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>) {
    let softness = pair_softness(pair);
    let movement = normal_movement(rules, pair, contact);
    if rules.as_one { solve_as_one(rules, pair, contact, softness, movement); }
    for (var k = contact.first_point; k < contact.first_point + contact.point_count; k++) {
        var impulse = impulses[k];
        solve_normal(rules, pair, contact, points[k], softness, movement, &impulse);
        impulses[k] = impulse;
    }
}

fn sweep_friction(rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>) {
    let end = contact.first_point + contact.point_count;
    if is_at_patch(rules) {
        var pressed = 0.0;
        var lever = 0.0;
        for (var k = contact.first_point; k < end; k++) {
            let normal = pressing(rules, impulses[k]);
            pressed += normal;
            lever += normal * points[k].slip_1;
        }
        var impulse = impulses[end];
        solve_twist(rules, pair, contact, points[end], lever, &impulse);
        solve_friction(rules, pair, contact, points[end], pressed, &impulse);
        impulses[end] = impulse;
    } else {
        for (var k = contact.first_point; k < end; k++) {
            var impulse = impulses[k];
            solve_friction(rules, pair, contact, points[k], pressing(rules, impulse), &impulse);
            impulses[k] = impulse;
        }
    }
    if rules.rolls {
        var all = 0.0;
        for (var k = contact.first_point; k < end; k++) { all += pressing(rules, impulses[k]); }
        var impulse = impulses[end];
        solve_rolling(rules, pair, contact, points[end], all, &impulse);
        impulses[end] = impulse;
    }
}

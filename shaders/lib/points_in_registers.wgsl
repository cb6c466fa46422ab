// The points of a manifold and their impulses stay in registers during a sweep. A GPU waits as long for one row as for
// five that are loaded together, and an index that is no constant would move them to memory. The same arithmetic as in
// points_in_memory.wgsl.

// The fifth row is the patch of a manifold with four points.
struct Held { points: array<Point, 5>, impulses: array<Impulse, 5> }

fn load_points(rules: Rules, contact: Contact) -> Held {
    let first = contact.first_point;
    let last = first + contact.point_count - select(1u, 0u, rules.has_patch);
    let at = min(vec4u(first + 1u, first + 2u, first + 3u, first + 4u), vec4u(last));
    return Held(
        array<Point, 5>(points[first], points[at.x], points[at.y], points[at.z], points[at.w]),
        array<Impulse, 5>(impulses[first], impulses[at.x], impulses[at.y], impulses[at.z], impulses[at.w]),
    );
}

fn store_points(rules: Rules, contact: Contact, held: ptr<function, Held>) {
    let first = contact.first_point;
    let count = contact.point_count + select(0u, 1u, rules.has_patch);
    impulses[first] = (*held).impulses[0];
    if count > 1u { impulses[first + 1u] = (*held).impulses[1]; }
    if count > 2u { impulses[first + 2u] = (*held).impulses[2]; }
    if count > 3u { impulses[first + 3u] = (*held).impulses[3]; }
    if count > 4u { impulses[first + 4u] = (*held).impulses[4]; }
}

fn normal_at(k: u32, rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>, softness: Softness, movement: NormalMovement) {
    var impulse = (*held).impulses[k];
    solve_normal(rules, pair, contact, (*held).points[k], softness, movement, &impulse);
    (*held).impulses[k] = impulse;
}

fn sweep_normals(rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>) {
    let softness = pair_softness(pair);
    let movement = normal_movement(rules, pair, contact);
    if rules.as_one {
        store_points(rules, contact, held);
        solve_as_one(rules, pair, contact, softness, movement);
        *held = load_points(rules, contact);
    }
    normal_at(0u, rules, pair, contact, held, softness, movement);
    if contact.point_count > 1u { normal_at(1u, rules, pair, contact, held, softness, movement); }
    if contact.point_count > 2u { normal_at(2u, rules, pair, contact, held, softness, movement); }
    if contact.point_count > 3u { normal_at(3u, rules, pair, contact, held, softness, movement); }
}

fn friction_at(k: u32, rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>) {
    var impulse = (*held).impulses[k];
    solve_friction(rules, pair, contact, (*held).points[k], pressing(rules, impulse), &impulse);
    (*held).impulses[k] = impulse;
}

fn patch_friction_at(k: u32, rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>, pressed: f32, lever: f32) {
    var impulse = (*held).impulses[k];
    solve_twist(rules, pair, contact, (*held).points[k], lever, &impulse);
    solve_friction(rules, pair, contact, (*held).points[k], pressed, &impulse);
    (*held).impulses[k] = impulse;
}

fn rolling_at(k: u32, rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>, pressed: f32) {
    var impulse = (*held).impulses[k];
    solve_rolling(rules, pair, contact, (*held).points[k], pressed, &impulse);
    (*held).impulses[k] = impulse;
}

// The normal impulse of a point, and its product with the distance from the middle of the patch.
fn pressed_at(k: u32, rules: Rules, held: ptr<function, Held>) -> vec2f {
    let normal = pressing(rules, (*held).impulses[k]);
    return vec2f(normal, normal * (*held).points[k].slip_1);
}

fn sweep_friction(rules: Rules, pair: ptr<function, Pair>, contact: Contact, held: ptr<function, Held>) {
    let count = contact.point_count;
    if is_at_patch(rules) {
        var pressed = vec2f() + pressed_at(0u, rules, held);
        if count > 1u { pressed += pressed_at(1u, rules, held); }
        if count > 2u { pressed += pressed_at(2u, rules, held); }
        if count > 3u { pressed += pressed_at(3u, rules, held); }
        if count == 1u { patch_friction_at(1u, rules, pair, contact, held, pressed.x, pressed.y); }
        if count == 2u { patch_friction_at(2u, rules, pair, contact, held, pressed.x, pressed.y); }
        if count == 3u { patch_friction_at(3u, rules, pair, contact, held, pressed.x, pressed.y); }
        if count == 4u { patch_friction_at(4u, rules, pair, contact, held, pressed.x, pressed.y); }
    } else {
        friction_at(0u, rules, pair, contact, held);
        if count > 1u { friction_at(1u, rules, pair, contact, held); }
        if count > 2u { friction_at(2u, rules, pair, contact, held); }
        if count > 3u { friction_at(3u, rules, pair, contact, held); }
    }
    if rules.rolls {
        var pressed = 0.0 + pressing(rules, (*held).impulses[0]);
        if count > 1u { pressed += pressing(rules, (*held).impulses[1]); }
        if count > 2u { pressed += pressing(rules, (*held).impulses[2]); }
        if count > 3u { pressed += pressing(rules, (*held).impulses[3]); }
        if count == 1u { rolling_at(1u, rules, pair, contact, held, pressed); }
        if count == 2u { rolling_at(2u, rules, pair, contact, held, pressed); }
        if count == 3u { rolling_at(3u, rules, pair, contact, held, pressed); }
        if count == 4u { rolling_at(4u, rules, pair, contact, held, pressed); }
    }
}

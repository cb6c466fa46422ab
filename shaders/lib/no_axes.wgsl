// The functions of lib/axes.wgsl for programs whose joints have no axes.

fn solve_axes(rules: Rules, but_locks: bool, pair: ptr<function, Pair>, joint: Joint) {}

fn warm_start_axes(pair: ptr<function, Pair>, joint: Joint) {}

fn of_anchors(joint: Joint, change: vec3f) -> vec3f { return change; }

// The rules of a kernel, which every call gives as a constant. Twin: Rules in src/kernels/mod.rs. rules_text in
// src/backend/gpu/wgsl.rs writes the fields in this order.

struct Rules {
    biased: bool,
    friction: u32,
    // A row for the whole manifold, the patch, follows the rows of its points. Friction acts there, unless it `rolls`.
    has_patch: bool,
    // The patch resists rolling and spinning, and friction acts at the points.
    rolls: bool,
    friction_first: bool,
    accumulated: bool,
    round: bool,
    // The points of a manifold are solved together before each is solved alone.
    as_one: bool,
    passes: u32,
    driven: bool,
    measured: bool,
    // Velocities of bodies are changes since the step began.
    from_start: bool,
    // Every movable body has the same moment of inertia about all axes, and no locked axis.
    isotropic: bool,
    // Points bounce, and friction counts the impulses by which they do.
    bounces: bool,
}

// Whether friction acts once for each manifold, at its patch.
fn is_at_patch(rules: Rules) -> bool { return rules.has_patch && !rules.rolls; }

const FRICTION_NONE: u32 = 0u;
const FRICTION_SLIP: u32 = 1u;
const FRICTION_BOX: u32 = 2u;
const FRICTION_DISC: u32 = 3u;

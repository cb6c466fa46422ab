//! Every rule of the settings.

use drystone::config::{Clamping, Friction, FrictionAt, FrictionOrder, FrictionSweeps, Method, Stabilization};

use super::Golden;

pub fn all() -> Vec<Golden> {
    vec![
        Golden::with_settings("friction-box", "pyramid:base=5", 60, |c| c.friction = Friction::Box),
        Golden::with_settings("friction-none", "pile:n=20", 90, |c| c.friction = Friction::None),
        Golden::with_settings("friction-slip", "slide:mu=0.2", 60, |c| c.rules.slip_friction = true),
        Golden::with_settings("friction-of-manifolds", "pile:n=30", 100, |c| c.friction_at = FrictionAt::Manifold),
        Golden::with_settings("friction-first", "pile:n=30,seed=2", 100, |c| {
            c.friction_sweeps = FrictionSweeps::All;
            c.rules.friction_order = FrictionOrder::FrictionFirst;
            c.rules.manifold_passes = 2;
        }),
        Golden::with_settings("baumgarte", "wall:rows=4,columns=4", 60, |c| {
            (c.stabilization, c.relax, c.iterations) = (Stabilization::Baumgarte, 0, 4);
        }),
        Golden::with_settings("clamped-corrections", "tower:n=4", 60, |c| {
            (c.stabilization, c.relax, c.iterations) = (Stabilization::None, 0, 4);
            (c.rules.clamping, c.relaxation) = (Clamping::PerCorrection, 0.9);
        }),
        Golden::with_settings("accelerated", "pyramid:base=6", 60, |c| {
            (c.method, c.iterations) = (Method::Accelerated, 8);
        }),
        Golden::with_settings("tolerance", "misaligned:n=5", 60, |c| {
            (c.tolerance, c.iterations, c.relax) = (1e-4, 20, 20);
        }),
        Golden::with_settings("computed-anew", "coins:n=8", 40, |c| {
            (c.recycle_distance, c.warm_start, c.gyroscopic) = (0.0, false, false);
        }),
        // Islands that take 8 to 1024 substeps.
        Golden::of_catalogue("efforts", "mass-ratio:n=6,ratio=1000", 60),
        Golden::of_catalogue("efforts-of-towers", "tallest:n=9,step=3", 60),
    ]
}

//! How hard the points of a manifold are to move: computed once a manifold, and kept with it while it is reused.

use glam::Vec3;
use rayon::prelude::*;

use super::effective::{EffectiveMass, InverseMass};
use super::layout::{ContactRow, MassRow};
use crate::collide::{MAX_POINTS, Manifold, Pair, PointMass};
use crate::config::FrictionRule;

/// Computes the masses of the manifolds that have none yet. One slip direction has a mass of its own in every step.
///
/// The bodies of a reused manifold turned by 0.1 rad at most, and unequal moments of inertia turned with them: what that
/// changes is left out, as it is in the arms.
pub(super) fn weigh(pairs: &mut [Pair], masses: &[MassRow], rule: FrictionRule, patch: bool) {
    pairs.par_iter_mut().with_min_len(256).for_each(|pair| {
        for manifold in pair.manifolds.iter_mut().filter(|m| m.masses.is_none()) {
            let inverse = [pair.body_a, pair.body_b].map(|i| InverseMass::of(&masses[i as usize]));
            manifold.masses = Some(weighed(manifold, &inverse, rule, patch));
        }
    });
}

fn weighed(
    manifold: &Manifold,
    inverse: &[InverseMass; 2],
    rule: FrictionRule,
    patch: bool,
) -> [PointMass; MAX_POINTS + 1] {
    let row = ContactRow::framed(manifold.normal);
    let effective = EffectiveMass { inverse, row: &row };
    let tangent = |r_a, r_b| match rule {
        FrictionRule::Box | FrictionRule::Disc => effective.tangent(r_a, r_b),
        FrictionRule::None | FrictionRule::Slip => 0.0,
    };
    let points = manifold.points();
    let mut all = [PointMass::default(); MAX_POINTS + 1];
    for (mass, p) in all.iter_mut().zip(points) {
        *mass = PointMass { normal: effective.normal(p.r_a, p.r_b), tangent: tangent(p.r_a, p.r_b) };
    }
    if patch {
        let (r_a, r_b) = (middle(points.iter().map(|p| p.r_a)), middle(points.iter().map(|p| p.r_b)));
        all[MAX_POINTS] = PointMass { normal: effective.twist(), tangent: effective.tangent(r_a, r_b) };
    }
    all
}

/// The mean of some arms.
pub(super) fn middle(arms: impl ExactSizeIterator<Item = Vec3>) -> Vec3 {
    let count = arms.len() as f32;
    arms.sum::<Vec3>() / count
}

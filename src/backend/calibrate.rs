//! From how large a scene on a GPU pays: measured on small piles that are the same everywhere.
//!
//! A step costs each backend something whatever its size (dispatches and transfers; waking threads) and something a body.
//! Both follow from two piles, one of which is all overhead on a GPU. A pile of this kind has the contacts, colors and substeps
//! of a settled pile of boxes and the default plan; what a GPU has of an earlier step stays there, as in a run.

use std::time::Instant;

use super::{Backend, CheckedStep};
use crate::config::SolverConfig;
use crate::error::Result;
use crate::plan::StepPlan;
use crate::problem::carry::{Carry, Preload};
use crate::problem::{BodyRow, ContactRow, ImpulseRow, MassRow, Params, PointRow, Softness, StepProblem};
use glam::Vec3;

/// Bodies along each side of the two piles.
const SIDES: [u32; 2] = [6, 20];
/// Steps of which the fastest counts.
const STEPS: u32 = 5;

/// From how many bodies on a step takes `gpu` less time than `cpu`; none if it never does.
///
/// # Errors
/// A backend cannot run.
pub fn crossover(cpu: &mut dyn Backend, gpu: &mut dyn Backend) -> Result<Option<usize>> {
    let piles = SIDES.map(pile);
    let [n, m] = [0, 1].map(|i| piles[i].bodies.len() as f64);
    let (mut fixed, mut a_body) = ([0.0; 2], [0.0; 2]);
    let both: [&mut dyn Backend; 2] = [cpu, gpu];
    for (i, backend) in both.into_iter().enumerate() {
        let (small, large) = (seconds(backend, &piles[0])?, seconds(backend, &piles[1])?);
        a_body[i] = ((large - small) / (m - n)).max(0.0);
        fixed[i] = (small - a_body[i] * n).max(0.0);
    }
    let (dearer, cheaper) = (fixed[1] - fixed[0], a_body[0] - a_body[1]);
    Ok((cheaper > 0.0).then(|| (dearer / cheaper).max(0.0).ceil() as usize))
}

/// Time of a step of a pile, once it has been run [s].
fn seconds(backend: &mut dyn Backend, pile: &StepProblem) -> Result<f64> {
    let plan = StepPlan::new(&SolverConfig::default(), pile);
    let (mut least, mut carry) = (f64::INFINITY, Carry::default());
    for _ in 0..=STEPS {
        let mut problem = pile.clone();
        let step = CheckedStep::new(&mut problem, &plan.passes)?;
        let start = Instant::now();
        backend.step(step, &carry)?;
        // The first compiles kernels and sends everything.
        if carry.on_device || !backend.keeps_rows() {
            least = least.min(start.elapsed().as_secs_f64());
        }
        carry.on_device = backend.keeps_rows();
        carry.preload = Preload { warm_start: 1, ..Preload::default() };
    }
    Ok(least)
}

/// Unit cubes without weight that touch their neighbors in a grid of `side` along each axis, with four points each.
fn pile(side: u32) -> StepProblem {
    let count = (side * side * side) as usize;
    let inertia = 6.0;
    let mass = MassRow {
        inv_inertia_x: [inertia, 0.0, 0.0],
        inv_mass: 1.0,
        inv_inertia_yz: [inertia, 0.0, inertia],
        ..MassRow::default()
    };
    let substep = 1.0 / 480.0;
    let soft = Softness { bias_rate: 30.0, mass_scale: 0.9, impulse_scale: 0.1, push_limit: 3.0 };
    let mut problem = StepProblem {
        bodies: vec![BodyRow::AT_REST; count],
        masses: vec![mass; count],
        params: Params {
            substep,
            inverse_substep: 1.0 / substep,
            movable: soft,
            fixed: soft,
            body_count: count as u32,
            relaxation: 1.0,
            ..Params::default()
        },
        colors: vec![0],
        ..StepProblem::default()
    };
    // Every other contact along an axis: no body twice.
    for (axis, stride) in [(Vec3::X, 1), (Vec3::Y, side), (Vec3::Z, side * side)] {
        for parity in 0..2 {
            for body in
                (0..side * side * side).filter(|b| b / stride % side % 2 == parity && b / stride % side + 1 < side)
            {
                let first_point = problem.points.len() as u32;
                let (body_a, body_b) = (body, body + stride);
                let framed = ContactRow::framed(axis);
                problem.contacts.push(ContactRow {
                    body_a,
                    body_b,
                    first_point,
                    point_count: 4,
                    friction: 0.5,
                    ..framed
                });
                let (t1, t2) = framed.tangents();
                for (x, y) in [(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)] {
                    let (r_a, r_b) = (t1 * x + t2 * y + axis * 0.5, t1 * x + t2 * y - axis * 0.5);
                    let masses = PointRow { normal_mass: 0.125, tangent_mass: 0.1, ..PointRow::default() };
                    problem.points.push(PointRow { r_a: r_a.to_array(), r_b: r_b.to_array(), ..masses });
                }
            }
            problem.colors.push(problem.contacts.len() as u32);
        }
    }
    problem.first_joint_color = problem.colors.len() as u32;
    problem.params.point_count = problem.points.len() as u32;
    problem.impulses = vec![ImpulseRow::default(); problem.points.len()];
    problem
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::{Cpu, Reference};
    use std::time::Duration;

    /// Takes as long as it is told to: so much a step, and so much a body.
    struct Sleeper(Duration, Duration);

    impl Backend for Sleeper {
        fn name(&self) -> &'static str {
            "sleeper"
        }
        fn adapter(&self) -> String {
            String::new()
        }
        fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
            let (problem, _) = step.into_parts();
            std::thread::sleep(self.0 + self.1 * problem.bodies.len() as u32);
            Ok(())
        }
    }

    #[test]
    fn two_backends_are_equal_where_their_lines_cross() {
        let of = |fixed: u64, a_body: u64| Sleeper(Duration::from_micros(fixed), Duration::from_nanos(a_body));
        // 2 + n / 1000 and 5 + n / 4000 milliseconds: equal at 4,000.
        let found = crossover(&mut of(2_000, 1_000), &mut of(5_000, 250)).expect("they run").expect("they cross");
        assert!((3_000..5_000).contains(&found), "{found}");
        assert_eq!(crossover(&mut of(1_000, 250), &mut of(1_000, 1_000)).expect("they run"), None);
        assert_eq!(crossover(&mut of(8_000, 500), &mut of(1_000, 100)).expect("they run"), Some(0));
    }

    #[test]
    fn a_pile_is_a_problem_like_any_other() {
        let pile = pile(6);
        assert_eq!((pile.bodies.len(), pile.contacts.len(), pile.points.len()), (216, 540, 2160));
        for color in pile.contact_colors() {
            let mut seen = std::collections::HashSet::new();
            let own = &pile.contacts[pile.rows_of(&(color..color + 1))];
            assert!(own.iter().all(|c| seen.insert(c.body_a) && seen.insert(c.body_b)), "color {color}");
        }
        let plan = StepPlan::new(&SolverConfig::default(), &pile);
        let after = |backend: &mut dyn Backend| {
            let mut pushed = pile.clone();
            pushed.bodies[0].v = [1.0, 0.5, 0.2];
            backend.run(&mut pushed, &plan.passes).expect("it runs");
            pushed
        };
        let (ours, theirs) = (after(&mut Reference::<f32>::new()), after(&mut Cpu::new()));
        assert_eq!(ours.bodies, theirs.bodies);
        assert!(ours.bodies[1].v[0] > 0.01, "{:?}", ours.bodies[1]);
    }
}

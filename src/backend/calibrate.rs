//! Measures the scene size from which a GPU is faster, with small piles that are the same on every machine.
//!
//! For each backend, a step has a fixed cost (dispatches and transfers, or waking threads) and a cost for each body.
//! Two piles give both numbers; on a GPU the time of the smaller one is almost only fixed cost. Each pile has the
//! contacts, colors and substeps of a settled pile of boxes with the default plan. As in a run, the GPU keeps rows of
//! an earlier step.

use super::{Backend, CheckedStep};
use crate::config::SolverConfig;
use crate::error::Result;
use crate::plan::StepPlan;
use crate::problem::carry::{Carry, Preload};
use crate::problem::{BodyRow, ContactRow, ImpulseRow, MassRow, Params, PointRow, Softness, StepProblem, Substep};
use crate::stats::Stopwatch;
use glam::Vec3;

/// Bodies along each side of the two piles.
const SIDES: [u32; 2] = [6, 20];
/// Number of steps. The fastest one counts.
const STEPS: u32 = 5;

/// The number of bodies from which a step takes less time on `gpu` than on `cpu`, or `None` if it never does.
///
/// # Errors
/// A backend cannot run.
pub fn crossover(cpu: &mut dyn Backend, gpu: &mut dyn Backend) -> Result<Option<usize>> {
    let piles = SIDES.map(pile);
    let times = |backend: &mut dyn Backend| Ok([seconds(backend, &piles[0])?, seconds(backend, &piles[1])?]);
    let (cpu, gpu) = (times(cpu)?, times(gpu)?);
    Ok(crossing(piles.map(|pile| pile.bodies.len()), cpu, gpu))
}

/// The number of bodies from which the line through the times of `gpu` is below that of `cpu`, or `None` if it never
/// is. The times were measured with two numbers of `bodies`, few and many. No line falls, and none starts below zero.
fn crossing(bodies: [usize; 2], cpu: [f64; 2], gpu: [f64; 2]) -> Option<usize> {
    let [few, many] = bodies.map(|n| n as f64);
    let line = |[small, large]: [f64; 2]| {
        let a_body = ((large - small) / (many - few)).max(0.0);
        ((small - a_body * few).max(0.0), a_body)
    };
    let ((fixed_cpu, body_cpu), (fixed_gpu, body_gpu)) = (line(cpu), line(gpu));
    let (dearer, cheaper) = (fixed_gpu - fixed_cpu, body_cpu - body_gpu);
    (cheaper > 0.0).then(|| (dearer / cheaper).max(0.0).ceil() as usize)
}

/// Time of a step of a pile, after a first run (s).
fn seconds(backend: &mut dyn Backend, pile: &StepProblem) -> Result<f64> {
    let plan = StepPlan::new(&SolverConfig::default(), pile);
    let (mut least, mut carry) = (f64::INFINITY, Carry::default());
    for _ in 0..=STEPS {
        let mut problem = pile.clone();
        let step = CheckedStep::new(&mut problem, &plan.passes)?;
        let start = Stopwatch::start();
        backend.step(step, &carry)?;
        // The first step compiles kernels and sends all rows.
        if carry.on_device || !backend.keeps_rows() {
            least = least.min(start.elapsed().as_secs_f64());
        }
        carry.on_device = backend.keeps_rows();
        carry.preload = Preload { warm_start: 1, ..Preload::default() };
    }
    Ok(least)
}

/// Weightless unit cubes in a grid of `side` along each axis. Neighbors touch with four points each.
pub(super) fn pile(side: u32) -> StepProblem {
    let count = (side * side * side) as usize;
    let inertia = 6.0;
    let mass = MassRow {
        inv_inertia_x: [inertia, 0.0, 0.0],
        inv_mass: 1.0,
        inv_inertia_yz: [inertia, 0.0, inertia],
        ..MassRow::default()
    };
    let length = 1.0 / 480.0;
    let soft = Softness { bias_rate: 30.0, mass_scale: 0.9, impulse_scale: 0.1, push_limit: 3.0 };
    let mut colors = vec![0];
    let mut problem = StepProblem {
        bodies: vec![BodyRow::AT_REST; count],
        masses: vec![mass; count],
        params: Params { body_count: count as u32, relaxation: 1.0, ..Params::default() },
        ..StepProblem::default()
    };
    // Every other contact along an axis: then no body occurs twice.
    for (axis, stride) in [(Vec3::X, 1), (Vec3::Y, side), (Vec3::Z, side * side)] {
        for parity in 0..2 {
            let place = |body: u32| body / stride % side;
            for body_a in (0..side.pow(3)).filter(|&body| place(body) % 2 == parity && place(body) + 1 < side) {
                let (body_b, first_point, framed) =
                    (body_a + stride, problem.points.len() as u32, ContactRow::framed(axis));
                let sides = ContactRow { body_a, body_b, first_point, point_count: 4, ..framed };
                problem.contacts.push(ContactRow { friction: 0.5, ..sides });
                let (t1, t2) = framed.tangents();
                for (x, y) in [(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)] {
                    let (r_a, r_b) = (t1 * x + t2 * y + axis * 0.5, t1 * x + t2 * y - axis * 0.5);
                    let masses = PointRow { normal_mass: 0.125, tangent_mass: 0.1, ..PointRow::default() };
                    problem.points.push(PointRow { r_a: r_a.to_array(), r_b: r_b.to_array(), ..masses });
                }
            }
            colors.push(problem.contacts.len() as u32);
        }
    }
    problem.order = (0..problem.contacts.len() as u32).collect();
    problem.colors = colors;
    let substep = Substep { length, inverse_length: 1.0 / length, movable: soft, fixed: soft, joint: soft };
    problem.in_one_block(problem.colors.len() as u32 - 1, substep);
    problem.params.point_count = problem.points.len() as u32;
    problem.impulses = vec![ImpulseRow::default(); problem.points.len()];
    problem
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::{Cpu, Reference};
    use std::time::Duration;

    /// Times of a line with the fixed cost `fixed` and the cost `a_body` for each body, at 200 and 8,000 bodies.
    fn times(fixed: f64, a_body: f64) -> [f64; 2] {
        BODIES.map(|n| fixed + a_body * n as f64)
    }

    const BODIES: [usize; 2] = [200, 8_000];

    #[test]
    fn a_gpu_pays_from_where_the_lines_cross() {
        // Powers of two make every sum exact: 2 + n / 1024 and 5 + n / 4096 are equal at 4096.
        let (cpu, gpu) = (times(2.0, 1.0 / 1024.0), times(5.0, 1.0 / 4096.0));
        let found = crossing(BODIES, cpu, gpu).expect("they cross");
        assert!((4096..=4097).contains(&found), "{found}");
        assert!(cpu[0] < gpu[0] && cpu[1] > gpu[1]);
        // With the roles swapped, the GPU is faster only for few bodies, and there is no crossover.
        assert_eq!(crossing(BODIES, gpu, cpu), None);
    }

    #[test]
    fn a_gpu_that_is_always_cheaper_pays_at_once_and_one_that_is_always_dearer_never() {
        let (cheap, dear) = (times(1.0, 0.125), times(8.0, 0.5));
        assert_eq!(crossing(BODIES, dear, cheap), Some(0));
        assert_eq!(crossing(BODIES, cheap, dear), None);
        assert_eq!(crossing(BODIES, cheap, cheap), None);
    }

    #[test]
    fn a_large_pile_that_was_measured_as_faster_than_a_small_one_counts_as_free() {
        let (falling, rising) = ([4.0, 3.0], times(1.0, 0.25));
        assert_eq!(crossing(BODIES, falling, rising), None);
        // A step costs the GPU a constant 4, and the processor 1 + n / 4.
        assert_eq!(crossing(BODIES, rising, falling), Some(12));
        // The cost per body is at least the whole time of the small pile: no fixed cost remains.
        assert_eq!(crossing(BODIES, [0.0, 78.0], [0.0, 39.0]), Some(0));
    }

    /// Keeps rows, sleeps in every step except the first, and records the steps that continue from its rows.
    #[derive(Default)]
    struct Sleeper(Vec<bool>);

    /// The shortest duration of such a step, however busy the machine is.
    const SLEEP: Duration = Duration::from_millis(2);

    impl Backend for Sleeper {
        fn name(&self) -> &'static str {
            "sleeper"
        }
        fn adapter(&self) -> String {
            String::new()
        }
        fn run_checked(&mut self, _: CheckedStep) -> Result<()> {
            unreachable!("steps are asked for")
        }
        fn step(&mut self, _: CheckedStep, carry: &Carry) -> Result<()> {
            if !self.0.is_empty() {
                std::thread::sleep(SLEEP);
            }
            self.0.push(carry.on_device);
            Ok(())
        }
        fn keeps_rows(&self) -> bool {
            true
        }
    }

    #[test]
    fn the_first_step_does_not_count_where_rows_stay_on_a_device() {
        let mut sleeper = Sleeper::default();
        let measured = seconds(&mut sleeper, &pile(2)).expect("it runs");
        assert!(measured >= SLEEP.as_secs_f64() && measured.is_finite(), "{measured} s");
        assert_eq!(sleeper.0, [false, true, true, true, true, true]);
    }

    #[test]
    fn a_pile_is_a_problem_like_any_other() {
        let pile = pile(6);
        assert_eq!((pile.bodies.len(), pile.contacts.len(), pile.points.len()), (216, 540, 2160));
        for color in pile.contact_colors() {
            let mut seen = std::collections::HashSet::new();
            let own = pile.rows_of(&(color..color + 1)).iter().map(|&row| &pile.contacts[row as usize]);
            assert!(own.into_iter().all(|c| seen.insert(c.body_a) && seen.insert(c.body_b)), "color {color}");
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

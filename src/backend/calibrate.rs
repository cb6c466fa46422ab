//! Measures whether a GPU is faster for a scene, with a pile that is the same on every machine.
//!
//! The pile has about as many bodies as the scene, and the contacts, colors and substeps of a settled pile of boxes with
//! the default plan. As in a run, the GPU keeps rows of an earlier step.

use super::{Backend, CheckedStep};
use crate::config::SolverConfig;
use crate::error::Result;
use crate::plan::StepPlan;
use crate::problem::carry::{Carry, Preload};
use crate::problem::{BodyRow, ContactRow, ImpulseRow, MassRow, Params, PointRow, Softness, StepProblem, Substep};
use crate::stats::Stopwatch;
use glam::Vec3;

/// Fewest and most bodies along each side of the pile. The largest pile runs for about a second.
const SIDES: [u32; 2] = [6, 40];
/// Number of steps. The fastest one counts.
const STEPS: u32 = 5;

/// The times of a step on two backends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepTimes {
    /// Number of bodies of the pile.
    pub bodies: usize,
    /// Time of a step on the CPU (s).
    pub cpu: f64,
    /// Time of a step on the GPU (s).
    pub gpu: f64,
}

/// Measures a step of a pile of `bodies` bodies or a few more, at most 64,000, on two backends.
///
/// # Errors
/// A backend cannot run.
pub fn step_times(cpu: &mut dyn Backend, gpu: &mut dyn Backend, bodies: usize) -> Result<StepTimes> {
    let pile = pile(side(bodies));
    Ok(StepTimes { bodies: pile.bodies.len(), cpu: seconds(cpu, &pile)?, gpu: seconds(gpu, &pile)? })
}

/// Number of bodies along each side of the smallest pile with `bodies` bodies.
fn side(bodies: usize) -> u32 {
    let [least, most] = SIDES;
    (least..most).find(|side| side.pow(3) as usize >= bodies).unwrap_or(most)
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

    #[test]
    fn the_pile_has_at_least_the_bodies_of_the_scene_or_as_many_as_it_can() {
        for (bodies, of_pile) in [(0, 216), (500, 512), (1_000, 1_000), (20_000, 21_952), (1_000_000, 64_000)] {
            assert_eq!(side(bodies).pow(3), of_pile, "{bodies}");
        }
    }

    #[test]
    fn each_backend_has_its_own_time() {
        let (mut cpu, mut gpu) = (Reference::<f32>::new(), Sleeper::default());
        let times = step_times(&mut cpu, &mut gpu, 216).expect("both run");
        assert_eq!((times.bodies, gpu.0.len()), (216, STEPS as usize + 1));
        assert!(times.gpu >= SLEEP.as_secs_f64() && times.cpu > 0.0 && times.cpu.is_finite(), "{times:?}");
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

//! The comparison of backends finds what a backend does wrong, and where.

use crate::common::state::reference;
use drystone::stages::backend::CheckedStep;
use drystone::stages::plan::StepPlan;
use drystone::stages::problem::StepProblem;
use drystone::stages::problem::{JointImpulseRow, JointRow};
use drystone::{Backend, Reference, Result, Simulation, SolverConfig};
use drystone_conform::compare::{BodyDifference, Difference, FirstDifference, Stage, compare, first_difference};
use drystone_scenes::Scene;

/// What goes wrong at one pass.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// It is not run.
    Dropped,
    /// It changes the results that the backend leaves behind.
    Spoiled(fn(&mut StepProblem)),
}

/// A reference that does one pass of a step wrong.
struct Faulty {
    fault: Fault,
    pass: usize,
}

impl Backend for Faulty {
    fn name(&self) -> &'static str {
        "faulty"
    }

    fn adapter(&self) -> String {
        format!("{:?} at pass {}", self.fault, self.pass)
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        let (before, rest) = passes.split_at(self.pass.min(passes.len()));
        let mut reference = Reference::<f32>::new();
        reference.run(problem, before)?;
        if let Some((pass, after)) = rest.split_first() {
            match self.fault {
                Fault::Dropped => {}
                Fault::Spoiled(spoil) => {
                    reference.run(problem, std::slice::from_ref(pass))?;
                    spoil(problem);
                }
            }
            reference.run(problem, after)?;
        }
        Ok(())
    }
}

/// A small pile: by 40 steps it lies on the floor.
fn pile() -> Scene {
    Scene::find("pile", &["n=27".into()]).expect("a scene of the catalogue")
}

/// A step of the pile on the floor.
fn lying() -> (StepProblem, StepPlan) {
    let scene = pile();
    let mut simulation =
        Simulation::with(scene.world, SolverConfig::default().without_sleep(), reference()).expect("good settings");
    for _ in 0..40 {
        simulation.step(scene.dt).expect("the reference runs");
    }
    simulation.next_problem(scene.dt).expect("a step")
}

#[test]
fn two_equal_backends_have_no_first_difference() {
    let (problem, plan) = lying();
    assert_eq!(first_difference(&problem, &plan, &mut [reference(), reference()]).expect("both run"), None);
}

/// One impulse is one percent off.
fn perturb(problem: &mut StepProblem) {
    let largest = problem.impulses.iter_mut().max_by(|a, b| a.normal.total_cmp(&b.normal));
    largest.expect("the boxes touch").normal *= 1.01;
}

#[test]
fn the_pass_that_goes_wrong_is_found_whichever_it_is() {
    let (problem, plan) = lying();
    for pass in 0..plan.passes.len() {
        for fault in [Fault::Dropped, Fault::Spoiled(perturb)] {
            let mut backends: [Box<dyn Backend>; 2] = [reference(), Box::new(Faulty { fault, pass })];
            let found = first_difference(&problem, &plan, &mut backends).expect("both run");
            assert_eq!(found, Some(pass), "{fault:?}, {}", plan.passes[pass].kernel);
        }
    }
}

#[test]
fn whatever_a_backend_gives_back_is_compared() {
    let (mut problem, mut plan) = lying();
    // A joint that no pass goes over.
    problem.joints.push(JointRow { body_a: 30, body_b: 31, ..JointRow::default() });
    problem.joint_impulses.push(JointImpulseRow::default());
    problem.joint_totals.push(JointImpulseRow::default());
    problem.params.joint_count = 1;
    let contacts = problem.rows_of(&problem.contact_colors()).to_vec();
    let colors = problem.contact_colors().len();
    problem.order = contacts.into_iter().chain([0]).collect();
    problem.colors.truncate(colors + 1);
    problem.colors.push(problem.order.len() as u32);
    let block = problem.blocks[0];
    problem.in_one_block(colors as u32, block.substep);
    // The colors of the bodies, and those after them, stand after the new one.
    for pass in plan.passes.iter_mut().filter(|pass| pass.kernel.has_one_color()) {
        pass.colors = pass.colors.start + 1..pass.colors.end + 1;
    }
    let spoils: [fn(&mut StepProblem); 6] = [
        |problem| problem.bodies[3].dq[2] = problem.bodies[3].dq[2].next_up(),
        |problem| problem.impulses[0].bounce = problem.impulses[0].bounce.next_up(),
        |problem| problem.joint_impulses[0].linear[1] = -0.0,
        |problem| problem.joint_totals[0].linear[1] = -0.0,
        |problem| problem.convergence.sweeps += 1,
        |problem| problem.momentum.restarts += 1,
    ];
    let last = plan.passes.len() - 1;
    for spoil in spoils {
        let faulty = Box::new(Faulty { fault: Fault::Spoiled(spoil), pass: last });
        let found = first_difference(&problem, &plan, &mut [reference(), faulty]).expect("both run");
        assert_eq!(found, Some(last));
    }
}

#[test]
fn a_comparison_names_the_step_the_pass_and_the_kernel() {
    // The first pass of each step adds gravity, which every box feels in the first step already.
    let mut open = |which| -> Result<Box<dyn Backend>> {
        Ok(if which == 0 { reference() } else { Box::new(Faulty { fault: Fault::Dropped, pass: 0 }) })
    };
    let mut finished = 0;
    let scene = pile();
    let found =
        compare(&scene, &SolverConfig::default().without_sleep(), &mut open, 3, || finished += 1).expect("both run");
    assert_eq!((finished, found.steps.len()), (3, 3));
    assert_eq!(found.steps[0].bodies, scene.world.dynamic_count());
    let first = found.first.expect("a difference");
    assert!(matches!(&first.stage, Stage::Pass { pass: 0, kernel, .. } if kernel == "integrate_velocities"), "{first}");
    assert_eq!(first.step, 1);
}

/// A reference that sees a body somewhere else, but only in its first run: what differs once and never again.
struct Once(bool);

impl Backend for Once {
    fn name(&self) -> &'static str {
        "once"
    }

    fn adapter(&self) -> String {
        "a fault that does not appear again".into()
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        if std::mem::take(&mut self.0) {
            problem.bodies.last_mut().expect("a box").v[0] += 1.0;
        }
        Reference::<f32>::new().run(problem, passes)
    }
}

/// Bits that depended on the number of threads were reported as "no difference in any bit", since no pass makes them.
#[test]
fn a_difference_that_no_pass_makes_is_still_a_difference() {
    let (mut opened, scene) = (0, pile());
    let mut open = |which| -> Result<Box<dyn Backend>> {
        opened += 1;
        Ok(if which == 0 { reference() } else { Box::new(Once(opened == 2)) })
    };
    let found = compare(&scene, &SolverConfig::default().without_sleep(), &mut open, 3, || ()).expect("both run");
    let first = found.first.clone().expect("a difference");
    let last = scene.world.bodies.handle(scene.world.bodies.len() - 1);
    let values = [first.body.values[0], first.body.values[0] + 1.0 / 60.0];
    let body = BodyDifference { bodies: [last; 2], quantity: "position.x", values: [values[0], first.body.values[1]] };
    assert_eq!(first, FirstDifference { step: 1, body, stage: Stage::NotRepeated { not_repeated: true } });
    assert!((first.body.values[1] - values[1]).abs() < 1e-5, "{first}");
    assert_eq!((found.steps[0].bodies, found.differing_steps()), (1, 3));
}

/// A reference that turns a body by a last bit in one step and takes it back in a later one.
struct Healing(u32);

impl Backend for Healing {
    fn name(&self) -> &'static str {
        "healing"
    }

    fn adapter(&self) -> String {
        "a fault that heals".into()
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        self.0 += 1;
        Reference::<f32>::new().run(problem, passes)?;
        let v = &mut problem.bodies[1].v[2];
        match self.0 {
            3 => *v += 0.5,
            20 => *v -= 0.5,
            _ => {}
        }
        Ok(())
    }
}

#[test]
fn a_difference_that_heals_is_still_told_with_its_step_its_body_and_both_values() {
    use drystone::{Body, Shape, World};
    let mut world = World::new();
    world.gravity = drystone::glam::Vec3::ZERO;
    world.insert(Body::fixed().shape(Shape::ball(1.0)).position(9.0, 0.0, 0.0));
    // So far away that half a meter a second for seventeen steps is less than a last bit of the position.
    let body = Some(world.insert(Body::dynamic().shape(Shape::ball(1.0)).position(0.0, 0.0, 1e9)));
    let scene = Scene { world, ..pile() };
    let mut open =
        |which| -> Result<Box<dyn Backend>> { Ok(if which == 0 { reference() } else { Box::new(Healing(0)) }) };
    let found = compare(&scene, &SolverConfig::default().without_sleep(), &mut open, 50, || ()).expect("both run");
    assert_eq!(found.steps[49], Difference::default(), "the difference healed");
    assert_eq!(found.differing_steps(), 17);
    let first = found.first.expect("a difference");
    assert_eq!(first.step, 3);
    assert_eq!(first.body, BodyDifference { bodies: [body; 2], quantity: "velocity.z", values: [0.0, 0.5] });
    assert!(first.to_string().starts_with("step 3, body 1, velocity.z: 0.0 and 0.5; "), "{first}");
}

#[test]
fn a_body_that_is_in_one_world_only_differs() {
    let world = pile().world;
    let mut fewer = world.clone();
    let gone = fewer.bodies.handle(7).expect("a box");
    fewer.remove(gone);
    let mut more = world.clone();
    more.insert(drystone::Body::dynamic().shape(drystone::Shape::ball(1.0)));
    for (other, body, values) in [(&fewer, 7, [1.0, 0.0]), (&more, world.bodies.len(), [0.0, 1.0])] {
        assert_eq!(Difference::between(&world, other).bodies, 1);
        let bodies = [&world, other].map(|world| world.bodies.handle(body));
        let first = BodyDifference { bodies, quantity: "presence", values };
        assert_eq!(BodyDifference::first(&world, other), Some(first));
    }
    assert_eq!(BodyDifference::first(&world, &world), None);
}

/// A backend that leaves impulses behind which the next step begins with, but bodies as they should be.
struct Hidden;

impl Backend for Hidden {
    fn name(&self) -> &'static str {
        "hidden"
    }

    fn adapter(&self) -> String {
        "a fault in what the next step begins with".into()
    }

    fn run_checked(&mut self, step: CheckedStep) -> Result<()> {
        let (problem, passes) = step.into_parts();
        Reference::<f32>::new().run(problem, passes)?;
        problem.impulses.iter_mut().for_each(|impulse| impulse.normal *= 1.01);
        Ok(())
    }
}

#[test]
fn rows_that_differ_before_the_first_pass_are_named() {
    let mut open = |which| -> Result<Box<dyn Backend>> { Ok(if which == 0 { reference() } else { Box::new(Hidden) }) };
    let found = compare(&pile(), &SolverConfig::default().without_sleep(), &mut open, 40, || ()).expect("both run");
    let first = found.first.expect("a difference");
    assert_eq!(first.stage, Stage::Rows { rows: "contacts" }, "preloads follow from impulses");
    let ending = "; before the first pass: contacts of the problem";
    assert_eq!(first.to_string(), format!("step {}, {}{ending}", first.step, first.body));
}

#[test]
fn equal_backends_agree_in_every_bit_of_every_step() {
    let found = compare(&pile(), &SolverConfig::default().without_sleep(), &mut |_| Ok(reference()), 50, || ())
        .expect("both run");
    assert!(found.steps.iter().all(|d| *d == Difference::default()));
    assert_eq!(found.first, None);
}

#[test]
fn one_bit_of_one_number_makes_a_body_differ() {
    let world = pile().world;
    let changed = |change: &dyn Fn(&mut drystone::Body)| {
        let mut other = world.clone();
        change(&mut other.bodies[7]);
        Difference::between(&world, &other)
    };
    assert_eq!(changed(&|_| ()), Difference::default());
    assert_eq!(changed(&|b| b.angular_velocity.z = f32::from_bits(1)).bodies, 1);
    assert_eq!(changed(&|b| b.position.x = b.position.x.next_up()).bodies, 1);
    let lost = changed(&|b| b.linear_velocity.y = f32::NAN);
    assert_eq!((lost.bodies, lost.velocity), (1, f64::INFINITY));
}

#[test]
fn each_number_of_a_difference_is_of_its_own_quantity() {
    let world = pile().world;
    let changed = |change: &dyn Fn(&mut drystone::Body)| {
        let mut other = world.clone();
        change(&mut other.bodies[7]);
        Difference::between(&world, &other)
    };
    let none = Difference { bodies: 1, ..Difference::default() };
    let position = changed(&|b| b.position.y += 4.0);
    assert!((position.position - 4.0).abs() < 1e-5, "{position:?}");
    assert_eq!(position, Difference { position: position.position, ..none });
    let rotation = changed(&|b| b.rotation.y += 0.5);
    assert!((rotation.rotation - 0.5).abs() < 1e-6, "{rotation:?}");
    assert_eq!(rotation, Difference { rotation: rotation.rotation, ..none });
    assert_eq!(changed(&|b| b.linear_velocity.z = -2.0), Difference { velocity: 2.0, ..none });
    assert_eq!(changed(&|b| b.angular_velocity.x = 0.25), Difference { angular_velocity: 0.25, ..none });
}

//! Compares two backends on the same scene, step by step: the size of their difference, and its first place.
//!
//! ```
//! use drystone::{Backend, Cpu, Reference, Result, Simulation, SolverConfig};
//! use drystone_conform::compare::{BodyDifference, Comparison, Difference, FirstDifference, Stage};
//! use drystone_conform::compare::{compare, first_difference};
//! use drystone_scenes::Scene;
//!
//! let scene = Scene::find("tower", &["n=3".into()])?;
//! let config = SolverConfig::default();
//! let mut open = |which: usize| -> Result<Box<dyn Backend>> {
//!     Ok(if which == 0 { Box::new(Cpu::new()) } else { Box::new(Reference::<f32>::new()) })
//! };
//! let comparison: Comparison = compare(&scene, &config, &mut open, 10, || {})?;
//! assert_eq!((comparison.steps.len(), comparison.differing_steps(), comparison.first), (10, 0, None));
//! let mut backends = [open(0)?, open(1)?];
//! let (problem, plan) = Simulation::with(scene.world.clone(), config, open(0)?)?.next_problem(scene.dt)?;
//! assert_eq!(first_difference(&problem, &plan, &mut backends)?, None);
//! // A body that one world has elsewhere.
//! let mut moved = scene.world.clone();
//! moved.bodies[1].position.x = 0.5;
//! let difference = Difference::between(&scene.world, &moved);
//! assert_eq!((difference.bodies, difference.position), (1, 0.5));
//! let body = BodyDifference::first(&scene.world, &moved).expect("a difference");
//! let first = FirstDifference { step: 1, body, stage: Stage::Rows { rows: "bodies" } };
//! let line = "step 1, body 1, position.x: 0.0 and 0.5; before the first pass: bodies of the problem";
//! assert_eq!(first.to_string(), line);
//! # Ok::<(), drystone::Error>(())
//! ```

use drystone::stages::plan::Pass;
use drystone::stages::plan::StepPlan;
use drystone::stages::problem::JointSystems;
use drystone::stages::problem::StepProblem;
use drystone::{Backend, Body, BodyHandle, Error, Result, Simulation, SolverConfig, World};
use drystone_scenes::{Scene, Spawners};

/// The difference between two worlds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Difference {
    /// Number of bodies with any bit that differs.
    pub bodies: usize,
    /// Largest difference of a coordinate of a position (m).
    pub position: f64,
    /// Largest difference of a component of a rotation.
    pub rotation: f64,
    /// Largest difference of a component of a velocity (m/s).
    pub velocity: f64,
    /// Largest difference of a component of an angular velocity (rad/s).
    pub angular_velocity: f64,
}

impl Difference {
    /// The difference between two worlds. NaN on one side only counts as an infinite difference. A body in only one of
    /// the worlds differs.
    pub fn between(a: &World, b: &World) -> Self {
        let mut all = Self::default();
        for (i, (body_a, body_b)) in a.bodies.iter().zip(&b.bodies).enumerate() {
            let mut differs = a.bodies.handle(i) != b.bodies.handle(i);
            for (k, (x, y)) in numbers(body_a).into_iter().zip(numbers(body_b)).enumerate() {
                differs |= x.to_bits() != y.to_bits();
                let largest = match k {
                    0..3 => &mut all.position,
                    3..7 => &mut all.rotation,
                    7..10 => &mut all.velocity,
                    _ => &mut all.angular_velocity,
                };
                *largest = largest.max(distance(x, y));
            }
            all.bodies += usize::from(differs);
        }
        all.bodies += a.bodies.len().abs_diff(b.bodies.len());
        all
    }
}

/// Pose and velocities of a body, in the order of [`QUANTITIES`].
fn numbers(body: &Body) -> [f32; 13] {
    let mut all = [0.0; 13];
    let parts: [&[f32]; 4] = [
        &body.position.to_array(),
        &body.rotation.to_array(),
        &body.linear_velocity.to_array(),
        &body.angular_velocity.to_array(),
    ];
    all.iter_mut().zip(parts.concat()).for_each(|(number, part)| *number = part);
    all
}

/// The names of the numbers of a body.
const QUANTITIES: [&str; 13] = [
    "position.x",
    "position.y",
    "position.z",
    "rotation.x",
    "rotation.y",
    "rotation.z",
    "rotation.w",
    "velocity.x",
    "velocity.y",
    "velocity.z",
    "angular velocity.x",
    "angular velocity.y",
    "angular velocity.z",
];

/// A number of a body that differs between two worlds.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct BodyDifference {
    /// The body in each world. Written as their indices.
    pub bodies: [Option<BodyHandle>; 2],
    /// The name of the number, for example `position.x`. It is `presence` if the body is in only one world, or if
    /// another body has its index.
    pub quantity: &'static str,
    /// The number in each world. For `presence` it is 1 if a body has this index, and 0 if none has.
    pub values: [f32; 2],
}

impl BodyDifference {
    /// The index of the body, in the world that has it.
    pub fn index(&self) -> usize {
        self.bodies[0].or(self.bodies[1]).map_or(0, BodyHandle::index)
    }

    /// The first number of the first body that differs in any bit.
    pub fn first(a: &World, b: &World) -> Option<Self> {
        let all = 0..a.bodies.len().max(b.bodies.len());
        all.into_iter().find_map(|body| {
            let bodies = [a, b].map(|world| world.bodies.handle(body));
            if bodies[0] != bodies[1] {
                let values = bodies.map(|body| f32::from(u8::from(body.is_some())));
                return Some(Self { bodies, quantity: "presence", values });
            }
            let (x, y) = (numbers(a.bodies.get(body)?), numbers(b.bodies.get(body)?));
            let k = x.iter().zip(&y).position(|(x, y)| x.to_bits() != y.to_bits())?;
            Some(Self { bodies, quantity: QUANTITIES[k], values: [x[k], y[k]] })
        })
    }
}

impl std::fmt::Display for BodyDifference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y] = self.values;
        write!(f, "body {}, {}: {x:?} and {y:?}", self.index(), self.quantity)
    }
}

fn distance(x: f32, y: f32) -> f64 {
    let d = (f64::from(x) - f64::from(y)).abs();
    if d.is_nan() && x.to_bits() != y.to_bits() {
        f64::INFINITY
    } else if d.is_nan() {
        0.0
    } else {
        d
    }
}

/// The first place at which two backends disagree.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FirstDifference {
    /// Number of the step, from 1.
    pub step: u32,
    /// The first number that differs after that step.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub body: BodyDifference,
    /// The stage of that step.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub stage: Stage,
}

/// The first stage of a step with different results.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
pub enum Stage {
    /// Before the first pass: the backends got different rows.
    Rows {
        /// The field of the problem.
        rows: &'static str,
    },
    /// A pass that got the same rows on both backends.
    Pass {
        /// Index of the pass in the plan of the step, from 0.
        pass: usize,
        /// Number of passes in the plan.
        passes: usize,
        /// Name of the kernel.
        kernel: String,
    },
    /// The difference did not appear when the run was repeated: the same input gives different bits.
    NotRepeated {
        /// Always true.
        not_repeated: bool,
    },
}

impl std::fmt::Display for FirstDifference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "step {}, {}; ", self.step, self.body)?;
        match &self.stage {
            Stage::Rows { rows } => write!(f, "before the first pass: {rows} of the problem"),
            Stage::Pass { pass, passes, kernel } => write!(f, "pass {pass} of {passes}, {kernel}"),
            Stage::NotRepeated { .. } => {
                write!(f, "the difference did not appear again: the same input gives different bits")
            }
        }
    }
}

/// The result of a comparison of every step.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Comparison {
    /// The difference after each step.
    pub steps: Vec<Difference>,
    /// The first place of a difference, if there was one. It remains even if later steps have no difference.
    pub first: Option<FirstDifference>,
}

impl Comparison {
    /// Number of steps after which any bit differs.
    pub fn differing_steps(&self) -> usize {
        self.steps.iter().filter(|step| step.bodies > 0).count()
    }
}

/// Runs `scene` on two backends for `steps` steps. Each backend continues from its own results. Calls `after_step`
/// after each step.
///
/// # Errors
/// A backend cannot run, or loses its device.
pub fn compare(
    scene: &Scene,
    config: &SolverConfig,
    open: &mut dyn FnMut(usize) -> Result<Box<dyn Backend>>,
    steps: u32,
    mut after_step: impl FnMut(),
) -> Result<Comparison> {
    let mut simulations = [
        Simulation::with(scene.world.clone(), config.clone(), open(0)?)?,
        Simulation::with(scene.world.clone(), config.clone(), open(1)?)?,
    ];
    let mut spawners = [Spawners::new(scene), Spawners::new(scene)];
    let (mut comparison, mut first) = (Comparison::default(), None);
    for _ in 0..steps {
        for (simulation, spawners) in simulations.iter_mut().zip(&mut spawners) {
            spawners.before_step(&mut simulation.world, scene.dt);
            // After a fault, another backend would be compared.
            if let Some(fault) = simulation.step(scene.dt)?.fault {
                return Err(Error::Lost(fault));
            }
        }
        let [a, b] = [&simulations[0].world, &simulations[1].world];
        first = first.or_else(|| Some((comparison.steps.len(), BodyDifference::first(a, b)?)));
        comparison.steps.push(Difference::between(a, b));
        after_step();
    }
    if let Some((step, body)) = first {
        let stage = first_stage(scene, config, open, step)?;
        comparison.first = Some(FirstDifference { step: step as u32 + 1, body, stage });
    }
    Ok(comparison)
}

/// The first stage at which two backends differ in the step after `before` other steps, on new simulations.
fn first_stage(
    scene: &Scene,
    config: &SolverConfig,
    open: &mut dyn FnMut(usize) -> Result<Box<dyn Backend>>,
    before: usize,
) -> Result<Stage> {
    let mut assembled = |which: usize| -> Result<(StepProblem, StepPlan)> {
        let mut simulation = Simulation::with(scene.world.clone(), config.clone(), open(which)?)?;
        let mut spawners = Spawners::new(scene);
        for _ in 0..before {
            spawners.before_step(&mut simulation.world, scene.dt);
            simulation.step(scene.dt)?;
        }
        spawners.before_step(&mut simulation.world, scene.dt);
        simulation.next_problem(scene.dt)
    };
    let [(problem, plan), (other, other_plan)] = [assembled(0)?, assembled(1)?];
    if let Some(rows) = first_rows(&problem, &other) {
        return Ok(Stage::Rows { rows });
    }
    if plan != other_plan {
        return Ok(Stage::Rows { rows: "plan" });
    }
    let mut backends = [open(0)?, open(1)?];
    Ok(match first_difference(&problem, &plan, &mut backends)? {
        Some(pass) => Stage::Pass { pass, passes: plan.passes.len(), kernel: plan.passes[pass].kernel.to_string() },
        None => Stage::NotRepeated { not_repeated: true },
    })
}

/// The first field of two problems that differs in any bit.
fn first_rows(a: &StepProblem, b: &StepProblem) -> Option<&'static str> {
    fields(a).into_iter().zip(fields(b)).find(|(a, b)| a.1 != b.1).map(|(a, _)| a.0)
}

/// All fields of a problem, as bytes.
fn fields(problem: &StepProblem) -> [(&'static str, &[u8]); 26] {
    // This pattern makes a new field a compile error until it is listed here.
    let StepProblem {
        params,
        bodies,
        masses,
        torques,
        dampings,
        inertias,
        contacts,
        points,
        impulses,
        totals,
        sags,
        order,
        colors,
        blocks,
        systems: JointSystems { begins, softness, nodes, blocks: system_blocks, terms },
        turning,
        joints,
        axes,
        joint_impulses,
        joint_totals,
        convergence,
        momentum,
    } = problem;
    [
        ("params", bytemuck::bytes_of(params)),
        ("bodies", bytemuck::cast_slice(bodies)),
        ("masses", bytemuck::cast_slice(masses)),
        ("torques", bytemuck::cast_slice(torques)),
        ("dampings", bytemuck::cast_slice(dampings)),
        ("inertias", bytemuck::cast_slice(inertias)),
        ("contacts", bytemuck::cast_slice(contacts)),
        ("points", bytemuck::cast_slice(points)),
        ("impulses", bytemuck::cast_slice(impulses)),
        ("totals", bytemuck::cast_slice(totals)),
        ("sags", bytemuck::cast_slice(sags)),
        ("order", bytemuck::cast_slice(order)),
        ("colors", bytemuck::cast_slice(colors)),
        ("blocks", bytemuck::cast_slice(blocks)),
        ("systems.begins", bytemuck::cast_slice(begins)),
        ("systems.softness", bytemuck::cast_slice(softness)),
        ("systems.nodes", bytemuck::cast_slice(nodes)),
        ("systems.blocks", bytemuck::cast_slice(system_blocks)),
        ("systems.terms", bytemuck::cast_slice(terms)),
        ("turning", bytemuck::cast_slice(turning)),
        ("joints", bytemuck::cast_slice(joints)),
        ("axes", bytemuck::cast_slice(axes)),
        ("joint_impulses", bytemuck::cast_slice(joint_impulses)),
        ("joint_totals", bytemuck::cast_slice(joint_totals)),
        ("convergence", bytemuck::bytes_of(convergence)),
        ("momentum", bytemuck::bytes_of(momentum)),
    ]
}

/// The first pass after which the results of two backends for `problem` differ in any bit, by bisection.
///
/// # Errors
/// A backend cannot run.
pub fn first_difference(
    problem: &StepProblem,
    plan: &StepPlan,
    backends: &mut [Box<dyn Backend>; 2],
) -> Result<Option<usize>> {
    let mut agree_after = |passes: &[Pass]| -> Result<bool> {
        let mut results = [problem.clone(), problem.clone()];
        for (result, backend) in results.iter_mut().zip(backends.iter_mut()) {
            backend.run(result, passes)?;
        }
        let [a, b] = results;
        Ok(first_rows(&a, &b).is_none())
    };
    if agree_after(&plan.passes)? {
        return Ok(None);
    }
    // They agree after the first `good` passes and disagree after the first `bad`.
    let (mut good, mut bad) = (0, plan.passes.len());
    while bad - good > 1 {
        let middle = (good + bad) / 2;
        if agree_after(&plan.passes[..middle])? { good = middle } else { bad = middle }
    }
    Ok(Some(bad - 1))
}

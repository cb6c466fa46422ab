//! Steps of a simulation with their contact problems and residuals.

use drystone::stages::plan::StepPlan;
use drystone::stages::plan::{Kernel, Pass};
use drystone::stages::problem::ContactRow;
use drystone::stages::problem::StepProblem;
use drystone::{Backend, Body, Error, Reference, Result, Simulation, StepStats};

use crate::contacts::ContactProblem;
use crate::residuals::Residuals;

/// Advances the world by `dt` seconds, and returns the contact problem that the first substep solved:
/// [`ContactProblem::of_step`]. The problem has no contacts if no awake body touches another.
///
/// ```
/// # use drystone::{Body, Shape, Simulation, World};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
/// let mut simulation = Simulation::new(world)?;
/// let (problem, _) = drystone_problems::step_with_contacts(&mut simulation, "a ball", 1.0 / 60.0)?;
/// assert_eq!((problem.name.as_str(), problem.contacts.len()), ("a ball", 1));
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// # Errors
/// Those of [`Simulation::step`]; or the world has joints or locked axes, which a contact problem cannot have.
pub fn step_with_contacts(simulation: &mut Simulation, name: &str, dt: f32) -> Result<(ContactProblem, StepStats)> {
    check(simulation, name)?;
    let (problem, plan) = simulation.next_problem(dt)?;
    step(simulation, name, dt, problem, &plan)
}

/// Advances the world by `dt` seconds, and returns the residuals of the impulses after the first substep. [`Reference`]
/// computes that substep a second time. The residuals are zero if no awake body touches another.
///
/// ```
/// # use drystone::{Body, Shape, Simulation, World};
/// # let mut world = World::new();
/// # world.insert(Body::fixed().shape(Shape::half_space(glam::Vec3::Y)));
/// # world.insert(Body::dynamic().shape(Shape::ball(0.5)).position(0.0, 0.5, 0.0));
/// let mut simulation = Simulation::new(world)?;
/// assert!(drystone_problems::step_with_residuals(&mut simulation, 1.0 / 60.0)?.e_vel < 1e-3);
/// # Ok::<(), drystone::Error>(())
/// ```
///
/// # Errors
/// Those of [`step_with_contacts`].
pub fn step_with_residuals(simulation: &mut Simulation, dt: f32) -> Result<Residuals> {
    const NAME: &str = "the world";
    check(simulation, NAME)?;
    let (begun, plan) = simulation.next_problem(dt)?;
    let mut problem = begun.clone();
    let begins = |p: &Pass| matches!(p.kernel, Kernel::IntegrateVelocities { .. });
    let end = plan.passes.iter().skip(1).position(begins).map_or(plan.passes.len(), |i| i + 1);
    Reference::<f32>::new().run(&mut problem, &plan.passes[..end])?;
    let of_contact = |row: &ContactRow| {
        let own = row.first_point as usize..(row.first_point + row.point_count) as usize;
        problem.impulses[own].iter().map(|i| glam::Vec3::new(i.normal, i.tangent_1, i.tangent_2).as_dvec3())
    };
    let mut impulses: Vec<_> = problem.swept_contacts().flat_map(of_contact).collect();
    let (contacts, _) = step(simulation, NAME, dt, begun, &plan)?;
    // A step in which all bodies sleep has no impulses.
    impulses.truncate(contacts.contacts.len());
    Ok(Residuals::of(&contacts, &impulses))
}

/// Refuses a world with constraints that a contact problem cannot have.
fn check(simulation: &Simulation, name: &str) -> Result<()> {
    let world = &simulation.world;
    if !world.joints.is_empty() {
        let joints = world.joints.len();
        return Err(Error::input(format!("{name} has {joints} joints: a contact problem cannot have joints")));
    }
    if let Some(i) = world.bodies.iter().position(Body::has_locked_axis) {
        let name = &world.bodies[i].name;
        return Err(Error::input(format!(
            "body {i} {name:?} has locked axes: a contact problem cannot have locked axes"
        )));
    }
    Ok(())
}

/// Makes the step that begins with `problem` and `plan`.
fn step(
    simulation: &mut Simulation,
    name: &str,
    dt: f32,
    mut problem: StepProblem,
    plan: &StepPlan,
) -> Result<(ContactProblem, StepStats)> {
    use Kernel::{
        BeginChanges, DampVelocities, EndChanges, IntegrateGyroscopic, IntegrateTorques, IntegrateVelocities,
    };
    let stats = simulation.step(dt)?;
    // No plan ran: all bodies sleep.
    if stats.dispatches == 0 {
        return Ok((ContactProblem { name: name.into(), ..ContactProblem::default() }, stats));
    }
    let forces = |p: &&Pass| {
        let Pass { kernel, .. } = p;
        matches!(
            kernel,
            BeginChanges
                | IntegrateVelocities { .. }
                | IntegrateTorques { .. }
                | DampVelocities { .. }
                | IntegrateGyroscopic { .. }
        )
    };
    let blocks = plan.passes.chunk_by(|p, q| p.block == q.block);
    let first: Vec<_> = blocks
        .flat_map(|own| own.iter().take_while(forces).chain(own.iter().filter(|p| p.kernel == EndChanges)))
        .cloned()
        .collect();
    Reference::<f32>::new().run(&mut problem, &first)?;
    Ok((ContactProblem::of_step(name.into(), &problem), stats))
}

//! What lasts from step to step on this side of the backend, and the stages that a step goes through before and after it.

use crate::collide::Detector;
use crate::config::SolverConfig;
use crate::error::Result;
use crate::graph::ConstraintGraph;
use crate::plan::{PlanKey, StepPlan};
use crate::problem::{Prepared, StepProblem};
use crate::sleep::Sleep;
use crate::stats::{StepStats, timed};
use crate::world::{MassProperties, Material, World};

/// Everything that a step leaves to the next one, but for what a device keeps.
#[derive(Clone)]
pub(super) struct Stages {
    pub detector: Detector,
    pub sleep: Sleep,
    /// What the rows of contacts were written for, body by body.
    surfaces: Vec<(MassProperties, Material)>,
    graph: ConstraintGraph,
    joint_graph: ConstraintGraph,
    pub prepared: Prepared,
    pub problem: StepProblem,
    pub plan: StepPlan,
    /// What the plan was made for.
    plan_key: PlanKey,
}

/// What the caller changed since the last step, as far as something that lasts between steps follows from it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Changes {
    /// Masses or materials.
    surfaces: bool,
    joints: bool,
    /// The length of a substep or the stiffness of contacts.
    step: bool,
    /// Whether the rows of contacts change with it, so that a device cannot go on from those that it has.
    pub rows: bool,
}

impl Stages {
    pub fn new(world: &World, config: &SolverConfig) -> Self {
        Self {
            detector: Detector::new(world),
            sleep: Sleep::new(world, config),
            surfaces: world.bodies.iter().map(|b| (b.mass, b.material)).collect(),
            graph: ConstraintGraph::default(),
            joint_graph: ConstraintGraph::default(),
            prepared: Prepared::default(),
            problem: StepProblem::default(),
            plan: StepPlan::default(),
            plan_key: PlanKey::default(),
        }
    }

    /// What the caller changed since the last step.
    ///
    /// # Errors
    /// Bodies came, went, or changed kind or shape; a joint or a mass is not fit to be simulated.
    pub fn changes(&self, world: &World, config: &SolverConfig, dt: f32) -> Result<Changes> {
        self.detector.check_bodies(world)?;
        let surfaces = world.bodies.iter().zip(&self.surfaces).any(|(b, known)| (b.mass, b.material) != *known);
        let joints = self.prepared.joints() != world.joints;
        world.check_gravity()?;
        if surfaces {
            world.check_surfaces()?;
        }
        if joints {
            world.check_joints()?;
        }
        let step = self.prepared.is_step_new(config, dt);
        Ok(Changes { surfaces, joints, step, rows: surfaces || step })
    }

    /// Brings all that lasts to what the caller changed.
    pub fn follow(&mut self, world: &World, config: &SolverConfig, dt: f32, changes: Changes) {
        if changes.surfaces {
            for (i, (known, body)) in self.surfaces.iter_mut().zip(&world.bodies).enumerate() {
                if *known != (body.mass, body.material) {
                    *known = (body.mass, body.material);
                    self.sleep.disturb(i);
                }
            }
            self.forget_layout();
        }
        if changes.joints {
            for joint in self.prepared.follow_joints(world) {
                self.sleep.disturb(joint.body_a);
                joint.body_b.iter().for_each(|&b| self.sleep.disturb(b));
            }
            self.detector.follow_joints(world);
        }
        if changes.step {
            self.prepared.change_step(world, config, dt, &mut self.problem, &mut self.detector);
        }
    }

    /// Takes over other settings.
    pub fn change_settings(&mut self, world: &World, before: &SolverConfig, now: &SolverConfig) {
        self.forget_layout();
        if before.friction_at != now.friction_at {
            // The other kind of friction begins without impulses.
            self.detector.pairs_mut().flatten().flat_map(|p| &mut p.manifolds).for_each(|m| m.forget_friction());
        }
        self.prepared.forget_joint_colors();
        self.sleep.change_settings(world, before, now);
    }

    /// Brings impulses, preloads and colors back to the manifolds, so that the next step writes all rows anew.
    fn forget_layout(&mut self) {
        self.prepared.give_all_back(&self.problem, &mut self.detector);
        self.plan_key = PlanKey::default();
    }

    /// Wakes what was changed; whether there is nothing to do in this step.
    pub fn is_everything_still(&mut self, world: &World, stats: &mut StepStats) -> bool {
        timed(&mut stats.times.detect, || self.sleep.before_step(world, &self.detector));
        stats.asleep = self.sleep.count();
        self.sleep.is_everything_still()
    }

    /// Detects, colors, prepares and plans. `on_device`: the device goes on from its own rows.
    pub fn assemble(&mut self, world: &World, config: &SolverConfig, dt: f32, on_device: bool, stats: &mut StepStats) {
        let Self { detector, sleep, prepared, problem, .. } = self;
        let times = &mut stats.times;
        let found = timed(&mut times.detect, || {
            let give_back = |pair: &mut _| prepared.give_back(problem, pair);
            let mut found = detector.detect(world, config, dt, sleep.activity(), &give_back);
            // A body that wakes takes part in this step already.
            while sleep.wake_touched(detector) {
                let reshaped = found.reshaped;
                found = detector.detect(world, config, dt, sleep.activity(), &give_back);
                found.reshaped |= reshaped;
            }
            found
        });
        timed(&mut times.color, || {
            prepared.color(world, detector, &mut self.graph, config.max_colors);
            prepared.color_joints(world, &mut self.joint_graph, config.max_colors);
        });
        timed(&mut times.prepare, || {
            prepared.carry.on_device = on_device;
            prepared.prepare(world, sleep.asleep(), detector, config, dt, problem);
            let contacts_changed = found.computed > 0 || found.reshaped;
            if self.plan_key.update(problem, contacts_changed) {
                self.plan = StepPlan::new(config, problem);
            }
        });
        stats.pairs = found.pairs;
        stats.computed = found.computed;
        stats.manifolds = problem.contacts.len();
        stats.points = problem.point_count(0..stats.manifolds);
        stats.joints = problem.joints.len();
        stats.colors = prepared.coloring.color_count();
        stats.overflow = prepared.coloring.overflow as usize;
        stats.dispatches = self.plan.passes.len();
        stats.bytes_moved = self.plan.bytes_moved(problem);
    }

    /// Brings poses and velocities to the world; whether any body fell asleep.
    pub fn store(&mut self, world: &mut World, dt: f32) -> bool {
        self.prepared.store(&self.problem, self.sleep.asleep(), world);
        self.sleep.after_step(world, &self.detector, dt)
    }
}

//! All state that lasts from step to step, except the copy on a device. It has the stages of a step before and after
//! the backend.

use glam::Vec3;
use rayon::prelude::*;

use super::by_body::ByBody;
use super::events::{ColliderOf, Event, Events, Hit, Met};
use super::hooks::ContactHooks;
use crate::collide::{Activity, ColliderSide, DetectStats, Detector, PairFilter};
use crate::config::{FrictionAt, FrictionRule, JointSolver, SolverConfig};
use crate::effort::{Effort, Interface};
use crate::energy::{Energy, Taken};
use crate::error::{Result, ensure};
use crate::openings::openings;
use crate::panics::blaming;
use crate::plan::{PlanKey, StepPlan};
use crate::problem::{
    self, Approach, ColliderPair, ContactRows, ContactSummary, JointRow, JointRows, StepProblem, StepScale,
};
use crate::rest;
use crate::saved::{Archive, Saved};
use crate::sleep::Sleep;
use crate::stats::{EFFORT_CLASSES, StepStats, timed};
use crate::world::{Body, BodyKind, JointHandle, Surface, World};

/// Everything that a step passes to the next one, except the data on a device.
#[derive(Default)]
pub(super) struct Stages {
    pub detector: Detector,
    pub sleep: Sleep,
    pub effort: Effort,
    energy: Energy,
    /// The result of the detection of this step.
    found: DetectStats,
    key: Key,
    pub contacts: ContactRows,
    pub joints: JointRows,
    pub problem: StepProblem,
    pub plan: StepPlan,
    pub events: Events,
    /// The contacts of each body, if a caller listens.
    pub by_body: ByBody,
    /// The key of the plan, or `None` if the next step has to build a plan.
    plan_key: Option<PlanKey>,
    /// The bodies that a surface threw in the last step.
    thrown: Vec<bool>,
    /// Number of active contact points, and bytes that the plan moves.
    points: usize,
    bytes_moved: u64,
    /// Bodies that the last step moved out of range, in ascending order. They touch nothing, and do not make the next
    /// step fail.
    pub astray: Vec<usize>,
    /// Whether some rows still come from loaded bytes and were not part of a step since. Anyone can compute the hash of
    /// forged bytes.
    pub is_foreign: bool,
}

crate::saved::cloned!(Stages {
    detector,
    sleep,
    effort,
    energy,
    found,
    key,
    contacts,
    joints,
    problem,
    plan,
    events,
    by_body,
    plan_key,
    points,
    bytes_moved,
    astray,
    is_foreign,
} scratch {
    thrown,
});

/// The settings and body properties for which all rows were written. Only a change of this value updates the state.
#[derive(Default)]
struct Key {
    config: SolverConfig,
    /// One entry for each body.
    surfaces: Vec<Surface>,
    /// Scale of impulses and preloads, or `None` before the first step.
    scale: Option<StepScale>,
}

crate::saved::cloned!(Key { config, surfaces, scale });

impl Saved for Key {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self { config, surfaces, scale } = self;
        config.walk(archive)?;
        let bodies = archive.count(surfaces.len())?;
        surfaces.resize(bodies, Surface::blank());
        archive.runs(bodies, |i, archive| surfaces[i].walk(archive))?;
        scale.walk(archive)
    }
}

/// The caller's changes since the last step that affect the state between steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    /// Bodies that were added or removed, or that changed kind, groups or shapes, in ascending order.
    bodies: Vec<usize>,
    settings: bool,
    /// Whether masses, locked axes or materials changed.
    surfaces: bool,
    joints: bool,
    /// Whether the length of a substep or the stiffness of contacts changed.
    step: bool,
}

impl Changes {
    /// Whether masses, materials or bodies changed.
    pub fn surfaces(&self) -> bool {
        self.surfaces || !self.bodies.is_empty()
    }

    /// Whether the number of bodies or all rows of contacts change, so that a device cannot continue from its own rows.
    pub fn all_rows(&self) -> bool {
        self.settings || self.step || self.surfaces()
    }
}

impl Stages {
    pub fn new(world: &World, config: &SolverConfig) -> Self {
        let surfaces = world.bodies.iter().map(Body::surface).collect();
        Self {
            detector: Detector::new(world),
            sleep: Sleep::new(world, config),
            key: Key { config: config.clone(), surfaces, scale: None },
            ..Self::default()
        }
    }

    /// Writes or reads all lasting state for the bodies of `world`. The plan is not part of it: without one, the next
    /// step builds its own.
    pub fn walk<A: Archive>(&mut self, world: &World, archive: &mut A) -> Result<()> {
        let Self {
            detector,
            sleep,
            effort,
            energy,
            found: _,
            key,
            contacts,
            joints,
            problem,
            plan: _,
            events,
            by_body: _,
            plan_key: _,
            thrown: _,
            points: _,
            bytes_moved: _,
            astray,
            is_foreign,
        } = self;
        *is_foreign = A::READS;
        astray.walk(archive)?;
        key.walk(archive)?;
        if A::READS {
            key.config.check()?;
        }
        let step = key.scale.map_or(0.0, |scale| scale.step(key.config.substeps));
        detector.walk(world, [key.config.speculative_margin, world.gravity.length() * step * step], archive)?;
        sleep.walk(world, detector.kinds(), archive)?;
        effort.walk(archive)?;
        energy.walk(archive)?;
        problem.walk(archive)?;
        contacts.walk(world, detector, (&key.config, key.scale.as_ref(), &key.surfaces), effort, problem, archive)?;
        joints.walk(archive)?;
        events.walk(archive)?;
        let bodies = detector.kinds().len();
        if A::READS {
            joints.check(bodies, problem)?;
        }
        let of_effort = effort.classes().len();
        ensure(key.surfaces.len() == bodies && (of_effort == 0 || of_effort == bodies), || {
            format!("classes of {of_effort} and surfaces of {} bodies, and not of {bodies}", key.surfaces.len())
        })
    }

    /// The caller's changes since the last step.
    ///
    /// # Errors
    /// A body, a joint or a mass cannot be simulated.
    pub fn changes(&self, world: &World, config: &SolverConfig, dt: f32) -> Result<Changes> {
        let is_astray = |i: usize| self.astray.binary_search(&i).is_ok();
        let fits = |i: usize, body: &Body| body.check_motion().is_ok() || is_astray(i);
        let bodies = self.detector.changed_bodies(world, fits);
        bodies.iter().try_for_each(|&i| world.check_body(i))?;
        let is_new = |i: usize| bodies.binary_search(&i).is_ok();
        let mut known = world.bodies.iter().zip(&self.key.surfaces).enumerate();
        let surfaces = known.any(|(i, (b, known))| b.surface() != *known && !is_new(i));
        let joints = !self.joints.are_of(world) || !bodies.is_empty() && !world.joints.is_empty();
        world.check_gravity()?;
        if surfaces {
            world.check_surfaces()?;
        }
        if joints {
            world.check_joints()?;
        }
        let settings = self.key.config != *config;
        if surfaces || !bodies.is_empty() {
            check_materials(world, config)?;
        }
        let step = self.key.scale.is_some_and(|scale| scale != StepScale::new(config, dt));
        Ok(Changes { bodies, settings, surfaces, joints, step })
    }

    /// Substeps of class 0 in the last step.
    pub fn least_substeps(&self) -> u32 {
        self.key.config.substeps
    }

    /// Updates all lasting state to the caller's changes.
    pub fn follow(&mut self, world: &World, config: &SolverConfig, dt: f32, changes: &Changes) {
        if !changes.bodies.is_empty() {
            self.follow_bodies(world, &changes.bodies);
        }
        if changes.settings {
            self.joints.forget_colors();
            self.sleep.change_settings(world, &self.key.config, config);
            self.key.config = config.clone();
        }
        if changes.surfaces {
            for (i, (known, body)) in self.key.surfaces.iter_mut().zip(&world.bodies).enumerate() {
                if *known != body.surface() {
                    *known = body.surface();
                    self.sleep.disturb(i);
                }
            }
        }
        if changes.joints {
            for joint in self.joints.follow(world, &mut self.problem) {
                let (a, b) = joint.indices();
                for body in [Some(a), b].into_iter().flatten() {
                    self.sleep.disturb(body);
                    self.energy.follow_joints_of(body);
                }
            }
            self.detector.follow_joints(world);
        }
        let scale = StepScale::new(config, dt);
        if let Some(before) = self.key.scale.replace(scale).filter(|_| changes.step) {
            scale.rescale(&before, world, &mut self.problem);
        }
        if changes.settings || changes.surfaces {
            self.joints.forget_systems();
            self.contacts.write_again();
            self.plan_key = None;
        }
    }

    /// Applies bodies that were added or removed, or that changed kind, groups or shapes.
    fn follow_bodies(&mut self, world: &World, changed: &[usize]) {
        self.sleep.follow_bodies(world, changed);
        self.detector.follow_bodies(world, changed);
        self.effort.follow_bodies(world, changed);
        self.energy.follow_bodies(world, changed);
        self.contacts.follow_bodies(world, changed);
        self.key.surfaces.resize(world.bodies.len(), Surface::blank());
        for &i in changed.iter().filter(|&&i| i < world.bodies.len()) {
            self.key.surfaces[i] = world.bodies[i].surface();
        }
        self.plan_key = None;
    }

    /// Wakes changed bodies. Returns whether the step has nothing to do.
    pub fn is_everything_still(&mut self, world: &World, stats: &mut StepStats) -> bool {
        timed(&mut stats.times.detect, || self.sleep.before_step(world, &self.detector));
        stats.asleep = self.sleep.count();
        self.sleep.is_everything_still()
    }

    /// Detects contacts, lets hooks change them, colors them, and chooses the substep level of each island. Returns
    /// true if the rows on a device no longer fit: an island has another level, a body rests where it touched nothing
    /// before, or a contact has another material.
    ///
    /// # Errors
    /// A hook sets a material that is out of range.
    pub fn find(
        &mut self,
        world: &World,
        config: &SolverConfig,
        dt: f32,
        mut hooks: Option<&mut (dyn ContactHooks + 'static)>,
        stats: &mut StepStats,
    ) -> Result<bool> {
        let Self { detector, sleep, problem, contacts, found, by_body, .. } = self;
        // Rows can change places. A step that fails makes no new lists.
        by_body.forget();
        let times = &mut stats.times;
        // Decided before the detection, like the decision whether to fetch the rows from a device.
        let are_sorted_anew = contacts.are_unsorted() || problem.contacts.is_empty();
        *found = timed(&mut times.detect, || {
            detector.end_teleported(world);
            let mut detect = |detector: &mut Detector, activity: &[Activity]| {
                let mut may_touch = hooks.as_deref_mut().map(|hooks| {
                    move |sides: [ColliderSide; 2]| {
                        let [a, b] = sides.map(|side| collider_of(world, side));
                        blaming(sides.map(|side| side.0), || hooks.may_touch(world, a, b))
                    }
                });
                let filter = may_touch.as_mut().map(|filter| filter as &mut PairFilter);
                detector.detect(world, config, dt, activity, filter)
            };
            let mut found = detect(detector, sleep.activity());
            contacts.follow(world, detector);
            // A body that wakes takes part in this step.
            while sleep.wake_touched(world, detector) {
                let before = found;
                found = detect(detector, sleep.activity());
                contacts.follow(world, detector);
                found.computed += before.computed;
                found.reshaped |= before.reshaped;
            }
            found
        });
        let modified = self.modify_contacts(world, config, hooks)?;
        if modified.materials {
            self.plan_key = None;
        }
        let Self { detector, sleep, effort, energy, contacts, joints, problem, found, .. } = self;
        found.reshaped |= modified.points;
        let changes_class = timed(&mut times.color, || {
            if found.reshaped || are_sorted_anew || self.plan_key.is_none() {
                contacts.color(world, config.max_colors);
                energy.follow_contacts();
            }
            joints.choose(world, config, dt / config.substeps as f32, problem);
            joints.follow_loads(dt / config.substeps as f32, problem);
            joints.color(world, config.max_colors);
            stats.hardest = contacts.follow_loads(world, config, effort.is_one_class(), problem);
            if are_sorted_anew {
                contacts.sort(detector, problem);
            }
            let has_new_bodies = contacts.note_new_bodies(world);
            let asleep = sleep.asleep();
            let interfaces = || interfaces(world, asleep, (detector, contacts, joints), config, dt);
            let is_above = stats.hardest.is_some_and(|hardest| hardest.need > 1.0) || joints.are_above();
            effort.follow(world, asleep, config, dt, is_above, interfaces) || has_new_bodies
        });
        Ok(changes_class || modified.materials)
    }

    /// Whether steps can be taken again: there are joints, and the settings leave the substeps of islands open.
    fn can_repeat(world: &World, config: &SolverConfig) -> bool {
        !world.joints.is_empty() && config.joint_solver != JointSolver::Sweeps && Effort::highest(config) > 0
    }

    /// Prepares and plans the step. With `on_device`, the device continues from its own rows.
    pub fn prepare(&mut self, world: &World, config: &SolverConfig, dt: f32, on_device: bool, stats: &mut StepStats) {
        if Self::can_repeat(world, config) {
            let Self { contacts, joints, problem, .. } = self;
            timed(&mut stats.times.prepare, || {
                contacts.keep(problem);
                joints.keep(problem);
            });
        }
        self.write(world, config, dt, on_device, stats);
    }

    /// Prepares the step that ran once more, with shorter substeps for the islands with joints that opened beyond the
    /// promise. Returns false if there are none: the step is done.
    pub fn prepare_again(&mut self, world: &World, config: &SolverConfig, dt: f32, stats: &mut StepStats) -> bool {
        if !Self::can_repeat(world, config) || stats.repeats >= EFFORT_CLASSES as u32 {
            return false;
        }
        let Self { detector, sleep, effort, contacts, joints, problem, .. } = self;
        if problem.rows_of(&problem.joint_colors()).is_empty() {
            return false;
        }
        let changes = timed(&mut stats.times.color, || {
            if !joints.measure(config, problem, openings) {
                return false;
            }
            let asleep = sleep.asleep();
            let interfaces = interfaces(world, asleep, (detector, contacts, joints), config, dt);
            effort.correct(world, asleep, dt, stats.repeats == 0, interfaces)
        });
        if changes {
            contacts.go_back(problem);
            joints.go_back(problem);
            stats.repeats += 1;
            self.write(world, config, dt, false, stats);
        }
        changes
    }

    /// Writes the rows of the step, and plans it.
    fn write(&mut self, world: &World, config: &SolverConfig, dt: f32, on_device: bool, stats: &mut StepStats) {
        let Self { detector, sleep, effort, contacts, joints, problem, found, events, .. } = self;
        timed(&mut stats.times.prepare, || {
            problem::begin(world, sleep.asleep(), config, problem);
            contacts.carry.on_device = on_device;
            // The work of a driven body follows from the impulses of the whole step.
            let drives = |body: &Body| body.kind != BodyKind::Dynamic && body.is_driven();
            contacts.sums = events.listen.sums() || world.bodies.iter().any(drives);
            contacts.write(world, detector, config, effort, dt, problem);
            joints.sums = events.listen.sums();
            effort.note_unbalanced(rest::begin(world, config, dt / config.substeps as f32, contacts, problem));
            joints.write(world, sleep.asleep(), config, effort, dt / config.substeps as f32, problem);
            problem::lay_out(world, sleep.asleep(), config, effort, dt, (contacts, joints), problem);
            problem::write_dampings(world, sleep.asleep(), problem);
            let is_planned = self.plan_key.as_ref().is_some_and(|key| key.is_of(problem));
            if found.computed > 0 || found.reshaped || !is_planned {
                let swept = ContactSummary::of(problem);
                self.plan = StepPlan::with_summary(config, problem, &swept);
                self.points = swept.point_count();
                self.bytes_moved = self.plan.bytes_moved(problem, &swept);
                self.plan_key = Some(PlanKey::of(problem));
            }
        });
        stats.efforts = effort.counts(sleep.count());
        stats.pairs = found.pairs;
        stats.computed = found.computed;
        stats.manifolds = contacts.coloring.order.len();
        stats.points = self.points;
        stats.joints = problem.rows_of(&problem.joint_colors()).len();
        stats.direct_joints = problem.blocks.iter().map(|block| problem.rows_of(&block.direct_joints()).len()).sum();
        stats.swept_joint_gap = joints.swept_gap();
        stats.colors = contacts.coloring.color_count();
        stats.overflow = contacts.coloring.overflow as usize;
        stats.dispatches = self.plan.passes.len();
        stats.bytes_moved = self.bytes_moved;
    }

    /// Records the events of the step that ran. `world` is the world before the step.
    fn note_events(&mut self, world: &World) {
        let Self { contacts, problem, events, by_body, .. } = self;
        let side = |side| collider_of(world, side);
        if events.listen.sums() {
            let bodies_of = |row: usize| [problem.contacts[row].body_a, problem.contacts[row].body_b];
            by_body.list(world.bodies.len(), contacts.taken().map(|row| (row, bodies_of(row))));
        } else {
            by_body.forget();
        }
        if events.listen.contacts {
            events.note_contacts(contacts.touching(problem).map(|pair| pair.map(side)));
        }
        if let Some(least) = events.listen.hits_above {
            let mut met = std::mem::take(&mut events.met);
            met.clear();
            let wanted = |pair: &ColliderPair, speed: f32| speed > least || events.waits_for(pair.map(side));
            met.extend(contacts.approaches(world, problem, wanted).map(|approach| {
                let [a, b] = approach.pair.map(side);
                let Approach { point, normal, speed, impulse, rest, .. } = approach;
                Met { hit: Hit { a, b, point, normal, speed, impulse }, left: Some(rest / speed) }
            }));
            events.note_hits(met);
        }
    }

    /// Force (N) of a joint on its body b in the last step, and torque about the anchor (N m), in world axes.
    pub fn joint_load(&self, world: &World, joint: JointHandle) -> Option<[Vec3; 2]> {
        let Self { joints, problem, sleep, key, .. } = self;
        let row = joints.row_of(world, joint)?;
        // A loaded state has no rows before its next step.
        let JointRow { body_a, body_b, .. } = *problem.joints.get(row)?;
        let step = key.scale?.step(key.config.substeps);
        let sleeps = |body: u32| sleep.asleep().get(body as usize) == Some(&true);
        // A step leaves the sums of sleeping joints at 0.
        let (impulses, time) = match problem.joint_totals.is_empty() || sleeps(body_a) || sleeps(body_b) {
            true => (&problem.joint_impulses, step / key.config.substeps as f32 * joints.share(row)),
            false => (&problem.joint_totals, step),
        };
        Some([problem.joint_impulse(impulses, row), problem.axis_impulse(impulses, row, false)].map(|j| j / time))
    }

    /// Impulse and angular impulse of a joint on its body b in the last substep.
    pub fn joint_impulse(&self, world: &World, joint: JointHandle) -> Option<[Vec3; 2]> {
        let Self { joints, problem, .. } = self;
        // A loaded state has no rows before its next step.
        let row = joints.row_of(world, joint).filter(|&row| row < problem.joints.len())?;
        let impulses = &problem.joint_impulses;
        Some([problem.joint_impulse(impulses, row), problem.axis_impulse(impulses, row, false)])
    }

    /// Removes the joints that carried more than their break force in the step.
    fn break_joints(&mut self, world: &mut World, dt: f32) {
        let first = self.events.all.len();
        for (i, joint) in world.joints.iter().enumerate().filter(|(_, joint)| joint.can_break()) {
            let force = self.problem.joint_impulse(&self.problem.joint_totals, i).length() / dt;
            if force > joint.break_force {
                self.events.all.push(Event::Broke { joint: world.joints.handles()[i], force });
            }
        }
        for event in &self.events.all[first..] {
            if let Event::Broke { joint, .. } = event {
                world.remove_joint(*joint);
            }
        }
    }

    /// Stores poses and velocities in the world, and removes energy that constraints added.
    pub fn store(&mut self, world: &mut World, dt: f32) -> Taken {
        self.note_events(world);
        let Self { energy, effort, key, problem, thrown, detector, .. } = self;
        problem::find_thrown(problem, thrown);
        problem::follow_parabolas(world, effort, [energy.note_jointed(problem), thrown], dt, problem);
        let taken = energy.hold(world, problem, effort, &key.config, dt, |i| detector.is_teleported(world, i));
        problem::store(&self.problem, self.sleep.asleep(), world);
        let (far, stopped) = self.detector.hold(world, dt, self.sleep.activity());
        if !stopped.is_empty() {
            self.energy.follow_stops(&self.problem, &stopped);
        }
        self.detector.note_left(world);
        self.astray = bodies_astray(world);
        if self.detector.has_sensors() || !self.events.inside().is_empty() {
            let overlaps = self.detector.sense(world, self.sleep.activity());
            self.events.note_overlaps(overlaps.iter().map(|pair| pair.map(|side| collider_of(world, side))));
            let passed = self.detector.passed(world, dt, self.sleep.activity(), &far);
            self.events.note_passed(passed.into_iter().map(|(pair, t)| (pair.map(|side| collider_of(world, side)), t)));
        }
        self.break_joints(world, dt);
        self.sleep.after_step(world, &self.detector, &self.key.config, dt);
        taken
    }
}

/// The contacts and joints between awake bodies, for the effort of their islands.
fn interfaces<'a>(
    world: &'a World,
    asleep: &'a [bool],
    (detector, contacts, joints): (&'a Detector, &'a ContactRows, &'a JointRows),
    config: &'a SolverConfig,
    dt: f32,
) -> impl Iterator<Item = Interface> + Clone + 'a {
    contacts.interfaces(world, detector, config, dt).chain(joints.interfaces(world, asleep))
}

/// Refuses materials that the settings cannot follow.
pub(super) fn check_materials(world: &World, config: &SolverConfig) -> Result<()> {
    if config.friction_at == FrictionAt::Points && config.friction_rule() != FrictionRule::Slip {
        return Ok(());
    }
    world.bodies.iter().enumerate().try_for_each(|(i, body)| {
        let check = |material| problem::check_material(config, &material);
        body.materials().try_for_each(check).map_err(|error| error.within(world.name_of(i)))
    })
}

/// The bodies whose pose, velocity or loads are out of range, in ascending order.
fn bodies_astray(world: &World) -> Vec<usize> {
    let is_astray = |i: &usize| world.bodies[*i].check_motion().is_err();
    let all = (0..world.bodies.len()).into_par_iter().with_min_len(1024);
    if all.clone().any(|i| is_astray(&i)) { all.filter(is_astray).collect() } else { Vec::new() }
}

/// A collider, by the index of its body and its index on that body.
pub(super) fn collider_of(world: &World, (body, collider): (u32, u32)) -> ColliderOf {
    let body = world.bodies.handle(body as usize).expect("a collider has its body");
    ColliderOf { body, collider: collider as usize }
}

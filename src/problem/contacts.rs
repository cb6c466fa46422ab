//! The rows of contacts: the slot of each manifold, the order of the sweeps, and the changes from step to step.

mod saved;

use glam::Vec3;
use rayon::prelude::*;

use super::StepProblem;
use super::bodies::MIN_BODIES;
use super::carry::{Carry, NO_POINT, Preload, Written};
use super::impacts::Impacts;
use super::points_a_slot;
use super::prepare::{ComputedRow, PoseRow};
use super::rows::{ContactRow, ImpulseRow, PointRow, Substep};
use super::slots::{Slot, Slots, Write};
use super::write::{SlotRows, Writer, point_before};
use crate::collide::{Detector, MAX_POINTS, Manifold};
use crate::config::{FrictionAt, FrictionRule, SolverConfig};
use crate::constants::MIN_JAMMING;
use crate::effort::{self, Effort, Interface};
use crate::error::{Result, ensure};
use crate::graph::{Coloring, ConstraintGraph, IMMOVABLE};
use crate::stats::HardestContact;
use crate::world::{Body, Material, World};

/// The manifolds that have rows, and their colors. Only the rows hold impulses and preloads.
#[derive(Debug, Default)]
pub struct ContactRows {
    slots: Slots,
    graph: ConstraintGraph,
    /// The coloring of this step's contacts.
    pub coloring: Coloring,
    /// The rows and slips that contacts have.
    layout: Layout,
    /// The data that the manifold of each slot was computed from.
    computed: Vec<ComputedRow>,
    /// The poses of bodies.
    poses: Vec<PoseRow>,
    /// Whether the manifold of each slot jams, with
    /// [`EffectiveMass::jamming`](super::effective::EffectiveMass::jamming) above 1 at some point.
    jams: Vec<bool>,
    /// The contacts that are struck in this step, and those of bodies with joints.
    impacts: Impacts,
    /// The classes of bodies when the rows were written.
    classes: Vec<u8>,
    /// The common facts about all materials; `None` if a material may have changed.
    materials: Option<Materials>,
    /// The bodies that lie still and have only new contacts.
    new_bodies: Vec<bool>,
    /// The rows before the step.
    before: Before,
    /// The material that hooks gave to the contact of each slot; empty if they gave none.
    hooked: Vec<Option<Material>>,
    /// Whether impulses are summed over the substeps of a step.
    pub sums: bool,
    /// Changes of the rows since the step before.
    pub carry: Carry,
}

crate::saved::cloned!(ContactRows {
    slots,
    coloring,
    layout,
    computed,
    jams,
    classes,
    materials,
    hooked,
    sums,
    carry,
} scratch { graph, poses, impacts, new_bodies, before });

/// The rows that a step changes before it runs, for a step that is taken again.
#[derive(Debug, Default)]
struct Before {
    contacts: Vec<ContactRow>,
    impulses: Vec<ImpulseRow>,
    writes: Vec<Write>,
    classes: Vec<u8>,
    layout: Layout,
}

/// The rows that contacts have besides those of their points, and whether rows have slips.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Layout {
    /// Whether a patch follows the points of every contact.
    pub patches: bool,
    /// Whether patches resist rolling and spinning, and friction acts at the points.
    pub rolls: bool,
    /// Whether some surface moves by itself.
    pub driven: bool,
}

crate::saved::fields!(Layout { patches, rolls, driven });

impl Layout {
    fn of(config: &SolverConfig, materials: &Materials) -> Self {
        let has_friction = config.friction_rule() != FrictionRule::None;
        let [rolls, driven] = [materials.rolls, materials.driven].map(|some| some && has_friction);
        Self { patches: rolls || has_friction && config.friction_at == FrictionAt::Manifold, rolls, driven }
    }

    /// Whether friction acts once for each manifold, at its patch.
    pub fn is_at_patch(self) -> bool {
        self.patches && !self.rolls
    }
}

/// Refuses a material that the settings cannot follow.
pub fn check_material(config: &SolverConfig, material: &Material) -> Result<()> {
    ensure(!material.rolls() || config.friction_at == FrictionAt::Points, || {
        "rolling_friction and spinning_friction need the setting friction_at = points".into()
    })?;
    ensure(!material.is_driven() || config.friction_rule() != FrictionRule::Slip, || {
        "surface_velocity needs the setting slip_friction = false".into()
    })
}

/// Common facts about the materials and the bodies of a world.
#[derive(Clone, Copy, Debug, Default)]
struct Materials {
    /// Whether any surface bounces.
    bounce: bool,
    /// Whether any surface has more friction than [`MIN_JAMMING`].
    may_jam: bool,
    /// Whether any surface resists rolling or spinning.
    rolls: bool,
    /// Whether any surface moves by itself.
    driven: bool,
    /// Whether any body has locked translations.
    locked: bool,
}

crate::saved::fields!(Materials { bounce, may_jam, rolls, driven, locked });

impl Materials {
    fn of(world: &World) -> Self {
        world.bodies.iter().fold(Self::default(), |all, body| {
            let locked = all.locked || body.has_locked_translation();
            body.materials().fold(Self { locked, ..all }, Self::with)
        })
    }

    /// The same facts with another material.
    fn with(self, material: Material) -> Self {
        Self {
            bounce: self.bounce || material.restitution > 0.0,
            may_jam: self.may_jam || material.friction > MIN_JAMMING,
            rolls: self.rolls || material.rolls(),
            driven: self.driven || material.is_driven(),
            ..self
        }
    }

    /// The same facts with the materials of hooks.
    fn and(self, hooked: &[Option<Material>]) -> Self {
        hooked.iter().flatten().copied().fold(self, Self::with)
    }
}

const SLOTS_A_TASK: usize = 4096;

impl ContactRows {
    /// Gives rows to new manifolds, and takes back those of manifolds that ended.
    pub fn follow(&mut self, world: &World, detector: &mut Detector) {
        self.slots.follow(world, detector);
    }

    /// Lets the next step write all rows again.
    pub fn write_again(&mut self) {
        self.slots.write_again();
        self.materials = None;
    }

    /// Forgets the materials of contacts that ended.
    pub fn begin_hooked(&mut self) {
        for (hooked, slot) in self.hooked.iter_mut().zip(&self.slots.all) {
            if slot.is_free() || slot.write == Write::New {
                *hooked = None;
            }
        }
    }

    /// Sets the material that hooks give to the contact in a row; `None` stands for its own. Returns whether that
    /// changes the row.
    pub fn set_hooked(&mut self, row: u32, material: Option<Material>) -> bool {
        let row = row as usize;
        if self.hooked.get(row).copied().flatten() == material {
            return false;
        }
        self.hooked.resize(self.slots.all.len(), None);
        self.hooked[row] = material;
        let write = &mut self.slots.all[row].write;
        *write = (*write).max(Write::Rows);
        true
    }

    /// Returns all contacts to their own materials. Returns whether that changes any rows.
    pub fn forget_hooked(&mut self) -> bool {
        self.begin_hooked();
        let rows = 0..self.hooked.len() as u32;
        let changed = rows.fold(false, |changed, row| self.set_hooked(row, None) | changed);
        self.hooked.clear();
        changed
    }

    /// Whether the manifold in a row is that of the step before.
    pub fn is_reused(&self, row: u32) -> bool {
        self.slots.all[row as usize].write < Write::Computed
    }

    /// Follows bodies that were added, removed, or changed in kind, groups or shapes.
    pub fn follow_bodies(&mut self, world: &World, changed: &[usize]) {
        if self.materials.is_some() {
            self.materials = Some(Materials::of(world));
        }
        if !self.classes.is_empty() {
            self.classes.resize(world.bodies.len(), 0);
            changed.iter().filter(|&&i| i < world.bodies.len()).for_each(|&i| self.classes[i] = 0);
        }
    }

    /// The rows that belong to a manifold.
    pub fn taken(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        (0..).zip(&self.slots.all).filter(|(_, slot)| !slot.is_free()).map(|(row, _)| row)
    }

    /// The manifold of a row.
    pub fn manifold<'a>(&self, row: usize, detector: &'a Detector) -> &'a Manifold {
        let slot = &self.slots.all[row];
        &detector.pair(slot.world, slot.pair).manifolds[slot.manifold as usize]
    }

    /// Whether the contact in a row is swept.
    pub(super) fn takes_part(&self, row: usize) -> bool {
        self.slots.all[row].takes_part
    }

    /// The colliders of the contact in a row, by their indices among those of its bodies a and b.
    pub fn colliders_of(&self, row: usize) -> [u32; 2] {
        self.slots.colliders[row]
    }

    /// Gives a color to every manifold that takes part. A manifold that has a color keeps it.
    pub fn color(&mut self, world: &World, max_colors: u32) {
        let members: Vec<u32> = self.slots.taking_part().collect();
        self.coloring = self.graph.color_members(world.bodies.len(), &mut self.slots.edges, &members, max_colors);
    }

    /// The color of the contact in a row.
    pub fn color_of(&self, row: u32) -> Option<u8> {
        self.slots.edges[row as usize].color
    }

    /// Whether so many rows are new that it pays to sort all. A device that keeps the rows cannot follow a sort.
    pub fn are_unsorted(&self) -> bool {
        self.slots.are_unsorted()
    }

    /// Sorts the rows of contacts into the order of the sweeps.
    pub fn sort(&mut self, detector: &mut Detector, problem: &mut StepProblem) {
        let from = self.slots.sort(&self.coloring.order, detector);
        self.coloring.order = (0..self.coloring.order.len() as u32).collect();
        let stride = points_a_slot(self.layout.patches);
        if !problem.contacts.is_empty() {
            problem.contacts = moved(&problem.contacts, &from, 1);
            (0..).zip(&mut problem.contacts).for_each(|(i, contact)| contact.first_point = i * stride as u32);
            problem.points = moved(&problem.points, &from, stride);
            problem.impulses = moved(&problem.impulses, &from, stride);
            if !problem.totals.is_empty() {
                problem.totals = moved(&problem.totals, &from, stride);
            }
            problem.sags = moved(&problem.sags, &from, 1);
            if !self.hooked.is_empty() {
                self.hooked = moved(&self.hooked, &from, 1);
            }
            self.computed = moved(&self.computed, &from, 1);
            self.jams = moved(&self.jams, &from, 1);
        }
    }

    /// Updates the needs of contacts from their loads in the step before, and returns the contact with the largest
    /// need. `is_one_class`: all substeps have the length of class 0.
    pub fn follow_loads(
        &mut self,
        world: &World,
        config: &SolverConfig,
        is_one_class: bool,
        problem: &StepProblem,
    ) -> Option<HardestContact> {
        let Slots { all, edges, .. } = &mut self.slots;
        let follow = |(chunk, slots): (usize, &mut [Slot])| {
            let mut hardest: Option<(usize, f32)> = None;
            for (i, slot) in (chunk * SLOTS_A_TASK..).zip(slots).filter(|(_, slot)| slot.takes_part) {
                slot.need = match problem.sags.get(i).filter(|_| slot.write != Write::New) {
                    Some(sag) => {
                        let share = if is_one_class { 1.0 } else { problem.contacts[i].substep_share };
                        // Class 0 has longer substeps, and sags grow with the square of the length.
                        effort::lasting(sag / (share * share * config.promised_sag(slot.size)), slot.need)
                    }
                    None => 0.0,
                };
                if hardest.is_none_or(|(_, need)| slot.need > need) {
                    hardest = Some((i, slot.need));
                }
            }
            hardest
        };
        // The first of equal needs wins.
        let harder = |one: Option<(usize, f32)>, other: Option<(usize, f32)>| match (one, other) {
            (Some(one), Some(other)) if other.1 > one.1 => Some(other),
            (one, other) => one.or(other),
        };
        let hardest = all.par_chunks_mut(SLOTS_A_TASK).enumerate().map(follow).reduce(|| None, harder);
        let body = |body: u32| world.bodies.handle(body as usize);
        hardest.map(|(i, need)| HardestContact { bodies: [body(edges[i].a), body(edges[i].b)], need })
    }

    /// The contacts that take part, for the effort of their islands. A moving kinematic body counts as a member of the
    /// island that it touches.
    pub fn interfaces<'a>(
        &'a self,
        world: &'a World,
        detector: &'a Detector,
        config: &'a SolverConfig,
        dt: f32,
    ) -> impl Iterator<Item = Interface> + Clone + 'a {
        let substep = Substep::new(config, dt / config.substeps as f32);
        let inverse_mass = |body: u32| (body != IMMOVABLE).then(|| world.bodies[body as usize].mass.mass.recip());
        let force = move |slot: &Slot, a: Option<f32>, b: Option<f32>| {
            let springs = if a.is_some() && b.is_some() { substep.movable } else { substep.fixed };
            let sag = substep.length * springs.compliance() * (a.unwrap_or(0.0) + b.unwrap_or(0.0));
            config.promised_sag(slot.size) / sag
        };
        let any_driven = world.bodies.iter().any(Body::is_driven);
        let all = self.slots.all.iter().zip(&self.slots.edges).filter(|(slot, _)| slot.takes_part);
        all.map(move |(slot, edge)| {
            let (mut a, mut b) = (edge.a, edge.b);
            let force = force(slot, inverse_mass(a), inverse_mass(b));
            if any_driven && (a == IMMOVABLE || b == IMMOVABLE) {
                let pair = detector.pair(slot.world, slot.pair);
                for (end, body) in [(&mut a, pair.body_a), (&mut b, pair.body_b)] {
                    if world.bodies[body as usize].is_driven() {
                        *end = body;
                    }
                }
            }
            Interface { a, b, need: slot.need, force, joint: None }
        })
    }

    /// Whether any of the contacts `rows` that takes part jams.
    pub fn any_jamming(&self, rows: &[ContactRow]) -> bool {
        let jams = self.jams(rows);
        self.slots.taking_part().any(jams)
    }

    /// A test of whether the contact in a row jams, by its masses. A contact of a body with joints does not.
    pub fn jams<'a>(&'a self, rows: &'a [ContactRow]) -> impl Fn(u32) -> bool + 'a {
        let may_jam = self.materials.unwrap_or_default().and(&self.hooked).may_jam;
        move |row| may_jam && self.jams[row as usize] && !self.impacts.is_jointed(&rows[row as usize])
    }

    /// The contacts that are struck in this step.
    pub fn impacts(&self) -> &Impacts {
        &self.impacts
    }

    /// Marks the bodies that lie still and have only new contacts, and returns whether there are any.
    pub fn note_new_bodies(&mut self, world: &World) -> bool {
        self.new_bodies.clear();
        let slots = || self.slots.all.iter().zip(&self.slots.edges).filter(|(slot, _)| slot.takes_part);
        let lies = |body: u32| {
            let body = world.bodies.get(body as usize);
            body.is_some_and(|b| b.linear_velocity == Vec3::ZERO && b.angular_velocity == Vec3::ZERO)
        };
        let is_new = |slot: &Slot| slot.write == Write::New;
        if !slots().any(|(slot, edge)| is_new(slot) && (lies(edge.a) || lies(edge.b))) {
            return false;
        }
        self.new_bodies.resize(world.bodies.len(), false);
        for wanted in [true, false] {
            for (_, edge) in slots().filter(|(slot, _)| is_new(slot) == wanted) {
                for body in [edge.a, edge.b].into_iter().filter(|&body| lies(body)) {
                    self.new_bodies[body as usize] = wanted;
                }
            }
        }
        self.new_bodies.contains(&true)
    }

    /// The bodies that [`Self::note_new_bodies`] marked; empty if there are none.
    pub fn new_bodies(&self) -> &[bool] {
        &self.new_bodies
    }

    /// Keeps the rows of contacts before a step, so that the step can be taken again.
    pub fn keep(&mut self, problem: &StepProblem) {
        let Self { before, slots, classes, layout, .. } = self;
        before.contacts.clone_from(&problem.contacts);
        before.impulses.clone_from(&problem.impulses);
        before.writes.clear();
        before.writes.extend(slots.all.iter().map(|slot| slot.write));
        before.classes.clone_from(classes);
        before.layout = *layout;
    }

    /// Returns to the rows of [`Self::keep`].
    pub fn go_back(&mut self, problem: &mut StepProblem) {
        let Self { before, slots, classes, layout, .. } = self;
        problem.contacts.clone_from(&before.contacts);
        problem.impulses.clone_from(&before.impulses);
        slots.all.iter_mut().zip(&before.writes).for_each(|(slot, write)| slot.write = *write);
        classes.clone_from(&before.classes);
        *layout = before.layout;
    }

    /// Writes the rows of a step of `dt` seconds, after the rows of bodies.
    pub fn write(
        &mut self,
        world: &World,
        detector: &Detector,
        config: &SolverConfig,
        effort: &Effort,
        dt: f32,
        problem: &mut StepProblem,
    ) {
        let materials = self.materials.get_or_insert_with(|| Materials::of(world)).and(&self.hooked);
        let Materials { bounce, may_jam, locked, .. } = materials;
        let layout = Layout::of(config, &materials);
        // The work of a driven surface follows from the impulses of the whole step.
        self.sums |= layout.driven;
        self.lay_out(layout, problem);
        problem.params.point_count = problem.points.len() as u32;
        problem.params.patches = layout.patches.into();
        problem.params.rolls = layout.rolls.into();
        problem.params.driven = layout.driven.into();
        self.carry.surfaces = layout.rolls || layout.driven || locked;
        self.carry.pull_or_slip = config.friction_rule() == FrictionRule::Slip || bounce;
        self.carry.tangents = matches!(config.friction_rule(), FrictionRule::Box | FrictionRule::Disc);
        let substep = Substep::new(config, dt / config.substeps as f32);
        self.carry.preload = Preload {
            movable_compliance: substep.movable.compliance(),
            fixed_compliance: substep.fixed.compliance(),
            share: 1.0 - 1.0 / (1.0 + config.preload_rate * dt),
            warm_start: config.warm_start.into(),
        };
        self.note_written(detector);
        let StepProblem { bodies, masses, contacts, points, impulses, sags, .. } = problem;
        let Self { slots, carry, layout, computed, poses, jams, classes, hooked, .. } = self;
        let pose = |body: &Body| PoseRow {
            center: body.center_of_mass().to_array(),
            pad: 0.0,
            rotation: body.rotation.to_array(),
        };
        world.bodies.par_iter().with_min_len(MIN_BODIES).map(pose).collect_into_vec(poses);
        let effort_changes = *classes != effort.classes();
        if effort_changes {
            classes.clear();
            classes.extend_from_slice(effort.classes());
        }
        let writer = Writer {
            world,
            detector,
            config,
            effort,
            effort_changes,
            bodies,
            masses,
            poses,
            carry,
            brings_impulses: true,
            layout: *layout,
            hooked,
            may_jam,
            locked,
        };
        writer.write(&slots.all, SlotRows { contacts, points, impulses, computed, sags, jams });
        slots.all.iter_mut().for_each(|slot| slot.write = Write::Separations);
        let any_fast = self.impacts.note(&self.slots.all, world, [config.restitution_threshold, dt], may_jam, problem);
        problem.params.bounces = (bounce && any_fast).into();
    }

    /// Makes room for the rows of all slots. If friction moves between points and manifolds, friction begins without
    /// impulses.
    fn lay_out(&mut self, layout: Layout, problem: &mut StepProblem) {
        let (count, stride) = (self.slots.all.len(), points_a_slot(layout.patches));
        let before = std::mem::replace(&mut self.layout, layout);
        if layout.patches != before.patches || layout.rolls != before.rolls {
            // A device has the rows of the layout before.
            self.carry.on_device = false;
            let stays = layout.is_at_patch() == before.is_at_patch();
            let impulses = std::mem::take(&mut problem.impulses);
            problem.impulses.resize(problem.contacts.len() * stride, ImpulseRow::default());
            let rows = impulses.chunks(points_a_slot(before.patches));
            for (now, before) in problem.impulses.chunks_mut(stride).zip(rows) {
                for (now, before) in now.iter_mut().zip(&before[..MAX_POINTS]) {
                    *now = if stays { *before } else { ImpulseRow { normal: before.normal, ..ImpulseRow::default() } };
                }
            }
            for (now, contact) in problem.impulses.chunks_mut(stride).zip(&problem.contacts) {
                now[contact.point_count as usize..].fill(ImpulseRow::default());
            }
        }
        problem.contacts.resize(count, ContactRow::default());
        problem.sags.resize(count, 0.0);
        problem.points.resize(count * stride, PointRow::default());
        problem.impulses.resize(count * stride, ImpulseRow::default());
        if self.sums && problem.totals.is_empty() {
            // Contacts at rest are not summed. Their sums are their impulses.
            problem.totals.clone_from(&problem.impulses);
        }
        problem.totals.resize(if self.sums { count * stride } else { 0 }, ImpulseRow::default());
        self.computed.resize(count, ComputedRow::default());
        self.jams.resize(count, false);
    }

    /// Records which rows are written again, for a device that keeps the others.
    fn note_written(&mut self, detector: &Detector) {
        self.carry.written.clear();
        if !self.carry.on_device {
            return;
        }
        let again = (0..).zip(&self.slots.all).filter(|(_, slot)| slot.write != Write::Separations);
        self.carry.written.extend(again.map(|(row, slot)| {
            let manifold = &detector.pair(slot.world, slot.pair).manifolds[slot.manifold as usize];
            let mut points_before = if slot.write == Write::New { Written::NEW } else { [NO_POINT; MAX_POINTS] };
            for ((k, point), before) in manifold.points().iter().enumerate().zip(&mut points_before) {
                *before = point_before(slot.write, k, point).unwrap_or(*before);
            }
            Written { row, points_before }
        }));
    }
}

/// The rows of slots, `stride` each, in a new order: `from` has their old places. Slots without rows get default rows.
fn moved<T: Copy + Default>(rows: &[T], from: &[u32], stride: usize) -> Vec<T> {
    let mut moved = vec![T::default(); from.len() * stride];
    for (to, &from) in moved.chunks_mut(stride).zip(from) {
        if let Some(rows) = rows.chunks(stride).nth(from as usize) {
            to.copy_from_slice(rows);
        }
    }
    moved
}

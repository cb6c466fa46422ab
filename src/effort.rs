//! The substeps of each island, from the loads on its contacts.
//!
//! A soft contact under a force F sags by F/(m w²), where m is its effective mass and w is 2 pi times the contact
//! frequency, which depends on the length of a substep (docs/derivation.md, section 5). The settings promise a largest
//! sag. An island of class c takes 2^c times the substeps of the settings, so its contacts sag 4^-c times as deep. Its
//! class is the lowest that keeps the promise. The same number decides whether tall and uneven structures stand,
//! because a tower sways if the springs of its contacts are soft for their load.
//!
//! A class rises as soon as a load lasts. It falls only after thirty steps in which the next lower class would have kept
//! half of the promise, so a constant load never changes a class. Impulses and preloads scale by powers of two, without
//! rounding.
//!
//! Bodies that others hold inside each other press harder, the stiffer their springs are, so every class would ask for
//! the next one. This force comes from no load. The need of a contact is therefore limited by the largest load that the
//! bodies and drives of its island can cause.

mod island;

use glam::Vec3;

use crate::config::{Method, SolverConfig, Stabilization};
use crate::constants::{FALL, LEVEL, LEVERAGE, LONG_SUBSTEPS, UNBALANCED_SUBSTEPS};
use crate::error::{Result, ensure};
use crate::graph::{IMMOVABLE, Islands};
use crate::load::Load;
use crate::saved::{Archive, Saved};
use crate::stats::EFFORT_CLASSES;
use crate::world::{Body, BodyHandle, BodyKind, World};
use island::{HIGHEST, Island};

/// A contact or joint, for the effort of its island.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// One body, or [`IMMOVABLE`].
    pub a: u32,
    /// The other body, or [`IMMOVABLE`].
    pub b: u32,
    /// The sag of a contact with the substeps of the settings, over the promised sag; for a joint the same ratio of
    /// gaps.
    pub need: f32,
    /// The force that makes the promised sag with the substeps of the settings (N).
    pub force: f32,
    /// The needs of a joint; `None` for a contact.
    pub joint: Option<JointNeed>,
}

/// The needs of a joint besides its load. No other joint of its bodies reduces them.
#[derive(Clone, Copy, Debug)]
pub struct JointNeed {
    /// The largest force of its drives (N).
    pub drives: f32,
    /// The gap that the last step left in class 0, over the promised gap.
    pub opening: f32,
    /// Whether shorter substeps did not reduce the gap.
    pub is_stuck: bool,
}

/// The class of effort of each island.
#[derive(Debug, Default)]
pub struct Effort {
    /// The class of each body.
    classes: Vec<u8>,
    /// The class of each body when the step first ran.
    first_classes: Vec<u8>,
    /// Steps in a row in which the next lower class would have been enough, for each body.
    descent_steps: Vec<u8>,
    /// Bodies that began on other bodies without a balance of forces, and whose islands have not come to rest since.
    unbalanced: Vec<u32>,
    /// The need that gives these bodies [`UNBALANCED_SUBSTEPS`].
    unbalanced_need: f32,
    /// The classes of awake bodies in ascending order, one for each block.
    used: Vec<u8>,
    /// Whether any body, awake or not, is above class 0.
    any_above: bool,
    /// Whether [`Self::refine`] raised classes since the last decision.
    is_refined: bool,
    highest: u8,
    /// The class from which a step has [`LONG_SUBSTEPS`].
    long_from: u8,
    /// Number of bodies that can be pushed, including those asleep.
    movable: u32,
    /// Number of awake bodies that can be pushed, for each class.
    counts: [u32; EFFORT_CLASSES],
    /// Awake bodies that are not fixed, and whether each can be pushed.
    awake: Vec<(u32, bool)>,
    islands: Islands,
    /// The island of each root body.
    of_root: Vec<Island>,
}

crate::saved::cloned!(Effort {
    classes,
    descent_steps,
    unbalanced,
    unbalanced_need,
    used,
    any_above,
    is_refined,
    highest,
    long_from,
    movable,
    counts,
} scratch { first_classes, awake, islands, of_root });

impl Saved for Effort {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let Self {
            classes,
            descent_steps,
            unbalanced,
            unbalanced_need,
            used,
            any_above,
            is_refined,
            highest,
            long_from,
            movable,
            counts,
            first_classes: _,
            awake: _,
            islands: _,
            of_root: _,
        } = self;
        let bodies = archive.count(classes.len())?;
        if A::READS {
            classes.resize(bodies, 0);
            descent_steps.resize(bodies, 0);
        }
        archive.runs(bodies, |i, archive| {
            classes[i].walk(archive)?;
            descent_steps[i].walk(archive)?;
            ensure(classes[i] <= HIGHEST, || format!("body {i} has class {}", classes[i]))
        })?;
        unbalanced.walk(archive)?;
        unbalanced_need.walk(archive)?;
        used.walk(archive)?;
        any_above.walk(archive)?;
        is_refined.walk(archive)?;
        highest.walk(archive)?;
        long_from.walk(archive)?;
        movable.walk(archive)?;
        counts.walk(archive)
    }
}

/// The largest load of a body on its contacts in a step (N): its weight, its applied force and torque, and the force
/// that stops it within the step.
fn load_of(body: &Body, gravity: Vec3, dt: f32) -> f32 {
    let mass = body.mass.mass;
    let gyration = (body.mass.principal_inertia.max_element() / mass).sqrt();
    let speed = body.linear_velocity.length() + gyration * body.angular_velocity.length();
    mass * (gravity.length() + speed / dt) + body.whole_force().length() + body.whole_torque().length() / gyration
}

/// The need after that of the step before. It falls at once and rises by one class in each step, so that the impulse of
/// a hit counts little.
pub fn lasting(now: f32, before: f32) -> f32 {
    now.min(4.0 * before + 0.25)
}

impl Effort {
    /// The highest class that the settings allow. If the sweeps depend on all bodies together, all have one class.
    pub fn highest(config: &SolverConfig) -> u8 {
        let is_soft = config.stabilization == Stabilization::Soft;
        if config.method == Method::Accelerated || config.tolerance > 0.0 || !is_soft {
            return 0;
        }
        (config.max_substeps / config.substeps).checked_ilog2().unwrap_or(0) as u8
    }

    /// Decides the classes of a step of `dt` seconds, and returns whether any changed. `interfaces` gives the contacts
    /// and joints between awake bodies; a body that a pass moves counts as movable. `is_above` tells whether any needs
    /// more than class 0 gives. If all bodies are in class 0 and none needs more, the interfaces are not read.
    pub fn follow<I: Iterator<Item = Interface> + Clone>(
        &mut self,
        world: &World,
        asleep: &[bool],
        config: &SolverConfig,
        dt: f32,
        is_above: bool,
        interfaces: impl FnOnce() -> I,
    ) -> bool {
        self.highest = Self::highest(config);
        self.long_from = (LONG_SUBSTEPS / config.substeps).checked_ilog2().unwrap_or(0) as u8;
        self.unbalanced_need = (UNBALANCED_SUBSTEPS / config.substeps as f32).powi(2);
        let is_first = self.classes.is_empty();
        if is_first {
            self.classes.resize(world.bodies.len(), 0);
            self.descent_steps.resize(world.bodies.len(), 0);
            self.movable = world.dynamic_count() as u32;
            if self.highest > 0 {
                self.begin(world, config, dt);
            }
        }
        let any_unbalanced = !self.unbalanced.is_empty();
        let changed = (is_first || self.any_above || is_above || any_unbalanced)
            && self.follow_islands(world, asleep, interfaces(), dt, Island::next);
        if any_unbalanced {
            let (islands, of_root) = (&mut self.islands, &self.of_root);
            self.unbalanced.retain(|&body| {
                let speeds = config.sleep_speed..FALL * world.gravity_at(body as usize).length();
                speeds.contains(&of_root[islands.root(body) as usize].fastest)
            });
        }
        changed
    }

    /// Raises the classes of islands with joints that opened too far in the step. An island returns to the class with
    /// which the step first ran if that did not help. Returns whether any class changed: the step is then taken again.
    /// `is_first`: the step ran once so far.
    pub fn correct(
        &mut self,
        world: &World,
        asleep: &[bool],
        dt: f32,
        is_first: bool,
        interfaces: impl Iterator<Item = Interface> + Clone,
    ) -> bool {
        if is_first {
            self.first_classes.clone_from(&self.classes);
        }
        self.follow_islands(world, asleep, interfaces, dt, |island, highest, _| island.corrected(highest))
    }

    /// Follows bodies that were added, removed, or changed in kind, groups or shapes.
    pub fn follow_bodies(&mut self, world: &World, changed: &[usize]) {
        if self.classes.is_empty() {
            return;
        }
        let bodies = world.bodies.len();
        self.unbalanced.retain(|&body| changed.binary_search(&(body as usize)).is_err());
        self.classes.resize(bodies, 0);
        self.descent_steps.resize(bodies, 0);
        for &i in changed.iter().filter(|&&i| i < bodies) {
            (self.classes[i], self.descent_steps[i]) = (0, 0);
        }
        self.movable = world.dynamic_count() as u32;
    }

    /// Adds bodies that begin on other bodies without a balance of forces.
    pub fn note_unbalanced(&mut self, bodies: Vec<u32>) {
        self.unbalanced.extend(bodies);
        // A step that is taken again adds the same bodies.
        self.unbalanced.sort_unstable();
        self.unbalanced.dedup();
    }

    /// Raises the class of the bodies of an island by two, which quarters the substep of the next step. Returns whether
    /// the class could rise.
    pub fn refine(&mut self, bodies: impl Iterator<Item = usize> + Clone) -> bool {
        let class = bodies.clone().map(|i| self.class_of(i)).max().unwrap_or(0);
        if class >= self.highest || self.classes.is_empty() {
            return false;
        }
        for i in bodies {
            (self.classes[i], self.descent_steps[i]) = ((class + 2).min(self.highest), 0);
        }
        (self.any_above, self.is_refined) = (true, true);
        true
    }

    /// Decides the first classes from the loads of statics.
    fn begin(&mut self, world: &World, config: &SolverConfig, dt: f32) {
        // The bounding boxes of neighboring bodies may overlap.
        let touches =
            |upper: BodyHandle, gap: f64| gap.abs() < LEVEL * f64::from(world.bodies[upper].smallest_half_extent());
        let is_dynamic = |body: BodyHandle| world.bodies[body].kind == BodyKind::Dynamic;
        let interface = |load: &Load| {
            let size = [load.upper, load.lower].map(|body| world.bodies[body].smallest_half_extent());
            let sag = load.overlap(config.substeps, dt, config);
            let need = sag / f64::from(config.promised_sag(size[0].min(size[1])));
            let [a, b] =
                [load.upper, load.lower].map(|body| if is_dynamic(body) { body.index() as u32 } else { IMMOVABLE });
            // Statics finds true loads, so no limit applies.
            Interface { a, b, need: need as f32, force: 0.0, joint: None }
        };
        let interfaces: Vec<_> = Load::all(world, config, touches).iter().map(interface).collect();
        self.follow_islands(world, &[], interfaces.iter().copied(), dt, Island::next);
    }

    fn follow_islands(
        &mut self,
        world: &World,
        asleep: &[bool],
        interfaces: impl Iterator<Item = Interface> + Clone,
        dt: f32,
        next: fn(&Island, u8, u8) -> (u8, u8),
    ) -> bool {
        let bodies = world.bodies.len();
        self.islands.reset(bodies);
        for Interface { a, b, .. } in interfaces.clone() {
            if a != IMMOVABLE && b != IMMOVABLE {
                self.islands.join(a, b);
            }
        }
        let roots = self.islands.roots();
        let root = |body: u32| roots[body as usize] as usize;
        self.of_root.clear();
        self.of_root.resize(bodies, Island::NONE);
        self.awake.clear();
        for (i, body) in (0..).zip(&world.bodies) {
            if body.kind == BodyKind::Fixed || asleep.get(i as usize) == Some(&true) {
                continue;
            }
            let is_dynamic = body.kind == BodyKind::Dynamic;
            self.awake.push((i, is_dynamic));
            let island = &mut self.of_root[root(i)];
            let i = i as usize;
            island.bodies += 1;
            island.class = island.class.max(self.classes[i]);
            island.first_class = island.first_class.max(self.first_classes.get(i).copied().unwrap_or(0));
            island.descent_steps = island.descent_steps.min(self.descent_steps[i]);
            island.fastest = island.fastest.max(body.linear_velocity.length());
            if is_dynamic {
                island.load += load_of(body, world.gravity_at(i), dt);
            }
        }
        let body_of = |a: u32, b: u32| Some(if a == IMMOVABLE { b } else { a }).filter(|&body| body != IMMOVABLE);
        for Interface { a, b, joint, .. } in interfaces.clone() {
            if let Some((body, JointNeed { drives, opening, is_stuck })) = body_of(a, b).zip(joint) {
                let island = &mut self.of_root[root(body)];
                island.load += drives;
                island.opening = island.opening.max(opening);
                island.whole_need = island.whole_need.max(opening);
                island.is_stuck |= is_stuck;
            }
        }
        for Interface { a, b, need, force, joint } in interfaces {
            let Some(body) = body_of(a, b) else { continue };
            let island = &mut self.of_root[root(body)];
            let need = need.min(LEVERAGE * island.load / force);
            if joint.is_some() {
                island.whole_need = island.whole_need.max(need);
            } else {
                island.largest_need = island.largest_need.max(need);
                island.contacts += 1;
            }
        }
        for &body in &self.unbalanced {
            let need = &mut self.of_root[root(body)].whole_need;
            *need = need.max(self.unbalanced_need);
        }
        for island in self.of_root.iter_mut().filter(|island| island.bodies > 0) {
            (island.class, island.descent_steps) = next(island, self.highest, self.long_from);
        }
        let mut changed = std::mem::take(&mut self.is_refined);
        self.counts = [0; EFFORT_CLASSES];
        for &(body, is_dynamic) in &self.awake {
            let Island { class, descent_steps, .. } = self.of_root[root(body)];
            let body = body as usize;
            changed |= class != self.classes[body];
            (self.classes[body], self.descent_steps[body]) = (class, descent_steps);
            self.counts[usize::from(class)] += u32::from(is_dynamic);
        }
        self.used.clear();
        self.used.extend((0..=HIGHEST).filter(|&class| self.counts[usize::from(class)] > 0));
        self.any_above = self.classes.iter().any(|&class| class > 0);
        changed
    }

    /// Number of awake bodies that can be pushed, for each class. `asleep` is the number of bodies asleep.
    pub fn counts(&self, asleep: usize) -> [u32; EFFORT_CLASSES] {
        if self.any_above {
            return self.counts;
        }
        let mut counts = [0; EFFORT_CLASSES];
        counts[0] = self.movable - asleep as u32;
        counts
    }

    /// Whether all bodies, including those asleep, are in class 0.
    pub fn is_one_class(&self) -> bool {
        !self.any_above
    }

    /// The class of a body.
    pub fn class_of(&self, body: usize) -> u8 {
        self.classes.get(body).copied().unwrap_or(0)
    }

    /// The number of blocks.
    pub fn block_count(&self) -> usize {
        self.used.len().max(1)
    }

    /// The block of a body. Awake bodies have one block for each class, in ascending order.
    pub fn block_of(&self, body: usize) -> usize {
        if self.used.len() < 2 {
            return 0;
        }
        self.used.iter().position(|&used| used == self.class_of(body)).unwrap_or(0)
    }

    /// The class of the bodies of a block.
    pub fn class_of_block(&self, block: usize) -> u8 {
        self.used.get(block).copied().unwrap_or_default()
    }

    /// The class of each body.
    pub fn classes(&self) -> &[u8] {
        &self.classes
    }

    /// The length of the substeps of a body over that of class 0.
    pub fn share(&self, body: usize) -> f32 {
        Self::share_of(self.class_of(body))
    }

    /// The length of the substeps of a class over that of class 0.
    pub fn share_of(class: u8) -> f32 {
        1.0 / (1_u32 << class) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hit_of_one_step_never_counts_and_a_load_does_soon() {
        assert!(lasting(1e9, 0.0) < 1.0);
        let mut need = 0.0;
        let steps = (1..).find(|_| {
            need = lasting(1000.0, need);
            need == 1000.0
        });
        assert_eq!(steps, Some(7));
        assert_eq!(lasting(0.0, 1000.0), 0.0);
    }
}

//! Two bodies in the frame of the contact between them. Doubles of `shaders/lib/frame.wgsl`.
//!
//! x is along the first tangent, y along the second, z along the normal. In these axes an impulse along the normal or a
//! tangent has one or two numbers, and so has its moment: a point takes about half of the operations that it takes in
//! the axes of the world. A sweep changes bodies once: their velocities by the sum of the impulses, their spins by the
//! sum of what the impulses changed.

use super::Rules;
use super::pair::spin_of;
use super::rows::{Contact, Free, Pair, Point, Sym3};
use crate::config::FrictionRule;
use crate::math::{Lane, NormalMovement, Vec3, cross3, dot3, vec3};

/// The axes of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame<L> {
    /// First unit tangent.
    pub tangent_1: Vec3<L>,
    /// Second unit tangent, the normal times the first.
    pub tangent_2: Vec3<L>,
    /// Unit normal from a to b.
    pub normal: Vec3<L>,
}

impl<L: Lane> Frame<L> {
    /// The frame of a contact.
    #[inline(always)]
    pub fn of(contact: &Contact<L>) -> Self {
        let Contact { normal, tangent, .. } = *contact;
        Self { tangent_1: tangent, tangent_2: cross3(normal, tangent), normal }
    }

    /// A vector of the world in these axes.
    #[inline(always)]
    pub fn components(&self, v: Vec3<L>) -> Vec3<L> {
        vec3(dot3(v, self.tangent_1), dot3(v, self.tangent_2), dot3(v, self.normal))
    }

    /// The vector of the world with these components.
    #[inline(always)]
    pub fn vector(&self, c: Vec3<L>) -> Vec3<L> {
        self.tangent_1 * c.x + self.tangent_2 * c.y + self.normal * c.z
    }

    /// A point whose arms are in the axes of the world, in these axes.
    #[inline(always)]
    pub fn point(&self, point: &Point<L>) -> Point<L> {
        Point { r_a: self.components(point.r_a), r_b: self.components(point.r_b), ..*point }
    }

    /// A movement along the normal, for arms in these axes.
    #[inline(always)]
    pub fn movement(&self, movement: NormalMovement<L>) -> NormalMovement<L> {
        movement.in_axes(self.tangent_1, self.tangent_2, self.normal)
    }

    /// A tensor of the world in these axes.
    #[inline(always)]
    fn tensor(&self, tensor: Sym3<L>) -> Sym3<L> {
        let along = [tensor.times(self.tangent_1), tensor.times(self.tangent_2), tensor.times(self.normal)];
        let x = vec3(dot3(self.tangent_1, along[0]), dot3(self.tangent_1, along[1]), dot3(self.tangent_1, along[2]));
        let yz = vec3(dot3(self.tangent_2, along[1]), dot3(self.tangent_2, along[2]), dot3(self.normal, along[2]));
        Sym3 { x, yz }
    }
}

/// Double of the WGSL struct `Motion`: velocities of two bodies in the frame of their contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion<L> {
    /// Velocity of the centre of b relative to that of a.
    pub u: Vec3<L>,
    /// Angular velocity of a.
    pub w_a: Vec3<L>,
    /// Angular velocity of b.
    pub w_b: Vec3<L>,
}

impl<L: Lane> Motion<L> {
    #[inline(always)]
    fn of(frame: &Frame<L>, a: Free<L>, b: Free<L>) -> Self {
        Self { u: frame.components(b.v - a.v), w_a: frame.components(a.w), w_b: frame.components(b.w) }
    }

    /// Velocity of b at r_b relative to a at r_a.
    #[inline(always)]
    fn at(&self, r_a: Vec3<L>, r_b: Vec3<L>) -> Vec3<L> {
        self.u + (cross3(self.w_b, r_b) - cross3(self.w_a, r_a))
    }
}

/// Double of the WGSL struct `FramedPair`: two bodies in the frame of their contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FramedPair<L> {
    /// The frame.
    pub frame: Frame<L>,
    /// Velocities.
    pub motion: Motion<L>,
    /// Velocities when the step began, if the others are changes since.
    pub start: Motion<L>,
    /// The sum of the impulses on b.
    pub impulse: Vec3<L>,
    /// The sum of the inverse masses.
    pub inv_mass: L,
    /// Inverse inertia of a.
    pub inv_inertia_a: Sym3<L>,
    /// Inverse inertia of b.
    pub inv_inertia_b: Sym3<L>,
}

impl<L: Lane> FramedPair<L> {
    /// Two bodies in the frame of a contact, before any impulse.
    #[inline(always)]
    pub fn new(rules: Rules, pair: &Pair<L>, frame: Frame<L>) -> Self {
        let Pair { a, b, mass_a, mass_b, start_a, start_b, .. } = pair;
        let (mut inv_inertia_a, mut inv_inertia_b) = (mass_a.inv_inertia, mass_b.inv_inertia);
        if !rules.isotropic {
            (inv_inertia_a, inv_inertia_b) = (frame.tensor(inv_inertia_a), frame.tensor(inv_inertia_b));
        }
        let mut start = Motion::default();
        if rules.from_start {
            start = Motion::of(&frame, *start_a, *start_b);
        }
        Self {
            frame,
            motion: Motion::of(&frame, Free { v: a.v, w: a.w }, Free { v: b.v, w: b.w }),
            start,
            impulse: Vec3::default(),
            inv_mass: mass_a.inv_mass + mass_b.inv_mass,
            inv_inertia_a,
            inv_inertia_b,
        }
    }

    /// Velocity of b at r_b relative to a at r_a.
    #[inline(always)]
    pub fn relative_velocity(&self, rules: Rules, r_a: Vec3<L>, r_b: Vec3<L>) -> Vec3<L> {
        let u = self.motion.at(r_a, r_b);
        if rules.from_start { u + self.start.at(r_a, r_b) } else { u }
    }

    /// Applies an impulse along the normal to b at r_b, and its opposite to a at r_a.
    #[inline(always)]
    pub fn press(&mut self, rules: Rules, r_a: Vec3<L>, r_b: Vec3<L>, impulse: L) {
        self.impulse.z = self.impulse.z + impulse;
        self.motion.u.z = self.motion.u.z + impulse * self.inv_mass;
        self.motion.w_a -= spin_by_normal(rules, self.inv_inertia_a, r_a, impulse);
        self.motion.w_b += spin_by_normal(rules, self.inv_inertia_b, r_b, impulse);
    }

    /// Applies impulses along the tangents to b at r_b, and their opposites to a at r_a.
    #[inline(always)]
    pub fn rub(&mut self, rules: Rules, r_a: Vec3<L>, r_b: Vec3<L>, along_1: L, along_2: L) {
        self.impulse.x = self.impulse.x + along_1;
        self.impulse.y = self.impulse.y + along_2;
        self.motion.u.x = self.motion.u.x + along_1 * self.inv_mass;
        self.motion.u.y = self.motion.u.y + along_2 * self.inv_mass;
        self.motion.w_a -= spin_by_tangents(rules, self.inv_inertia_a, r_a, along_1, along_2);
        self.motion.w_b += spin_by_tangents(rules, self.inv_inertia_b, r_b, along_1, along_2);
    }

    /// Applies a moment about the normal to b, and its opposite to a.
    #[inline(always)]
    pub fn twist(&mut self, rules: Rules, moment: L) {
        let about = vec3(L::constant(0.0), L::constant(0.0), moment);
        self.motion.w_a -= spin_of(rules, self.inv_inertia_a, about);
        self.motion.w_b += spin_of(rules, self.inv_inertia_b, about);
    }

    /// Changes two bodies by what happened in their frame since [`FramedPair::new`].
    #[inline(always)]
    pub fn change(&self, rules: Rules, pair: &mut Pair<L>) {
        let Frame { tangent_1, tangent_2, normal } = self.frame;
        let has_friction = rules.friction != FrictionRule::None;
        let mut p = normal * self.impulse.z;
        if has_friction {
            p += tangent_1 * self.impulse.x + tangent_2 * self.impulse.y;
        }
        pair.a.v -= p * pair.mass_a.inv_mass;
        pair.b.v += p * pair.mass_b.inv_mass;
        let turn_a = self.motion.w_a - self.frame.components(pair.a.w);
        let turn_b = self.motion.w_b - self.frame.components(pair.b.w);
        pair.a.w += tangent_1 * turn_a.x + tangent_2 * turn_a.y;
        pair.b.w += tangent_1 * turn_b.x + tangent_2 * turn_b.y;
        // A normal impulse turns no body with equal moments of inertia about the normal.
        if has_friction || !rules.isotropic {
            pair.a.w += normal * turn_a.z;
            pair.b.w += normal * turn_b.z;
        }
    }
}

/// How an impulse along the normal at r turns a body: its inverse inertia times (r.y, -r.x, 0).
#[inline(always)]
fn spin_by_normal<L: Lane>(rules: Rules, inv_inertia: Sym3<L>, r: Vec3<L>, impulse: L) -> Vec3<L> {
    let Sym3 { x, yz } = inv_inertia;
    if rules.isotropic {
        let turn = x.x * impulse;
        return vec3(r.y * turn, -(r.x * turn), L::constant(0.0));
    }
    vec3(x.x * r.y - x.y * r.x, x.y * r.y - yz.x * r.x, x.z * r.y - yz.y * r.x) * impulse
}

/// How impulses along the tangents at r turn a body.
#[inline(always)]
fn spin_by_tangents<L: Lane>(rules: Rules, inv_inertia: Sym3<L>, r: Vec3<L>, along_1: L, along_2: L) -> Vec3<L> {
    spin_of(rules, inv_inertia, vec3(-(r.z * along_2), r.z * along_1, r.x * along_2 - r.y * along_1))
}

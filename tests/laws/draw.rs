//! Random worlds of jointed bodies: a family, a kind of joint and a seed make one, the same everywhere and forever.

use std::f32::consts::PI;
use std::fmt;
use std::str::FromStr;

use drystone::glam::{Quat, Vec3};
use drystone::stages::random::SplitMix64;
use drystone::{Axis, Body, BodyHandle, BodyKind, Error, Groups, Joint, Linear, Shape, World, named};
use drystone_scenes::Scene;

/// The things that the worlds of a family have beside bodies of 0.1 to 1 m and 100 to 10,000 kg/m³ on joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Nothing.
    Plain,
    /// Motors on most axes that are not locked; a third of them at speed 0.
    Motors,
    /// Springs on most axes that are not locked; half of them without damper.
    Springs,
    /// A kinematic body that shifts or turns.
    Kinematic,
    /// Masses of 1 g to 1 t.
    Ratios,
    /// Anchors up to 100 sizes of the second body beside it.
    Levers,
    /// Restitution from 0 to 1 of each body.
    Bouncing,
}

named!(Family {
    Plain = "plain",
    Motors = "motors",
    Springs = "springs",
    Kinematic = "kinematic",
    Ratios = "ratios",
    Levers = "levers",
    Bouncing = "bouncing",
});

/// The joints of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Bodies without joints.
    None,
    Ball,
    Hinge,
    Slider,
    Fixed,
    /// Axes free, limited or locked.
    Generic,
    /// Ropes, rods, springs.
    Distance,
    /// Any of them, for each joint anew.
    All,
}

named!(Kind {
    None = "none",
    Ball = "ball",
    Hinge = "hinge",
    Slider = "slider",
    Fixed = "fixed",
    Generic = "generic",
    Distance = "distance",
    All = "all",
});

/// A world: what it is drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    pub family: Family,
    pub kind: Kind,
    /// Whether the bodies of the world collide with each other. With the floor they do anyway.
    pub collides: bool,
    pub seed: u64,
}

/// As in `plain/ball-0/17`.
impl fmt::Display for Drawn {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}-{}/{}", self.family, self.kind, u8::from(self.collides), self.seed)
    }
}

impl FromStr for Drawn {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let form = || format!("{name}: no world; plain/ball-0/17 is one");
        let [family, group, seed] = name.split('/').collect::<Vec<_>>()[..] else { return Err(form()) };
        let (kind, collides) = group.rsplit_once('-').ok_or_else(form)?;
        let collides = match collides {
            "0" => false,
            "1" => true,
            _ => return Err(form()),
        };
        let seed = seed.parse().map_err(|_| form())?;
        let line = |error: Error| error.to_string();
        Ok(Self { family: family.parse().map_err(line)?, kind: kind.parse().map_err(line)?, collides, seed })
    }
}

/// Random numbers.
struct Random(SplitMix64);

impl Random {
    fn within(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * (0.5 + 0.5 * self.0.symmetric()) as f32
    }

    /// Uniform in its logarithm.
    fn scale(&mut self, least: f32, most: f32) -> f32 {
        self.within(least.ln(), most.ln()).exp()
    }

    fn happens(&mut self, chance: f32) -> bool {
        self.within(0.0, 1.0) < chance
    }

    fn below(&mut self, end: usize) -> usize {
        (self.0.bits() % end as u64) as usize
    }

    fn vector(&mut self, size: f32) -> Vec3 {
        Vec3::from_array([(); 3].map(|()| self.within(-size, size)))
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    fn rotation(&mut self) -> Quat {
        Quat::from_axis_angle(self.direction(), self.within(-PI, PI))
    }
}

/// The longest side of a shape that is drawn (m).
const SIZES: (f32, f32) = (0.1, 1.0);
/// Distance of neighbors along x, and across it (m).
const SPACING: (f32, f32) = (0.5, 1.1);
const BESIDE: f32 = 0.4;
/// The floor is below the lowest point of every body by at least this (m).
const CLEARANCE: f32 = 0.02;

/// A body at the origin, and its longest side.
fn body(random: &mut Random, family: Family) -> (Body, f32) {
    let size = random.scale(SIZES.0, SIZES.1);
    let half = 0.5 * size;
    let shape = match random.below(4) {
        0 => Shape::ball(half),
        1 => {
            let [y, z] = [(); 2].map(|()| half * random.within(0.3, 1.0));
            Shape::cuboid(half, y, z)
        }
        2 => {
            let radius = half * random.within(0.3, 0.8);
            Shape::capsule(half - radius, radius)
        }
        _ => Shape::cylinder(half * random.within(0.2, 1.0), half * random.within(0.3, 0.8)),
    };
    let density = random.scale(100.0, 1e4);
    let mass = random.scale(1e-3, 1e3);
    let body = Body::dynamic().shape(shape).friction(random.within(0.0, 1.0)).rotation(random.rotation());
    let (moves, turns) = (random.happens(0.5), random.happens(0.5));
    let (velocity, spin) = (random.vector(3.0), random.vector(5.0));
    let keep = |keeps: bool, v: Vec3| if keeps { v } else { Vec3::ZERO };
    let body = body.velocity(keep(moves, velocity), keep(turns, spin));
    let body = if family == Family::Bouncing { body.restitution(random.within(0.0, 1.0)) } else { body };
    (if family == Family::Ratios { body.total_mass(mass) } else { body.density(density) }, size)
}

/// Limits of a place or an angle around 0, or none.
fn limits(random: &mut Random, most: f32, chance: f32) -> Axis {
    let (is_limited, least, most) = (random.happens(chance), random.within(0.02, most), random.within(0.02, most));
    if is_limited { Axis::limited(-least, most) } else { Axis::FREE }
}

/// An axis of a generic joint.
fn axis(random: &mut Random, most: f32) -> Axis {
    let limited = limits(random, most, 1.0);
    [Axis::FREE, limited, Axis::LOCKED][random.below(3)]
}

/// A joint of a kind between two bodies whose anchors coincide; a distance has the anchor of a beside its center instead.
fn joint(random: &mut Random, kind: Kind, joint: Joint, beside: Vec3) -> Joint {
    const KINDS: [Kind; 6] = [Kind::Ball, Kind::Hinge, Kind::Slider, Kind::Fixed, Kind::Generic, Kind::Distance];
    let kind = if kind == Kind::All { KINDS[random.below(KINDS.len())] } else { kind };
    match kind {
        Kind::None | Kind::Ball | Kind::All => joint,
        Kind::Hinge => {
            let angle = limits(random, 2.8, 0.6);
            joint.generic([Axis::LOCKED; 3], [angle, Axis::LOCKED, Axis::LOCKED])
        }
        Kind::Slider => {
            let place = limits(random, 0.5, 0.6);
            joint.generic([place, Axis::LOCKED, Axis::LOCKED], [Axis::LOCKED; 3])
        }
        Kind::Fixed => joint.fixed(),
        Kind::Generic => {
            let holds = random.happens(0.7);
            let linear = [(); 3].map(|()| axis(random, 0.5));
            let angular = [2.8, 1.5, 1.5].map(|most| axis(random, most));
            joint.generic(if holds { [Axis::LOCKED; 3] } else { linear }, angular)
        }
        Kind::Distance => {
            let length = beside.length();
            let joint = Joint { anchor_a: joint.anchor_a + beside, ..joint };
            let (slack, frequency, damping) =
                (random.within(0.5, 1.5), random.scale(0.3, 10.0), random.within(-1.0, 1.0));
            match random.below(3) {
                0 => joint.rope(length * slack.max(1.0)),
                1 => joint.rod(length),
                _ => joint.elastic(length * slack, frequency, damping.max(0.0)),
            }
        }
    }
}

/// A drive for each axis of a joint that is not locked, of most. `load` is what the joint bears about (N).
fn drive(random: &mut Random, family: Family, joint: &mut Joint, load: f32) {
    // No scene file drives both a distance and angles.
    let (is_ball, is_distance) = (joint.is_ball(), matches!(joint.linear, Linear::Distance(_)));
    let linear: &mut [Axis] = match &mut joint.linear {
        Linear::Axes(axes) => axes,
        Linear::Distance(distance) => std::slice::from_mut(distance),
    };
    let count = linear.len();
    for (i, axis) in linear.iter_mut().chain(&mut joint.angular).enumerate() {
        let is_angle = i >= count;
        let (is_driven, strength, is_still) = (random.happens(0.7), random.scale(0.1, 10.0), random.happens(1.0 / 3.0));
        let speed =
            random.within(0.5, if is_angle { 10.0 } else { 2.0 }) * if random.happens(0.5) { 1.0 } else { -1.0 };
        let (frequency, damping, is_damped) = (random.scale(0.3, 20.0), random.within(0.0, 1.0), random.happens(0.5));
        let (target, is_weak) = (random.within(-0.3, 0.3), random.happens(0.2));
        // A torque is that of the load on a lever of 0.5 m.
        let load = load * strength * if is_angle { 0.5 } else { 1.0 };
        if !is_driven || *axis == Axis::LOCKED || (is_ball && !is_angle) || (is_distance && is_angle) {
            continue;
        }
        // A spring of a distance has its target already.
        let is_spring = matches!(axis.drive, drystone::Drive::Spring { .. });
        match family {
            Family::Motors => *axis = axis.motor(if is_still { 0.0 } else { speed }, load),
            Family::Springs if !is_spring => {
                let most = if is_weak { load } else { f32::MAX };
                let target = if count == 1 && !is_angle { 0.5 + target } else { target };
                *axis = axis.spring(target, frequency, if is_damped { damping } else { 0.0 }, most);
            }
            _ => {}
        }
    }
}

impl Drawn {
    /// The scene: 10 s at 60 steps a second.
    pub fn scene(&self) -> Scene {
        let label = format!("{}/{}-{}", self.family, self.kind, u8::from(self.collides));
        let stream = label
            .bytes()
            .fold(self.seed, |all, byte| SplitMix64::new(all.wrapping_mul(257).wrapping_add(u64::from(byte))).bits());
        let random = &mut Random(SplitMix64::new(stream));
        let mut world = World::new();
        let has_floor = random.happens(0.5);
        if has_floor {
            world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).named("floor"));
        } else if random.happens(0.8) {
            world.gravity = Vec3::ZERO;
        }
        let count = 2 + random.below(6);
        let driver = (self.family == Family::Kinematic).then(|| random.below(count));
        let mut at = Vec3::Y * if has_floor { 2.5 } else { 0.0 };
        let mut chain: Vec<(BodyHandle, f32)> = Vec::new();
        for i in 0..count {
            let (mut own, size) = body(random, self.family);
            at += Vec3::new(random.within(SPACING.0, SPACING.1), 0.0, 0.0)
                + random.vector(BESIDE) * Vec3::new(0.0, 1.0, 1.0);
            if has_floor {
                at.y = at.y.max(0.87 * size + CLEARANCE);
            }
            let turns = random.happens(0.4);
            if driver == Some(i) {
                (own.kind, own.mass) = (BodyKind::Kinematic, drystone::MassProperties::IMMOVABLE);
                let (velocity, spin) = (random.vector(2.0), random.vector(3.0));
                // Its work is known from the momentum that it gives: where it turns, only if nothing else gives any.
                let is_turning = turns && !has_floor;
                own = own.velocity(
                    if is_turning { Vec3::ZERO } else { velocity },
                    if is_turning { spin } else { Vec3::ZERO },
                );
            }
            if !self.collides {
                own.groups = Groups { membership: 2 << i, filter: 1 };
            }
            chain.push((world.insert(own.position(at.x, at.y, at.z).named(format!("b{i}"))), size));
        }
        let first_joint = random.happens(0.15) && driver.is_none();
        for i in usize::from(!first_joint)..count {
            let (b, size) = chain[i];
            let (reach, away) = (random.scale(1.0, 100.0), random.direction() * random.within(0.0, 0.2));
            let away = if self.family == Family::Levers { away.normalize_or(Vec3::X) * size * reach } else { away };
            let (chance, loops) = (random.happens(0.85), random.happens(0.1));
            let a = match i {
                0 => None,
                1 => Some(chain[0].0),
                _ => Some(chain[i - if loops { 2 } else { 1 }].0),
            };
            self.join(random, &mut world, [Some(b), a], away, chance || count == 2);
            if loops && i > 1 {
                self.join(random, &mut world, [Some(b), Some(chain[i - 1].0)], away, true);
            }
        }
        Scene::new(self.to_string(), world, 600)
    }

    /// Joins body b to body a, or to the world, `away` from the center of b.
    fn join(&self, random: &mut Random, world: &mut World, ends: [Option<BodyHandle>; 2], away: Vec3, is_there: bool) {
        let [Some(b), a] = ends else { return };
        let pose = |body: Option<BodyHandle>| {
            body.map_or((Vec3::ZERO, Quat::IDENTITY), |i| (world.bodies[i].position, world.bodies[i].rotation))
        };
        let ((at_b, turn_b), (at_a, turn_a)) = (pose(Some(b)), pose(a));
        let point = at_b + away;
        let anchor_b = turn_b.inverse() * away;
        let beside = random.direction() * random.within(0.1, 0.6);
        let along = random.direction();
        let tie = match a {
            // The first body of a joint is the one whose anchor a distance shifts.
            Some(a) => Joint::new(a, turn_a.inverse() * (point - at_a), b, anchor_b),
            None => Joint::to_world(b, anchor_b, point),
        };
        let frames = if a.is_some() { (turn_a, turn_b) } else { (turn_b, Quat::IDENTITY) };
        let tie = tie.along(along).zero_at(frames.0, frames.1);
        let mut tie = joint(random, self.kind, tie, beside);
        tie.collide = self.collides;
        let mass = |body: Option<BodyHandle>| body.map_or(0.0, |i| world.bodies[i].mass.mass);
        let lighter = match (mass(a), mass(Some(b))) {
            (x, y) if x > 0.0 && y > 0.0 => x.min(y),
            (x, y) => x.max(y),
        };
        drive(random, self.family, &mut tie, 10.0 * lighter);
        let moves = |i: BodyHandle| world.bodies[i].kind == BodyKind::Dynamic;
        if is_there && self.kind != Kind::None && (moves(b) || a.is_some_and(moves)) {
            world.insert_joint(tie);
        }
    }
}

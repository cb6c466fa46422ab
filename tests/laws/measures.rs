//! The quantities of the laws, in f64, from a world between two steps: energy, momentum, gaps of joints.

use std::f64::consts::{PI, TAU};

use drystone::glam::{DMat3, DQuat, DVec3};
use drystone::{Axis, Body, BodyKind, Bounds, Drive, Joint, Linear, World};

/// Energy and momentum of the dynamic bodies of a world.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mechanics {
    pub mass: f64,
    /// Kinetic (J).
    pub kinetic: f64,
    /// Kinetic energy of the motion of the common center of mass (J).
    pub common: f64,
    /// Of gravity, zero at the origin (J).
    pub potential: f64,
    /// Linear momentum (kg m/s).
    pub momentum: DVec3,
    /// Angular momentum about the common center of mass (kg m²/s).
    pub spin: DVec3,
    /// Angular momentum about the origin (kg m²/s).
    pub spin_about_origin: DVec3,
    /// Sum of mass times center of mass (kg m).
    pub moment: DVec3,
    /// Sum of the sizes of the momenta of the bodies, relative to the common center (kg m/s).
    pub momenta: f64,
    /// Likewise of the angular momenta.
    pub spins: f64,
    /// Sum of mass times distance from the common center times speed (kg m²/s).
    pub levers: f64,
}

fn inertia(body: &Body) -> DMat3 {
    let turn = body.rotation.as_dquat().normalize() * body.mass.principal_frame.as_dquat().normalize();
    let axes = DMat3::from_quat(turn);
    axes * DMat3::from_diagonal(body.mass.principal_inertia.as_dvec3()) * axes.transpose()
}

/// The center of mass of a body, without the rounding of a sum in f32 (m).
pub fn center(body: &Body) -> DVec3 {
    body.position.as_dvec3() + rotation(body) * body.mass.center.as_dvec3()
}

fn rotation(body: &Body) -> DQuat {
    body.rotation.as_dquat().normalize()
}

impl Mechanics {
    pub fn of(world: &World) -> Self {
        let mut all = Self::default();
        for body in world.dynamic() {
            let (m, x, v) = (f64::from(body.mass.mass), center(body), body.linear_velocity.as_dvec3());
            all.mass += m;
            all.moment += m * x;
            all.momentum += m * v;
        }
        if all.mass == 0.0 {
            return all;
        }
        let (common, drift) = (all.moment / all.mass, all.momentum / all.mass);
        all.common = 0.5 * all.mass * drift.length_squared();
        for handle in world.bodies.handles().filter(|&body| world.bodies[body].kind == BodyKind::Dynamic) {
            let body = &world.bodies[handle];
            let (m, x, v) = (f64::from(body.mass.mass), center(body), body.linear_velocity.as_dvec3());
            let spin = body.angular_velocity.as_dvec3();
            let own = inertia(body) * spin;
            all.kinetic += 0.5 * m * v.length_squared() + 0.5 * spin.dot(own);
            all.potential -= m * world.gravity_on(handle).as_dvec3().dot(x);
            let (arm, beside) = (x - common, v - drift);
            all.spin += m * arm.cross(beside) + own;
            all.spin_about_origin += m * x.cross(v) + own;
            all.momenta += m * beside.length();
            all.spins += m * arm.length() * beside.length() + own.length();
            all.levers += m * arm.length() * v.length();
        }
        all
    }
}

/// Whether nothing outside touches the dynamic bodies, gravity apart that is the same for all.
pub fn is_alone(world: &World) -> bool {
    let all_move = world.bodies.iter().all(|body| body.kind == BodyKind::Dynamic && body.gravity_scale == 1.0);
    all_move && world.joints.iter().all(|joint| joint.body_b.is_some())
}

/// One axis of a joint as it stands.
struct Stand {
    axis: Axis,
    is_angle: bool,
    /// Of body a against body b (m, rad).
    position: f64,
    /// One over the mass that the free bodies have at the anchors, in the mean of all directions, or over their reduced inertia about the axis in
    /// each.
    inverse_mass: f64,
}

/// The same angle, by whole turns as near to another one as it can be (rad).
fn nearest(angle: f64, to: f64) -> f64 {
    angle - TAU * ((angle - to) / TAU).round()
}

/// The bodies of a joint.
fn ends<'a>(world: &'a World, joint: &Joint) -> [Option<&'a Body>; 2] {
    [world.body(joint.body_a), joint.body_b.and_then(|b| world.body(b))]
}

/// The anchors of a joint (m).
fn anchors(world: &World, joint: &Joint) -> [DVec3; 2] {
    let [a, b] = ends(world, joint);
    let on = |body: Option<&Body>, anchor: DVec3| {
        body.map_or(anchor, |body| body.position.as_dvec3() + rotation(body) * anchor)
    };
    [on(a, joint.anchor_a.as_dvec3()), on(b, joint.anchor_b.as_dvec3())]
}

/// The axes of a joint that holds any: their places, and what moves along them.
fn stands(world: &World, joint: &Joint) -> Vec<Stand> {
    let (linear, is_distance): (&[Axis], bool) = match &joint.linear {
        Linear::Axes(axes) => (axes, false),
        Linear::Distance(distance) => (std::slice::from_ref(distance), true),
    };
    let [a, b] = ends(world, joint);
    let [at_a, at_b] = anchors(world, joint);
    let apart = at_a - at_b;
    let frame = b.map_or(DQuat::IDENTITY, rotation) * joint.frame_b.as_dquat().normalize();
    let motion = world.joint_motion(joint);
    let unit = [DVec3::X, DVec3::Y, DVec3::Z];
    let sides = [(a, joint.frame_a, joint.anchor_a), (b, joint.frame_b, joint.anchor_b)];
    let inverse_mass = |of: &dyn Fn(&Body, DQuat, DVec3) -> f64| -> f64 {
        let movable = sides.iter().filter_map(|(body, frame, anchor)| {
            Some((body.filter(|body| body.kind == BodyKind::Dynamic)?, frame, anchor))
        });
        movable.map(|(body, frame, anchor)| of(body, frame.as_dquat().normalize(), anchor.as_dvec3())).sum()
    };
    let mut all: Vec<Stand> = Vec::with_capacity(6);
    for (i, &axis) in linear.iter().enumerate() {
        let n = if is_distance { apart.normalize_or(frame * DVec3::X) } else { frame * unit[i] };
        let along = |body: &Body, _: DQuat, anchor: DVec3| {
            let arm = rotation(body) * (anchor - body.mass.center.as_dvec3());
            let turned = unit.map(|axis| arm.cross(axis)).map(|about| about.dot(inertia(body).inverse() * about));
            1.0 / f64::from(body.mass.mass) + turned.iter().sum::<f64>() / 3.0
        };
        all.push(Stand { axis, is_angle: false, position: n.dot(apart), inverse_mass: inverse_mass(&along) });
    }
    for (i, &axis) in joint.angular.iter().enumerate() {
        let about = |body: &Body, frame: DQuat, _: DVec3| {
            let own = frame * unit[i];
            let turned = rotation(body) * own;
            turned.dot(inertia(body).inverse() * turned)
        };
        let position = f64::from(motion.position[3 + i]);
        all.push(Stand { axis, is_angle: true, position, inverse_mass: inverse_mass(&about) });
    }
    all
}

/// The stiffness of a spring of the caller (N/m, N m/rad), its distance from where it is at rest, and the most that it bears.
///
/// [`Drive::Spring`] has a frequency: the stiffness is that of the mass that its free bodies have at the anchors, by the mean of its inverse over all
/// directions, or of their reduced inertia about the axis of the joint in each.
struct Spring {
    stiffness: f64,
    gap: f64,
    most: f64,
}

impl Spring {
    fn of(stand: &Stand) -> Option<Self> {
        let Drive::Spring { target, frequency, max_load, .. } = stand.axis.drive else { return None };
        let gap = if stand.is_angle {
            nearest(stand.position, f64::from(target)) - f64::from(target)
        } else {
            stand.position - f64::from(target)
        };
        let rate = TAU * f64::from(frequency);
        let stiffness = if stand.inverse_mass > 0.0 { rate * rate / stand.inverse_mass } else { 0.0 };
        Some(Self { stiffness, gap, most: f64::from(max_load) })
    }

    /// The work that it can do: it pushes by stiffness times gap, and by no more than its most.
    fn energy(&self) -> f64 {
        let free = (self.most / self.stiffness).min(self.gap.abs());
        0.5 * self.stiffness * free * free + self.most.min(1e30) * (self.gap.abs() - free)
    }
}

/// The energy of the springs of the caller.
#[derive(Clone, Copy, Debug, Default)]
pub struct Springs {
    /// (J)
    pub energy: f64,
}

impl Springs {
    pub fn of(world: &World) -> Self {
        let mut all = Self::default();
        for joint in &world.joints {
            let has_spring = |axis: &Axis| matches!(axis.drive, Drive::Spring { .. });
            let linear = match &joint.linear {
                Linear::Axes(axes) => axes.iter().any(has_spring),
                Linear::Distance(distance) => has_spring(distance),
            };
            if linear || joint.angular.iter().any(has_spring) {
                all.energy +=
                    stands(world, joint).iter().filter_map(Spring::of).map(|spring| spring.energy()).sum::<f64>();
            }
        }
        all
    }
}

/// How far a joint is from where it is to be: as a share of its lever (m/m), and by angles (rad).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gap {
    /// Of the longest arm of the joint, or the smallest half extent of its bodies if that is longer.
    pub share: f64,
    /// An angle of 0.01 moves the end of a lever by 1 % of the lever.
    pub angle: f64,
    /// (m)
    pub distance: f64,
}

impl Gap {
    pub fn of(world: &World, joint: &Joint) -> Self {
        let [at_a, at_b] = anchors(world, joint);
        let lever = lever(world, joint, [at_a, at_b]);
        let outside = |stand: &Stand| match stand.axis.bounds {
            Bounds::Free => 0.0,
            Bounds::Locked => stand.position.abs(),
            Bounds::Between { min, max } => {
                let (min, max) = (f64::from(min), f64::from(max));
                let place = if stand.is_angle { nearest(stand.position, 0.5 * (min + max)) } else { stand.position };
                (min - place).max(place - max).max(0.0)
            }
        };
        let (mut square, mut angle) = (0.0, 0.0_f64);
        for stand in &stands(world, joint) {
            match stand.is_angle {
                true => angle = angle.max(outside(stand).min(PI)),
                false => square += outside(stand).powi(2),
            }
        }
        let distance: f64 = square.sqrt();
        Self { share: distance / lever, angle, distance }
    }

    /// The largest of all joints, each number by itself.
    pub fn largest(world: &World) -> Self {
        world.joints.iter().map(|joint| Self::of(world, joint)).fold(Self::default(), |all, own| Self {
            share: all.share.max(own.share),
            angle: all.angle.max(own.angle),
            distance: all.distance.max(own.distance),
        })
    }

    /// The larger of both.
    pub fn worst(&self) -> f64 {
        self.share.max(self.angle)
    }
}

/// The longest arm of a joint, or the smallest half extent of its bodies that can move if that is longer (m). Where the anchors are apart, as on a
/// slider, the arm of a body reaches to the further one.
fn lever(world: &World, joint: &Joint, at: [DVec3; 2]) -> f64 {
    let of = |body: Option<&Body>| {
        let Some(body) = body.filter(|body| body.kind == BodyKind::Dynamic) else { return 0.0 };
        let extent = f64::from(body.smallest_half_extent());
        let arms = at.map(|anchor| anchor.distance(center(body)));
        arms.into_iter().fold(if extent.is_finite() { extent } else { 0.0 }, f64::max)
    };
    ends(world, joint).into_iter().map(of).fold(1e-9, f64::max)
}

/// The largest distance of a point of the shapes of a body from its origin, or without shapes the radius of a ball of its inertia (m).
pub fn size(body: &Body) -> f64 {
    let of = |c: &drystone::world::Collider| f64::from(c.position.length() + c.shape.bounding_radius());
    let size = body.colliders.iter().map(of).filter(|size| size.is_finite()).fold(0.0, f64::max);
    let mass = body.mass;
    if size > 0.0 { size } else { (2.5 * f64::from(mass.principal_inertia.max_element() / mass.mass)).sqrt() }
}

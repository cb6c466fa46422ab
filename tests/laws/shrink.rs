//! Makes a world that breaks a law smaller while it still does.

use drystone::glam::{Quat, Vec3};
use drystone::{Axis, Body, BodyKind, Bounds, Drive, Joint, Linear, MassProperties, Shape, World};

use super::run::{Case, Verdict, run};

/// The broken law that has to stay broken as a world shrinks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// A gain of energy of at least this share, above what the world began with.
    Gain(f64),
    /// Energy of at least this share that was lost and comes back.
    Return(f64),
    /// A step is refused, or numbers are not finite.
    Lost,
    /// A gap of at least this share or angle.
    Gap(f64),
    /// A drift of the momentum, or of the angular momentum, of at least this share.
    Drift(usize, f64),
}

impl Cause {
    /// The worst that a run shows, at half of its size or less; none if it breaks no law.
    pub fn of(verdict: &Verdict) -> Option<Self> {
        let drift = verdict.drift.unwrap_or_default();
        match verdict.broken().first().copied()? {
            "finite" => Some(Self::Lost),
            "energy" if verdict.above_start > 0.0 => Some(Self::Gain((0.5 * verdict.lasting_gain()).min(0.05))),
            "energy" => Some(Self::Return((0.5 * verdict.gain()).min(0.05))),
            "gap" => Some(Self::Gap((0.5 * verdict.gap.worst()).clamp(0.01, 0.1))),
            "momentum" => Some(Self::Drift(0, (0.5 * drift[0]).min(1e-2))),
            _ => Some(Self::Drift(1, (0.5 * drift[1]).min(1e-2))),
        }
    }

    /// Whether a run shows it.
    pub fn is_in(self, verdict: &Verdict) -> bool {
        match self {
            Self::Gain(share) => verdict.lost.is_none() && verdict.lasting_gain() >= share,
            Self::Return(share) => verdict.lost.is_none() && verdict.gain() >= share,
            Self::Lost => verdict.lost.is_some() && verdict.scale > 0.0,
            Self::Gap(most) => verdict.lost.is_none() && verdict.gap.worst() >= most,
            Self::Drift(which, most) => verdict.drift.is_some_and(|drift| drift[which] >= most),
        }
    }
}

/// Most runs of a shrinking.
const MAX_RUNS: usize = 500;

/// The smallest case found that still shows the cause.
pub fn shrunk(case: &Case, cause: Cause) -> Case {
    let enough = if cause == Cause::Lost { f64::INFINITY } else { 100.0 };
    let mut best = Case { enough, ..case.clone() };
    let mut runs = 0;
    let mut shows = |next: &Case| {
        runs += 1;
        (runs <= MAX_RUNS).then(|| cause.is_in(&run(next)))
    };
    // A run of some times what it takes to break the law costs less, and leaves room for worlds that take longer.
    let steps = run(&best).broken_at.map_or(u32::MAX, |step| 4 * step + 60);
    let next = Case { seconds: best.seconds.min(steps as f32 * best.scene.dt), ..best.clone() };
    if shows(&next) == Some(true) {
        best = next;
    }
    let (mut place, mut since) = (0, 0);
    loop {
        let all = changes(&best.scene.world);
        if since > all.len() {
            break;
        }
        place %= all.len();
        let mut next = best.clone();
        since += 1;
        if all[place](&mut next.scene.world) && next.scene.world.check().is_ok() {
            match shows(&next) {
                // The next change stands in the same place where a body or a joint went.
                Some(true) => (best, since) = (next, 0),
                Some(false) => place += 1,
                None => break,
            }
        } else {
            place += 1;
        }
    }
    loop {
        let next = Case { seconds: 0.5 * best.seconds, ..best.clone() };
        if next.steps() < 10 || !cause.is_in(&run(&next)) {
            break;
        }
        best = next;
    }
    best.enough = case.enough;
    best.scene.steps = best.steps();
    best
}

/// Something that makes a world smaller; false if the world is so already.
type Change = Box<dyn Fn(&mut World) -> bool>;

/// Changes that may be tried, those that take most away first.
fn changes(world: &World) -> Vec<Change> {
    let mut all: Vec<Change> = Vec::new();
    let bodies: Vec<usize> = (0..world.bodies.len()).filter(|&i| world.bodies.handle(i).is_some()).collect();
    for &i in bodies.iter().rev() {
        all.push(Box::new(move |world| without_body(world, i)));
    }
    for k in (0..world.joints.len()).rev() {
        all.push(Box::new(move |world| {
            let handle = world.joints.handles()[k];
            world.remove_joint(handle).is_some()
        }));
    }
    all.push(Box::new(|world| std::mem::replace(&mut world.gravity, Vec3::ZERO) != Vec3::ZERO));
    for &i in &bodies {
        let change = |change: fn(&mut Body) -> bool| -> Change {
            Box::new(move |world| {
                let handle = world.bodies.handle(i).expect("a body that is there");
                world.body_mut(handle).is_some_and(change)
            })
        };
        all.push(Box::new(move |world| without_shapes(world, i)));
        all.push(change(|body| std::mem::replace(&mut body.linear_velocity, Vec3::ZERO) != Vec3::ZERO));
        all.push(change(|body| std::mem::replace(&mut body.angular_velocity, Vec3::ZERO) != Vec3::ZERO));
        all.push(change(|body| std::mem::replace(&mut body.material.friction, 0.0) != 0.0));
        all.push(Box::new(move |world| is_held(world, i)));
        all.push(change(isotropic));
        all.push(change(|body| {
            let radius = rounded(body.smallest_half_extent());
            let is_ball = body.colliders.iter().all(|c| c.shape.is_ball() || c.shape.is_half_space());
            let ball = (!is_ball).then(|| body.colliders[0].shape = Shape::ball(radius));
            ball.is_some()
        }));
    }
    for k in 0..world.joints.len() {
        let change = |change: fn(&mut Joint) -> bool| -> Change {
            Box::new(move |world| {
                let handle = world.joints.handles()[k];
                world.joint_mut(handle).is_some_and(change)
            })
        };
        all.push(change(|joint| std::mem::replace(&mut joint.collide, false)));
        for axis in 0..6 {
            for simpler in [simpler_free, simpler_locked, simpler_undriven] {
                all.push(Box::new(move |world| {
                    let handle = world.joints.handles()[k];
                    // A ball joint stays one.
                    let is_fit = |joint: &Joint| axis >= 3 || !joint.holds_anchors();
                    world
                        .joint_mut(handle)
                        .is_some_and(|joint| is_fit(joint) && axis_of(joint, axis).is_some_and(simpler))
                }));
            }
        }
    }
    for &i in &bodies {
        all.push(Box::new(move |world| {
            let handle = world.bodies.handle(i).expect("a body that is there");
            let Some(body) = world.body_mut(handle) else { return false };
            let before = (body.linear_velocity, body.angular_velocity);
            body.linear_velocity = body.linear_velocity.map(rounded);
            body.angular_velocity = body.angular_velocity.map(rounded);
            body.material.friction = rounded(body.material.friction);
            before != (body.linear_velocity, body.angular_velocity)
        }));
        all.push(Box::new(move |world| {
            let handle = world.bodies.handle(i).expect("a body that is there");
            let Some(body) = world.body_mut(handle) else { return false };
            let before = body.mass;
            body.mass.mass = rounded(body.mass.mass);
            body.mass.principal_inertia = body.mass.principal_inertia.map(rounded);
            body.mass != before
        }));
        all.push(Box::new(move |world| {
            placed(world, i, |_, turn| (None, if turn == Quat::IDENTITY { None } else { Some(Quat::IDENTITY) }))
        }));
        all.push(Box::new(move |world| {
            placed(world, i, |at, _| (Some(at.map(rounded)).filter(|&next| next != at), None))
        }));
    }
    for k in 0..world.joints.len() {
        all.push(Box::new(move |world| {
            let handle = world.joints.handles()[k];
            let joint = *world.joint(handle).expect("a joint that is there");
            let [at, _] = world.anchors(&joint);
            let next = at.map(rounded);
            if !joint.holds_anchors() || next.distance(at) < 1e-5 {
                return false;
            }
            let local = |body: &Body| body.rotation.inverse() * (next - body.position);
            let anchor_a = local(world.body(joint.body_a).expect("a body of a joint"));
            let anchor_b = joint.body_b.map_or(next, |b| local(world.body(b).expect("a body of a joint")));
            let joint = world.joint_mut(handle).expect("a joint that is there");
            (joint.anchor_a, joint.anchor_b) = (anchor_a, anchor_b);
            true
        }));
    }
    all
}

/// Takes a body out, and closes the gap in the list.
fn without_body(world: &mut World, i: usize) -> bool {
    let mut next = World { gravity: world.gravity, ..World::new() };
    let mut place = vec![None; world.bodies.len()];
    for handle in world.bodies.handles().filter(|handle| handle.index() != i) {
        place[handle.index()] = Some(next.insert(world.bodies[handle.index()].clone()));
    }
    if next.dynamic_count() == 0 {
        return false;
    }
    for joint in world.joints.iter() {
        let b = joint.body_b.map(|b| place[b.index()]);
        if let (Some(body_a), Some(body_b)) = (place[joint.body_a.index()], b.map_or(Some(None), |b| b.map(Some))) {
            next.insert_joint(Joint { body_a, body_b, ..*joint });
        }
    }
    *world = next;
    true
}

/// Takes the shapes of a body away, which keeps its mass: it touches nothing.
fn without_shapes(world: &mut World, i: usize) -> bool {
    let body = &mut world.bodies[i];
    let had = !body.colliders.is_empty();
    if had {
        body.colliders.clear();
        if body.kind == BodyKind::Dynamic {
            *body = body.clone().mass_properties(body.mass);
        }
    }
    had
}

/// Fixes a body to the world.
fn is_held(world: &mut World, i: usize) -> bool {
    let body = &mut world.bodies[i];
    let moves = body.kind != BodyKind::Fixed;
    if moves {
        body.kind = BodyKind::Fixed;
        (body.linear_velocity, body.angular_velocity) = (Vec3::ZERO, Vec3::ZERO);
        body.mass = MassProperties::IMMOVABLE;
    }
    moves && world.dynamic_count() > 0
}

/// Gives a body the mean of its moments of inertia.
fn isotropic(body: &mut Body) -> bool {
    let moments = body.mass.principal_inertia;
    let differ = body.mass.is_anisotropic();
    if differ {
        let mass = MassProperties {
            principal_inertia: Vec3::splat(moments.element_sum() / 3.0),
            principal_frame: Quat::IDENTITY,
            ..body.mass
        };
        *body = body.clone().mass_properties(mass);
    }
    differ
}

/// Puts a body elsewhere, or turns it, with the anchors and axes of its joints where they are.
fn placed(world: &mut World, i: usize, to: impl Fn(Vec3, Quat) -> (Option<Vec3>, Option<Quat>)) -> bool {
    let (at, turn) = (world.bodies[i].position, world.bodies[i].rotation);
    let (next_at, next_turn) = match to(at, turn) {
        (None, None) => return false,
        (next_at, next_turn) => (next_at.unwrap_or(at), next_turn.unwrap_or(turn)),
    };
    let joints: Vec<_> = world.joints.handles().to_vec();
    for handle in joints {
        let joint = world.joint_mut(handle).expect("a joint that is there");
        let anchor = |anchor: Vec3| next_turn.inverse() * (at + turn * anchor - next_at);
        let frame = |frame: Quat| (next_turn.inverse() * (turn * frame)).normalize();
        if joint.body_a.index() == i {
            (joint.anchor_a, joint.frame_a) = (anchor(joint.anchor_a), frame(joint.frame_a));
        } else if joint.body_b.is_some_and(|b| b.index() == i) {
            (joint.anchor_b, joint.frame_b) = (anchor(joint.anchor_b), frame(joint.frame_b));
        }
    }
    (world.bodies[i].position, world.bodies[i].rotation) = (next_at, next_turn);
    true
}

fn axis_of(joint: &mut Joint, i: usize) -> Option<&mut Axis> {
    match &mut joint.linear {
        Linear::Axes(axes) if i < 3 => axes.get_mut(i),
        Linear::Distance(distance) if i == 0 => Some(distance),
        Linear::Distance(_) if i < 3 => None,
        _ => joint.angular.get_mut(i - 3),
    }
}

fn simpler_free(axis: &mut Axis) -> bool {
    axis.drive == Drive::None && std::mem::replace(&mut axis.bounds, Bounds::Free) != Bounds::Free
}

/// A limit that locks.
fn simpler_locked(axis: &mut Axis) -> bool {
    let is_limited = matches!(axis.bounds, Bounds::Between { .. });
    if is_limited && axis.drive == Drive::None {
        axis.bounds = Bounds::Locked;
    }
    is_limited && axis.drive == Drive::None
}

fn simpler_undriven(axis: &mut Axis) -> bool {
    std::mem::replace(&mut axis.drive, Drive::None) != Drive::None
}

/// Two digits.
fn rounded(x: f32) -> f32 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

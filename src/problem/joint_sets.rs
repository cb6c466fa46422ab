//! How far sweeps would leave the joints of a connected set of bodies open: the rule that chooses which joints are solved at once.

use std::f32::consts::TAU;

use glam::{Mat3, Vec3, Vec4};

use super::joint_loads::borne;
use crate::config::SolverConfig;
use crate::world::{Body, BodyKind, Bounds, Joint, Linear, World};

/// (h w)² of a body that swings at the frequency w under the pull of its joints, w² = Σ|r||F|/I, from which on sweeps need not hold it. A
/// light ball on two levers between the world and a heavy ball stays together up to 4 and flies apart at 4.5 to 6.
const MOST_SWING: f32 = 4.0;

/// The joints of a connected set of bodies that can move.
pub struct JointSet {
    /// Their indices.
    pub joints: Vec<u32>,
    /// How each of them bears its load.
    bearings: Vec<Bearing>,
}

/// How a joint bears its load.
#[derive(Default)]
struct Bearing {
    /// Its bodies.
    bodies: Vec<u32>,
    /// The distances of its anchors from their centers of mass (m).
    arms: Vec<f32>,
    /// (h w)² of them by the force on the joint, as its share of the sum (1/N); 0 of a body that cannot move.
    swings: Vec<f32>,
    /// The weight that it bears (N), and the mass (kg).
    weight: f32,
    mass: f32,
    /// The gap that sweeps leave, as a share of the arms, by force (1/N).
    gap: f32,
    /// The angle that they leave under the moment of the weight (rad).
    angle: f32,
}

impl JointSet {
    /// The set of some joints. `sides` are the bodies of a joint that can move; `substep` is the length of a substep (s).
    pub fn new(
        joints: Vec<u32>,
        world: &World,
        config: &SolverConfig,
        substep: f32,
        sides: impl Fn(u32) -> [Option<u32>; 2],
    ) -> Self {
        let sides: Vec<_> = joints.iter().map(|&joint| sides(joint)).collect();
        let load = |factor: fn(&Body) -> f32| {
            borne(&sides, |body| {
                let body = &world.bodies[body as usize];
                (body.center_of_mass() * body.mass.mass).extend(body.mass.mass) * factor(body)
            })
        };
        let [weights, masses] = [load(|body| body.gravity_scale.abs()), load(|_| 1.0)];
        let omega = TAU * config.joint_frequency / substep;
        let loads = joints.iter().zip(weights).zip(masses);
        let bearings = loads.map(|((&joint, weight), all)| {
            Bearing::new(&world.joints[joint as usize], [weight, all], world, omega, substep)
        });
        Self { bearings: bearings.collect(), joints }
    }

    /// The largest gap that sweeps leave in any joint, as a share of its arms, where bodies move as they do. `swings` is memory with a zero for
    /// each body.
    pub fn gap(&self, world: &World, swings: &mut [f32]) -> f32 {
        for bearing in &self.bearings {
            let force = bearing.force(world);
            for (&body, swing) in bearing.bodies.iter().zip(&bearing.swings) {
                swings[body as usize] += force * swing;
            }
        }
        let gap = self.bearings.iter().map(|bearing| {
            let swing = bearing.bodies.iter().map(|&body| swings[body as usize]).fold(0.0, f32::max);
            let opened = if swing > MOST_SWING { 1.0 } else { bearing.angle };
            opened.max(bearing.force(world) * bearing.gap)
        });
        let gap = gap.fold(0.0, f32::max);
        self.bearings.iter().flat_map(|bearing| &bearing.bodies).for_each(|&body| swings[body as usize] = 0.0);
        gap
    }
}

impl Bearing {
    /// How a joint bears two loads: what has weight, and all. `omega` is the frequency of the springs of sweeps.
    fn new(joint: &Joint, [weight, all]: [Vec4; 2], world: &World, omega: f32, substep: f32) -> Self {
        let (a, b) = joint.indices();
        let bodies: Vec<u32> = [Some(a), b].into_iter().flatten().map(|body| body as u32).collect();
        let body = |i: u32| &world.bodies[i as usize];
        let anchors = world.anchors(joint);
        let arms: Vec<Vec3> =
            bodies.iter().zip(anchors).map(|(&i, anchor)| anchor - body(i).center_of_mass()).collect();
        let length: f32 = arms.iter().map(|arm| arm.length()).sum();
        let moves = |i: u32| body(i).kind == BodyKind::Dynamic;
        let movable = || bodies.iter().copied().filter(|&i| moves(i)).map(body);
        let gravity = world.gravity_of(world.bodies.worlds()[a] as usize).length();
        let mut own = Self { bodies: bodies.clone(), weight: weight.w * gravity, mass: all.w, ..Self::default() };
        own.arms = arms.iter().map(|arm| arm.length()).collect();
        own.swings = bodies
            .iter()
            .zip(&arms)
            .map(|(&i, &arm)| {
                let swing = substep * substep * arm.length() * turn_across(body(i), arm);
                if moves(i) && swing.is_finite() { swing } else { 0.0 }
            })
            .collect();
        let bears = match &joint.linear {
            Linear::Axes(axes) => axes.iter().any(|axis| axis.bounds != Bounds::Free),
            Linear::Distance(distance) => distance.bounds != Bounds::Free,
        };
        let softness: f32 = movable().map(|body| body.mass.mass.recip()).sum();
        let gap = softness / (omega * omega * length);
        // A joint without arms has no length to be held against.
        own.gap = if bears && gap.is_finite() { gap } else { 0.0 };
        if joint.angular.iter().any(|axis| axis.bounds == Bounds::Locked) && weight.w > 0.0 {
            let lever = weight.truncate() / weight.w - anchors[0];
            let turn: f32 = movable().map(|body| turn_across(body, lever)).sum();
            let angle = own.weight * lever.length() * turn / (omega * omega);
            own.angle = if angle.is_finite() { angle } else { 0.0 };
        }
        own
    }

    /// The force that the joint bears while its bodies turn as they do (N).
    fn force(&self, world: &World) -> f32 {
        let pull = |(&body, arm): (&u32, &f32)| world.bodies[body as usize].angular_velocity.length_squared() * arm;
        self.weight + self.mass * self.bodies.iter().zip(&self.arms).map(pull).sum::<f32>()
    }
}

/// The inverse inertia of a body about an axis across a direction: the mean of two axes (1/(kg m²)).
fn turn_across(body: &Body, direction: Vec3) -> f32 {
    let i: Mat3 = body.mass.world_inverse_inertia(body.rotation);
    let along = direction.normalize_or_zero();
    0.5 * (i.x_axis.x + i.y_axis.y + i.z_axis.z - along.dot(i * along))
}

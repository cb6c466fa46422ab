//! Colliders, bodies and margins in the form that the detection reads.

use glam::{Quat, Vec3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use crate::math::rotation::squared_length;
use crate::world::{Body, BodyKind, Collider, Shape, placed};

/// How a body takes part in the detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Does not move, and nothing is solved for it.
    Still,
    /// Moves by itself: cannot be pushed, but may wake what it touches.
    Moving,
    /// Can be pushed.
    Awake,
}

crate::saved::kinds!(Activity { Still, Moving, Awake });

/// A collider with what the detection asks of it all the time.
#[derive(Clone)]
pub(super) struct ColliderInfo {
    pub body: u32,
    /// Index among the colliders of the body.
    pub index: u32,
    pub shape: SharedShape,
    /// Place in the body's frame.
    pub local: Pose,
    /// Half extents of a cuboid (m).
    pub cuboid: Option<Vec3>,
    /// Half of the smallest side (m).
    pub size: f32,
    /// Radius around the body's origin that holds the collider (m).
    pub reach: f32,
    /// Half-spaces have no box to put into the tree.
    pub unbounded: bool,
    /// Whether it meets others without contacts.
    pub sensor: bool,
}

/// The body of a collider that is gone.
const NO_BODY: u32 = u32::MAX;

impl ColliderInfo {
    /// The collider of a body with this index among those of the body.
    pub fn new(body: u32, index: u32, c: &Collider) -> Self {
        Self {
            body,
            index,
            shape: c.shape.0.clone(),
            local: Pose::from_parts(c.position, c.rotation),
            cuboid: c.shape.0.as_cuboid().map(|cuboid| cuboid.half_extents),
            size: c.shape.smallest_half_extent(),
            reach: c.position.length() + c.shape.bounding_radius(),
            unbounded: c.shape.is_half_space(),
            sensor: c.sensor,
        }
    }

    /// A collider that is gone.
    pub fn gone() -> Self {
        let (position, rotation) = (Vec3::ZERO, Quat::IDENTITY);
        Self::new(NO_BODY, 0, &Collider { shape: Shape::ball(1.0), position, rotation, sensor: false })
    }

    /// Marks a collider that is gone.
    pub fn leave(&mut self) {
        self.body = NO_BODY;
    }

    /// Whether the collider is gone.
    pub fn is_gone(&self) -> bool {
        self.body == NO_BODY
    }

    /// The box around it when its body is at `pose`. That of a cuboid needs nothing from elsewhere in memory.
    pub fn aabb(&self, pose: Pose) -> Aabb {
        let pose = placed(pose, self.local);
        let Some(half) = self.cuboid else { return self.shape.compute_aabb(&pose) };
        let axes = glam::Mat3::from_quat(pose.rotation);
        Aabb::from_half_extents(pose.translation, axes.abs() * half)
    }

    /// Whether this is still the collider of a body.
    pub fn is(&self, body: usize, collider: &Collider) -> bool {
        self.body as usize == body
            && self.sensor == collider.sensor
            && std::sync::Arc::ptr_eq(&self.shape.0, &collider.shape.0.0)
            && self.local == Pose::from_parts(collider.position, collider.rotation)
    }

    pub fn is_composite(&self) -> bool {
        self.shape.as_trimesh().is_some() || self.shape.as_heightfield().is_some()
    }
}

/// Pose and velocity of a body, as far as the detection needs it: three rows of eight numbers, so that lanes can gather them. The first two
/// are what the test of a pair reads.
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(super) struct BodyState {
    pub rotation: Quat,
    pub center: Vec3,
    /// 1 for a kinematic body, otherwise 0.
    pub kinematic: f32,
    pub v: Vec3,
    pub w: Vec3,
    /// 1 if contacts can be computed, otherwise 0.
    pub in_range: f32,
    /// 0 if it is still, 1 if it moves by itself, 2 if it is awake.
    pub activity: f32,
    pub position: Vec3,
    /// Size of the gravity that it feels over that of its world; 0 if it cannot be pushed.
    pub gravity_scale: f32,
    /// Acceleration by gravity and by lasting forces (m/s²).
    pub pull: Vec3,
    /// 1 if a joint holds it, otherwise 0.
    pub tied: f32,
}

/// The row of a [`BodyState`] that begins with rotation and center.
pub(super) const POSE: usize = 0;
/// The row with the velocities.
pub(super) const VELOCITY: usize = 1;
/// The row that begins with the position.
pub(super) const POSITION: usize = 2;

/// A cuboid in the form that lanes gather: two rows of eight numbers.
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(super) struct CuboidPlace {
    /// In the body's frame.
    pub rotation: Quat,
    pub position: Vec3,
    pub rest_of_place: f32,
    /// Half extents (m).
    pub half: Vec3,
    pub rest: [f32; 5],
}

impl CuboidPlace {
    pub fn new(half: Vec3, position: Vec3, rotation: Quat) -> Self {
        Self { rotation, position, half, ..Self::default() }
    }

    /// The place of a collider; zero if it is no cuboid.
    pub fn of(c: &ColliderInfo) -> Self {
        c.cuboid.map(|half| Self::new(half, c.local.translation, c.local.rotation)).unwrap_or_default()
    }

    pub fn is_cuboid(&self) -> bool {
        self.half.x > 0.0
    }
}

impl BodyState {
    /// A body on which gravity acts so much (m/s²).
    pub fn of(body: &Body, activity: Activity, gravity: Vec3) -> Self {
        let (position, rotation) = (body.position, body.rotation);
        let moves = body.kind != BodyKind::Fixed;
        let (v, w) = if moves { (body.linear_velocity, body.angular_velocity) } else { (Vec3::ZERO, Vec3::ZERO) };
        let in_range = is_placed(position, rotation, FARTHEST) && v.is_finite() && w.is_finite();
        Self {
            rotation,
            center: body.center_of_mass(),
            kinematic: f32::from(body.kind == BodyKind::Kinematic),
            v,
            w,
            in_range: f32::from(in_range),
            activity: [0.0, 1.0, 2.0][activity as usize],
            position,
            gravity_scale: if body.kind == BodyKind::Dynamic { body.gravity_scale.abs() } else { 0.0 },
            pull: if body.kind == BodyKind::Dynamic && activity == Activity::Awake {
                gravity + body.whole_force() / body.mass.mass
            } else {
                Vec3::ZERO
            },
            tied: 0.0,
        }
    }
}

/// Farthest that something is from the origin and still touches anything (m): the square is far inside of single precision.
pub(super) const FARTHEST: f32 = 1e15;

/// Whether contacts can be computed at a pose, at most `farthest` from the origin along each axis (m): parry squares lengths, and takes rotations
/// for unit quaternions.
pub(super) fn is_placed(position: Vec3, rotation: Quat, farthest: f32) -> bool {
    position.abs().cmple(Vec3::splat(farthest)).all() && (squared_length(rotation) - 1.0).abs() < 0.1
}

/// Whether a box is so near that something may touch it.
pub(super) fn is_in_range(aabb: &Aabb) -> bool {
    let farthest = glam::Vec3::splat(FARTHEST);
    aabb.mins.abs().cmple(farthest).all() && aabb.maxs.abs().cmple(farthest).all()
}

/// Settings of the detection, as lengths relative to the thinner shape.
#[derive(Clone, Copy)]
pub(super) struct Margins {
    pub speculative: f32,
    pub recycle: f32,
    /// How far gravity moves any body of the world in one step (m); with a gravity scale of 1 at least.
    pub fall: f32,
    /// Lengths of the step and of its longest substep (s).
    pub dt: f32,
    pub substep: f32,
}

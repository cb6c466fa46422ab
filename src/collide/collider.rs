//! Colliders, bodies and margins, in the layout that the detection reads.

use glam::{Quat, Vec3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use crate::math::rotation::squared_length;
use crate::world::{Body, BodyKind, Collider, Material, Shape, placed};

/// How a body takes part in the detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Does not move, and the step solves nothing for it.
    Still,
    /// Moves on its own: contacts cannot push it, but it can wake the bodies that it touches.
    Moving,
    /// Contacts can push it.
    Awake,
}

crate::saved::kinds!(Activity { Still, Moving, Awake });

/// A collider with the data that the detection reads most often.
#[derive(Clone)]
pub(super) struct ColliderInfo {
    pub body: u32,
    /// Index among the colliders of the body.
    pub index: u32,
    pub shape: SharedShape,
    /// Pose in the body's frame.
    pub local: Pose,
    /// Half extents of a cuboid (m).
    pub cuboid: Option<Vec3>,
    /// Half of the smallest side (m).
    pub size: f32,
    /// Radius around the body's origin that holds the collider (m).
    pub reach: f32,
    /// Whether it is a half-space, which has no box for the tree.
    pub unbounded: bool,
    pub sensor: bool,
    /// Its own material.
    pub material: Option<Material>,
}

/// The body index of a removed collider.
const NO_BODY: u32 = u32::MAX;

impl ColliderInfo {
    /// The collider at this index on a body.
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
            material: c.material,
        }
    }

    /// A removed collider.
    pub fn gone() -> Self {
        Self::new(NO_BODY, 0, &Collider::new(Shape::ball(1.0)))
    }

    /// Marks the collider as removed.
    pub fn leave(&mut self) {
        self.body = NO_BODY;
    }

    /// Whether the collider was removed.
    pub fn is_gone(&self) -> bool {
        self.body == NO_BODY
    }

    /// Its box when the body is at `pose`. The box of a cuboid needs no other memory.
    pub fn aabb(&self, pose: Pose) -> Aabb {
        let pose = placed(pose, self.local);
        let Some(half) = self.cuboid else { return self.shape.compute_aabb(&pose) };
        let axes = glam::Mat3::from_quat(pose.rotation);
        Aabb::from_half_extents(pose.translation, axes.abs() * half)
    }

    /// Whether this entry still describes the collider of a body.
    pub fn is(&self, body: usize, collider: &Collider) -> bool {
        self.body as usize == body
            && (self.sensor, self.material) == (collider.sensor, collider.material)
            && std::sync::Arc::ptr_eq(&self.shape.0, &collider.shape.0.0)
            && self.local == Pose::from_parts(collider.position, collider.rotation)
    }

    pub fn is_composite(&self) -> bool {
        self.shape.as_trimesh().is_some() || self.shape.as_heightfield().is_some()
    }
}

/// Pose and velocity of a body for the detection: three rows of eight numbers, so that lanes can gather them. The test
/// of a pair reads the first two rows.
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
    /// 0 if it does not move, 1 if it moves on its own, 2 if it is awake.
    pub activity: f32,
    pub position: Vec3,
    /// Gravity of the body divided by the gravity of its world, in size; 0 if contacts cannot push it.
    pub gravity_scale: f32,
    /// Acceleration by gravity and by lasting forces (m/s²).
    pub pull: Vec3,
    /// 1 if a joint holds the body, otherwise 0.
    pub tied: f32,
}

/// The row of a [`BodyState`] that begins with rotation and center.
pub(super) const POSE: usize = 0;
/// The row with the velocities.
pub(super) const VELOCITY: usize = 1;
/// The row that begins with the position.
pub(super) const POSITION: usize = 2;

/// A cuboid in a layout that lanes can gather: two rows of eight numbers.
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(super) struct CuboidPlace {
    /// In the body's frame.
    pub rotation: Quat,
    pub position: Vec3,
    pub rest_of_place: f32,
    /// Half extents (m).
    pub half: Vec3,
    /// Stands for a distance of zero between faces (m): 2^-40 of the smallest half extent, as a power of two.
    pub least: f32,
    pub rest: [f32; 4],
}

impl CuboidPlace {
    pub fn new(half: Vec3, position: Vec3, rotation: Quat) -> Self {
        // The power of two alone, so that scaled cuboids have scaled distances.
        let size = f32::from_bits(half.min_element().to_bits() & 0x7f80_0000);
        let least = size / (1_u64 << 40) as f32;
        Self { rotation, position, half, least, ..Self::default() }
    }

    /// The row of a collider; zero if it is not a cuboid.
    pub fn of(c: &ColliderInfo) -> Self {
        c.cuboid.map(|half| Self::new(half, c.local.translation, c.local.rotation)).unwrap_or_default()
    }

    pub fn is_cuboid(&self) -> bool {
        self.half.x > 0.0
    }
}

impl BodyState {
    /// A body with this acceleration by gravity (m/s²).
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

/// Largest distance from the origin at which a body still touches anything (m). Its square is far below the
/// single-precision limit.
pub(super) const FARTHEST: f32 = 1e15;

/// Whether contacts can be computed at a pose, at most `farthest` from the origin along each axis (m): parry squares
/// lengths, and expects unit quaternions.
pub(super) fn is_placed(position: Vec3, rotation: Quat, farthest: f32) -> bool {
    position.abs().cmple(Vec3::splat(farthest)).all() && (squared_length(rotation) - 1.0).abs() < 0.1
}

/// Whether a box is near enough to the origin to touch anything.
pub(super) fn is_in_range(aabb: &Aabb) -> bool {
    let farthest = glam::Vec3::splat(FARTHEST);
    aabb.mins.abs().cmple(farthest).all() && aabb.maxs.abs().cmple(farthest).all()
}

/// Settings of the detection, as lengths relative to the thinner shape.
#[derive(Clone, Copy)]
pub(super) struct Margins {
    pub speculative: f32,
    pub recycle: f32,
    /// Displacement by gravity of any body of the world in one step, at a gravity scale of at least 1 (m).
    pub fall: f32,
    /// Lengths of the step and of its longest substep (s).
    pub dt: f32,
    pub substep: f32,
}

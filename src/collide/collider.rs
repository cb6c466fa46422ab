//! Colliders, bodies and margins in the form that the detection reads.

use glam::{Quat, Vec3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use crate::world::Collider;

/// A collider with what the detection asks of it all the time.
#[derive(Clone)]
pub(super) struct ColliderInfo {
    pub body: u32,
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
}

impl ColliderInfo {
    /// The box around it when its body is at `pose`. That of a cuboid needs nothing from elsewhere in memory.
    pub fn aabb(&self, pose: Pose) -> Aabb {
        let pose = pose * self.local;
        let Some(half) = self.cuboid else { return self.shape.compute_aabb(&pose) };
        let axes = glam::Mat3::from_quat(pose.rotation);
        Aabb::from_half_extents(pose.translation, axes.abs() * half)
    }

    /// Whether this is still the collider of a body.
    pub fn is(&self, body: usize, collider: &Collider) -> bool {
        self.body as usize == body
            && std::sync::Arc::ptr_eq(&self.shape.0, &collider.shape.0.0)
            && self.local == Pose::from_parts(collider.position, collider.rotation)
    }

    pub fn is_composite(&self) -> bool {
        self.shape.as_trimesh().is_some() || self.shape.as_heightfield().is_some()
    }
}

/// Pose and velocity of a body, as far as the detection needs it.
#[derive(Clone, Copy)]
pub(super) struct BodyState {
    pub position: Vec3,
    pub rotation: Quat,
    pub center: Vec3,
    pub v: Vec3,
    pub w: Vec3,
    pub kinematic: bool,
}

impl BodyState {
    /// Whether contacts can be computed: parry squares lengths, and takes rotations for unit quaternions.
    pub fn is_in_range(&self) -> bool {
        let near = self.position.abs().cmple(Vec3::splat(FARTHEST)).all();
        near && (self.rotation.length_squared() - 1.0).abs() < 0.1 && self.v.is_finite() && self.w.is_finite()
    }
}

/// Farthest that something is from the origin and still touches anything (m): the square is far inside of single precision.
pub(super) const FARTHEST: f32 = 1e15;

/// Settings of the detection, as lengths relative to the thinner shape.
#[derive(Clone, Copy)]
pub(super) struct Margins {
    pub speculative: f32,
    pub recycle: f32,
    /// How far gravity moves a body in one step (m).
    pub fall: f32,
    pub dt: f32,
}

//! Ball joints.

use glam::Vec3;

/// Keeps a point of one body together with a point of another, or of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallJoint {
    /// Index of one body.
    pub body_a: usize,
    /// Index of the other; none for the world.
    pub body_b: Option<usize>,
    /// The point in a's frame (m).
    pub anchor_a: Vec3,
    /// The point in b's frame, or in the world (m).
    pub anchor_b: Vec3,
    /// Whether the two bodies still collide with each other.
    pub collide: bool,
    /// The force at which the joint breaks (N), above 0; infinite for one that holds. A joint breaks after a step whose last substep took more,
    /// its impulse over the length of the substep: the joint is then gone, and [`Event::Broke`](crate::Event::Broke) tells of it.
    pub break_force: f32,
}

crate::saved::fields!(BallJoint { body_a, body_b, anchor_a, anchor_b, collide, break_force });

impl BallJoint {
    /// Ties two bodies together, which then do not collide.
    pub fn new(body_a: usize, anchor_a: Vec3, body_b: usize, anchor_b: Vec3) -> Self {
        Self { body_b: Some(body_b), ..Self::to_world(body_a, anchor_a, anchor_b) }
    }

    /// Ties a body to a point of the world.
    pub fn to_world(body_a: usize, anchor_a: Vec3, point: Vec3) -> Self {
        Self { body_a, body_b: None, anchor_a, anchor_b: point, collide: false, break_force: f32::INFINITY }
    }

    /// Whether this is one of its bodies.
    pub fn holds(&self, body: usize) -> bool {
        self.body_a == body || self.body_b == Some(body)
    }

    /// Lets the joint break at a force (N).
    pub fn breaking_at(mut self, force: f32) -> Self {
        self.break_force = force;
        self
    }

    /// Lets the two bodies collide all the same.
    pub fn colliding(mut self) -> Self {
        self.collide = true;
        self
    }
}

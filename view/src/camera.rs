//! A camera that orbits a point, and the framing of a scene.

use glam::camera::rh::proj::directx;
use glam::camera::rh::view::look_at_mat4;
use glam::{Mat4, Quat, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

use crate::bounds::Bounds;

/// Vertical angle of view (rad).
const FIELD: f32 = 0.6;

/// `distance` is the distance of the eye from `target` (m); `up` is a unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub target: Vec3,
    pub distance: f32,
    /// Angle around the upward axis, and elevation (rad). At 0 the camera looks along -z if up is y.
    pub yaw: f32,
    pub pitch: f32,
    pub up: Vec3,
}

impl Camera {
    /// A camera that fits `bounds` into a picture of width `aspect` times its height.
    pub fn framing(bounds: &Bounds, up: Vec3, yaw: f32, pitch: f32, aspect: f32) -> Self {
        let mut camera = Self { target: bounds.center(), distance: bounds.radius(), yaw, pitch, up };
        if !bounds.low.is_finite() {
            return Self { distance: 5.0, ..camera };
        }
        let slope_y = (0.5 * FIELD).tan();
        let slope_x = slope_y * aspect;
        let [right, above, back] = camera.axes();
        // Every corner requires a distance, for the wider of its two sides. Move the target until opposite margins are
        // equal.
        for _ in 0..8 {
            let seen = |corner: Vec3| {
                let r = corner - camera.target;
                (r.dot(right), r.dot(above), r.dot(back))
            };
            let corners = bounds.corners().map(seen);
            let needed = corners.map(|(x, y, z)| (x.abs() / slope_x).max(y.abs() / slope_y) + z);
            camera.distance = needed.into_iter().fold(0.0, f32::max);
            let edge = |axis: fn(&(f32, f32, f32)) -> f32| {
                let at = corners.iter().map(|c| axis(c) / (camera.distance - c.2).max(1e-6));
                at.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
            };
            let ((left, rightmost), (lowest, highest)) = (edge(|c| c.0), edge(|c| c.1));
            camera.target += 0.5 * camera.distance * ((left + rightmost) * right + (lowest + highest) * above);
        }
        camera.distance *= 1.06;
        camera
    }

    /// A camera at `distance` behind a body at `target`, which looks `ahead`.
    pub fn behind(target: Vec3, ahead: Vec3, up: Vec3, distance: f32) -> Self {
        let ahead = Quat::from_rotation_arc(up, Vec3::Y) * ahead;
        Self { target, distance, yaw: (-ahead.x).atan2(-ahead.z), pitch: 0.3, up }
    }

    /// The camera `other`, with target and yaw only a share of the way from this one to it.
    pub fn towards(&self, other: &Self, share: f32) -> Self {
        let turn = (other.yaw - self.yaw + PI).rem_euclid(TAU) - PI;
        Self { target: self.target.lerp(other.target, share), yaw: self.yaw + share * turn, ..*other }
    }

    /// Unit vectors to the right, up and back (towards the eye).
    pub fn axes(&self) -> [Vec3; 3] {
        let upright = Quat::from_rotation_arc(Vec3::Y, self.up);
        let turn = upright * Quat::from_rotation_y(self.yaw) * Quat::from_rotation_x(-self.pitch);
        [turn * Vec3::X, turn * Vec3::Y, turn * Vec3::Z]
    }

    pub fn eye(&self) -> Vec3 {
        self.target + self.distance * self.axes()[2]
    }

    /// The projection from the world to the picture. `reach` is the radius of the scene around the target (m).
    pub fn projection(&self, aspect: f32, reach: f32) -> Mat4 {
        let far = self.distance + 60.0 * reach;
        let near = (self.distance - reach).max(0.01 * self.distance);
        let eye = self.eye();
        directx::perspective(FIELD, aspect, near, far) * look_at_mat4(eye, self.target, self.axes()[1])
    }

    /// Origin and unit direction of the ray through a place of the picture, -1 to 1 from left to right and from bottom
    /// to top.
    pub fn ray(&self, at: Vec2, aspect: f32) -> (Vec3, Vec3) {
        let slope = (0.5 * FIELD).tan();
        let [right, above, back] = self.axes();
        let direction = right * (at.x * slope * aspect) + above * (at.y * slope) - back;
        (self.eye(), direction.normalize())
    }

    /// Turns the camera by a drag of the mouse, in heights of the picture.
    pub fn orbit(&mut self, drag: Vec2) {
        self.yaw -= 3.0 * drag.x;
        self.pitch = (self.pitch + 3.0 * drag.y).clamp(-1.5, 1.5);
    }

    /// Moves the camera sideways by a drag of the mouse, in heights of the picture.
    pub fn pan(&mut self, drag: Vec2) {
        let [right, above, _] = self.axes();
        let height = 2.0 * self.distance * (0.5 * FIELD).tan();
        self.target += height * (drag.y * above - drag.x * right);
    }

    /// Moves the camera nearer by `notches` of the wheel.
    pub fn zoom(&mut self, notches: f32) {
        self.distance *= 0.9_f32.powf(notches.clamp(-20.0, 20.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of the corners of `bounds` in the picture, -1 to 1.
    fn seen(camera: &Camera, bounds: &Bounds, aspect: f32) -> [Vec3; 8] {
        bounds.corners().map(|c| camera.projection(aspect, bounds.radius()).project_point3(c))
    }

    #[test]
    fn a_framed_scene_is_inside_of_the_picture_and_fills_it() {
        for (size, aspect, up) in [
            (Vec3::new(10.0, 1.0, 1.0), 1.5, Vec3::Y),
            (Vec3::new(1.0, 30.0, 1.0), 1.5, Vec3::Y),
            (Vec3::new(5.0, 5.0, 5.0), 0.5, Vec3::Z),
        ] {
            let bounds = Bounds { low: Vec3::new(3.0, -1.0, 2.0), high: Vec3::new(3.0, -1.0, 2.0) + size };
            let camera = Camera::framing(&bounds, up, 0.5, 0.35, aspect);
            let corners = seen(&camera, &bounds, aspect);
            assert!(corners.iter().all(|c| c.x.abs() < 1.0 && c.y.abs() < 1.0 && (0.0..1.0).contains(&c.z)));
            let widest = corners.iter().map(|c| c.x.abs().max(c.y.abs())).fold(0.0, f32::max);
            assert!(widest > 0.85, "{widest}");
        }
    }

    #[test]
    fn a_ray_goes_through_its_place_in_the_picture() {
        let bounds = Bounds::around(Vec3::new(1.0, 2.0, 3.0), 2.0);
        let camera = Camera::framing(&bounds, Vec3::Y, 0.4, 0.3, 1.6);
        for at in [Vec2::ZERO, Vec2::new(0.5, -0.7)] {
            let (origin, direction) = camera.ray(at, 1.6);
            let there = camera.projection(1.6, 2.0).project_point3(origin + direction * camera.distance);
            assert!(there.truncate().distance(at) < 1e-4, "{there} instead of {at}");
        }
    }

    #[test]
    fn an_empty_scene_has_a_finite_camera() {
        assert!(Camera::framing(&Bounds::EMPTY, Vec3::Y, 0.0, 0.3, 1.0).eye().is_finite());
        let joined = Bounds::around(Vec3::ZERO, 1.0).join(Bounds::around(Vec3::NAN, 1.0));
        assert_eq!(joined, Bounds::around(Vec3::ZERO, 1.0));
    }
}

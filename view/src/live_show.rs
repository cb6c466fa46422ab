//! Pictures, keys and pointer of a live scene.

use crate::bounds::Bounds;
use crate::camera::Camera;
use crate::colors::Rgba;
use crate::live::{Grabbed, Live, Order};
use crate::overlay::{LineEnd, Overlay, lines};
use crate::show::{Key, Passing, Pointer, Show};
use drystone::{Joint, World};

impl Show for Live {
    fn title(&self) -> String {
        self.scene.name.clone()
    }

    fn world(&self) -> &World {
        &self.simulation.world
    }

    fn bounds(&self) -> Bounds {
        self.way
    }

    fn container(&self) -> Option<Bounds> {
        self.scene.container.map(|(low, high)| Bounds { low, high })
    }

    fn camera(&self, aspect: f32) -> Camera {
        if let Some(camera) = self.chase {
            // A picture that is higher than wide shows as much from side to side.
            return Camera { distance: camera.distance / aspect.min(1.0), ..camera };
        }
        Camera::framing(&self.bounds(), self.up(), 30.0_f32.to_radians(), 25.0_f32.to_radians(), aspect)
    }

    fn colors(&mut self) -> Vec<Rgba> {
        let values = self.color.values(&mut self.simulation);
        let world = &self.simulation.world;
        // The scale changes slowly, so that colors do not flicker.
        let scale = self.color.scale(world, &values);
        self.light_end += 0.05 * (scale - self.light_end);
        self.color.paint(world, &values, self.light_end.max(0.5 * scale))
    }

    fn lines(&mut self) -> Vec<LineEnd> {
        let size = 0.02 * self.built.radius();
        let overlay = Overlay { joints: self.overlay.joints || self.grabbed.is_some(), ..self.overlay };
        lines(&mut self.simulation, overlay, size)
    }

    fn advance(&mut self, seconds: f32) -> Passing<'_> {
        Box::pin(self.advance_async(seconds))
    }

    fn point(&mut self, pointer: &Pointer) {
        self.pointer = Some(*pointer);
    }

    fn key(&mut self, key: Key, down: bool) {
        let arrows = [Key::Up, Key::Down, Key::Left, Key::Right];
        if let Some(arrow) = arrows.iter().position(|a| *a == key) {
            self.held[arrow] = down;
        }
        self.steer_by_keys(down && key == Key::Character('j'));
        if !down {
            return;
        }
        match key {
            Key::Character(' ') => self.paused = !self.paused,
            Key::Character('n') => self.order(Order::Step),
            Key::Character('r') => self.order(Order::Restart),
            Key::Character('f') => self.look_anew(),
            Key::Character('b') => self.throw(),
            Key::Character('x') | Key::Delete => self.delete(),
            Key::Character('s') => self.keep(),
            Key::Character('l') => self.go_back(),
            Key::Left => self.order(Order::Seek(-1.0)),
            Key::Right => self.order(Order::Seek(1.0)),
            Key::Character('c') => self.color = self.color.next(),
            Key::Character('1') => self.overlay.contacts = !self.overlay.contacts,
            Key::Character('2') => self.overlay.joints = !self.overlay.joints,
            Key::Character('3') => self.overlay.boxes = !self.overlay.boxes,
            Key::Character('+' | '=') => self.speed = (self.speed * 2.0).min(16.0),
            Key::Character('-') => self.speed = (self.speed / 2.0).max(1.0 / 64.0),
            _ => {}
        }
    }

    fn grab(&mut self, pointer: &Pointer) -> bool {
        let Pointer { origin, direction, .. } = *pointer;
        let Some((distance, body)) = self.body_at(*pointer) else { return false };
        let world = &mut self.simulation.world;
        let target = origin + distance * direction;
        let Some(pulled) = world.body(body) else { return false };
        let anchor = pulled.rotation.inverse() * (target - pulled.position);
        let joint = world.insert_joint(Joint::to_world(body, anchor, target));
        self.grabbed = Some(Grabbed { body, anchor, distance, target, joint });
        true
    }

    fn drag(&mut self, pointer: &Pointer) {
        if let Some(grabbed) = &mut self.grabbed {
            grabbed.target = pointer.origin + grabbed.distance * pointer.direction;
        }
    }

    fn release(&mut self) {
        if let Some(grabbed) = self.grabbed.take() {
            self.simulation.world.remove_joint(grabbed.joint);
        }
    }
}

//! A run or a recorded motion as frames, and pictures of the frames from one camera.

use glam::{Quat, Vec3};

use crate::bounds::Bounds;
use crate::camera::Camera;
use crate::canvas::{Canvas, Picture};
use crate::colors::ColorBy;
use crate::labyrinth;
use crate::overlay::ropes;
use crate::poses::poses;
use crate::renderer::Shot;
use drystone::queries::{Filter, Queries};
use drystone::{Body, BodyKind, Result, Shape, Simulation, World};
use drystone_maze::Map;
use drystone_scenes::Scene;

/// A hidden scene is looked at from above in such steps, up to this pitch (rad).
const STEP_OF_PITCH: f32 = 0.1;
const MAX_PITCH: f32 = 1.5;

#[derive(Clone, Debug)]
pub struct Moment {
    /// Time since the start (s).
    pub time: f64,
    pub poses: Vec<(Vec3, Quat)>,
    pub values: Vec<f32>,
    /// The world at that time, for a scene with spawners or leaving bodies.
    world: Option<World>,
}

/// Angle of the camera around the scene, and elevation above the horizon (rad).
#[derive(Clone, Copy, Debug)]
pub struct Look {
    pub yaw: f32,
    pub pitch: f32,
}

#[derive(Clone, Debug)]
pub struct Film {
    scene: Scene,
    color: ColorBy,
    frames: Vec<Moment>,
}

impl Film {
    pub fn new(scene: Scene, color: ColorBy) -> Self {
        Self { scene, color, frames: Vec::new() }
    }

    pub fn add(&mut self, time: f64, simulation: &mut Simulation) {
        let values = self.color.values(simulation);
        let comes_and_goes = !(self.scene.spawners.is_empty() && self.scene.leaving.is_empty());
        let world = comes_and_goes.then(|| simulation.world.clone());
        self.frames.push(Moment { time, poses: poses(&simulation.world), values, world });
    }

    /// Adds a world without contacts and sleep.
    pub fn add_world(&mut self, time: f64, world: &World) {
        self.frames.push(Moment {
            time,
            poses: poses(world),
            values: self.color.values_of(world, &[], &[]),
            world: None,
        });
    }

    pub fn frames(&self) -> &[Moment] {
        &self.frames
    }

    /// The film with `count` of its frames, evenly spaced, including the last one.
    pub fn thinned(mut self, count: usize) -> Self {
        self.frames = evenly(self.frames.len(), count).map(|i| self.frames[i].clone()).collect();
        self
    }

    pub fn bounds(&self) -> Bounds {
        let radius = Bounds::of(&self.scene.world).radius();
        let of = |frame: &Moment| Bounds::at(frame.world.as_ref().unwrap_or(&self.scene.world), &frame.poses, radius);
        self.frames.iter().fold(Bounds::EMPTY, |all, frame| all.join(of(frame)))
    }

    /// Draws the frames in order from one camera, on a canvas for the film's world.
    pub fn draw(&self, canvas: &mut Canvas, look: &Look, mut show: impl FnMut(&Picture) -> Result<()>) -> Result<()> {
        let world = &self.scene.world;
        let bounds = self.bounds();
        let up = -world.gravity.try_normalize().unwrap_or(Vec3::NEG_Y);
        let camera =
            unhidden(world, |pitch| Camera::framing(&bounds, up, look.yaw, pitch, canvas.aspect()), look.pitch);
        let scale = self
            .frames
            .iter()
            .map(|f| self.color.scale(f.world.as_ref().unwrap_or(world), &f.values))
            .fold(0.0, f32::max);
        let container = self.scene.container.map(|(low, high)| Bounds { low, high });
        for frame in &self.frames {
            let world = frame.world.as_ref().unwrap_or(world);
            canvas.renderer.follow(world);
            let colors = self.color.paint(world, &frame.values, scale);
            let ropes = ropes(world, &frame.poses);
            let shot = Shot { poses: &frame.poses, colors: &colors, camera: &camera, bounds, container, lines: &ropes };
            show(&canvas.draw(&shot)?)?;
        }
        Ok(())
    }
}

/// The camera with the least pitch, from `pitch` on, whose view of its target no fixed mesh or height field hides: the
/// hills of a terrain can be higher than a flat view of a valley.
fn unhidden(world: &World, camera: impl Fn(f32) -> Camera, pitch: f32) -> Camera {
    let queries = Queries::of(world);
    let is_terrain = |_, body: &Body| {
        let is_surface = |shape: &Shape| !shape.has_volume() && !shape.is_half_space();
        body.kind == BodyKind::Fixed && body.colliders.iter().any(|collider| is_surface(&collider.shape))
    };
    let is_hidden = |camera: &Camera| {
        let back = camera.eye() - camera.target;
        queries.ray(camera.target, back, back.length(), &Filter::default().only(&is_terrain)).is_some()
    };
    let steeper = (0..).map(|k| pitch + STEP_OF_PITCH * k as f32).take_while(|pitch| *pitch < MAX_PITCH);
    steeper.map(&camera).find(|camera| !is_hidden(camera)).unwrap_or_else(|| camera(pitch))
}

/// `count` of the numbers below `all`, evenly spaced, including the last one.
pub fn evenly(all: usize, count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(all);
    (1..=count).map(move |k| (k * all).div_ceil(count) - 1)
}

/// Draws a game of the maze at some poses of its bodies.
pub fn draw_game(
    canvas: &mut Canvas,
    map: &Map,
    world: &World,
    frames: &[Vec<(Vec3, Quat)>],
    mut show: impl FnMut(&Picture) -> Result<()>,
) -> Result<()> {
    let (colors, camera, bounds) =
        (labyrinth::colors(world), labyrinth::camera_of(map, canvas.aspect()), labyrinth::bounds_of(map));
    frames.iter().try_for_each(|poses| {
        let shot = Shot { poses, colors: &colors, camera: &camera, bounds, container: None, lines: &[] };
        show(&canvas.draw(&shot)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat view into a valley is hidden by hills of triangles, and not by boxes, which are part of the picture.
    #[test]
    fn a_camera_looks_over_the_hills_of_a_terrain() {
        let valley: Vec<Vec<f32>> = (-5..=5).map(|z: i32| vec![(0.4 * z as f32).powi(2); 11]).collect();
        let hills = Shape::height_field(&valley, Vec3::new(10.0, 1.0, 10.0)).expect("good heights");
        let wall = Shape::cuboid(5.0, 5.0, 0.1);
        let bounds = Bounds { low: Vec3::new(-1.0, 0.0, -1.0), high: Vec3::ONE };
        let pitch_over = |body: Body| {
            let mut world = World::new();
            world.insert(body);
            unhidden(&world, |pitch| Camera::framing(&bounds, Vec3::Y, 0.0, pitch, 1.5), 0.3).pitch
        };
        let over_hills = pitch_over(Body::fixed().shape(hills));
        assert!((0.35..1.2).contains(&over_hills), "{over_hills}");
        assert_eq!(pitch_over(Body::fixed().shape(wall).position(0.0, 0.0, 3.0)), 0.3);
    }
}

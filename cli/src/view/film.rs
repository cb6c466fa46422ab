//! A run or a recorded motion as frames, and pictures of the frames from one camera.

use std::path::Path;

use glam::{Quat, Vec3};

use super::camera::{Bounds, Camera};
use super::canvas::{Canvas, Picture};
use super::colors::ColorBy;
use super::mesh::{Poses, poses};
use super::overlay::ropes;
use super::renderer::Shot;
use drystone::{BodyKind, Error, Result, Scene, Simulation, World};

#[derive(Clone, Debug)]
pub struct Frame {
    /// Time since the start (s).
    pub time: f64,
    pub poses: Vec<(Vec3, Quat)>,
    pub values: Vec<f32>,
    /// The world at that time, in a scene whose bodies come and go.
    world: Option<World>,
}

/// Angle of the camera around the scene, and elevation above the horizon (rad).
#[derive(Clone, Copy, Debug)]
pub struct Look {
    pub yaw: f32,
    pub pitch: f32,
}

/// Step, time, body, center of mass, rotation and velocities, as [`crate::report::Trajectory`] writes them.
type Row = (u32, f64, usize, [f32; 3], [f32; 4], [f32; 3], [f32; 3]);

#[derive(Clone, Debug)]
pub struct Film {
    scene: Scene,
    color: ColorBy,
    frames: Vec<Frame>,
}

impl Film {
    pub fn new(scene: Scene, color: ColorBy) -> Self {
        Self { scene, color, frames: Vec::new() }
    }

    pub fn add(&mut self, time: f64, simulation: &mut Simulation) {
        let values = self.color.values(simulation);
        let comes_and_goes = !(self.scene.spawners.is_empty() && self.scene.leaving.is_empty());
        let world = comes_and_goes.then(|| simulation.world.clone());
        self.frames.push(Frame { time, poses: poses(&simulation.world), values, world });
    }

    /// Adds a world without contacts and sleep.
    fn add_world(&mut self, time: f64, world: &World) {
        self.frames.push(Frame {
            time,
            poses: poses(world),
            values: self.color.values_of(world, &[], &[]),
            world: None,
        });
    }

    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The film with `count` of its frames, evenly spaced, with the last one.
    pub fn thinned(mut self, count: usize) -> Self {
        self.frames = evenly(self.frames.len(), count).map(|i| self.frames[i].clone()).collect();
        self
    }

    pub fn read(scene: Scene, color: ColorBy, path: &Path) -> Result<Self> {
        if matches!(color, ColorBy::Batch | ColorBy::Impulse | ColorBy::Sleeping | ColorBy::Effort) {
            let refusal = "--from: a recorded motion has neither contacts nor sleep; color by material or speed";
            return Err(Error::input(refusal));
        }
        let file = std::fs::File::open(path).map_err(Error::file(path))?;
        let mut film = Self::new(scene, color);
        let mut world = film.scene.world.clone();
        let mut last: Option<(u32, f64)> = None;
        for (i, row) in csv::Reader::from_reader(file).deserialize::<Row>().enumerate() {
            // Line 1 has the names of the columns.
            let line = i + 2;
            let refuse = |what: String| Error::input(format!("{}: line {line}: {what}", path.display()));
            let row = row.map_err(|e| match e.into_kind() {
                csv::ErrorKind::Io(e) => Error::file(path)(e),
                csv::ErrorKind::Deserialize { err, .. } => refuse(err.to_string()),
                csv::ErrorKind::UnequalLengths { len, .. } => refuse(format!("{len} values instead of 16")),
                _ => refuse("not a row of 16 numbers".into()),
            })?;
            let (step, time, index, place, [qx, qy, qz, qw], velocity, _) = row;
            if let Some((before, then)) = last.filter(|(before, _)| *before != step) {
                if step < before {
                    return Err(refuse(format!("step {step} after step {before}")));
                }
                film.add_world(then, &world);
            }
            last = Some((step, time));
            let bodies = world.bodies.len();
            let Some(body) = world.bodies.get_mut(index).filter(|b| b.kind != BodyKind::Fixed) else {
                return Err(refuse(format!("body {index} is not one of the {bodies} of the scene that can move")));
            };
            body.rotation = Quat::from_xyzw(qx, qy, qz, qw);
            body.position = Vec3::from_array(place) - body.rotation * body.mass.center;
            body.linear_velocity = Vec3::from_array(velocity);
        }
        match last {
            Some((_, time)) => film.add_world(time, &world),
            None => return Err(Error::input(format!("{}: no motion in it", path.display()))),
        }
        Ok(film)
    }

    pub fn bounds(&self) -> Bounds {
        let of = |frame: &Frame| bounds_at(frame.world.as_ref().unwrap_or(&self.scene.world), &frame.poses, MARGIN);
        self.frames.iter().fold(Bounds::EMPTY, |all, frame| all.join(of(frame)))
    }

    /// Draws the frames in order from one camera, on a canvas for the film's world.
    pub fn draw(&self, canvas: &mut Canvas, look: &Look, mut show: impl FnMut(&Picture) -> Result<()>) -> Result<()> {
        let world = &self.scene.world;
        let bounds = self.bounds();
        let up = -world.gravity.try_normalize().unwrap_or(Vec3::NEG_Y);
        let camera = Camera::framing(&bounds, up, look.yaw, look.pitch, canvas.aspect());
        let scale = self
            .frames
            .iter()
            .map(|f| self.color.scale(f.world.as_ref().unwrap_or(world), &f.values))
            .fold(0.0, f32::max);
        let container = self.scene.container.map(|(low, high)| Bounds { low, high });
        for frame in &self.frames {
            let world = frame.world.as_ref().unwrap_or(world);
            canvas.follow(world);
            let colors = self.color.paint(world, &frame.values, scale);
            let ropes = ropes(world, &frame.poses);
            let shot = Shot { poses: &frame.poses, colors: &colors, camera: &camera, bounds, container, lines: &ropes };
            show(&canvas.draw(&shot)?)?;
        }
        Ok(())
    }
}

/// `count` of the numbers below `all`, evenly spaced, with the last one.
pub fn evenly(all: usize, count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(all);
    (1..=count).map(move |k| (k * all).div_ceil(count) - 1)
}

/// The bounds of everything that moves in a world, with a margin, of sensors, and of the points from which bodies hang.
pub fn bounds(world: &World) -> Bounds {
    bounds_at(world, &poses(world), MARGIN)
}

/// The same without a margin: what lies outside on the side of the eye only hides it.
pub fn tight_bounds(world: &World) -> Bounds {
    bounds_at(world, &poses(world), 0.0)
}

/// Room on each side of a body, as a share of its size.
const MARGIN: f32 = 0.25;

fn bounds_at(world: &World, poses: &Poses, margin: f32) -> Bounds {
    let around = world.bodies.iter().zip(poses).map(|(body, &(position, rotation))| {
        let shown = body.colliders.iter().filter(|c| body.kind != BodyKind::Fixed || c.sensor);
        let bounds = shown.map(|c| c.bounds(position, rotation));
        let body = bounds.fold(Bounds::EMPTY, |all, (low, high)| all.join(Bounds { low, high }));
        let room = margin * (body.high - body.low);
        Bounds { low: body.low - room, high: body.high + room }
    });
    let hung = world.joints.iter().filter(|j| j.body_b.is_none());
    let anchors = hung.map(|j| Bounds::around(j.anchor_b, 0.0));
    around.chain(anchors).fold(Bounds::EMPTY, Bounds::join)
}

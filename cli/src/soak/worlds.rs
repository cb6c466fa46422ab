//! The worlds of soak runs: small, and on average constant over time.

use std::collections::VecDeque;

use drystone::stages::random::SplitMix64;
use drystone::{Body, BodyHandle, Joint, Result, Shape, World};
use drystone_scenes::Scene;
use glam::{Quat, Vec3};

/// The worlds by name, each with a one-line description.
pub const WORLDS: &[(&str, &str)] = &[
    ("drum", "60 boxes in a drum that turns"),
    ("shaken", "60 boxes in a tray that is shaken"),
    ("rain", "60 bodies of five shapes, some joined; one is replaced every third step"),
    ("waking", "24 sleeping boxes; one is thrown every four seconds"),
    ("conveyor", "boxes that come onto rollers, ride along and leave"),
];

pub const NAMES: [&str; WORLDS.len()] = {
    let mut names = [""; WORLDS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = WORLDS[i].0;
        i += 1;
    }
    names
};

/// The actions on a world while it runs, in addition to its spawners.
pub enum Acts {
    None,
    Shakes(BodyHandle),
    Rains(Rain),
    Throws { boxes: Vec<BodyHandle>, random: SplitMix64 },
}

pub fn find(spec: &str) -> Result<(Scene, Acts)> {
    Ok(match spec {
        "drum" => (Scene::find_spec("drum:n=60")?, Acts::None),
        "shaken" => shaken(),
        "rain" => rain(),
        "waking" => waking(),
        other => (Scene::find_spec(other)?, Acts::None),
    })
}

/// A floor and four walls of 3 m around a square.
fn tray(body: Body, half: f32) -> Body {
    let body = body.shape_at(Shape::cuboid(half + 0.5, 0.25, half + 0.5), -0.25 * Vec3::Y, Quat::IDENTITY);
    [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z].into_iter().fold(body, |body, out| {
        let sides = Vec3::new(half, 1.5, half) + (0.25 - half) * out.abs();
        body.shape_at(Shape::cuboid(sides.x, sides.y, sides.z), (half + 0.25) * out + 1.5 * Vec3::Y, Quat::IDENTITY)
    })
}

/// A scene that no body should leave.
fn scene(world: World, half: f32) -> Scene {
    let reach = Vec3::new(half, 0.0, half);
    Scene { container: Some((-reach - 0.1, reach + Vec3::new(0.1, 4.0, 0.1))), ..Scene::new("", world, 0) }
}

fn boxes(world: &mut World, count: usize, half: f32, pitch: f32) -> Vec<BodyHandle> {
    let place = |i: usize, across: usize| (i as f32 - 0.5 * (across as f32 - 1.0)) * pitch;
    let at = |i: usize| Vec3::new(place(i % 4, 4), half + (i / 16) as f32 * pitch, place(i / 4 % 4, 4));
    let cube = |at: Vec3| Body::dynamic().shape(Shape::cuboid(half, half, half)).position(at.x, at.y, at.z);
    (0..count).map(|i| world.insert(cube(at(i)))).collect()
}

fn shaken() -> (Scene, Acts) {
    const HALF: f32 = 0.6;
    let mut world = World::new();
    let moved = world.insert(tray(Body::kinematic().named("tray"), HALF));
    boxes(&mut world, 60, 0.1, 0.25);
    // The tray moves by 4 cm to and fro.
    (scene(world, HALF + 0.05), Acts::Shakes(moved))
}

fn waking() -> (Scene, Acts) {
    let mut world = World::new();
    world.insert(tray(Body::fixed(), 2.0));
    let boxes = boxes(&mut world, 24, 0.2, 0.8);
    (scene(world, 2.0), Acts::Throws { boxes, random: SplitMix64::new(3) })
}

fn rain() -> (Scene, Acts) {
    let mut world = World::new();
    world.insert(tray(Body::fixed(), 1.5));
    let rain = Rain { here: VecDeque::new(), gone: VecDeque::new(), keeps: 60, came: 0, random: SplitMix64::new(5) };
    (scene(world, 1.5), Acts::Rains(rain))
}

/// Bodies that appear and disappear.
pub struct Rain {
    /// Bodies in the world, the oldest first.
    here: VecDeque<BodyHandle>,
    /// The last removed bodies.
    gone: VecDeque<BodyHandle>,
    /// Largest number of bodies.
    keeps: usize,
    /// Number of added bodies, modulo the number of places.
    came: u32,
    random: SplitMix64,
}

impl Rain {
    fn within(&mut self, size: f32) -> f32 {
        size * self.random.symmetric() as f32
    }

    fn body(&mut self) -> Body {
        let mut size = || 0.2 + self.within(0.08);
        let (a, b, c) = (size(), size(), size());
        let shape = match self.random.bits() % 5 {
            0 => Shape::ball(a),
            1 => Shape::capsule(0.5 * a, b),
            2 => Shape::cylinder(a, b),
            3 => Shape::cone(a, b),
            _ => Shape::cuboid(a, b, c),
        };
        let turn = Quat::from_xyzw(self.within(1.0), self.within(1.0), self.within(1.0), 1.5).normalize();
        // Use the nine places in turn: the previous body at the same place has fallen by a meter.
        let place = |k: u32| 0.8 * ((k % 3) as f32 - 1.0);
        self.came = (self.came + 1) % 9;
        Body::dynamic().shape(shape).position(place(self.came), 3.0, place(self.came / 3)).rotation(turn)
    }

    fn before_step(&mut self, step: u32, world: &mut World) {
        if !step.is_multiple_of(3) {
            return;
        }
        if self.here.len() >= self.keeps {
            // A body of the older half.
            let place = (self.random.bits() % (self.here.len() as u64 / 2)) as usize;
            let oldest = self.here.remove(place).expect("a place");
            world.remove(oldest);
            self.gone.push_back(oldest);
            if self.gone.len() > 1000 {
                self.gone.pop_front();
            }
        }
        let body = self.body();
        let new = world.insert(body);
        // Neighbors in a row, which are added one after the other.
        let before = self.here.back().copied().filter(|_| step.is_multiple_of(15) && !self.came.is_multiple_of(3));
        if let Some([a, b]) = before.and_then(|before| Some([world.body(before)?, world.body(new)?])) {
            let middle = a.position.midpoint(b.position);
            let anchor = |body: &Body| body.rotation.inverse() * (middle - body.position);
            let joint = Joint::new(before.expect("a body"), anchor(a), new, anchor(b));
            world.insert_joint(joint);
        }
        self.here.push_back(new);
    }
}

impl Acts {
    pub fn before_step(&mut self, step: u32, dt: f32, world: &mut World) {
        match self {
            Self::None => {}
            Self::Shakes(tray) => {
                // To and fro in 20 steps, from the place where the last step left it, so that rounding errors do not
                // add up.
                let phase = (step + 1) % 20;
                let target = 4e-3 * (if phase < 10 { phase as f32 } else { 20.0 - phase as f32 });
                let tray = world.body_mut(*tray).expect("the tray stays");
                tray.linear_velocity = (target - tray.position.x) / dt * Vec3::X;
            }
            Self::Rains(rain) => rain.before_step(step, world),
            Self::Throws { boxes, random } => {
                if step % 240 == 120 {
                    let chosen = boxes[(random.bits() % boxes.len() as u64) as usize];
                    let mut some = |size: f32| size * random.symmetric() as f32;
                    let body = world.body_mut(chosen).expect("a box stays");
                    body.linear_velocity = Vec3::new(some(1.5), 3.0, some(1.5));
                    body.angular_velocity = Vec3::new(some(5.0), some(5.0), some(5.0));
                }
            }
        }
    }

    /// Number of bodies that are missing, or that still exist after their removal.
    pub fn lost(&self, world: &World) -> usize {
        let missing =
            |all: &mut dyn Iterator<Item = &BodyHandle>| all.filter(|&&body| world.body(body).is_none()).count();
        match self {
            Self::None => 0,
            Self::Shakes(tray) => missing(&mut std::iter::once(tray)),
            Self::Rains(rain) => {
                let there = rain.gone.iter().filter(|&&body| world.body(body).is_some()).count();
                missing(&mut rain.here.iter()) + there
            }
            Self::Throws { boxes, .. } => missing(&mut boxes.iter()),
        }
    }

    /// Sets the largest number of bodies.
    #[cfg(test)]
    pub fn keep(&mut self, bodies: usize) {
        if let Self::Rains(rain) = self {
            rain.keeps = bodies;
        }
    }
}

//! Drives a body of a scene by the input of a person.

use glam::{Quat, Vec3};

use drystone::stages::math::{about, product, unit};
use drystone::world::Collider;
use drystone::{Axis, Body, BodyHandle, Bounds, Character, Drive, Result, Simulation, World};

/// Speed of a walk (m/s), angular speed of its turns (rad/s), and speed of a jump (m/s).
const WALK_SPEED: f32 = 2.5;
const TURN_RATE: f32 = 2.0;
const JUMP_SPEED: f32 = 4.0;
/// Largest speed of a vehicle (m/s) and steering (rad), and the angular speed at which the wheels steer (rad/s).
const MAX_SPEED: f32 = 10.0;
const MAX_STEERING: f32 = 0.5;
const STEERING_RATE: f32 = 1.0;
/// Largest lateral acceleration to which a driver steers (m/s²). The vehicle of the catalogue turns over at up to 1.26 g.
const MAX_LATERAL: f32 = 4.0;

/// Drives a body of a scene by the input of a person: a character that walks, or a vehicle with motors and steering.
/// Forward is the x axis of the body. Until the first input, the scene runs without a driver. The same inputs give the
/// same bits. The value is the whole state: a copy of it belongs to a snapshot of the simulation.
///
/// ```
/// use drystone::Simulation;
/// use drystone_scenes::{Driver, Scene};
///
/// let scene = Scene::find("course", &[])?;
/// let mut driver: Driver = scene.driver.expect("a character");
/// assert!(driver.can_jump() && !driver.is_driving());
/// let mut simulation = Simulation::new(scene.world)?;
/// driver.steer(1.0, 0.0, false);
/// assert!(driver.is_driving());
/// for _ in 0..60 {
///     driver.before_step(&mut simulation, scene.dt)?;
///     simulation.step(scene.dt)?;
/// }
/// // It walks at 2.5 m/s up the stairs.
/// let at = simulation.world.body(driver.body()).expect("a character").position;
/// assert!((at.x - 2.5).abs() < 0.01 && at.y > 1.2);
/// # Ok::<(), drystone::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Driver {
    driven: Driven,
    forward: f32,
    right: f32,
    jump: bool,
    is_driving: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Driven {
    Character(Character),
    /// The chassis of a vehicle.
    Vehicle(BodyHandle),
}

impl Driver {
    /// Drives a kinematic body that walks.
    pub(crate) fn character(body: BodyHandle) -> Self {
        Self::of(Driven::Character(Character::new(body)))
    }

    /// Drives a vehicle with this chassis, and wheels on joints to it. Its x axis is forward, and its y axis up. The first
    /// angle of a joint is that of the wheel about its axle, which a motor turns; the second steers it between limits.
    pub(crate) fn vehicle(chassis: BodyHandle) -> Self {
        Self::of(Driven::Vehicle(chassis))
    }

    fn of(driven: Driven) -> Self {
        Self { driven, forward: 0.0, right: 0.0, jump: false, is_driving: false }
    }

    /// The driven body.
    pub fn body(&self) -> BodyHandle {
        match self.driven {
            Driven::Character(Character { body, .. }) | Driven::Vehicle(body) => body,
        }
    }

    /// Whether it can jump.
    pub fn can_jump(&self) -> bool {
        matches!(self.driven, Driven::Character(_))
    }

    /// Whether there was an input so far.
    pub fn is_driving(&self) -> bool {
        self.is_driving
    }

    /// Sets the input until the next call: forward and to the right from -1 to 1, as shares of the largest speed and
    /// turn. A jump counts for the next step, and only from the ground.
    pub fn steer(&mut self, forward: f32, right: f32, jump: bool) {
        (self.forward, self.right) = (forward.clamp(-1.0, 1.0), right.clamp(-1.0, 1.0));
        self.jump |= jump;
        self.is_driving |= forward != 0.0 || right != 0.0 || jump;
    }

    /// Moves the body by the input in a step of `dt` seconds. Call it before the step, after all other changes of the
    /// world. If the body is gone, nothing happens.
    ///
    /// # Errors
    /// Those of [`Character::walk`].
    pub fn before_step(&mut self, simulation: &mut Simulation, dt: f32) -> Result<()> {
        let jump = std::mem::take(&mut self.jump);
        let own = self.body();
        let Some(body) = simulation.world.body_mut(own).filter(|_| self.is_driving) else { return Ok(()) };
        match &mut self.driven {
            Driven::Character(character) => {
                body.rotation = unit(product(about(Vec3::Y, -TURN_RATE * self.right * dt), body.rotation));
                let velocity = WALK_SPEED * self.forward * (body.rotation * Vec3::X);
                if jump && character.ground().is_some() {
                    character.launch(JUMP_SPEED * Vec3::Y);
                }
                character.walk(simulation, velocity, dt)?;
            }
            Driven::Vehicle(chassis) => drive(&mut simulation.world, *chassis, self.forward, self.right, dt),
        }
        Ok(())
    }
}

/// The circle on which a vehicle drives.
pub(crate) struct Turn {
    /// Speed of the vehicle (m/s).
    pub speed: f32,
    /// Angle of a wheel in the middle of the front axle, positive to the left (rad).
    pub steering: f32,
    /// Places of the rear and of the front axle along x (m).
    pub axles: (f32, f32),
}

impl Turn {
    /// Angle of a wheel (rad) and its speed over the ground (m/s), at its place along x and z. All axles pass through the
    /// center of one circle.
    pub(crate) fn of_wheel(&self, (x, z): (f32, f32)) -> (f32, f32) {
        // A vehicle that lost an axle does not steer.
        let wheelbase = self.axles.1 - self.axles.0;
        let curvature = if wheelbase > 0.0 { libm::tanf(self.steering) / wheelbase } else { 0.0 };
        // From the middle of the rear axle.
        let (ahead, across) = (curvature * (x - self.axles.0), 1.0 + curvature * z);
        (libm::atan2f(ahead, across), self.speed * (ahead * ahead + across * across).sqrt())
    }
}

/// Places of the rear and of the front axle of a chassis along x (m).
pub(crate) fn axles(world: &World, chassis: BodyHandle) -> (f32, f32) {
    let wheels = || world.joints.iter().filter(|joint| joint.body_b == Some(chassis)).map(|joint| joint.anchor_b.x);
    (wheels().fold(f32::INFINITY, f32::min), wheels().fold(f32::NEG_INFINITY, f32::max))
}

/// Turns and steers the wheels of a chassis in a step of `dt` seconds: forward and to the right by -1 to 1.
fn drive(world: &mut World, chassis: BodyHandle, forward: f32, right: f32, dt: f32) {
    let Some(body) = world.body(chassis) else { return };
    let speed = body.linear_velocity.dot(body.rotation * Vec3::X);
    let axles = axles(world, chassis);
    let sharpest = libm::atanf(MAX_LATERAL * (axles.1 - axles.0) / (speed * speed)).min(MAX_STEERING);
    let turn = Turn { speed: forward * MAX_SPEED, steering: -right * sharpest, axles };
    let World { bodies, joints, .. } = world;
    for joint in joints.iter_mut().filter(|joint| joint.body_b == Some(chassis)) {
        let (angle, speed) = turn.of_wheel((joint.anchor_b.x, joint.anchor_b.z));
        let [roll, steer, _] = &mut joint.angular;
        if let Drive::Motor { max_load, .. } = roll.drive {
            *roll = roll.motor(-speed / radius(&bodies[joint.body_a]), max_load);
        }
        if let Bounds::Between { min, .. } = steer.bounds {
            let angle = min + (angle - min).clamp(-STEERING_RATE * dt, STEERING_RATE * dt);
            *steer = Axis::limited(angle, angle);
        }
    }
}

/// Radius of a wheel (m): the largest extent of its shapes from its center.
fn radius(wheel: &Body) -> f32 {
    let extent = |collider: &Collider| collider.bounds(Vec3::ZERO, Quat::IDENTITY).1.max_element();
    wheel.colliders.iter().map(extent).fold(0.0, f32::max)
}

//! Drives a body of a scene by the input of a person.

use glam::Vec3;

use drystone::stages::math::rotation::{about, product, unit};
use drystone::{Axis, BodyHandle, Bounds, Character, Result, Simulation, World};

/// Speed of a walk (m/s), angular speed of its turns (rad/s), and speed of a jump (m/s).
const WALK_SPEED: f32 = 2.5;
const TURN_RATE: f32 = 2.0;
const JUMP_SPEED: f32 = 4.0;
/// The vehicle of the catalogue: radius of its wheels (m), its wheelbase (m), and the largest torque on each wheel (N m).
pub(crate) const RADIUS: f32 = 0.35;
pub(crate) const WHEELBASE: f32 = 2.6;
pub(crate) const TORQUE: f32 = 300.0;
/// Largest speed of the vehicle (m/s) and steering (rad), and the angular speed at which the wheels steer (rad/s).
const MAX_SPEED: f32 = 10.0;
const MAX_STEERING: f32 = 0.5;
const STEERING_RATE: f32 = 1.0;
/// Largest lateral acceleration to which a driver steers (m/s²). The vehicle turns over at up to 1.26 g.
const MAX_LATERAL: f32 = 4.0;

/// Drives a body of a scene by the input of a person: a character that walks, or a vehicle with motors and steering.
/// Forward is the x axis of the body. Until the first input, the scene runs without a driver. The same inputs give the
/// same bits. The value is the whole state: a copy of it belongs to a snapshot of the simulation.
///
/// ```
/// use drystone::{Reference, Simulation, SolverConfig};
/// use drystone_scenes::{Driver, Scene};
///
/// let scene = Scene::find("course", &[])?;
/// let mut driver: Driver = scene.driver.expect("a character");
/// assert!(driver.can_jump() && !driver.is_driving());
/// let mut simulation = Simulation::with(scene.world, SolverConfig::default(), Box::new(Reference::<f32>::new()))?;
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

    /// Drives the vehicle of the catalogue with this chassis.
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
}

impl Turn {
    /// Angle of a wheel (rad) and its angular speed about Z (rad/s). All axles pass through the center of one circle,
    /// and each wheel rolls at the speed of its place.
    pub(crate) fn of_wheel(&self, (x, z): (f32, f32)) -> (f32, f32) {
        let curvature = libm::tanf(self.steering) / WHEELBASE;
        // From the middle of the rear axle.
        let (ahead, across) = (curvature * (x + 0.5 * WHEELBASE), 1.0 + curvature * z);
        let angle = libm::atan2f(ahead, across);
        (angle, -self.speed / RADIUS * (ahead * ahead + across * across).sqrt())
    }
}

/// Turns and steers the wheels of a chassis in a step of `dt` seconds: forward and to the right by -1 to 1.
fn drive(world: &mut World, chassis: BodyHandle, forward: f32, right: f32, dt: f32) {
    let Some(body) = world.body(chassis) else { return };
    let speed = body.linear_velocity.dot(body.rotation * Vec3::X);
    let sharpest = libm::atanf(MAX_LATERAL * WHEELBASE / (speed * speed)).min(MAX_STEERING);
    let turn = Turn { speed: forward * MAX_SPEED, steering: -right * sharpest };
    for joint in world.joints.iter_mut().filter(|joint| joint.body_b == Some(chassis)) {
        let (angle, spin) = turn.of_wheel((joint.anchor_b.x, joint.anchor_b.z));
        let [roll, steer, _] = &mut joint.angular;
        *roll = roll.motor(spin, TORQUE);
        if let Bounds::Between { min, .. } = steer.bounds {
            let angle = min + (angle - min).clamp(-STEERING_RATE * dt, STEERING_RATE * dt);
            *steer = Axis::limited(angle, angle);
        }
    }
}

//! Drives a body of a scene by the input of a person.

use glam::Vec3;

use crate::catalogue::drive;
use drystone::stages::math::rotation::{about, product, unit};
use drystone::{BodyHandle, Character, Result, Simulation};

/// Speed of a walk (m/s), angular speed of its turns (rad/s), and speed of a jump (m/s).
const WALK_SPEED: f32 = 2.5;
const TURN_RATE: f32 = 2.0;
const JUMP_SPEED: f32 = 4.0;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use drystone::{Backend, Body, Cpu, Reference, SolverConfig};

    /// A scene with its driver.
    struct Drive {
        simulation: Simulation,
        driver: Driver,
        dt: f32,
    }

    impl Drive {
        fn on(backend: Box<dyn Backend>, name: &str) -> Self {
            let Scene { world, driver, dt, .. } = Scene::find(name, &[]).expect("a scene");
            let simulation = Simulation::with(world, SolverConfig::default(), backend).expect("a simulation");
            Self { simulation, driver: driver.expect("a driver"), dt }
        }

        fn of(name: &str) -> Self {
            Self::on(Box::new(Reference::<f32>::new()), name)
        }

        /// Makes steps with one input, and returns the greatest height (m).
        fn steps(&mut self, count: u32, forward: f32, right: f32, jump: bool) -> f32 {
            self.driver.steer(forward, right, jump);
            (0..count).fold(0.0, |highest, _| {
                self.driver.before_step(&mut self.simulation, self.dt).expect("a walk");
                self.simulation.step(self.dt).expect("a step");
                highest.max(self.body().position.y)
            })
        }

        fn body(&self) -> &Body {
            self.simulation.world.body(self.driver.body()).expect("it is there")
        }

        fn ahead(&self) -> Vec3 {
            self.body().rotation * Vec3::X
        }
    }

    #[test]
    fn the_walker_climbs_the_stairs_reaches_the_ramp_turns_and_jumps() {
        let mut drive = Drive::of("course");
        drive.steps(30, 0.0, 0.0, false);
        assert!(!drive.driver.is_driving() && drive.body().position == Vec3::new(0.0, 0.906, 0.0));
        let highest = drive.steps(170, 1.0, 0.0, false);
        let Vec3 { x, y, z } = drive.body().position;
        // Six stairs of 0.18 m lead to the landing, and the ramp descends by 30 degrees from 5.8 m on.
        assert!((highest - 6.0 * 0.18 - 0.906).abs() < 0.01, "{highest} m");
        assert!(x > 6.5 && y < highest - 0.4 && z.abs() < 1e-3, "{x}, {y}, {z}");
        let before = drive.body().position;
        drive.steps(60, 0.0, 0.0, false);
        assert!(drive.body().position.distance(before) < 0.05, "it stands");
        let highest = drive.steps(20, 0.0, 0.0, true);
        assert!(highest > drive.body().position.y.min(before.y) + 0.6, "{highest} m, from {before}");
        drive.steps(45, 0.0, 1.0, false);
        let ahead = drive.ahead();
        assert!((ahead - Vec3::new(libm::cosf(1.5), 0.0, libm::sinf(1.5))).length() < 1e-3, "{ahead}");
        let before = drive.body().position;
        drive.steps(30, -1.0, 0.0, false);
        assert!(drive.body().position.z < before.z - 1.0, "it walks back");
    }

    #[test]
    fn the_vehicle_drives_forward_turns_left_and_stops() {
        let mut drive = Drive::of("vehicle");
        drive.steps(120, 1.0, 0.0, false);
        let (at, ahead) = (drive.body().position, drive.ahead());
        assert!(at.x > 4.0 && at.z.abs() < 0.5 && ahead.x > 0.99, "{at}, ahead {ahead}");
        drive.steps(120, 1.0, -1.0, false);
        let (to, ahead) = (drive.body().position, drive.ahead());
        assert!(ahead.z < -0.5 && to.z < at.z - 1.0, "{to}, ahead {ahead}");
        drive.steps(300, 0.0, 1.0, false);
        assert!(drive.body().linear_velocity.length() < 0.1, "{}", drive.body().linear_velocity);
        drive.steps(120, -1.0, 0.0, false);
        assert!(drive.body().linear_velocity.dot(drive.ahead()) < -2.0, "{}", drive.body().linear_velocity);
        let up = (drive.body().rotation * Vec3::Y).y;
        assert!(up > 0.95, "{up}");
    }

    #[test]
    fn the_same_inputs_give_the_same_bits() {
        for name in ["course", "vehicle"] {
            let hash = |backend: Box<dyn Backend>| {
                let mut drive = Drive::on(backend, name);
                for (forward, right, jump) in [(1.0, 0.3, false), (0.7, -1.0, true), (-0.5, 0.1, false)] {
                    drive.steps(40, forward, right, jump);
                }
                drive.simulation.hash()
            };
            assert_eq!(hash(Box::new(Reference::<f32>::new())), hash(Box::new(Cpu::new())), "{name}");
        }
    }

    #[test]
    fn a_driver_of_a_removed_body_does_nothing() {
        let mut drive = Drive::of("course");
        drive.simulation.world.remove(drive.driver.body());
        drive.driver.steer(1.0, 0.0, true);
        drive.driver.before_step(&mut drive.simulation, drive.dt).expect("nothing");
    }
}

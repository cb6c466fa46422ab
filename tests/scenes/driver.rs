//! A driver moves the body of a scene by the input of a person.

use drystone::glam::Vec3;
use drystone::{Backend, Body, Cpu, Reference, Simulation, SolverConfig};
use drystone_scenes::{Driver, Scene};

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

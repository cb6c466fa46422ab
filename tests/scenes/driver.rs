//! A driver moves the body of a scene by the input of a person.

use drystone::glam::Vec3;
use drystone::{Backend, Body, Cpu, Reference, Simulation, SolverConfig};
use drystone_scenes::{Driver, Scene, SceneFile};

/// A scene with its driver.
struct Drive {
    simulation: Simulation,
    driver: Driver,
    dt: f32,
}

impl Drive {
    fn on(backend: Box<dyn Backend>, name: &str) -> Self {
        Self::through(Scene::find(name, &[]).expect("a scene"), backend)
    }

    fn through(Scene { world, driver, dt, .. }: Scene, backend: Box<dyn Backend>) -> Self {
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
fn a_scene_file_keeps_its_driver() {
    for name in ["course", "vehicle"] {
        let run = |scene: Scene| {
            let mut drive = Drive::through(scene, Box::new(Reference::<f32>::new()));
            drive.steps(30, 1.0, 0.5, false);
            drive.simulation.hash()
        };
        let scene = Scene::find(name, &[]).expect("a scene");
        let text = SceneFile::of(&scene).expect("a file").to_text();
        let read = SceneFile::parse(&text).and_then(|file| file.into_scene(name)).expect("a scene");
        assert_eq!((read.driver, run(read)), (scene.driver, run(scene)), "{name}");
    }
}

/// A cart of its own: wheels of 0.2 m on one axle are driven, and those of 0.3 m on the other are steered.
#[test]
fn a_file_has_a_vehicle_of_any_size() {
    let wheel = |x: f32, z: f32, radius: f32| {
        format!(
            r#",{{"name": "wheel {x} {z}", "position": [{x}, {radius}, {z}], "mass": 5, "friction": 1,
            "rotation": [0.70710678, 0, 0, 0.70710678],
            "shapes": [{{"type": "cylinder", "half_height": 0.05, "radius": {radius}}}]}}"#
        )
    };
    let joint = |x: f32, z: f32, radius: f32| {
        let [roll, steer] = if x < 0.0 {
            [r#"{"motor": {"speed": 0, "max_load": 40}}"#, r#"{"locked": true}"#]
        } else {
            ["{}", r#"{"limits": [0, 0]}"#]
        };
        format!(
            r#",{{"type": "generic", "bodies": ["wheel {x} {z}", "chassis"], "anchor": [{x}, {radius}, {z}],
            "frame": [0, -0.70710678, 0, 0.70710678],
            "linear": [{{"locked": true}}, {{"locked": true}}, {{"locked": true}}],
            "angular": [{roll}, {steer}, {{"locked": true}}]}}"#
        )
    };
    let places = [(-0.6, -0.4, 0.2), (-0.6, 0.4, 0.2), (0.6, -0.4, 0.3), (0.6, 0.4, 0.3)];
    let list = |part: &dyn Fn(f32, f32, f32) -> String| places.map(|(x, z, radius)| part(x, z, radius)).concat();
    let text = format!(
        r#"{{"version": 1, "driver": {{"type": "vehicle", "body": "chassis"}},
        "bodies": [{{"name": "floor", "kind": "fixed", "friction": 1, "shapes": [{{"type": "half_space", "normal": [0, 1, 0]}}]}},
        {{"name": "chassis", "position": [0, 0.5, 0], "mass": 60, "shapes": [{{"type": "cuboid", "half_extents": [0.7, 0.1, 0.3]}}]}}
        {}], "joints": [{}]}}"#,
        list(&wheel),
        &list(&joint)[1..]
    );
    let scene = SceneFile::parse(&text).and_then(|file| file.into_scene("cart")).expect("a scene");
    let mut drive = Drive::through(scene, Box::new(Reference::<f32>::new()));
    drive.steps(180, 0.5, 0.0, false);
    let Vec3 { x: speed, .. } = drive.body().linear_velocity;
    // Half of the largest speed, 10 m/s: the radius of each wheel is its own.
    assert!((speed - 5.0).abs() < 0.05, "{speed} m/s");
    drive.steps(60, 0.5, -0.5, false);
    assert!(drive.ahead().z < -0.1, "it turns left: {}", drive.ahead());
}

#[test]
fn a_file_refuses_a_driver_of_a_body_that_it_cannot_drive() {
    for (kind, message) in [
        ("character", r#"driver: body "box": a character must be kinematic"#),
        (
            "vehicle",
            r#"driver: body "box": a vehicle needs joints whose second body it is, at two places along its x axis"#,
        ),
    ] {
        let text = format!(
            r#"{{"version": 1, "driver": {{"type": "{kind}", "body": "box"}},
            "bodies": [{{"name": "box", "shapes": [{{"type": "ball", "radius": 1}}]}}]}}"#
        );
        let error = SceneFile::parse(&text).and_then(|file| file.into_scene("box")).expect_err("no scene");
        assert_eq!(error.to_string(), message);
    }
}

#[test]
fn a_driver_of_a_removed_body_does_nothing() {
    let mut drive = Drive::of("course");
    drive.simulation.world.remove(drive.driver.body());
    drive.driver.steer(1.0, 0.0, true);
    drive.driver.before_step(&mut drive.simulation, drive.dt).expect("nothing");
}

//! The vehicle of the catalogue against closed forms, and a character on the course.

use drystone::glam::Vec3;
use drystone::preset::Preset;
use drystone::{Body, Character, Reference, Simulation, SolverConfig};
use drystone_scenes::Scene;

const DT: f32 = 1.0 / 60.0;
const G: f32 = 9.81;
/// Masses (kg) and lengths (m) of the vehicle.
const CHASSIS: f32 = 1200.0;
const WHEEL: f32 = 30.0;
const RADIUS: f32 = 0.35;
const WHEELBASE: f32 = 2.6;

fn vehicle(parameters: &[&str]) -> Simulation {
    vehicle_with(SolverConfig::default(), parameters)
}

fn vehicle_with(config: SolverConfig, parameters: &[&str]) -> Simulation {
    let parameters: Vec<String> = parameters.iter().map(|&p| p.to_owned()).collect();
    let scene = Scene::find("vehicle", &parameters).expect("the scene");
    let reference = Box::new(Reference::<f32>::new());
    Simulation::with(scene.world, config.without_sleep(), reference).expect("a simulation")
}

fn steps(simulation: &mut Simulation, count: u32) {
    (0..count).for_each(|_| drop(simulation.step(DT).expect("a step")));
}

fn chassis(simulation: &Simulation) -> &Body {
    simulation.world.bodies.iter().find(|body| body.name == "chassis").expect("a chassis")
}

/// The closed form is mg/k.
#[test]
fn it_stands_as_high_as_its_springs_say() {
    // At 1.5 Hz the springs yield by g/omega² under the chassis alone, and it then is 0.75 m high.
    let omega = std::f32::consts::TAU * 1.5;
    let sag = G / (omega * omega);
    for load in [0.0, 300.0, 1200.0] {
        let mut simulation = vehicle(&["speed=0", "steering=0", "hills=0", &format!("load={load}")]);
        steps(&mut simulation, 480);
        let Body { position, linear_velocity, .. } = chassis(&simulation);
        let (yielded, expected) = (0.75 + sag - position.y, sag * (1.0 + load / CHASSIS));
        println!("{load} kg: {yielded} m of {expected}, {linear_velocity} m/s");
        assert!((yielded / expected - 1.0).abs() < 1e-3, "{load} kg: {yielded} m, not {expected}");
        assert!(linear_velocity.length() < 1e-3 && position.x.abs() < 2e-3, "{load} kg: {position} {linear_velocity}");
    }
}

#[test]
fn it_accelerates_with_the_torque_of_its_motors_or_the_friction_of_the_ground() {
    for mu in [1.0, 0.1] {
        let mut simulation = vehicle(&["speed=0", "steering=0", "hills=0", &format!("mu={mu}")]);
        steps(&mut simulation, 120);
        let spin = |axis: drystone::Axis| axis.motor(-30.0 / RADIUS, 300.0);
        simulation.world.joints.iter_mut().for_each(|joint| joint.angular[0] = spin(joint.angular[0]));
        steps(&mut simulation, 20);
        let before = chassis(&simulation).linear_velocity.x;
        steps(&mut simulation, 60);
        let acceleration = chassis(&simulation).linear_velocity.x - before;
        // A wheel has half of its mass times the squared radius as moment of inertia.
        let by_torque = 4.0 * 300.0 / RADIUS / (CHASSIS + 4.0 * 1.5 * WHEEL);
        let expected = by_torque.min(mu * G);
        assert!((acceleration / expected - 1.0).abs() < 0.02, "mu {mu}: {acceleration} m/s², not {expected}");
    }
}

#[test]
fn it_drives_the_circle_of_its_steering() {
    for degrees in [10.0_f32, -20.0, 30.0] {
        let mut simulation = vehicle(&["speed=3", "hills=0", &format!("steering={degrees}")]);
        steps(&mut simulation, 180);
        let rear = |simulation: &Simulation| {
            let body = chassis(simulation);
            body.position - 0.5 * WHEELBASE * (body.rotation * Vec3::X)
        };
        let turned = |simulation: &Simulation| chassis(simulation).angular_velocity.y;
        let (mut way, mut angle, mut before) = (0.0, 0.0, rear(&simulation));
        for _ in 0..240 {
            steps(&mut simulation, 1);
            way += rear(&simulation).distance(before);
            angle += turned(&simulation) * DT;
            before = rear(&simulation);
        }
        let (radius, expected) = (way / angle, WHEELBASE / degrees.to_radians().tan());
        assert!((radius / expected - 1.0).abs() < 0.03, "{degrees} degrees: {radius} m, not {expected}");
        assert!((way / 4.0 / 3.0 - 1.0).abs() < 0.03, "{degrees} degrees: {} m/s", way / 4.0);
    }
}

/// It slides sideways at mu g. The wheels are 0.9 m from the middle, and the center of mass is 0.71 m high: it turns over
/// from 1.26 g on, or from less on its springs. With the 8 substeps of the default it slides on all
/// wheels and does not turn over, which is wrong; the cause is not known. From 16 substeps on it turns over.
#[test]
fn it_turns_over_only_beyond_the_limit_of_its_track() {
    let least_upright = |mu: f32| {
        let mut simulation =
            vehicle_with(Preset::Accurate.config(), &["speed=0", "steering=0", "hills=0", &format!("mu={mu}")]);
        steps(&mut simulation, 120);
        let moving = simulation.world.bodies.iter_mut().filter(|body| body.mass.mass > 0.0);
        moving.for_each(|body| body.linear_velocity += 8.0 * Vec3::Z);
        let mut least = 1.0_f32;
        for _ in 0..240 {
            steps(&mut simulation, 1);
            least = least.min((chassis(&simulation).rotation * Vec3::Y).y);
        }
        least
    };
    let (low, high) = (least_upright(1.0), least_upright(2.0));
    println!("up at least {low} at a friction of 1.0, and {high} at 2.0");
    assert!(low > 0.99 && high < 0.5, "{low}, {high}");
}

#[test]
fn it_stays_upright_on_hills() {
    let mut simulation = vehicle(&[]);
    let (mut least, mut gap, mut heights) = (1.0_f32, 0.0_f32, [f32::INFINITY, 0.0]);
    for _ in 0..900 {
        steps(&mut simulation, 1);
        let body = chassis(&simulation);
        least = least.min((body.rotation * Vec3::Y).y);
        heights = [heights[0].min(body.position.y), heights[1].max(body.position.y)];
        gap = gap.max(simulation.world.joint_gap());
    }
    assert!(least > 0.95 && gap < 0.02, "up {least}, gap {gap} m");
    assert!(heights[1] - heights[0] > 0.3, "no hills: {heights:?}");
}

#[test]
fn a_character_walks_the_course() {
    for spin in [-1.0, 0.0, 0.5] {
        let scene = Scene::find("course", &[format!("spin={spin}")]).expect("the scene");
        let reference = Box::new(Reference::<f32>::new());
        let mut simulation = Simulation::with(scene.world, SolverConfig::default(), reference).expect("a simulation");
        let own = simulation.world.bodies.iter().position(|body| body.name == "character").expect("a character");
        let mut character = Character::new(simulation.world.bodies.handle(own).expect("it is there"));
        let (mut highest, mut in_air) = (0.0_f32, 0);
        for _ in 0..scene.steps {
            let place = simulation.world.bodies[own].position;
            let velocity = Vec3::new(2.0, 0.0, -place.z.clamp(-1.0, 1.0));
            let movement = character.walk(&mut simulation, velocity, scene.dt).expect("a walk");
            simulation.step(scene.dt).expect("a step");
            in_air += u32::from(movement.ground.is_none());
            highest = highest.max(place.y);
        }
        let place = simulation.world.bodies[own].position;
        // Six stairs of 0.18 m. In the end it is at the foot of the slope of 50 degrees, or of a crate there.
        assert!((highest - 6.0 * 0.18 - 0.906).abs() < 0.01, "spin {spin}: {highest} m");
        assert!(place.x > 18.5 && place.x < 20.0 && (place.y - 0.906).abs() < 0.01, "spin {spin}: {place}");
        assert_eq!(in_air, 0, "spin {spin}");
    }
}

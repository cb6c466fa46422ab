//! Few bodies, in trouble.

use std::f64::consts::PI;

use glam::{DVec3, Quat, Vec3};

use super::{Check, DT, Setup, is_broken};
use drystone::Result;
use drystone::Simulation;
use drystone::config::Friction;
use drystone::metrics;
use drystone::scenes::Scene;
use drystone::stats::largest;
use drystone::world::{BallJoint, Body, MassProperties, Shape, World};

/// Less than anything.
const LEAST: f64 = f64::NEG_INFINITY;

fn floor(friction: f32) -> World {
    let mut world = World::new();
    world.add(Body::fixed().shape(Shape::half_space(Vec3::Y)).friction(friction));
    world
}

fn cube(x: f32, y: f32) -> Body {
    Body::dynamic().shape(Shape::cuboid(0.5, 0.5, 0.5)).position(x, y, 0.0)
}

fn weightless() -> World {
    World { gravity: Vec3::ZERO, ..World::new() }
}

fn energy(world: &World) -> f64 {
    world.kinetic_energy() + world.potential_energy()
}

/// By how much a value is off an exact one, relative.
fn off(value: f64, exact: f64) -> f64 {
    (value / exact - 1.0).abs()
}

/// What `measure` says after each of `steps` steps.
fn watch(simulation: &mut Simulation, steps: u32, measure: impl Fn(&World) -> f64) -> Result<Vec<f64>> {
    (0..steps).map(|_| simulation.step(DT).map(|_| measure(&simulation.world))).collect()
}

pub(super) fn heavy_chain(setup: &Setup) -> Result<Vec<Check>> {
    const LINKS: usize = 100;
    const RADIUS: f32 = 0.5;
    let mut world = World::new();
    let bar = Body::dynamic().shape(Shape::cuboid(0.25, 0.05, 0.05)).density(500.0);
    let mut held: Option<usize> = None;
    for k in 0..=LINKS {
        let is_end = k == LINKS;
        let half = if is_end { RADIUS } else { 0.25 };
        let body = if is_end {
            Body::dynamic().shape(Shape::ball(RADIUS)).total_mass(1000.0 * bar.mass.mass)
        } else {
            bar.clone()
        };
        let index = world.add(body.position(0.5 * k as f32 + half, 0.0, 0.0));
        world.join(match held {
            None => BallJoint::to_world(index, -half * Vec3::X, Vec3::ZERO),
            Some(before) => BallJoint::new(before, 0.25 * Vec3::X, index, -half * Vec3::X),
        });
        held = Some(index);
    }
    let before = energy(&world);
    // The most that the swing can set free.
    let scale: f64 = world.bodies.iter().map(|b| f64::from(b.mass.mass) * 9.81 * f64::from(b.position.x)).sum();
    let mut simulation = setup.simulation(world)?;
    let mut gap = 0.0_f64;
    let mut gained = f64::NEG_INFINITY;
    for _ in 0..600 {
        simulation.step(DT)?;
        gap = largest(gap, [simulation.world.joint_gap().into()]);
        gained = largest(gained, [energy(&simulation.world) - before]);
    }
    Ok(vec![
        Check::at_most("largest gap of a joint over the length of a link", gap / 0.5, 0.01),
        Check::at_most("energy gained over what the swing sets free", gained / scale, 1e-3),
        Check::at_most("bodies that are no numbers", is_broken(&simulation.world), 0.0),
    ])
}

pub(super) fn spinning_rod(setup: &Setup) -> Result<Vec<Check>> {
    const HALF: f32 = 0.5;
    // Solid cylinder: r²/2 along, r²/4 + l²/12 across.
    let radius = (4.0 * HALF * HALF / 12.0 / (500.0 - 0.25)).sqrt();
    let rod = Body::dynamic().shape(Shape::cylinder(HALF, radius));
    let mut free = weightless();
    free.add(rod.clone().velocity(Vec3::ZERO, Vec3::new(1.0, 1000.0, 0.0)));
    let before = free.kinetic_energy();
    let drift = largest(LEAST, watch(&mut setup.simulation(free)?, 600, |w| off(w.kinetic_energy(), before))?);

    let mut lying = floor(0.5);
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    lying.add(rod.rotation(turn).position(0.0, 2.0 * radius, 0.0).velocity(Vec3::ZERO, 1000.0 * Vec3::X));
    let before = energy(&lying);
    let mut simulation = setup.simulation(lying)?;
    let gained = largest(LEAST, watch(&mut simulation, 600, energy)?) / before - 1.0;
    Ok(vec![
        Check::at_most("free: change of energy in 10 s, relative", drift, 1e-3),
        Check::at_most("on a floor: energy gained, relative", gained, 1e-3),
        Check::at_most("on a floor: bodies that are no numbers", is_broken(&simulation.world), 0.0),
    ])
}

pub(super) fn overlaps(setup: &Setup) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for share in [0.25, 0.5, 1.0_f32] {
        let mut world = weightless();
        world.add(cube(0.0, 0.0));
        world.add(cube(0.0, 1.0 - share));
        let mut simulation = setup.simulation(world)?;
        let speed = largest(LEAST, watch(&mut simulation, 300, |w| metrics::fastest(w).0)?);
        checks.push(Check::at_most(
            format!("{:.0} %: speed at any time over the push limit", 100.0 * share),
            speed / f64::from(setup.config.push_limit),
            1.0,
        ));
        checks.push(Check::at_most(
            format!("{:.0} %: overlap after 5 s [mm]", 100.0 * share),
            1e3 * simulation.penetration().max,
            1.0,
        ));
    }
    Ok(checks)
}

pub(super) fn no_direction(setup: &Setup) -> Result<Vec<Check>> {
    let ball = |x: f32, y: f32, z: f32| Body::dynamic().shape(Shape::ball(0.5)).position(x, y, z);
    let block = || Body::fixed().shape(Shape::cuboid(0.5, 0.5, 0.5));
    let mut checks = Vec::new();
    let mut trial = |what: &str, bodies: Vec<Body>, gravity: Vec3| -> Result<()> {
        let mut world = World { gravity, ..World::new() };
        for body in bodies {
            world.add(body);
        }
        let (before, limit) = (energy(&world), f64::from(setup.config.push_limit));
        let most = f64::from(world.bodies.iter().map(|b| b.mass.mass).sum::<f32>()) * 0.5 * limit * limit;
        let mut simulation = setup.simulation(world)?;
        let gained = largest(LEAST, watch(&mut simulation, 300, energy)?) - before;
        checks.push(Check::at_most(
            format!("{what}: energy gained over what the push limit allows"),
            gained / most,
            1.0,
        ));
        checks.push(Check::at_most(format!("{what}: bodies that are no numbers"), is_broken(&simulation.world), 0.0));
        Ok(())
    };
    let g = World::new().gravity;
    trial("ball on an edge", vec![block(), ball(0.5, 1.0, 0.0)], g)?;
    trial("ball on a corner", vec![block(), ball(0.5, 1.0, 0.5)], g)?;
    trial("middle of a ball on a corner", vec![block(), ball(0.5, 0.5, 0.5)], g)?;
    trial("two balls in one place", vec![ball(0.0, 0.0, 0.0), ball(0.0, 0.0, 0.0)], Vec3::ZERO)?;
    trial("two cubes in one place", vec![cube(0.0, 0.0), cube(0.0, 0.0)], Vec3::ZERO)?;
    Ok(checks)
}

pub(super) fn nearly_parallel(setup: &Setup) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut rest = |what: String, upper: Body| -> Result<()> {
        let mut world = floor(0.5);
        world.add(cube(0.0, 0.5));
        world.add(upper);
        let mut simulation = setup.simulation(world)?;
        for _ in 0..540 {
            simulation.step(DT)?;
        }
        let fastest = largest(LEAST, watch(&mut simulation, 60, metrics::rms_speed)?);
        checks.push(Check::at_most(format!("{what}: rms speed in the tenth second [mm/s]"), 1e3 * fastest, 1.0));
        Ok(())
    };
    for angle in [1e-7, 1e-6, 1e-5, 1e-4, 1e-3_f32] {
        let turn = Quat::from_rotation_y(angle) * Quat::from_rotation_x(angle);
        rest(format!("turned by {angle:e} rad"), cube(0.0, 1.5).rotation(turn))?;
    }
    // On its edge, a little off balance.
    let on_edge = Quat::from_rotation_z(std::f32::consts::FRAC_PI_4 + 0.01);
    let rocking = Body::dynamic().shape(Shape::cuboid(0.25, 0.25, 0.25)).rotation(on_edge);
    rest("a cube let go on its edge".into(), rocking.position(0.0, 1.0 + 0.25 * 2_f32.sqrt(), 0.0))?;
    Ok(checks)
}

pub(super) fn no_inertia(setup: &Setup) -> Result<Vec<Check>> {
    let mut world = floor(0.5);
    let point = MassProperties { mass: 1.0, principal_inertia: Vec3::splat(1e-9), ..MassProperties::IMMOVABLE };
    let mut still = Vec::new();
    still.push(world.add(Body::dynamic().shape(Shape::ball(0.1)).mass_properties(point).position(0.0, 0.1, 0.0)));
    still.push(
        world.add(Body::dynamic().shape(Shape::cuboid(0.1, 0.1, 0.1)).mass_properties(point).position(1.0, 0.1, 0.0)),
    );
    let lying = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    still.push(world.add(Body::dynamic().shape(Shape::cylinder(0.5, 1e-3)).rotation(lying).position(3.0, 1e-3, 0.0)));
    // Pairs of infinite mass inside of each other.
    let wall = |body: Body| body.shape(Shape::cuboid(0.5, 0.5, 0.5)).position(6.0, 0.5, 0.0);
    world.add(wall(Body::fixed()));
    world.add(wall(Body::kinematic().velocity(0.1 * Vec3::X, Vec3::ZERO)));
    world.add(wall(Body::kinematic().velocity(-0.1 * Vec3::X, Vec3::ZERO)));
    let before = world.clone();
    let mut simulation = setup.simulation(world)?;
    let speed = largest(LEAST, watch(&mut simulation, 300, |w| metrics::fastest(w).0)?);
    let moved = still.iter().map(|&i| before.bodies[i].position.distance(simulation.world.bodies[i].position).into());
    Ok(vec![
        Check::at_most("bodies that are no numbers", is_broken(&simulation.world), 0.0),
        Check::at_most("way of what lies still [mm]", 1e3 * largest(LEAST, moved), 1.0),
        Check::at_most("speed at any time [m/s]", speed, 0.1),
    ])
}

/// Painlevé: a rod at `angle` from the floor whose tip slides at 5 m/s. Where mu > 4/3 there are angles at which friction presses the tip
/// into the floor faster than any normal force lifts it out.
pub(super) fn painleve(setup: &Setup) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for (mu, degrees, way) in
        [(1.5, 60.0, -1.0), (2.0, 60.0, -1.0), (2.0, 60.0, 1.0), (3.0, 45.0, -1.0), (3.0, 45.0, 1.0_f32)]
    {
        let mut world = floor(mu);
        let turn = Quat::from_rotation_z((degrees as f32 - 90.0).to_radians());
        let rod = Body::dynamic().shape(Shape::capsule(1.0, 0.01)).friction(mu).rotation(turn);
        // The lower end touches; +x leans away from it.
        let y = (degrees as f32).to_radians().sin() + 0.01;
        world.add(rod.position(0.0, y, 0.0).velocity(5.0 * way * Vec3::X, Vec3::ZERO));
        let before = energy(&world);
        let mut simulation = setup.simulation(world)?;
        let all = watch(&mut simulation, 300, energy)?;
        let grown = all.iter().scan(before, |last, &e| {
            let by = e - *last;
            *last = e;
            Some(by)
        });
        let what =
            format!("mu {mu}, {degrees} degrees, tip to {}", if way > 0.0 { "its middle" } else { "the outside" });
        checks.push(Check::at_most(
            format!("{what}: most energy gained in a step, relative"),
            largest(LEAST, grown) / before,
            1e-3,
        ));
        checks.push(Check::at_most(format!("{what}: bodies that are no numbers"), is_broken(&simulation.world), 0.0));
    }
    Ok(checks)
}

/// What a free body with moments 1, 2, 3 kg m² and spin (`first`, 10, 0) rad/s does in 20 s.
pub struct Tumble {
    /// When its spin about the middle axis changes sign (s).
    pub flips: Vec<f64>,
    /// Largest relative change of the energy.
    pub energy: f64,
    /// Largest relative change of the angular momentum.
    pub momentum: f64,
}

impl Tumble {
    /// Runs it with `config` at 60 steps a second.
    ///
    /// # Errors
    /// Of the simulation.
    pub fn new(first: f32, simulation: impl FnOnce(World) -> Result<Simulation>) -> Result<Self> {
        let mut world = weightless();
        let inertia = Vec3::new(1.0, 2.0, 3.0);
        let mass = MassProperties { mass: 1.0, principal_inertia: inertia, ..MassProperties::IMMOVABLE };
        world.add(Body::dynamic().mass_properties(mass).velocity(Vec3::ZERO, Vec3::new(first, 10.0, 0.0)));
        let (energy, momentum) = (world.kinetic_energy(), world.angular_momentum().length());
        let mut simulation = simulation(world)?;
        let mut tumble = Self { flips: Vec::new(), energy: 0.0, momentum: 0.0 };
        let mut before = 10.0;
        for step in 1..=1200 {
            simulation.step(DT)?;
            let world = &simulation.world;
            let body = &world.bodies[0];
            let spin = f64::from((body.rotation.inverse() * body.angular_velocity).y);
            if spin * before < 0.0 {
                // Where the line through both is zero.
                tumble.flips.push((f64::from(step) - spin / (spin - before)) / 60.0);
            }
            before = spin;
            tumble.energy = largest(tumble.energy, [off(world.kinetic_energy(), energy)]);
            tumble.momentum = largest(tumble.momentum, [off(world.angular_momentum().length(), momentum)]);
        }
        Ok(tumble)
    }

    /// Mean time between flips (s); NaN if there were fewer than two.
    pub fn between(&self) -> f64 {
        let [first, .., last] = self.flips[..] else { return f64::NAN };
        (last - first) / (self.flips.len() - 1) as f64
    }
}

/// Time between two flips of that body, 2 K(k) / rate (Landau and Lifshitz, "Mechanics", section 37), with moments
/// i < j < l and 2 E j > L²; the first comes after half of it (s).
pub fn flip_time(first: f64) -> f64 {
    let (i, j, l) = (1.0, 2.0, 3.0);
    let twice_energy = i * first * first + j * 100.0;
    let momentum_squared = (i * first).powi(2) + (j * 10.0).powi(2);
    let rate = ((j - i) * (l * twice_energy - momentum_squared) / (i * j * l)).sqrt();
    let k_squared = (l - j) * (momentum_squared - i * twice_energy) / ((j - i) * (l * twice_energy - momentum_squared));
    // K by the arithmetic-geometric mean.
    let (mut a, mut b) = (1.0, (1.0 - k_squared).sqrt());
    for _ in 0..8 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    PI / a / rate
}

pub(super) fn flip(setup: &Setup) -> Result<Vec<Check>> {
    let slow = Tumble::new(0.01, |world| setup.simulation(world))?;
    let first = slow.flips.first().copied().unwrap_or(f64::NAN);
    let fast = Tumble::new(1.0, |world| setup.simulation(world))?;
    Ok(vec![
        Check::at_most("spin (0.01, 10, 0): first flip, relative error", off(first, 0.5 * flip_time(0.01)), 0.005),
        Check::at_most("spin (0.01, 10, 0): energy in 20 s, relative error", slow.energy, 1e-5),
        Check::at_most(
            "spin (1, 10, 0): time between flips in 20 s, relative error",
            off(fast.between(), flip_time(1.0)),
            0.005,
        ),
        Check::at_most("spin (1, 10, 0): energy in 20 s, relative error", fast.energy, 1e-5),
    ])
}

/// SimBenchmark's rolling test: 25 balls on a plate that is pushed at `angle` degrees from x to z. All move along the push with
/// accelerations known on paper; the error is the mean over 4 s of |dv|² of the plate plus that of the first ball (m²/s²).
///
/// # Errors
/// Of the simulation.
pub fn rolling_error(angle: f32, simulation: impl FnOnce(World) -> Result<Simulation>) -> Result<f64> {
    let scene = Scene::find("rolling", &[format!("angle={angle}")])?;
    let (m, plate, g, mu, balls, push) = (1.0, 10.0, 9.81, 0.4, 25.0, 150.0);
    // A ball that rolls on the plate takes 2/7 of its acceleration.
    let slip = push - mu * (plate + balls * m) * g;
    let a_ball = slip / plate / (3.5 + balls * m / plate);
    let a_plate = 3.5 * a_ball;
    let along = DVec3::new(f64::from(angle).to_radians().cos(), 0.0, f64::from(angle).to_radians().sin());
    let mut simulation = simulation(scene.world)?;
    let mut sum = 0.0;
    for step in 1..=scene.steps {
        simulation.step(scene.dt)?;
        let time = f64::from(step) * f64::from(scene.dt);
        for (body, a) in [(1, a_plate), (2, a_ball)] {
            let v: Vec3 = simulation.world.bodies[body].linear_velocity;
            sum += (v.as_dvec3() - along * a * time).length_squared();
        }
    }
    Ok(sum / f64::from(scene.steps))
}

pub(super) fn rolling(setup: &Setup) -> Result<Vec<Check>> {
    let error = |angle: f32, friction: Friction| {
        let config = setup.config.clone().with(|c| c.friction = friction);
        rolling_error(angle, |world| Simulation::new(world, config, (setup.open)()?))
    };
    let across = error(60.0, Friction::Box)?;
    Ok(vec![
        Check::at_most("disc, 60 degrees: mean squared error [m²/s²]", error(60.0, Friction::Disc)?, 1e-5),
        Check::at_most("disc, 90 degrees: mean squared error [m²/s²]", error(90.0, Friction::Disc)?, 1e-5),
        Check::at_most("box, 90 degrees: mean squared error [m²/s²]", error(90.0, Friction::Box)?, 1e-5),
        // A plate that does not move: the limit of each direction alone is beyond the push.
        Check::at_most(
            "box, 60 degrees: off the error of a plate that stays, 3.145 m²/s²",
            (across - 3.145).abs(),
            0.005,
        ),
    ])
}

/// Three balls on a floor, the top one of 100 times, which is taken off after 2 s.
pub(super) fn release(setup: &Setup) -> Result<Vec<Check>> {
    let mut world = floor(0.5);
    let ball = |y: f32, density: f32| Body::dynamic().shape(Shape::ball(0.5)).density(density).position(0.0, y, 0.0);
    world.add(ball(0.5, 1000.0));
    let second = world.add(ball(1.5, 1000.0));
    let top = world.add(ball(2.5, 1e5));
    let mut simulation = setup.simulation(world)?;
    for _ in 0..120 {
        simulation.step(DT)?;
    }
    simulation.world.bodies[top].position = Vec3::new(50.0, 0.5, 0.0);
    let highest = largest(LEAST, watch(&mut simulation, 120, |w| w.bodies[second].position.y.into())?);
    Ok(vec![Check::at_most("rise of the ball under the load above its place [mm]", 1e3 * (highest - 1.5), 5.0)])
}

//! Motions with a closed form or a conserved quantity.

use std::f64::consts::PI;

use glam::{DVec3, Quat, Vec3};

use super::{Checks, DT, LEAST, Setup, energy, floor, largest_speed, off, watch, weightless};
use drystone::config::Friction;
use drystone::stats::largest;
use drystone::{Body, Joint, MassProperties, Result, Shape, Simulation, World};
use drystone_scenes::Scene;

pub(super) fn heavy_chain(setup: &Setup, checks: &mut Checks) -> Result<()> {
    const LINKS: usize = 100;
    const RADIUS: f32 = 0.5;
    let mut world = World::new();
    let bar = Body::dynamic().shape(Shape::cuboid(0.25, 0.05, 0.05)).density(500.0);
    let mut before = None;
    for k in 0..=LINKS {
        let (half, body) = match k {
            LINKS => (RADIUS, Body::dynamic().shape(Shape::ball(RADIUS)).total_mass(1000.0 * bar.mass.mass)),
            _ => (0.25, bar.clone()),
        };
        let link = world.insert(body.position(0.5 * k as f32 + half, 0.0, 0.0));
        world.insert_joint(match before.replace(link) {
            None => Joint::to_world(link, -half * Vec3::X, Vec3::ZERO),
            Some(before) => Joint::new(before, 0.25 * Vec3::X, link, -half * Vec3::X),
        });
    }
    let before = energy(&world);
    // The largest potential energy that the swing can release.
    let scale: f64 = world.bodies.iter().map(|b| f64::from(b.mass.mass) * 9.81 * f64::from(b.position.x)).sum();
    let mut simulation = setup.simulation(world)?;
    let (mut gap, mut gained) = (0.0, LEAST);
    for _ in 0..600 {
        simulation.step(DT)?;
        gap = largest(gap, [simulation.world.joint_gap().into()]);
        gained = largest(gained, [energy(&simulation.world) - before]);
    }
    checks.at_most("largest gap of a joint over the length of a link", gap / 0.5, 0.01);
    checks.at_most("energy gained over the potential energy of the swing", gained / scale, 1e-3);
    checks.finite("", &simulation.world);
    Ok(())
}

pub(super) fn spinning_rod(setup: &Setup, checks: &mut Checks) -> Result<()> {
    const HALF: f32 = 0.5;
    // The moments of a solid cylinder are r²/2 along and r²/4 + l²/12 across its axis.
    let radius = (4.0 * HALF * HALF / 12.0 / (500.0 - 0.25)).sqrt();
    let rod = Body::dynamic().shape(Shape::cylinder(HALF, radius));
    let mut free = weightless();
    free.insert(rod.clone().velocity(Vec3::ZERO, Vec3::new(1.0, 1000.0, 0.0)));
    let before = free.kinetic_energy();
    let drift = largest(LEAST, watch(&mut setup.simulation(free)?, 600, |w| off(w.kinetic_energy(), before))?);

    let mut lying = floor(0.5);
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    lying.insert(rod.rotation(turn).position(0.0, 2.0 * radius, 0.0).velocity(Vec3::ZERO, 1000.0 * Vec3::X));
    let before = energy(&lying);
    let mut simulation = setup.simulation(lying)?;
    let gained = largest(LEAST, watch(&mut simulation, 600, energy)?) / before - 1.0;
    checks.at_most("free: change of energy in 10 s, relative", drift, 1e-3);
    checks.at_most("on a floor: energy gained, relative", gained, 1e-3);
    checks.finite("on a floor: ", &simulation.world);
    Ok(())
}

/// The motion of a free body with moments 1, 2, 3 kg m² and spin (`first`, 10, 0) rad/s over 20 s.
pub struct Tumble {
    /// Times at which the spin about the middle axis changes sign (s).
    pub flips: Vec<f64>,
    /// Largest relative changes of energy and angular momentum.
    pub energy: f64,
    pub momentum: f64,
}

impl Tumble {
    /// Runs the simulation at 60 steps a second.
    pub fn new(first: f32, simulation: impl FnOnce(World) -> Result<Simulation>) -> Result<Self> {
        let mut world = weightless();
        let inertia = Vec3::new(1.0, 2.0, 3.0);
        let mass = MassProperties { mass: 1.0, principal_inertia: inertia, ..MassProperties::IMMOVABLE };
        world.insert(Body::dynamic().mass_properties(mass).velocity(Vec3::ZERO, Vec3::new(first, 10.0, 0.0)));
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
                // Linear interpolation of the zero.
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

/// Time between two flips of this body (s): 2 K(k) / rate (Landau and Lifshitz, "Mechanics", section 37), with moments
/// i < j < l and 2 E j > L². The first flip comes after half of this time.
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

pub(super) fn flip(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let slow = Tumble::new(0.01, |world| setup.simulation(world))?;
    let first = slow.flips.first().copied().unwrap_or(f64::NAN);
    let fast = Tumble::new(1.0, |world| setup.simulation(world))?;
    checks.at_most("spin (0.01, 10, 0): first flip, relative error", off(first, 0.5 * flip_time(0.01)), 0.005);
    checks.at_most("spin (0.01, 10, 0): energy in 20 s, relative error", slow.energy, 1e-5);
    let between = off(fast.between(), flip_time(1.0));
    checks.at_most("spin (1, 10, 0): time between flips in 20 s, relative error", between, 0.005);
    checks.at_most("spin (1, 10, 0): energy in 20 s, relative error", fast.energy, 1e-5);
    Ok(())
}

/// SimBenchmark's rolling test: a force pushes a plate with 25 balls at `angle` degrees from x to z. The accelerations
/// have a closed form. The error is the mean over 4 s of |dv|² of the plate plus that of the first ball (m²/s²).
pub fn rolling_error(angle: f32, simulation: impl FnOnce(World) -> Result<Simulation>) -> Result<f64> {
    let scene = Scene::find("rolling", &[format!("angle={angle}")])?;
    let (m, plate, g, mu, balls, push) = (1.0, 10.0, 9.81, 0.4, 25.0, 150.0);
    // A rolling ball has 2/7 of the acceleration of the plate.
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

pub(super) fn rolling(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let error = |angle: f32, friction: Friction| {
        let config = setup.config.clone().with(|c| c.friction = friction);
        rolling_error(angle, |world| Simulation::with(world, config, (setup.open)()?))
    };
    let across = error(60.0, Friction::Box)?;
    checks.at_most("disc, 60 degrees: mean squared error [m²/s²]", error(60.0, Friction::Disc)?, 1e-5);
    checks.at_most("disc, 90 degrees: mean squared error [m²/s²]", error(90.0, Friction::Disc)?, 1e-5);
    checks.at_most("box, 90 degrees: mean squared error [m²/s²]", error(90.0, Friction::Box)?, 1e-5);
    // The plate does not move: the friction limit of each direction alone exceeds the push.
    checks.at_most("box, 60 degrees: deviation from a fixed plate's 3.145 m²/s²", (across - 3.145).abs(), 0.005);
    Ok(())
}

/// Three balls on a floor; the top one has 100 times the mass and is removed after 2 s.
pub(super) fn release(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let mut world = floor(0.5);
    let ball = |y: f32, density: f32| Body::dynamic().shape(Shape::ball(0.5)).density(density).position(0.0, y, 0.0);
    world.insert(ball(0.5, 1000.0));
    let second = world.insert(ball(1.5, 1000.0));
    let top = world.insert(ball(2.5, 1e5));
    let mut simulation = setup.simulation(world)?;
    (0..120).try_for_each(|_| simulation.step(DT).map(drop))?;
    simulation.world.bodies[top].position = Vec3::new(50.0, 0.5, 0.0);
    let highest = largest(LEAST, watch(&mut simulation, 120, |w| w.bodies[second].position.y.into())?);
    checks.at_most("rise of the ball under the load [mm]", 1e3 * (highest - 1.5), 5.0);
    Ok(())
}

/// Twenty ragdolls fall on the floor, and nothing drives them.
pub(super) fn ragdolls(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let mut simulation = setup.sleeping(Scene::find("ragdolls", &[])?.world)?;
    let speeds = watch(&mut simulation, 300, largest_speed)?;
    checks.at_most("speed in the fifth second [m/s]", largest(LEAST, speeds[240..].iter().copied()), 0.05);
    let asleep = simulation.world.bodies.handles().filter(|&body| simulation.is_asleep(body)).count();
    checks.at_most("parts awake after 5 s", (simulation.world.dynamic_count() - asleep) as f64, 0.0);
    Ok(())
}

/// The number of bodies that a scene of the catalogue loses in `steps` steps, and the final energy relative to the
/// initial energy.
fn lost(setup: &Setup, spec: &str, steps: usize) -> Result<[f64; 2]> {
    let scene = Scene::find_spec(spec)?;
    let before = energy(&scene.world);
    let mut simulation = setup.simulation(scene.world.clone())?;
    (0..steps).try_for_each(|_| simulation.step(DT).map(drop))?;
    Ok([scene.escaped(&simulation.world) as f64, energy(&simulation.world) / before])
}

/// Bodies that are thinner than their path in a step fall on triangles.
pub(super) fn terrain(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for (spec, name) in [("terrain", "from 5 m"), ("terrain:n=30,height=50", "from 50 m")] {
        checks.at_most(format!("{name}: bodies lost"), lost(setup, spec, 400)?[0], 0.0);
    }
    Ok(())
}

/// Fast bodies hit thin walls and keep their energy.
pub(super) fn bullets(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for speed in [10.0, 100.0, 1000.0] {
        let [lost, energy] = lost(setup, &format!("bullets:speed={speed}"), 120)?;
        checks.at_most(format!("{speed} m/s: balls lost"), lost, 0.0);
        checks.at_most(format!("{speed} m/s: energy at the end, over that of the start"), energy, 1.001);
    }
    Ok(())
}

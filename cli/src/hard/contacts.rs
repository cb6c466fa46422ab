//! Contacts between few bodies: without a defined normal, without inertia, or without a solution.

use glam::{Quat, Vec3};

use super::{Checks, DT, LEAST, Setup, cube, energy, floor, largest_speed, watch, weightless};
use drystone::stats::largest;
use drystone::{Body, MassProperties, Result, Shape, World, metrics};
use drystone_scenes::Scene;

pub(super) fn overlaps(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for share in [0.25, 0.5, 1.0_f32] {
        let mut world = weightless();
        world.insert(cube(0.0, 0.0));
        world.insert(cube(0.0, 1.0 - share));
        let mut simulation = setup.simulation(world)?;
        let speed = largest(LEAST, watch(&mut simulation, 300, largest_speed)?);
        let (percent, limit) = (100.0 * share, f64::from(setup.config.push_limit));
        checks.at_most(format!("{percent:.0} %: largest speed over the push limit"), speed / limit, 1.0);
        let depth = 1e3 * simulation.penetration().max;
        checks.at_most(format!("{percent:.0} %: overlap after 5 s [mm]"), depth, 1.0);
    }
    Ok(())
}

pub(super) fn no_direction(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let ball = |x: f32, y: f32, z: f32| Body::dynamic().shape(Shape::ball(0.5)).position(x, y, z);
    let block = || Body::fixed().shape(Shape::cuboid(0.5, 0.5, 0.5));
    let mut trial = |what: &str, bodies: Vec<Body>, gravity: Vec3| -> Result<()> {
        let mut world = World { gravity, ..World::new() };
        for body in bodies {
            world.insert(body);
        }
        let (before, limit) = (energy(&world), f64::from(setup.config.push_limit));
        let most = f64::from(world.bodies.iter().map(|b| b.mass.mass).sum::<f32>()) * 0.5 * limit * limit;
        let mut simulation = setup.simulation(world)?;
        let gained = largest(LEAST, watch(&mut simulation, 300, energy)?) - before;
        checks.at_most(format!("{what}: energy gained over that at the push limit"), gained / most, 1.0);
        checks.finite(&format!("{what}: "), &simulation.world);
        Ok(())
    };
    let g = World::new().gravity;
    trial("ball on an edge", vec![block(), ball(0.5, 1.0, 0.0)], g)?;
    trial("ball on a corner", vec![block(), ball(0.5, 1.0, 0.5)], g)?;
    trial("middle of a ball on a corner", vec![block(), ball(0.5, 0.5, 0.5)], g)?;
    trial("two balls in one place", vec![ball(0.0, 0.0, 0.0), ball(0.0, 0.0, 0.0)], Vec3::ZERO)?;
    trial("two cubes in one place", vec![cube(0.0, 0.0), cube(0.0, 0.0)], Vec3::ZERO)?;
    Ok(())
}

/// A press overlaps a crate on the floor. Nothing drives the crate, and no number of substeps helps.
pub(super) fn held(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for depth in [0.05, 0.1] {
        let mut simulation = setup.sleeping(Scene::find_spec(&format!("press:depth={depth}"))?.world)?;
        let fastest = largest(LEAST, watch(&mut simulation, 600, largest_speed)?);
        checks.at_most(format!("{depth} m deep: largest speed [m/s]"), fastest, 0.5);
        let bodies = &simulation.world.bodies;
        let crate_ = bodies.handles().find(|&body| bodies[body].name == "crate").expect("a crate");
        let substeps = simulation.substeps_of(crate_) / setup.config.substeps;
        checks.at_most(format!("{depth} m deep: substeps, over those of the settings"), substeps.into(), 1.0);
        let is_awake = !simulation.is_asleep(crate_);
        checks.at_most(format!("{depth} m deep: awake after 10 s"), u8::from(is_awake).into(), 0.0);
    }
    Ok(())
}

/// Wheels overlap the chassis, so joints and contacts push against each other. All energy comes from the motors.
pub(super) fn jammed_car(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let free = Scene::find_spec("car")?.world;
    let (mass, speed) = (free.dynamic().map(|body| f64::from(body.mass.mass)).sum::<f64>(), 5.0);
    for inside in [0.05, 0.1, 0.2] {
        let mut simulation = setup.simulation(Scene::find_spec(&format!("car:inside={inside}"))?.world)?;
        let most = largest(LEAST, watch(&mut simulation, 600, World::kinetic_energy)?);
        checks.at_most(
            format!("{inside} m inside: kinetic energy at any time, over that at the speed of the motors"),
            most / (0.5 * mass * speed * speed),
            1.0,
        );
    }
    Ok(())
}

pub(super) fn nearly_parallel(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let mut rest = |what: String, upper: Body| -> Result<()> {
        let mut world = floor(0.5);
        world.insert(cube(0.0, 0.5));
        world.insert(upper);
        let mut simulation = setup.simulation(world)?;
        (0..540).try_for_each(|_| simulation.step(DT).map(drop))?;
        let fastest = largest(LEAST, watch(&mut simulation, 60, metrics::rms_speed)?);
        checks.at_most(format!("{what}: rms speed, tenth second [mm/s]"), 1e3 * fastest, 1.0);
        Ok(())
    };
    for angle in [1e-7, 1e-6, 1e-5, 1e-4, 1e-3_f32] {
        let turn = Quat::from_rotation_y(angle) * Quat::from_rotation_x(angle);
        rest(format!("turned by {angle:e} rad"), cube(0.0, 1.5).rotation(turn))?;
    }
    // The cube stands on its edge, slightly off balance.
    let on_edge = Quat::from_rotation_z(std::f32::consts::FRAC_PI_4 + 0.01);
    let rocking = Body::dynamic().shape(Shape::cuboid(0.25, 0.25, 0.25)).rotation(on_edge);
    rest("a cube let go on its edge".into(), rocking.position(0.0, 1.0 + 0.25 * 2_f32.sqrt(), 0.0))?;
    Ok(())
}

pub(super) fn no_inertia(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let mut world = floor(0.5);
    let point = MassProperties { mass: 1.0, principal_inertia: Vec3::splat(1e-9), ..MassProperties::IMMOVABLE };
    let lying = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let still = [
        Body::dynamic().shape(Shape::ball(0.1)).mass_properties(point).position(0.0, 0.1, 0.0),
        Body::dynamic().shape(Shape::cuboid(0.1, 0.1, 0.1)).mass_properties(point).position(1.0, 0.1, 0.0),
        Body::dynamic().shape(Shape::cylinder(0.5, 1e-3)).rotation(lying).position(3.0, 1e-3, 0.0),
    ];
    let still = still.map(|body| world.insert(body));
    // Bodies of infinite mass overlap.
    let wall = |body: Body| body.shape(Shape::cuboid(0.5, 0.5, 0.5)).position(6.0, 0.5, 0.0);
    world.insert(wall(Body::fixed()));
    world.insert(wall(Body::kinematic().velocity(0.1 * Vec3::X, Vec3::ZERO)));
    world.insert(wall(Body::kinematic().velocity(-0.1 * Vec3::X, Vec3::ZERO)));
    let before = world.clone();
    let mut simulation = setup.simulation(world)?;
    let speed = largest(LEAST, watch(&mut simulation, 300, largest_speed)?);
    let moved = still.iter().map(|&i| before.bodies[i].position.distance(simulation.world.bodies[i].position).into());
    checks.finite("", &simulation.world);
    checks.at_most("displacement of bodies at rest [mm]", 1e3 * largest(LEAST, moved), 1.0);
    checks.at_most("largest speed [m/s]", speed, 0.1);
    Ok(())
}

/// Painlevé's paradox: the tip of an inclined rod slides at 5 m/s. If mu > 4/3, at some angles friction presses the tip
/// into the floor faster than any normal force can lift it.
pub(super) fn painleve(setup: &Setup, checks: &mut Checks) -> Result<()> {
    for (mu, degrees, way) in
        [(1.5, 60.0, -1.0), (2.0, 60.0, -1.0), (2.0, 60.0, 1.0), (3.0, 45.0, -1.0), (3.0, 45.0, 1.0_f32)]
    {
        let mut world = floor(mu);
        let turn = Quat::from_rotation_z((degrees as f32 - 90.0).to_radians());
        let rod = Body::dynamic().shape(Shape::capsule(1.0, 0.01)).friction(mu).rotation(turn);
        // The lower end touches the floor; the rod leans to -x from there.
        let y = (degrees as f32).to_radians().sin() + 0.01;
        world.insert(rod.position(0.0, y, 0.0).velocity(5.0 * way * Vec3::X, Vec3::ZERO));
        let before = energy(&world);
        let mut simulation = setup.simulation(world)?;
        let all = [vec![before], watch(&mut simulation, 300, energy)?].concat();
        let grown = all.windows(2).map(|pair| pair[1] - pair[0]);
        let to = if way > 0.0 { "its middle" } else { "the outside" };
        let what = format!("mu {mu}, {degrees} degrees, tip to {to}");
        checks.at_most(format!("{what}: relative energy gain in a step"), largest(LEAST, grown) / before, 1e-3);
        checks.finite(&format!("{what}: "), &simulation.world);
    }
    Ok(())
}

//! Where single precision ends, and what is no input.

use glam::{Quat, Vec3};

use super::{Checks, DT, Setup, cube, floor};
use drystone::Result;
use drystone::scenes::Scene;
use drystone::stats::largest;
use drystone::world::{Body, World};

pub(super) fn far_and_bad(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let at_origin = settled(setup, 0.0)?;
    for (km, most) in [(10.0, 2.0), (100.0, 20.0_f32)] {
        let far = settled(setup, 1e3 * km)?;
        let off = |(near, far): (&Body, &Body)| {
            f64::from((far.position - near.position - 1e3 * km * Vec3::X).abs().max_element())
        };
        let worst = at_origin.bodies.iter().zip(&far.bodies).map(off);
        // Twice the distance between neighboring numbers there.
        checks.at_most(
            format!("{km} km from the origin: a tower of 5, off the one at the origin [mm]"),
            1e3 * largest(0.0, worst),
            most.into(),
        );
        checks.finite(&format!("{km} km from the origin: "), &far);
    }
    let taken = bad_bodies().into_iter().filter(|(_, body)| is_taken(setup, body.clone())).count();
    checks.at_most(format!("of {} bodies that are no input: taken", bad_bodies().len()), taken as f64, 0.0);
    let mut world = floor(0.5);
    let tiny = f32::MIN_POSITIVE / 8.0;
    world.add(cube(0.0, 0.5).velocity(Vec3::splat(tiny), Vec3::splat(tiny)).position(tiny, 0.5, tiny));
    let mut simulation = setup.simulation(world)?;
    (0..60).try_for_each(|_| simulation.step(DT).map(drop))?;
    checks.finite("numbers next to zero: ", &simulation.world);
    Ok(())
}

/// A tower of five, `x` from the origin, after 5 s.
fn settled(setup: &Setup, x: f32) -> Result<World> {
    let mut world = Scene::find("tower", &["n=5".into()])?.world;
    world.bodies.iter_mut().for_each(|b| b.position.x += x);
    let mut simulation = setup.simulation(world)?;
    (0..300).try_for_each(|_| simulation.step(DT).map(drop))?;
    Ok(simulation.world)
}

/// Bodies of which one number is none, or none that a body can have.
fn bad_bodies() -> Vec<(&'static str, Body)> {
    let mut bad = Vec::new();
    for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let with = |change: fn(&mut Body, f32)| {
            let mut body = cube(0.0, 0.5);
            change(&mut body, number);
            body
        };
        bad.push(("position", with(|b, x| b.position.y = x)));
        bad.push(("rotation", with(|b, x| b.rotation = Quat::from_xyzw(x, 0.0, 0.0, 1.0))));
        bad.push(("linear velocity", with(|b, x| b.linear_velocity.x = x)));
        bad.push(("angular velocity", with(|b, x| b.angular_velocity.z = x)));
        bad.push(("force", with(|b, x| b.force.x = x)));
        bad.push(("mass", with(|b, x| b.mass.mass = x)));
        bad.push(("inertia", with(|b, x| b.mass.principal_inertia.x = x)));
        bad.push(("friction", with(|b, x| b.material.friction = x)));
        bad.push(("restitution", with(|b, x| b.material.restitution = x)));
    }
    let mut negative = cube(0.0, 0.5);
    negative.mass.mass = -1.0;
    bad.push(("mass", negative));
    bad.push(("friction", cube(0.0, 0.5).friction(-0.1)));
    bad
}

/// Whether a simulation takes a body, or refuses it without its name.
fn is_taken(setup: &Setup, body: Body) -> bool {
    let mut world = floor(0.5);
    world.add(body.named("culprit"));
    setup.simulation(world).map_or_else(|e| !e.to_string().contains("culprit"), |_| true)
}

//! Positions at the limit of single precision, and invalid input.

use glam::{Quat, Vec3};

use super::{Checks, DT, Setup, cube, floor};
use drystone::stats::largest;
use drystone::{Body, Result, World};
use drystone_scenes::Scene;

pub(super) fn far_and_bad(setup: &Setup, checks: &mut Checks) -> Result<()> {
    let at_origin = settled(setup, 0.0)?;
    for (km, most) in [(10.0, 2.0), (100.0, 20.0_f32)] {
        let far = settled(setup, 1e3 * km)?;
        let off = |(near, far): (&Body, &Body)| {
            f64::from((far.position - near.position - 1e3 * km * Vec3::X).abs().max_element())
        };
        let worst = at_origin.bodies.iter().zip(&far.bodies).map(off);
        // The limit is twice the spacing of floats at that distance.
        let what = format!("{km} km from the origin: difference from a tower of 5 at the origin [mm]");
        checks.at_most(what, 1e3 * largest(0.0, worst), most.into());
        checks.finite(&format!("{km} km from the origin: "), &far);
    }
    let bad = bad_bodies();
    // A refusal must have the name of the body.
    let is_taken = |body: &&Body| {
        let mut world = floor(0.5);
        world.insert((*body).clone().named("culprit"));
        setup.simulation(world).map_or_else(|e| !e.to_string().contains("culprit"), |_| true)
    };
    let taken = bad.iter().filter(is_taken).count();
    checks.at_most(format!("invalid bodies accepted, of {}", bad.len()), taken as f64, 0.0);
    let mut world = floor(0.5);
    let tiny = f32::MIN_POSITIVE / 8.0;
    world.insert(cube(0.0, 0.5).velocity(Vec3::splat(tiny), Vec3::splat(tiny)).position(tiny, 0.5, tiny));
    let mut simulation = setup.simulation(world)?;
    (0..60).try_for_each(|_| simulation.step(DT).map(drop))?;
    checks.finite("subnormal numbers: ", &simulation.world);
    Ok(())
}

/// A tower of five, `x` from the origin, after 5 s.
fn settled(setup: &Setup, x: f32) -> Result<World> {
    let mut world = Scene::find_spec("tower:n=5")?.world;
    world.bodies.iter_mut().for_each(|b| b.position.x += x);
    let mut simulation = setup.simulation(world)?;
    (0..300).try_for_each(|_| simulation.step(DT).map(drop))?;
    Ok(simulation.world)
}

fn bad_bodies() -> Vec<Body> {
    let set: [fn(&mut Body, f32); 9] = [
        |b, x| b.mass.mass = x,
        |b, x| b.material.friction = x,
        |b, x| b.position.y = x,
        |b, x| b.rotation = Quat::from_xyzw(x, 0.0, 0.0, 1.0),
        |b, x| b.linear_velocity.x = x,
        |b, x| b.angular_velocity.z = x,
        |b, x| b.force.x = x,
        |b, x| b.mass.principal_inertia.x = x,
        |b, x| b.material.restitution = x,
    ];
    let with = |(set, number): (fn(&mut Body, f32), f32)| {
        let mut body = cube(0.0, 0.5);
        set(&mut body, number);
        body
    };
    let not_finite = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().flat_map(|x| set.map(|set| (set, x)));
    not_finite.chain([(set[0], -1.0), (set[1], -0.1)]).map(with).collect()
}

//! Asks a world where its bodies are: heights by rays, the way of a walker, the bodies near a blast.
//!
//!     cargo run --release --example queries

use drystone::glam::{Quat, Vec3};
use drystone::queries::Filter;
use drystone::{Body, BodyKind, Result, Shape, Simulation, World};

fn main() -> Result<()> {
    run(|line| println!("{line}"))
}

pub fn run(mut print: impl FnMut(String)) -> Result<()> {
    let mut world = World::new();
    let floor = world.insert(Body::fixed().shape(Shape::half_space(Vec3::Y)).named("floor"));
    for (i, (half, y)) in [(0.6, 0.6), (0.5, 1.7), (0.4, 2.6)].into_iter().enumerate() {
        let box_of_wood = Body::dynamic().shape(Shape::cuboid(half, half, half)).named(format!("crate {i}"));
        world.insert(box_of_wood.position(2.0, y, 0.0));
    }
    world.insert(Body::dynamic().shape(Shape::ball(0.4)).position(-2.0, 0.4, 0.0).named("ball"));
    let mut simulation = Simulation::new(world)?;
    for _ in 0..60 {
        simulation.step(1.0 / 60.0)?;
    }

    // One look at all bodies serves many questions.
    let queries = simulation.queries();
    let all = Filter::default();
    let name = |index: usize| &simulation.world.bodies[index].name;
    for x in [-2.0, 0.0, 2.0] {
        if let Some(hit) = queries.ray(Vec3::new(x, 100.0, 0.0), Vec3::NEG_Y, 200.0, &all) {
            print(format!("{x} m: {:.2} m high, {}", hit.point.y, name(hit.body.index())));
        }
    }
    // A walker of 1.8 m stands on the floor, which does not stop it.
    let walker = Shape::capsule(0.6, 0.3);
    if let Some(hit) = queries.cast(&walker, 0.9 * Vec3::Y, Quat::IDENTITY, Vec3::X, 10.0, &all.except(floor)) {
        print(format!("the walker gets {:.2} m far, to {}", hit.distance, name(hit.body.index())));
    }
    if let Some(hit) = queries.closest(Vec3::new(-1.0, 0.4, 0.0), 1.0, &all.except(floor)) {
        print(format!("{:.2} m to {}", hit.distance, name(hit.body.index())));
    }
    let blast = Vec3::new(1.0, 0.2, 0.0);
    let is_dynamic = |_, body: &Body| body.kind == BodyKind::Dynamic;
    let near = queries.intersecting(&Shape::ball(2.0), blast, Quat::IDENTITY, &all.only(&is_dynamic));

    // The answers stay when the world changes again.
    for (handle, _) in near {
        let Some(body) = simulation.world.body_mut(handle) else { continue };
        let away = body.position - blast;
        body.linear_velocity += 10.0 * away / away.length_squared().max(0.1);
        print(format!("the blast pushes {} at {:.1} m/s", body.name, body.linear_velocity.length()));
    }
    simulation.step(1.0 / 60.0)?;
    Ok(())
}

//! Boxes fall on a floor, without a window: prints where they are, and the hash of all bits.
//!
//!     cargo run --release -p bevy_drystone --example falling_boxes

use std::time::Duration;

use bevy_app::prelude::*;
use bevy_drystone::prelude::*;
use bevy_ecs::prelude::*;
use bevy_math::Vec3;
use bevy_time::{TimePlugin, TimeUpdateStrategy};
use bevy_transform::prelude::*;

fn spawn(mut commands: Commands) {
    commands.spawn((RigidBody::Static, Collider::from(Shape::half_space(Vec3::Y)), Name::new("floor")));
    for i in 0..5 {
        commands.spawn((
            RigidBody::Dynamic,
            Collider::from(Shape::cuboid(0.5, 0.5, 0.5)),
            Transform::from_xyz(0.3 * i as f32, 1.0 + 1.2 * i as f32, 0.0),
            Name::new(format!("box {i}")),
        ));
    }
}

/// What happened.
#[derive(Resource, Default)]
pub struct Lines(Vec<String>);

fn report(mut hits: MessageReader<CollisionHit>, names: Query<&Name>, mut lines: ResMut<Lines>) {
    for hit in hits.read() {
        let [a, b] = [hit.entity, hit.other].map(|entity| names.get(entity).map_or("?", Name::as_str));
        lines.0.push(format!("{b} hits {a} with {:.1} m/s", hit.speed));
    }
}

/// Runs three seconds at a number of frames a second.
pub fn run(rate: u32) -> Vec<String> {
    let mut app = App::new();
    app.add_plugins((TimePlugin, TransformPlugin, DrystonePlugin));
    app.init_resource::<Lines>().add_systems(Startup, spawn).add_systems(FixedLast, report);
    let listen = Listen { hits_above: Some(2.0), ..Listen::default() };
    app.world_mut().resource_mut::<Physics>().simulation.listen(listen).expect("2 m/s is a speed");
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs(1) / rate));
    for second in 1..=3 {
        (0..rate).for_each(|_| app.update());
        let mut lines = std::mem::take(&mut app.world_mut().resource_mut::<Lines>().0);
        let mut boxes = app.world_mut().query_filtered::<(&Name, &Transform, Has<Sleeping>), With<Collider>>();
        for (name, at, sleeps) in boxes.iter(app.world()) {
            let sleeps = if sleeps { ", asleep" } else { "" };
            lines.push(format!("{second} s: {name} at {:.2}{sleeps}", at.translation));
        }
        app.world_mut().resource_mut::<Lines>().0 = lines;
    }
    let hash = app.world().resource::<Physics>().simulation.hash();
    let mut lines = std::mem::take(&mut app.world_mut().resource_mut::<Lines>().0);
    lines.push(format!("hash {hash:016x}"));
    lines
}

pub fn main() {
    run(60).iter().for_each(|line| println!("{line}"));
}

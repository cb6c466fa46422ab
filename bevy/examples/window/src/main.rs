//! A pile of boxes in a window. Space throws a ball, Backspace goes two seconds back, G shows what physics computes.
//!
//!     cargo run --manifest-path bevy/examples/window/Cargo.toml

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_drystone::prelude::*;
use bevy_drystone::{PhysicsGizmos, PhysicsGizmosPlugin, PhysicsSnapshot};

/// The states of the last two seconds.
#[derive(Resource, Default)]
struct Past(VecDeque<PhysicsSnapshot>);

const STEPS_BACK: usize = 128;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, DrystonePlugin, PhysicsGizmosPlugin))
        .init_resource::<Past>()
        .add_systems(Startup, set_up)
        .add_systems(FixedPostUpdate, keep.after(PhysicsSystems::Write))
        .add_systems(Update, (throw, go_back, toggle_gizmos))
        .run();
}

fn set_up(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut gizmos: ResMut<GizmoConfigStore>,
) {
    gizmos.config_mut::<PhysicsGizmos>().0.enabled = false;
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 6.0, 16.0).looking_at(Vec3::Y * 3.0, Vec3::Y)));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(4.0, 8.0, 6.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((
        RigidBody::Static,
        Collider::from(Shape::half_space(Vec3::Y)),
        Mesh3d(meshes.add(Plane3d::default().mesh().size(40.0, 40.0))),
        MeshMaterial3d(materials.add(Color::srgb(0.4, 0.45, 0.4))),
    ));
    let (mesh, material) = (meshes.add(Cuboid::new(1.0, 1.0, 1.0)), materials.add(Color::srgb(0.8, 0.6, 0.3)));
    for row in 0..8 {
        for k in 0..(8 - row) {
            let x = k as f32 * 1.1 + row as f32 * 0.55 - 4.0;
            commands.spawn((
                RigidBody::Dynamic,
                Collider::from(Shape::cuboid(0.5, 0.5, 0.5)),
                TransformInterpolation,
                Transform::from_xyz(x, 0.5 + row as f32, 0.0),
                Mesh3d(mesh.clone()),
                MeshMaterial3d(material.clone()),
            ));
        }
    }
}

fn throw(
    keys: Res<ButtonInput<KeyCode>>,
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    if keys.just_pressed(KeyCode::Space) {
        commands.spawn((
            RigidBody::Dynamic,
            Collider::from(Shape::ball(0.4)),
            Mass(800.0),
            LinearVelocity(Vec3::new(0.0, 3.0, -20.0)),
            TransformInterpolation,
            Transform::from_xyz(0.0, 3.0, 12.0),
            Mesh3d(meshes.add(Sphere::new(0.4))),
            MeshMaterial3d(materials.add(Color::srgb(0.3, 0.4, 0.8))),
        ));
    }
}

fn keep(physics: Res<Physics>, mut past: ResMut<Past>) {
    if past.0.len() < STEPS_BACK {
        past.0.push_back(physics.snapshot());
    } else if let Some(mut oldest) = past.0.pop_front() {
        physics.snapshot_into(&mut oldest);
        past.0.push_back(oldest);
    }
}

/// Balls that were thrown since then stay, and fall anew.
fn go_back(world: &mut World) {
    if world.resource::<ButtonInput<KeyCode>>().just_pressed(KeyCode::Backspace) {
        let past = world.resource_mut::<Past>().0.drain(..).next();
        past.iter().for_each(|state| Physics::restore(world, state));
    }
}

fn toggle_gizmos(keys: Res<ButtonInput<KeyCode>>, mut gizmos: ResMut<GizmoConfigStore>) {
    if keys.just_pressed(KeyCode::KeyG) {
        gizmos.config_mut::<PhysicsGizmos>().0.enabled ^= true;
    }
}

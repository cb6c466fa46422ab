//! Shapes, contacts and joints as gizmos of Bevy.

use bevy_app::prelude::*;
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_gizmos::prelude::*;
use bevy_reflect::Reflect;

use crate::debug::{DebugLine, debug_lines};
use crate::physics::Physics;

/// The gizmos of physics, for Bevy's `GizmoConfigStore`: whether they are drawn, and how wide.
#[derive(Default, Reflect, GizmoConfigGroup)]
pub struct PhysicsGizmos;

/// Draws [`debug_lines`] in each frame. It needs Bevy's `GizmoPlugin`, which is among the default plugins.
///
/// ```
/// use bevy_app::App;
/// use bevy_drystone::{DrystonePlugin, PhysicsGizmos, PhysicsGizmosPlugin};
/// use bevy_gizmos::config::GizmoConfigStore;
///
/// let mut app = App::new();
/// app.add_plugins((DrystonePlugin, PhysicsGizmosPlugin));
/// // Hidden until a key shows them.
/// app.world_mut().resource_mut::<GizmoConfigStore>().config_mut::<PhysicsGizmos>().0.enabled = false;
/// ```
pub struct PhysicsGizmosPlugin;

impl Plugin for PhysicsGizmosPlugin {
    fn build(&self, app: &mut App) {
        app.init_gizmo_group::<PhysicsGizmos>().add_systems(PostUpdate, draw);
    }
}

fn draw(physics: Option<Res<Physics>>, store: Res<GizmoConfigStore>, mut gizmos: Gizmos<PhysicsGizmos>) {
    let is_shown = store.config::<PhysicsGizmos>().0.enabled;
    for (kind, [from, to]) in physics.iter().filter(|_| is_shown).flat_map(|physics| debug_lines(physics)) {
        let color = match kind {
            DebugLine::Shape => Color::srgb(0.9, 0.6, 0.2),
            DebugLine::Sensor => Color::srgb(0.3, 0.8, 0.4),
            DebugLine::Sleeping => Color::srgb(0.5, 0.5, 0.6),
            DebugLine::Contact => Color::srgb(0.9, 0.2, 0.2),
            DebugLine::Joint => Color::srgb(0.3, 0.5, 1.0),
        };
        gizmos.line(from, to, color);
    }
}

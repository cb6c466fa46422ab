//! Bodies between their last two poses, for frames between steps.

use bevy_ecs::prelude::*;
use bevy_time::{Fixed, Time};
use bevy_transform::components::Transform;

use crate::components::TransformInterpolation;
use crate::physics::{Motion, Physics, Row};

/// Whether the program left a transform as the plugin set it.
fn is_as_shown(transform: &Transform, row: &Row) -> bool {
    (transform.translation, transform.rotation) == (row.shown.position, row.shown.rotation)
}

fn show_at(transform: &mut Transform, row: &mut Row, pose: &Motion) {
    (transform.translation, transform.rotation) = (pose.position, pose.rotation);
    (row.shown.position, row.shown.rotation) = (pose.position, pose.rotation);
}

/// Shows bodies between their last two poses.
pub(crate) fn show(
    mut physics: ResMut<Physics>,
    time: Res<Time<Fixed>>,
    mut bodies: Query<&mut Transform, With<TransformInterpolation>>,
) {
    if bodies.is_empty() {
        return;
    }
    let part = time.overstep_fraction();
    let Physics { simulation, tables, .. } = &mut *physics;
    for row in tables.rows.iter_mut().flatten() {
        let now = Motion::of(&simulation.world.bodies[row.handle.index()]);
        // Bodies at rest, whose transforms stay unchanged.
        let rests = (row.before.position, row.before.rotation) == (now.position, now.rotation);
        let Ok(mut transform) = bodies.get_mut(row.entity) else { continue };
        if rests || !is_as_shown(&transform, row) {
            continue;
        }
        let position = row.before.position.lerp(now.position, part);
        let rotation = row.before.rotation.slerp(now.rotation, part);
        show_at(&mut transform, row, &Motion { position, rotation, ..now });
    }
}

/// Sets bodies back to their exact poses before the systems of a fixed step.
pub(crate) fn undo(mut physics: ResMut<Physics>, mut bodies: Query<&mut Transform>) {
    let Physics { simulation, tables, .. } = &mut *physics;
    for row in tables.rows.iter_mut().flatten() {
        let now = Motion::of(&simulation.world.bodies[row.handle.index()]);
        if (row.shown.position, row.shown.rotation) == (now.position, now.rotation) {
            continue;
        }
        let Ok(mut transform) = bodies.get_mut(row.entity) else { continue };
        if is_as_shown(&transform, row) {
            show_at(&mut transform, row, &now);
        }
    }
}

//! Counts bodies that come and go during a run, and the visits of sensors.

use serde::Serialize;

use super::RunReport;
use drystone::{BodyHandle, ColliderOf, Event, Simulation, World};
use drystone_scenes::Spawners;

/// Numbers of bodies that entered and left a sensor, and that are inside.
#[derive(Clone, Debug, Serialize)]
pub struct SensorCount {
    /// Name of the body with the sensor, or its index if it has none.
    pub sensor: String,
    pub entered: u64,
    pub left: u64,
    pub inside: usize,
    #[serde(skip)]
    of: ColliderOf,
}

/// The sensors of a world, before any count.
pub(super) fn of(world: &World) -> Vec<SensorCount> {
    let colliders = |body: BodyHandle| {
        (0..world.bodies[body.index()].colliders.len()).map(move |collider| ColliderOf { body, collider })
    };
    world.bodies.handles().flat_map(colliders).filter_map(|of| SensorCount::new(world, of)).collect()
}

impl SensorCount {
    /// `None` if the collider is gone or is not a sensor.
    fn new(world: &World, of: ColliderOf) -> Option<Self> {
        let body = world.body(of.body)?;
        let is_sensor = body.colliders.get(of.collider)?.sensor;
        let sensor = if body.name.is_empty() { format!("body {}", of.body.index()) } else { body.name.clone() };
        is_sensor.then_some(Self { sensor, entered: 0, left: 0, inside: 0, of })
    }
}

impl RunReport {
    /// Records the bodies that came and left, and the sensor events of the last step.
    pub fn count(&mut self, simulation: &Simulation, spawners: &Spawners) {
        let (came, left) = (spawners.came(), spawners.left());
        if (came, left) != (self.came.unwrap_or(0), self.left.unwrap_or(0)) {
            (self.came, self.left) = (Some(came), Some(left));
            self.bodies_now = simulation.world.dynamic_count();
        }
        for event in simulation.events() {
            let (of, entered) = match *event {
                Event::Entered { sensor, .. } => (sensor, true),
                Event::Left { sensor, .. } => (sensor, false),
                _ => continue,
            };
            let known = self.sensors.iter().position(|count| count.of == of);
            let Some(at) = known.or_else(|| {
                self.sensors.push(SensorCount::new(&simulation.world, of)?);
                Some(self.sensors.len() - 1)
            }) else {
                continue;
            };
            let count = &mut self.sensors[at];
            if entered {
                (count.entered, count.inside) = (count.entered + 1, count.inside + 1);
            } else {
                (count.left, count.inside) = (count.left + 1, count.inside.saturating_sub(1));
            }
        }
    }
}

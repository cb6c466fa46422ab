//! A scene without pictures and recording, for measurements: of a device by the page, of engines by web/measure.

use drystone::metrics::Penetration;
use drystone::{Cpu, Error, Result, Simulation};
use drystone_scenes::{Scene, SceneFile};
use glam::{Quat, Vec3};
use wasm_bindgen::prelude::*;

use crate::{choice, thrown};

/// Numbers of a pose: position (m) and rotation.
const POSE: usize = 7;

/// A scene file that runs without pictures and recording.
#[wasm_bindgen]
pub struct Bare {
    simulation: Simulation,
    dt: f32,
}

impl Bare {
    fn of(text: &str, settings: &str) -> Result<Self> {
        let Scene { world, dt, .. } = SceneFile::parse(text)?.into_scene("scene")?;
        Ok(Self { simulation: Simulation::with(world, choice::config(settings)?, Box::new(Cpu::new()))?, dt })
    }

    fn overlap(&self, poses: &[f32]) -> Result<Penetration> {
        let mut world = self.simulation.world.clone();
        let (poses, rest) = poses.as_chunks::<POSE>();
        if poses.len() != world.bodies.len() || !rest.is_empty() {
            return Err(Error::input(format!("{} poses for {} bodies", poses.len(), world.bodies.len())));
        }
        for (i, &[x, y, z, a, b, c, d]) in poses.iter().enumerate() {
            (world.bodies[i].position, world.bodies[i].rotation) = (Vec3::new(x, y, z), Quat::from_xyzw(a, b, c, d));
        }
        Ok(Penetration::of_world(&world, self.simulation.config()))
    }
}

#[wasm_bindgen]
impl Bare {
    /// The scene file of a pile with `boxes` boxes.
    pub fn pile(boxes: u32) -> std::result::Result<String, JsError> {
        let scene = choice::scene("pile", &[format!("n={boxes}")]);
        thrown(scene.and_then(|scene| SceneFile::of(&scene)).map(|file| file.to_text()))
    }

    /// The scene of a file; `settings` is a JSON object.
    #[wasm_bindgen(constructor)]
    pub fn new(text: &str, settings: &str) -> std::result::Result<Bare, JsError> {
        thrown(Self::of(text, settings))
    }

    /// Chooses the backend of the sweeps: `cpu`, `webgpu` or `webgpu-exact`.
    pub async fn use_backend(&mut self, name: String) -> std::result::Result<(), JsError> {
        self.simulation.set_backend(thrown(choice::backend(&name).await)?);
        Ok(())
    }

    /// Makes `count` steps.
    pub async fn steps(&mut self, count: u32) -> std::result::Result<(), JsError> {
        for _ in 0..count {
            thrown(self.simulation.step_async(self.dt).await)?;
        }
        Ok(())
    }

    /// Position (m) and rotation of each body.
    pub fn poses(&self) -> Vec<f32> {
        let pose =
            |b: &drystone::Body| b.position.to_array().into_iter().chain(b.rotation.to_array()).collect::<Vec<_>>();
        self.simulation.world.bodies.iter().flat_map(pose).collect()
    }

    /// Mean and deepest overlap (m) of the bodies at these poses.
    pub fn overlap_of(&self, poses: &[f32]) -> std::result::Result<Vec<f64>, JsError> {
        thrown(self.overlap(poses).map(|depth| vec![depth.mean, depth.max]))
    }
}

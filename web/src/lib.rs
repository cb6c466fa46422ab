//! The functions of the page that its JavaScript calls.

mod choice;
mod conform;
mod describe;
mod maze;
mod measure;
#[cfg(target_family = "wasm")]
mod picture;
mod show;

use std::sync::atomic::{AtomicU32, Ordering};

use drystone::{Result, Simulation};
use drystone_scenes::Spawners;
use wasm_bindgen::prelude::*;

/// A number that is unique in the page.
fn next_number() -> u32 {
    static LAST: AtomicU32 = AtomicU32::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}

/// Makes a panic print its message on the browser's console. WebAssembly stops there.
#[cfg(target_family = "wasm")]
#[wasm_bindgen(start)]
pub fn start() {
    #[wasm_bindgen]
    extern "C" {
        #[wasm_bindgen(js_namespace = console)]
        fn error(line: &str);
    }
    std::panic::set_hook(Box::new(|info| error(&info.to_string())));
}

/// Converts an error to a JavaScript exception with its line.
fn thrown<T>(result: Result<T>) -> std::result::Result<T, JsError> {
    result.map_err(|error| JsError::new(&error.to_string()))
}

/// The scenes of the catalogue as JSON.
#[wasm_bindgen]
pub fn catalogue() -> String {
    describe::catalogue().to_string()
}

/// The presets and settings as JSON.
#[wasm_bindgen]
pub fn settings() -> String {
    describe::settings().to_string()
}

/// The hash of all poses and velocities after some steps of a scene on the CPU. `drystone run SCENE --json` prints the
/// same hash.
#[wasm_bindgen]
pub fn hash_after(scene: &str, parameters: Vec<String>, steps: u32) -> std::result::Result<String, JsError> {
    thrown(hash_of(scene, &parameters, steps))
}

fn hash_of(scene: &str, parameters: &[String], steps: u32) -> Result<String> {
    let scene = choice::scene(scene, parameters)?;
    let mut spawners = Spawners::new(&scene);
    let mut simulation = Simulation::new(scene.world)?;
    for _ in 0..steps {
        spawners.before_step(&mut simulation.world, scene.dt);
        simulation.step(scene.dt)?;
    }
    Ok(format!("{:016x}", simulation.hash()))
}

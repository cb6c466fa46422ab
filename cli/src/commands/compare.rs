//! `drystone compare`.

use clap::Args;

use super::output::{print, print_json};
use super::progress::Progress;
use super::scene::SceneArgs;
use super::words;
use drystone::backend::gpu::adapters;
use drystone::backend::{BackendChoice, choose};
use drystone::stages::compare::{Difference, compare};
use drystone::{Error, Result};

/// Arguments of `drystone compare`.
#[derive(Args)]
pub struct CompareArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// The two backends, the one to trust first.
    #[arg(long, value_parser = words::backend(), value_delimiter = ',', num_args = 1.., default_values = ["reference", "gpu"])]
    backends: Vec<BackendChoice>,
    /// Exact shaders: on where the adapter can, unless --plain.
    #[arg(long, conflicts_with = "plain")]
    exact: bool,
    /// Plain WGSL, as in a browser.
    #[arg(long)]
    plain: bool,
}

impl CompareArgs {
    /// Runs both and prints how far apart they are.
    pub fn run(&self) -> Result<()> {
        let &[a, b] = &self.backends[..] else {
            return Err(Error::input(format!("--backends: two are compared, {} were given", self.backends.len())));
        };
        let (scene, config) = self.scene.load_awake()?;
        self.scene.set_threads(BackendChoice::Auto);
        let exact = self.exact || (!self.plain && adapters().first().is_some_and(|a| a.exact));
        let bodies = scene.world.dynamic_count();
        let mut named = [String::new(), String::new()];
        let mut open = |which: usize| {
            let (backend, _) = choose([a, b][which], bodies, exact)?;
            named[which] = format!("{} ({})", backend.name(), backend.adapter());
            Ok(backend)
        };
        let bar = Progress::steps(scene.steps, self.scene.json);
        let found = compare(&scene, &config, &mut open, scene.steps, || bar.inc())?;
        bar.finish();
        if self.scene.json {
            return print_json(&serde_json::json!({
                "scene": scene.name, "backends": named, "exact": exact, "bodies": bodies, "dt": scene.dt,
                "config": config, "steps": found.steps, "first": found.first,
            }));
        }
        print(format_args!("{} against {}, {bodies} dynamic bodies", named[1], named[0]))?;
        print("  step   differ   position m     rotation        v m/s      w rad/s")?;
        for (step, d) in (1..).zip(&found.steps) {
            // Every step at first, then the round ones and the last.
            if step <= 4 || step % (scene.steps / 10).max(1) == 0 || step == scene.steps {
                print_step(step, d)?;
            }
        }
        match found.first {
            Some(first) => print(format_args!("first difference: {first}")),
            None => print("no difference in any bit"),
        }
    }
}

fn print_step(step: u32, d: &Difference) -> Result<()> {
    print(format_args!(
        "{step:>6} {:>8} {:>12.3e} {:>12.3e} {:>12.3e} {:>12.3e}",
        d.bodies, d.position, d.rotation, d.velocity, d.angular_velocity
    ))
}

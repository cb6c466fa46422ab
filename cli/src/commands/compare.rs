//! `drystone compare`.

use clap::Args;

use super::output::{print, print_json};
use super::progress::Progress;
use super::scene::{SceneArgs, WorldsArgs};
use super::words;
use crate::adapter;
use drystone::backend::{BackendChoice, choose};
use drystone::{Error, Result};
use drystone_conform::compare::compare;

#[derive(Args)]
pub struct CompareArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    worlds: WorldsArgs,
    /// The two backends; the first is the reference.
    #[arg(long, value_parser = words::of::<BackendChoice>(), value_delimiter = ',', num_args = 1.., default_values = ["reference", "gpu"])]
    backends: Vec<BackendChoice>,
    /// Use exact shaders even if the adapter does not accept SPIR-V.
    #[arg(long, conflicts_with = "plain")]
    exact: bool,
    /// Use plain WGSL, as in a browser.
    #[arg(long)]
    plain: bool,
}

impl CompareArgs {
    pub fn run(&self) -> Result<()> {
        let &[a, b] = &self.backends[..] else {
            return Err(Error::input(format!("--backends: give two backends, not {}", self.backends.len())));
        };
        let (scene, config) = self.scene.load_awake(&self.worlds)?;
        self.scene.set_threads(BackendChoice::Auto);
        let exact = self.exact || (!self.plain && adapter::best().is_some_and(|a| a.takes_spirv));
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
                "scene": scene.name, "backends": named, "exact": exact, "worlds": self.worlds.worlds, "bodies": bodies, "dt": scene.dt,
                "config": config, "steps": found.steps, "first": found.first, "differing_steps": found.differing_steps(),
            }));
        }
        let worlds = if self.worlds.worlds == 1 { String::new() } else { format!(" in {} worlds", self.worlds.worlds) };
        print(format_args!("{} against {}, {bodies} dynamic bodies{worlds}", named[1], named[0]))?;
        print("  step   differ   position m     rotation        v m/s      w rad/s")?;
        for (step, d) in (1..).zip(&found.steps) {
            // The first four steps, the first that differs, every tenth part of the run, and the last step.
            let is_first = found.first.as_ref().is_some_and(|first| first.step == step);
            if is_first || step <= 4 || step % (scene.steps / 10).max(1) == 0 || step == scene.steps {
                print(format_args!(
                    "{step:>6} {:>8} {:>12.3e} {:>12.3e} {:>12.3e} {:>12.3e}",
                    d.bodies, d.position, d.rotation, d.velocity, d.angular_velocity
                ))?;
            }
        }
        match &found.first {
            Some(first) => {
                print(format_args!("first difference: {first}"))?;
                print(format_args!("{} of {} steps differ", found.differing_steps(), found.steps.len()))
            }
            None => print("no difference in any bit"),
        }
    }
}

//! `drystone view`.

use clap::Args;

use super::scene::{BackendArgs, SceneArgs, SleepArgs, WorldsArgs};
use super::words;
use crate::view::window;
use drystone::Result;
use drystone_view::{ColorBy, Live};

#[derive(Args)]
pub struct ViewArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    backend: BackendArgs,
    #[command(flatten)]
    sleep: SleepArgs,
    /// Quantity that determines the colors of bodies.
    #[arg(long, value_parser = words::of::<ColorBy>(), default_value_t)]
    color: ColorBy,
}

impl ViewArgs {
    pub fn run(&self) -> Result<()> {
        if let Some(replay) = self.scene.recording()? {
            self.scene.set_threads(self.backend.choice);
            return window::run(Box::new(Live::of_recording(
                replay,
                self.backend.choice,
                self.backend.exact,
                self.color,
            )?));
        }
        let (scene, mut config) = self.scene.load(&WorldsArgs::ONE)?;
        self.sleep.apply(&mut config);
        self.scene.set_threads(self.backend.choice);
        window::run(Box::new(Live::new(scene, config, self.backend.choice, self.backend.exact, self.color)?))
    }
}

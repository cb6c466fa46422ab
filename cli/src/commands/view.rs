//! `drystone view`.

use clap::Args;

use super::scene::{BackendArgs, SceneArgs, SleepArgs};
use crate::view::{ColorBy, Live, window};
use drystone::Result;

/// Arguments of `drystone view`.
#[derive(Args)]
pub struct ViewArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    backend: BackendArgs,
    #[command(flatten)]
    sleep: SleepArgs,
    /// What bodies are colored by.
    #[arg(long, value_enum, default_value_t)]
    color: ColorBy,
}

impl ViewArgs {
    /// Shows the scene until the window is closed.
    pub fn run(&self) -> Result<()> {
        let (scene, mut config) = self.scene.load(1, None)?;
        self.sleep.apply(&mut config);
        self.scene.set_threads(self.backend.choice);
        window::run(Box::new(Live::new(scene, config, self.backend.choice, self.backend.exact, self.color)?))
    }
}

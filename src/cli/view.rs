//! `drystone view`.

use clap::Args;

use super::{SceneArgs, SleepArgs};
use crate::backend::BackendChoice;
use crate::error::Result;
use crate::view::{ColorBy, Live, window};

/// Arguments of `drystone view`.
#[derive(Args)]
pub struct ViewArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// What runs the sweeps.
    #[arg(long, value_enum, default_value_t)]
    backend: BackendChoice,
    /// Ask the GPU for the reference's results to the last bit.
    #[arg(long)]
    exact: bool,
    #[command(flatten)]
    sleep: SleepArgs,
    /// What bodies are colored by.
    #[arg(long, value_enum, default_value_t)]
    color: ColorBy,
}

impl ViewArgs {
    /// Shows the scene until the window is closed.
    pub fn run(&self) -> Result<()> {
        let (scene, mut config) = self.scene.load()?;
        self.sleep.apply(&mut config);
        self.scene.set_threads(usize::from(self.backend == BackendChoice::Reference));
        window::run(Box::new(Live::new(scene, config, self.backend, self.exact, self.color)?))
    }
}

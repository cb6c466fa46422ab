//! Arguments that commands share: scene, settings, backend.

use std::path::PathBuf;

use clap::Args;

use super::output::say;
use super::words;
use crate::settings;
use drystone::backend::BackendChoice;
use drystone::config::{LONGEST_STEP, Method, SHORTEST_STEP};
use drystone::load::Load;
use drystone::preset::Preset;
use drystone::stages::memory;
use drystone::{BodyHandle, Error, Result, SolverConfig};
use drystone_problems::ContactProblem;
#[cfg(feature = "view")]
use drystone_scenes::Replay;
use drystone_scenes::{CATALOGUE, Scene};

// Headings of options in the help.
pub(super) const SCENE: &str = "Scene";
pub(super) const SETTINGS: &str = "Settings of the solver";
pub(super) const MACHINE: &str = "Machine";
pub(super) const OUTPUT: &str = "Output";

#[derive(Args)]
pub(super) struct SceneArgs {
    /// A scene of the catalogue, also as NAME:KEY=VALUE,..., or a scene file.
    ///
    /// `drystone scenes` lists the catalogue.
    pub(super) scene: String,
    /// Set a parameter of the scene; can be repeated.
    #[arg(short, long = "parameter", value_name = "KEY=VALUE", help_heading = SCENE)]
    pub(super) parameter: Vec<String>,
    /// Number of steps, instead of the default of the scene.
    #[arg(long, help_heading = SCENE, value_parser = clap::value_parser!(u32).range(0..))]
    pub(super) steps: Option<u32>,
    /// Length of a step, instead of the default of the scene.
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, help_heading = SCENE)]
    pub(super) dt: Option<f32>,
    /// Preset to start from; --set and other options override it.
    #[arg(long, value_parser = words::of::<Preset>(), conflicts_with = "config", default_value_t, help_heading = SETTINGS)]
    pub(super) preset: Preset,
    /// Use the fewest substeps that keep the overlap of resting bodies below this length, for example 1mm.
    ///
    /// A number without a unit is in meters. A heavy load that is applied suddenly overlaps up to twice as deep.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    #[arg(conflicts_with = "substeps", help_heading = SETTINGS)]
    pub(super) max_penetration: Option<f64>,
    /// Substeps per step.
    #[arg(long, value_name = "N", help_heading = SETTINGS, value_parser = clap::value_parser!(u32).range(0..))]
    pub(super) substeps: Option<u32>,
    /// Biased sweeps per substep.
    #[arg(long, value_name = "N", help_heading = SETTINGS, value_parser = clap::value_parser!(u32).range(0..))]
    pub(super) iterations: Option<u32>,
    /// Relax sweeps per substep.
    #[arg(long, value_name = "N", help_heading = SETTINGS, value_parser = clap::value_parser!(u32).range(0..))]
    pub(super) relax: Option<u32>,
    /// Method of the sweeps.
    #[arg(long, value_parser = words::of::<Method>(), help_heading = SETTINGS)]
    pub(super) method: Option<Method>,
    /// Set any setting; can be repeated.
    ///
    /// `drystone settings` lists them.
    #[arg(long, value_name = "KEY=VALUE", help_heading = SETTINGS)]
    pub(super) set: Vec<String>,
    /// Settings from a TOML file; --set and other options override them.
    #[arg(long, value_name = "FILE", help_heading = SETTINGS)]
    pub(super) config: Option<PathBuf>,
    /// Threads on the CPU; 0 means one for each core.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MACHINE)]
    #[arg(value_parser = clap::value_parser!(u16).range(0..=1024))]
    pub(super) threads: u16,
    /// Print one JSON object instead of a table.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) json: bool,
}

#[derive(Args)]
pub(super) struct BackendArgs {
    /// Backend that runs the sweeps.
    #[arg(long = "backend", value_name = "BACKEND", value_parser = words::of::<BackendChoice>(), default_value_t, help_heading = MACHINE)]
    pub(super) choice: BackendChoice,
    /// Make results of the GPU equal to the reference to the last bit.
    #[arg(long, help_heading = MACHINE)]
    pub(super) exact: bool,
}

#[derive(Args)]
pub(super) struct WorldsArgs {
    /// Solve N separate worlds of the scene as one problem.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = SCENE)]
    pub(super) worlds: u32,
    /// Increase this parameter by one from each world to the next.
    ///
    /// Without this option, all worlds are equal.
    #[arg(long, help_heading = SCENE, value_name = "KEY", requires = "worlds")]
    pub(super) vary: Option<String>,
}

#[cfg(feature = "view")]
impl WorldsArgs {
    /// One world.
    pub(super) const ONE: Self = Self { worlds: 1, vary: None };
}

#[derive(Args)]
pub(super) struct SleepArgs {
    /// Keep all bodies awake.
    ///
    /// By default, bodies slower than sleep_speed for sleep_after seconds sleep until another body touches them.
    #[arg(long, help_heading = SETTINGS)]
    pub(super) no_sleep: bool,
}

impl SleepArgs {
    pub(super) fn apply(&self, config: &mut SolverConfig) {
        if self.no_sleep {
            config.sleep_after = 0.0;
        }
    }
}

impl SceneArgs {
    /// The scene, or several worlds of it, and the settings for a comparison: bodies sleep only with `--set
    /// sleep_after`.
    pub(super) fn load_awake(&self, worlds: &WorldsArgs) -> Result<(Scene, SolverConfig)> {
        self.load_from(self.base()?.without_sleep(), worlds)
    }

    /// The scene, or several worlds of it ([`Scene::find_worlds`]), and the settings.
    pub(super) fn load(&self, worlds: &WorldsArgs) -> Result<(Scene, SolverConfig)> {
        self.load_from(self.base()?, worlds)
    }

    /// The name and the parameters. A scene of the catalogue can have parameters after a colon, in the form that other
    /// commands accept and print.
    fn parts(&self) -> (&str, Vec<String>) {
        let is_scene = |(name, _): &(&str, &str)| CATALOGUE.iter().any(|entry| entry.name == *name);
        let (name, own) = self.scene.split_once(':').filter(is_scene).unwrap_or((&self.scene, ""));
        let own = own.split(',').filter(|assignment| !assignment.is_empty()).map(str::to_owned);
        (name, own.chain(self.parameter.iter().cloned()).collect())
    }

    fn base(&self) -> Result<SolverConfig> {
        self.config.as_deref().map_or_else(|| Ok(self.preset.config()), settings::read)
    }

    fn load_from(&self, mut config: SolverConfig, worlds: &WorldsArgs) -> Result<(Scene, SolverConfig)> {
        let WorldsArgs { worlds, vary } = worlds;
        let (worlds, vary) = (*worlds as usize, vary.as_deref());
        for assignment in &self.set {
            settings::set(&mut config, assignment)?;
        }
        for (name, value) in [("substeps", self.substeps), ("iterations", self.iterations), ("relax", self.relax)] {
            if let Some(value) = value {
                settings::set(&mut config, &format!("{name}={value}"))?;
            }
        }
        config.method = self.method.unwrap_or(config.method);
        config.check()?;
        if let Some(dt) = self.dt.filter(|dt| !(SHORTEST_STEP..=LONGEST_STEP).contains(dt)) {
            return Err(Error::input(format!("--dt {dt}: must be {SHORTEST_STEP:e} to {LONGEST_STEP} seconds")));
        }
        let (name, parameters) = self.parts();
        announce(name, &parameters, worlds);
        let mut scene = Scene::find_worlds(name, &parameters, worlds, vary)?;
        scene.dt = self.dt.unwrap_or(scene.dt);
        scene.steps = self.steps.unwrap_or(scene.steps);
        if let Some(most) = self.max_penetration {
            choose_substeps(&mut config, &scene, most)?;
        }
        Ok((scene, config))
    }

    /// The recording that the scene names, or `None` if it is not a recording file.
    #[cfg(feature = "view")]
    pub(super) fn recording(&self) -> Result<Option<Replay>> {
        let Ok(bytes) = std::fs::read(&self.scene) else { return Ok(None) };
        if !Replay::is_recording(&bytes) {
            return Ok(None);
        }
        Replay::read(&bytes).map(Some).map_err(|e| e.within(&self.scene))
    }

    /// Sets the number of threads of the process.
    pub(super) fn set_threads(&self, backend: BackendChoice) {
        set_threads(self.threads, backend);
    }
}

/// Sets the number of threads of the process. 0 means one for each core, but one for the reference.
pub(super) fn set_threads(threads: u16, backend: BackendChoice) {
    let unless_told = usize::from(backend == BackendChoice::Reference);
    let threads = if threads == 0 { unless_told } else { threads.into() };
    // This fails only if the pool exists already. This thread is one of its threads: a separate pool costs 14 us per
    // step.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build_global();
}

/// Refuses a contact problem without contacts.
pub(super) fn check_touching(problem: &ContactProblem) -> Result<()> {
    if !problem.contacts.is_empty() {
        return Ok(());
    }
    Err(Error::input(format!("{}: no awake body touches another", problem.name)))
}

/// Worlds with fewer bodies take less than a second to build.
const MANY_BODIES: u64 = 200_000;

/// Prints a line before a large world is built.
fn announce(scene: &str, parameters: &[String], worlds: usize) {
    let Some(entry) = CATALOGUE.iter().find(|e| e.name == scene) else { return };
    // `Scene::find_worlds` refuses wrong parameters later.
    let bodies = entry.body_count(parameters).unwrap_or(0).saturating_mul(worlds as u64);
    // A world that exceeds the memory is refused later, before it is built.
    if bodies >= MANY_BODIES && memory::check(bodies as f64 * memory::BODY, scene).is_ok() {
        say(format_args!("building {bodies} bodies ..."));
    }
}

/// Chooses the substeps for which the heaviest contact overlaps by at most `most`, and prints them.
fn choose_substeps(config: &mut SolverConfig, scene: &Scene, most: f64) -> Result<()> {
    let Some(load) = Load::heaviest(&scene.world, config) else {
        say(format_args!("substeps {}: no body of {} supports another", config.substeps, scene.name));
        return Ok(());
    };
    config.substeps = load.substeps(most, scene.dt, config)?;
    let (substeps, Load { force, .. }) = (config.substeps, load);
    let [upper, lower] = [load.upper, load.lower].map(BodyHandle::index);
    let overlap = 1e3 * load.overlap(substeps, scene.dt, config);
    say(format_args!(
        "substeps {substeps}: body {upper} presses on body {lower} with {force:.3e} N, which makes {overlap:.3} mm"
    ));
    Ok(())
}

/// Parses a length as `1mm`, `0.1cm` or `0.001m`. A number without a unit is in meters.
fn length(text: &str) -> std::result::Result<f64, String> {
    let (number, unit) = text.split_at(text.find(|c: char| c.is_alphabetic() && c != 'e').unwrap_or(text.len()));
    let unit = match unit {
        "" | "m" => 1.0,
        "cm" => 1e-2,
        "mm" => 1e-3,
        "um" => 1e-6,
        _ => return Err("write it as 1mm, 0.1cm or 0.001m".into()),
    };
    let meters = number.trim().parse::<f64>().map_err(|_| "write it as 1mm, 0.1cm or 0.001m")? * unit;
    if meters > 0.0 && meters.is_finite() { Ok(meters) } else { Err("must be more than 0".into()) }
}

//! The command line: parse, one library call, print.

mod bench;
mod compare;
#[cfg(feature = "fclib")]
mod export;
mod hard;
mod list;
mod play;
mod progress;
#[cfg(feature = "view")]
mod render;
mod report;
mod run;
mod solve;
#[cfg(feature = "view")]
mod view;
mod words;

pub use report::SurveyArgs;

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind as Usage};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use self::progress::Progress;
use crate::files;
use crate::settings;
use drystone::Simulation;
use drystone::backend::BackendChoice;
use drystone::config::{LONGEST_STEP, Method, SHORTEST_STEP, SolverConfig};
use drystone::contacts::ContactProblem;
use drystone::load::Load;
use drystone::preset::Preset;
use drystone::scenes::{CATALOGUE, Scene};
use drystone::stages::memory;
use drystone::stages::suggest::nearest;
use drystone::stats::StepStats;
use drystone::{Error, Result};

/// Contact between rigid bodies: run scenes, compare backends, solve contact problems.
#[derive(Parser)]
#[command(name = "drystone", version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scene and report on it.
    Run(run::RunArgs),
    /// Run a scene on two backends and show how far apart they are.
    Compare(compare::CompareArgs),
    /// Solve a contact problem and show how its error falls with the sweeps.
    Solve(solve::SolveArgs),
    /// Run a scene in a window.
    #[cfg(feature = "view")]
    View(view::ViewArgs),
    /// Run a scene in a window (in builds with `--features view`).
    #[cfg(not(feature = "view"))]
    View(NotBuilt),
    /// Write a contact problem for other solvers.
    #[cfg(feature = "fclib")]
    Export(export::ExportArgs),
    /// Run hard cases and say which pass.
    Hard(hard::HardArgs),
    /// Play a game.
    Play(play::PlayArgs),
    /// Draw a scene: one picture, an animation, or every scene of the catalogue.
    #[cfg(feature = "view")]
    Render(render::RenderArgs),
    /// Draw a scene (in builds with `--features view`).
    #[cfg(not(feature = "view"))]
    Render(NotBuilt),
    /// Measure what the stages of a step cost on standard scenes.
    Bench(bench::BenchArgs),
    /// Make a page of tables and pictures from runs.
    Report(report::ReportArgs),
    /// List the scenes of the catalogue with their parameters.
    Scenes(list::ScenesArgs),
    /// List the settings of the solver, as a file for --config.
    Settings(list::SettingsArgs),
    /// List the adapters that can run the shaders.
    Adapters(list::AdaptersArgs),
}

/// A command that this build leaves out.
#[cfg(not(feature = "view"))]
#[derive(Args)]
struct NotBuilt {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    rest: Vec<String>,
}

#[cfg(not(feature = "view"))]
impl NotBuilt {
    fn run(&self) -> Result<()> {
        Err(Error::input("pictures and windows need a build with them: `cargo install --path cli --features view`"))
    }
}

/// Headings of options in the help.
mod heading {
    pub(super) const SCENE: &str = "Scene";
    pub(super) const SETTINGS: &str = "Settings of the solver";
    pub(super) const MACHINE: &str = "What it runs on";
    pub(super) const OUTPUT: &str = "Output";
}
use heading::{MACHINE, OUTPUT, SCENE, SETTINGS};

/// A scene, and how to solve it.
#[derive(Args)]
struct SceneArgs {
    /// A scene of the catalogue, or a scene file.
    ///
    /// `drystone scenes` lists the catalogue.
    scene: String,
    /// Parameter of the scene; may be given several times.
    #[arg(short, long = "parameter", value_name = "KEY=VALUE", help_heading = SCENE)]
    parameter: Vec<String>,
    /// Steps, if not as many as the scene says.
    #[arg(long, help_heading = SCENE, value_parser = clap::value_parser!(u32).range(0..))]
    steps: Option<u32>,
    /// Length of a step, if not what the scene says.
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, help_heading = SCENE)]
    dt: Option<f32>,
    /// Settings by name, before --set and the others.
    #[arg(long, value_parser = words::preset(), conflicts_with = "config", default_value_t, help_heading = SETTINGS)]
    preset: Preset,
    /// Choose the substeps by the overlap of what stands, as 1mm.
    ///
    /// A bare number is in meters. A heavy load that comes on at once swings up to twice as deep.
    #[arg(
        long,
        value_name = "LENGTH",
        value_parser = length,
        allow_hyphen_values = true,
        conflicts_with = "substeps",
        help_heading = SETTINGS
    )]
    max_penetration: Option<f64>,
    /// Substeps of a step.
    #[arg(long, value_name = "N", help_heading = SETTINGS, value_parser = clap::value_parser!(u32).range(0..))]
    substeps: Option<u32>,
    /// Biased sweeps of a substep.
    #[arg(long, value_name = "N", help_heading = SETTINGS, value_parser = clap::value_parser!(u32).range(0..))]
    iterations: Option<u32>,
    /// Relax sweeps of a substep.
    #[arg(long, value_name = "N", help_heading = SETTINGS, value_parser = clap::value_parser!(u32).range(0..))]
    relax: Option<u32>,
    /// What the sweeps do.
    #[arg(long, value_parser = words::method(), help_heading = SETTINGS)]
    method: Option<Method>,
    /// Any setting; may be given several times.
    ///
    /// `drystone settings` lists them.
    #[arg(long, value_name = "KEY=VALUE", help_heading = SETTINGS)]
    set: Vec<String>,
    /// Settings from a TOML file, before --set and the others.
    #[arg(long, value_name = "FILE", help_heading = SETTINGS)]
    config: Option<PathBuf>,
    /// Threads on the CPU; 0 is one a core.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        value_parser = clap::value_parser!(u16).range(0..=1024),
        help_heading = MACHINE
    )]
    threads: u16,
    /// Print one JSON object instead of a table.
    #[arg(long, help_heading = OUTPUT)]
    json: bool,
}

/// What runs the sweeps of one scene.
#[derive(Args)]
struct BackendArgs {
    /// What runs the sweeps.
    #[arg(long = "backend", value_name = "BACKEND", value_parser = words::backend(), default_value_t, help_heading = MACHINE)]
    choice: BackendChoice,
    /// Ask the GPU for the reference's results to the last bit.
    #[arg(long, help_heading = MACHINE)]
    exact: bool,
}

/// Scenes that run for their result.
#[derive(Args)]
struct SleepArgs {
    /// Let nothing fall asleep.
    ///
    /// Without it what was slow for half a second does, until it is touched: --set sleep_after=0.5, sleep_speed=0.01.
    #[arg(long, help_heading = SETTINGS)]
    no_sleep: bool,
}

impl SleepArgs {
    fn apply(&self, config: &mut SolverConfig) {
        if self.no_sleep {
            config.sleep_after = 0.0;
        }
    }
}

impl SceneArgs {
    /// The scene with its step length, and the settings for a comparison: nothing sleeps unless `--set sleep_after` says so.
    fn load_awake(&self) -> Result<(Scene, SolverConfig)> {
        self.load_from(self.base()?.without_sleep(), 1, None)
    }

    /// The scene, or some worlds of it ([`Scene::find_worlds`]), with its step length, and the settings.
    fn load(&self, worlds: usize, vary: Option<&str>) -> Result<(Scene, SolverConfig)> {
        self.load_from(self.base()?, worlds, vary)
    }

    /// The settings that the others change.
    fn base(&self) -> Result<SolverConfig> {
        self.config.as_deref().map_or_else(|| Ok(self.preset.config()), settings::read)
    }

    fn load_from(&self, mut config: SolverConfig, worlds: usize, vary: Option<&str>) -> Result<(Scene, SolverConfig)> {
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
        announce(&self.scene, &self.parameter, worlds);
        let mut scene = Scene::find_worlds(&self.scene, &self.parameter, worlds, vary)?;
        scene.dt = self.dt.unwrap_or(scene.dt);
        scene.steps = self.steps.unwrap_or(scene.steps);
        if let Some(most) = self.max_penetration {
            choose_substeps(&mut config, &scene, most)?;
        }
        Ok((scene, config))
    }

    /// Sets the number of threads, once for the process: one a core unless told, and one for the reference.
    fn set_threads(&self, backend: BackendChoice) {
        let unless_told = usize::from(backend == BackendChoice::Reference);
        let threads = if self.threads == 0 { unless_told } else { self.threads.into() };
        // Fails only if it was set before, which nothing does.
        // This thread is one of them: to hand work to a pool of other threads and wait costs 14 us a step.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build_global();
    }
}

/// Moves a scene on by the step that is its `number`th, and gives what that asked of the velocities, if anything.
fn step_with_contacts(
    simulation: &mut Simulation,
    scene: &str,
    dt: f32,
    number: u32,
) -> Result<(ContactProblem, StepStats)> {
    let (problem, stats) = simulation.step_with_contacts(&format!("{scene}, step {number}"), dt)?;
    match problem.contacts.is_empty() {
        true => Err(Error::input(format!("{}: nothing touches that is awake", problem.name))),
        false => Ok((problem, stats)),
    }
}

/// Worlds with fewer bodies are built within a second.
const MANY_BODIES: u64 = 200_000;

/// Says that a world is built, where that takes a while.
fn announce(scene: &str, parameters: &[String], worlds: usize) {
    let Some(entry) = CATALOGUE.iter().find(|e| e.name == scene) else { return };
    // `Scene::find_worlds` refuses wrong parameters.
    let bodies = entry.body_count(parameters).unwrap_or(0).saturating_mul(worlds as u64);
    // What does not fit is refused before anything is built.
    if bodies >= MANY_BODIES && memory::check(bodies as f64 * memory::BODY, scene).is_ok() {
        say(format_args!("building {bodies} bodies ..."));
    }
}

/// Picks the substeps that keep the heaviest contact of a scene as shallow as asked for, and says which.
fn choose_substeps(config: &mut SolverConfig, scene: &Scene, most: f64) -> Result<()> {
    let Some(load) = Load::heaviest(&scene.world, config) else {
        say(format_args!("substeps {}: no body of {} bears another", config.substeps, scene.name));
        return Ok(());
    };
    config.substeps = load.substeps(most, scene.dt, config)?;
    let (substeps, Load { upper, lower, force, .. }) = (config.substeps, load);
    let overlap = 1e3 * load.overlap(substeps, scene.dt, config);
    say(format_args!(
        "substeps {substeps}: body {upper} presses on body {lower} with {force:.3e} N, which makes {overlap:.3} mm"
    ));
    Ok(())
}

/// A length as `1mm`, `0.1cm` or `0.001m`; a bare number is in meters.
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

/// Over the steps of a run.
fn progress(steps: u32, quiet: bool) -> Progress {
    Progress::new("step", steps.into(), quiet)
}

/// Runs what writes a file, and says so if the file took the place of another.
fn replacing<T>(path: &Path, write: impl FnOnce() -> Result<T>) -> Result<T> {
    let was_there = path.is_file();
    let written = write()?;
    if was_there {
        say(format_args!("{}: replaced what was there", path.display()));
    }
    Ok(written)
}

/// Prints to standard output, and a line break. That the reader of a pipe has seen enough is no error.
fn print(text: impl Display) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::file("standard output")(e)),
        _ => Ok(()),
    }
}

/// Prints a line to standard error. Nothing depends on a reader of it: `eprintln!` would panic without one.
fn say(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Prints a value as JSON on one line.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(serde_json::to_string(value).expect("reports serialize"))
}

/// A command that takes a negative number for a value everywhere: what is out of range is refused as such, not as an argument
/// that there is not. Of `-1e-3` clap knows no number: real numbers allow hyphens.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes = |a: &clap::Arg| a.get_action().takes_values() && !a.is_positional() && !a.is_allow_hyphen_values_set();
    let allow = |a: clap::Arg| if takes(&a) { a.allow_negative_numbers(true) } else { a };
    command.mut_args(allow).mut_subcommands(with_negative_numbers)
}

/// The arguments of this process; ends it where they cannot be used, or help is asked for.
fn arguments() -> Cli {
    let command = with_negative_numbers(Cli::command());
    let parsed = command.clone().try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.unwrap_or_else(|mut error| {
        let typed = match error.get(ContextKind::InvalidSubcommand) {
            Some(ContextValue::String(typed)) if error.kind() == Usage::InvalidSubcommand => typed.clone(),
            _ => error.exit(),
        };
        let mut place = &command;
        for word in std::env::args().skip(1) {
            place = place.find_subcommand(&word).unwrap_or(place);
        }
        if CATALOGUE.iter().any(|e| e.name == typed) {
            let meant = format!("did you mean `drystone run {typed}`?");
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![meant.into()]));
        } else if let Some(name) = nearest(&typed, place.get_subcommands().map(clap::Command::get_name)) {
            error.insert(ContextKind::SuggestedSubcommand, ContextValue::String(name.into()));
        }
        error.exit()
    })
}

/// Runs the command line; returns the exit code: 0, 2 for bad input, 3 for a missing adapter or too little memory, 130 after
/// Ctrl-C.
pub fn main() -> std::process::ExitCode {
    let cli = arguments();
    // Ctrl-C removes unfinished files. The call fails only if the process handles signals already.
    let _ = ctrlc::set_handler(|| {
        files::discard_drafts();
        std::process::exit(130);
    });
    let result = match cli.command {
        Command::Run(args) => args.run(),
        Command::Compare(args) => args.run(),
        Command::Solve(args) => args.run(),
        Command::View(args) => args.run(),
        #[cfg(feature = "fclib")]
        Command::Export(args) => args.run(),
        Command::Hard(args) => args.run(),
        Command::Play(args) => args.run(),
        Command::Render(args) => args.run(),
        Command::Bench(args) => args.run(),
        Command::Report(args) => args.run(),
        Command::Scenes(args) => args.run(),
        Command::Settings(args) => args.run(),
        Command::Adapters(args) => args.run(),
    };
    match result {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            // One line, whatever the caller's names are made of.
            say(format_args!("drystone: {}", e.to_string().replace(char::is_control, " ")));
            e.exit_code().into()
        }
    }
}

//! The command line. Each command parses its arguments, makes one library call and prints.

#[cfg(feature = "gpu")]
mod adapters;
mod bench;
mod compare;
#[cfg(feature = "gpu")]
mod conform;
#[cfg(feature = "fclib")]
mod export;
mod hard;
mod list;
mod output;
mod play;
mod progress;
#[cfg(feature = "view")]
mod render;
mod replay;
mod report;
mod run;
mod scene;
mod soak;
mod solve;
mod stop;
#[cfg(feature = "view")]
mod view;
mod words;

pub use report::SurveyArgs;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue, ErrorKind as Usage};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use drystone::stages::suggest::nearest;
use drystone_scenes::CATALOGUE;

/// Simulate contact between rigid bodies: run scenes, compare backends, solve contact problems.
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
    /// Run a scene on two backends and measure the difference.
    Compare(compare::CompareArgs),
    /// Check an adapter and its driver: kernels, scenes, limits, long plans, lost devices.
    #[cfg(feature = "gpu")]
    Conform(conform::ConformArgs),
    /// Check an adapter and its driver (in builds with the feature gpu).
    #[cfg(not(feature = "gpu"))]
    Conform(NotBuilt),
    /// Solve a contact problem and show how its error falls from sweep to sweep.
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
    /// Run hard cases and report which ones pass.
    Hard(hard::HardArgs),
    /// Run small worlds for a long time and check that they stay level.
    Soak(soak::SoakArgs),
    /// Play a game.
    Play(play::PlayArgs),
    /// Replay a recording and report differences.
    Replay(replay::ReplayArgs),
    /// Draw a scene: one picture, an animation, or every scene of the catalogue.
    #[cfg(feature = "view")]
    Render(render::RenderArgs),
    /// Draw a scene (in builds with `--features view`).
    #[cfg(not(feature = "view"))]
    Render(NotBuilt),
    /// Measure the cost of the stages of a step on standard scenes.
    Bench(bench::BenchArgs),
    /// Make a page of tables and pictures from runs.
    Report(report::ReportArgs),
    /// List the scenes of the catalogue with their parameters.
    Scenes(list::ScenesArgs),
    /// List the settings of the solver, as a file for --config.
    Settings(list::SettingsArgs),
    /// List the adapters that can run the shaders.
    #[cfg(feature = "gpu")]
    Adapters(adapters::AdaptersArgs),
    /// List the adapters that can run the shaders (in builds with the feature gpu).
    #[cfg(not(feature = "gpu"))]
    Adapters(NotBuilt),
}

/// A command that needs the feature `view` or `gpu`.
#[cfg(not(feature = "view"))]
#[derive(clap::Args)]
struct NotBuilt {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    rest: Vec<String>,
}

#[cfg(not(feature = "view"))]
impl NotBuilt {
    fn run(&self) -> drystone::Result<()> {
        let needed = "GPUs, pictures and windows need a build with them: `cargo install --path cli --features view`";
        Err(drystone::Error::input(needed))
    }
}

/// Accepts negative numbers as values everywhere, so that clap reports a number out of range and not an unknown
/// argument. Clap does not recognize `-1e-3` as a number, so real arguments allow hyphens.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes = |a: &clap::Arg| a.get_action().takes_values() && !a.is_positional() && !a.is_allow_hyphen_values_set();
    let allow = |a: clap::Arg| if takes(&a) { a.allow_negative_numbers(true) } else { a };
    command.mut_args(allow).mut_subcommands(with_negative_numbers)
}

/// Parses the arguments. Ends the process if they are invalid or ask for help.
fn arguments(words: &[OsString]) -> Cli {
    let command = with_negative_numbers(Cli::command());
    let parsed = command.clone().try_get_matches_from(words).and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.unwrap_or_else(|mut error| {
        let typed = match error.get(ContextKind::InvalidSubcommand) {
            Some(ContextValue::String(typed)) if error.kind() == Usage::InvalidSubcommand => typed.clone(),
            _ => error.exit(),
        };
        let mut place = &command;
        for word in words.iter().skip(1) {
            place = place.find_subcommand(word).unwrap_or(place);
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

/// Runs the command line. Exit codes: 0 for success; 1 if a check of `conform` failed, or after a defect in the
/// program; 2 for bad input or a file that cannot be written; 3 for a missing adapter or too little memory; 128 plus
/// the number of the signal that stopped the command: 130 for Ctrl-C, 141 if the reader of standard output is gone.
pub fn main() -> ExitCode {
    main_of(&std::env::args_os().collect::<Vec<_>>())
}

/// The same for the words of a command line. The first word is the name of the program.
pub fn main_of(words: &[OsString]) -> ExitCode {
    let cli = arguments(words);
    stop::guarded(|| cli.command.run())
}

impl Command {
    /// Returns whether all checks passed; true for commands without checks.
    fn run(&self) -> drystone::Result<bool> {
        match self {
            #[cfg(feature = "gpu")]
            Self::Conform(args) => return args.run(),
            #[cfg(not(feature = "gpu"))]
            Self::Conform(args) => args.run(),
            Self::Run(args) => args.run(),
            Self::Compare(args) => args.run(),
            Self::Solve(args) => args.run(),
            Self::View(args) => args.run(),
            #[cfg(feature = "fclib")]
            Self::Export(args) => args.run(),
            Self::Hard(args) => args.run(),
            Self::Soak(args) => args.run(),
            Self::Play(args) => args.run(),
            Self::Replay(args) => args.run(),
            Self::Render(args) => args.run(),
            Self::Bench(args) => args.run(),
            Self::Report(args) => args.run(),
            Self::Scenes(args) => args.run(),
            Self::Settings(args) => args.run(),
            Self::Adapters(args) => args.run(),
        }?;
        Ok(true)
    }
}

//! The command line: each command parses, makes one library call and prints.

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

use drystone::scenes::CATALOGUE;
use drystone::stages::suggest::nearest;

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
    /// Check an adapter and its driver: kernels, scenes, limits, long plans, lost devices.
    #[cfg(feature = "gpu")]
    Conform(conform::ConformArgs),
    /// Check an adapter and its driver (in builds with the feature gpu).
    #[cfg(not(feature = "gpu"))]
    Conform(NotBuilt),
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
    /// Let small worlds live for long and say whether they stay level.
    Soak(soak::SoakArgs),
    /// Play a game.
    Play(play::PlayArgs),
    /// Run a recording again and say where it differs.
    Replay(replay::ReplayArgs),
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

/// Accepts negative numbers as values everywhere, so that clap reports a number out of range and not an unknown argument. clap does
/// not recognize `-1e-3` as a number; real arguments therefore allow hyphens.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes = |a: &clap::Arg| a.get_action().takes_values() && !a.is_positional() && !a.is_allow_hyphen_values_set();
    let allow = |a: clap::Arg| if takes(&a) { a.allow_negative_numbers(true) } else { a };
    command.mut_args(allow).mut_subcommands(with_negative_numbers)
}

/// Parses the arguments; ends the process if they are invalid or ask for help.
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

/// Runs the command line. Exit codes: 0; 1 where a check of `conform` failed, or after a mistake in the program; 2 for bad input and files that
/// cannot be written; 3 for a missing adapter or too little memory; 128 and the number of the signal that stopped the command: 130 for Ctrl-C,
/// 141 where nobody reads standard output any more.
pub fn main() -> ExitCode {
    main_of(&std::env::args_os().collect::<Vec<_>>())
}

/// The same, with the words of a command line: the first is the name of the program.
pub fn main_of(words: &[OsString]) -> ExitCode {
    let cli = arguments(words);
    stop::guarded(|| cli.command.run())
}

impl Command {
    /// Whether all checks passed; commands that check nothing pass.
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

//! `drystone-peers SCENE...`: drystone, Rapier, Box3D and PhysX on the same scenes, time beside errors.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use comfy_table::{CellAlignment, Table, presets};
use drystone::{Error, Result, Scene};
use drystone_cli::commands::SurveyArgs;
use drystone_cli::files;
use drystone_cli::report::comparison::{Origin, Row, blocks, measure, scene};
use drystone_peers::{Engine, Entrant, team};
use indicatif::{ProgressBar, ProgressStyle};

/// Runs scenes with drystone, Rapier, Box3D and PhysX, each at its defaults and at the settings asked for.
///
/// They step in turns. Time is the median over blocks of 10 steps, in brackets its quartiles; ratio is that to the first row in
/// the same blocks. Times and overlaps are of the second half of a run.
#[derive(Parser)]
#[command(max_term_width = 110, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Scenes: names of the catalogue, as tower or tower:n=20,top_ratio=100, and paths of scene files.
    #[arg(required = true)]
    scenes: Vec<String>,
    /// Engines that take part; PhysX needs a build with `--features physx`.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = Engine::built())]
    engines: Vec<Engine>,
    /// Substeps to run besides the defaults.
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=4096))]
    substeps: Vec<u32>,
    /// Contact frequencies to run with each of the substeps, times the length of a substep; `own` is what an engine does by itself.
    #[arg(long, value_delimiter = ',', default_value = "0.125", value_parser = parse_frequency)]
    frequency: Vec<Frequency>,
    /// Settings of drystone, as key=value,key=value; each time this is given adds a row with them.
    #[arg(long, value_name = "KEY=VALUE,...")]
    set: Vec<String>,
    /// Threads of each engine.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=32))]
    threads: u16,
    /// Steps; a scene says how many if this does not.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Write all rows as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Command {
    /// The report of `drystone report`, with the other engines on the same pictures.
    Report(SurveyArgs),
}

/// A contact frequency relative to the substep rate, or an engine's own.
#[derive(Clone, Copy)]
struct Frequency(Option<f32>);

fn parse_frequency(text: &str) -> std::result::Result<Frequency, String> {
    match text {
        "own" => Ok(Frequency(None)),
        _ => match text.parse() {
            Ok(x) if x > 0.0 && x <= 0.5 => Ok(Frequency(Some(x))),
            _ => Err("must be own, or more than 0 and at most 0.5".into()),
        },
    }
}

impl Args {
    /// Each engine at its defaults, then at what was asked for, each once.
    fn entrants(&self, dt: f32) -> Vec<Entrant> {
        let mut entrants: Vec<Entrant> = Vec::new();
        for &engine in &self.engines {
            let usual = Entrant::default_of(engine);
            let asked = self.substeps.iter().flat_map(|&substeps| {
                self.frequency.iter().map(move |f| Entrant { substeps, frequency: f.0, ..Entrant::default_of(engine) })
            });
            let set = |text: &String| Entrant { set: text.split(',').map(str::to_owned).collect(), ..usual.clone() };
            let set = self.set.iter().filter(|_| engine == Engine::Drystone).map(set);
            for entrant in std::iter::once(usual.clone()).chain(asked).chain(set) {
                let named = |e: &Entrant| (e.engine, e.substeps, e.hertz(dt).round(), e.set.clone());
                if entrants.iter().all(|e| named(e) != named(&entrant)) {
                    entrants.push(entrant);
                }
            }
        }
        entrants
    }

    fn scene(&self, text: &str) -> Result<Scene> {
        let mut scene = scene(text)?;
        scene.steps = self.steps.unwrap_or(scene.steps);
        Ok(scene)
    }

    fn run(&self) -> Result<()> {
        let threads = usize::from(self.threads);
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .use_current_thread()
            .build_global()
            .map_err(Error::input)?;
        let origin = Origin::here(None);
        // Every scene is read before the first is run.
        let scenes = self.scenes.iter().map(|text| self.scene(text)).collect::<Result<Vec<_>>>()?;
        let mut all = Vec::new();
        for scene in &scenes {
            let build = |entrant: Entrant| entrant.build(scene, threads);
            let mut contenders = self.entrants(scene.dt).into_iter().map(build).collect::<Result<Vec<_>>>()?;
            let style =
                ProgressStyle::with_template("{msg} {bar:40} {percent} %  {eta} left").expect("a fixed template");
            let bar = ProgressBar::new(contenders.len() as u64 * u64::from(blocks(scene.steps))).with_style(style);
            bar.set_message(scene.name.clone());
            let rows = measure(scene, &mut contenders, &origin, &mut || bar.inc(1))?;
            bar.finish_and_clear();
            print_table(scene, &rows);
            all.extend(rows);
        }
        match &self.csv {
            Some(path) => files::write(path, &files::csv(&all)?),
            None => Ok(()),
        }
    }
}

fn print_table(scene: &Scene, rows: &[Row]) {
    let Some(first) = rows.first() else { return };
    println!("{}: {} dynamic bodies, {} steps, threads {}", scene.name, first.bodies, first.steps, first.threads);
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header([
        "",
        "ms a step",
        "",
        "ratio",
        "deepest mm",
        "mean mm",
        "rms mm/s",
        "drift mm",
        "in place",
        "gap mm",
    ]);
    for row in rows {
        let mm = |x: f64| format!("{:.3}", x * 1e3);
        table.add_row([
            row.setting().label(),
            format!("{:.4}", row.ms),
            format!("({:.4} {:.4})", row.ms_low, row.ms_high),
            format!("{:.2}", row.ratio),
            mm(row.penetration_max),
            mm(row.penetration_mean),
            mm(row.speed_rms),
            mm(row.drift),
            row.in_place.map_or_else(String::new, |n| format!("{n}/{}", row.bodies)),
            row.joint_gap.map_or_else(String::new, mm),
        ]);
    }
    table.column_iter_mut().skip(1).for_each(|column| column.set_cell_alignment(CellAlignment::Right));
    println!("{table}\n");
}

fn main() -> ExitCode {
    let args = Args::parse();
    let done = match &args.command {
        Some(Command::Report(survey)) => survey.run(&[&|scene, extent| team(scene, extent, survey.threads())]),
        None => args.run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("drystone-peers: {}", e.to_string().replace(char::is_control, " "));
            e.exit_code().into()
        }
    }
}

//! `drystone-peers SCENE...`: drystone, Rapier, Box3D, PhysX and Bullet on the same scenes, time beside errors.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use comfy_table::{CellAlignment, Table, presets};
use drystone::{Error, Result};
use drystone_scenes::Scene;
use drystone_cli::commands::SurveyArgs;
use drystone_cli::files;
use drystone_cli::report::comparison::{Origin, Row, blocks, measure, scene};
use drystone_peers::{BulletSolver, Engine, Entrant, team};
use indicatif::{ProgressBar, ProgressStyle};

/// Runs scenes with drystone, Rapier, Box3D, PhysX and Bullet, each at its defaults and at the settings asked for.
///
/// They step in turns of 10 steps. The first table has the thirds of a run: the median and the worst time of a step, the time relative
/// to the fastest other engine in the same turns, and errors at the end of the third. The first step of a run has a column of its own.
/// The second table has the second half: medians over the turns, in brackets the quartiles, and the ratio to the first row.
#[derive(Parser)]
#[command(max_term_width = 110, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Scenes: names of the catalogue, as tower or tower:n=20,top_ratio=100, and paths of scene files.
    #[arg(required = true)]
    scenes: Vec<String>,
    /// Engines that take part; all of the build that run on so many threads if this is not given. PhysX needs a build with
    /// `--features physx`, and Bullet, which runs on one thread, with `--features bullet`.
    #[arg(long, value_enum, value_delimiter = ',')]
    engines: Vec<Engine>,
    /// Substeps to run besides the defaults.
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=4096))]
    substeps: Vec<u32>,
    /// Contact frequencies to run with each of the substeps, times the length of a substep; `own` is what an engine does by itself.
    #[arg(long, value_delimiter = ',', default_value = "0.125", value_parser = parse_frequency)]
    frequency: Vec<Frequency>,
    /// Solvers of Bullet to run with each of its iterations.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "sequential")]
    bullet_solver: Vec<BulletSolver>,
    /// Iterations of Bullet in a substep to run besides the default, 10.
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=4096))]
    bullet_iterations: Vec<u32>,
    /// Settings of drystone, as key=value,key=value; each time this is given adds a row with them.
    #[arg(long, value_name = "KEY=VALUE,...")]
    set: Vec<String>,
    /// Threads of each engine.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=32))]
    threads: u16,
    /// Steps; a scene says how many if this does not.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Write the rows of the second half as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the rows of the thirds as CSV, as docs/performance.md is made of.
    #[arg(long, value_name = "FILE")]
    thirds: Option<PathBuf>,
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
        let engines = if self.engines.is_empty() { Engine::on(self.threads.into()) } else { self.engines.clone() };
        for engine in engines {
            let usual = Entrant::default_of(engine);
            let asked = self.substeps.iter().flat_map(|&substeps| {
                self.frequency.iter().map(move |f| Entrant { substeps, frequency: f.0, ..Entrant::default_of(engine) })
            });
            let set = |text: &String| Entrant { set: text.split(',').map(str::to_owned).collect(), ..usual.clone() };
            let set = self.set.iter().filter(|_| engine == Engine::Drystone).map(set);
            let bullets = if engine == Engine::Bullet { self.bullets(&usual) } else { Vec::new() };
            for entrant in std::iter::once(usual.clone()).chain(asked).chain(set).chain(bullets) {
                let named =
                    |e: &Entrant| (e.engine, e.substeps, e.hertz(dt).round(), e.solver, e.iterations, e.set.clone());
                if entrants.iter().all(|e| named(e) != named(&entrant)) {
                    entrants.push(entrant);
                }
            }
        }
        entrants
    }

    /// The solvers and iterations of Bullet that were asked for.
    fn bullets(&self, usual: &Entrant) -> Vec<Entrant> {
        let all = [&[usual.iterations][..], &self.bullet_iterations].concat();
        let of = |&solver| all.iter().map(move |&iterations| Entrant { solver, iterations, ..usual.clone() });
        self.bullet_solver.iter().flat_map(of).collect()
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
            print_tables(scene, &rows);
            all.extend(rows);
        }
        if let Some(path) = &self.thirds {
            let thirds: Vec<_> = all.iter().flat_map(|row| &row.windows).collect();
            files::write(path, &files::csv(&thirds)?)?;
        }
        self.csv.as_ref().map_or(Ok(()), |path| files::write(path, &files::csv(&all)?))
    }
}

fn mm(x: f64) -> String {
    format!("{:.3}", x * 1e3)
}

fn print_tables(scene: &Scene, rows: &[Row]) {
    let Some(first) = rows.first() else { return };
    println!("{}: {} dynamic bodies, {} steps, threads {}", scene.name, first.bodies, first.steps, first.threads);
    let heads =
        ["", "steps", "ms", "worst", "first", "to best", "deepest mm", "mean mm", "rms mm/s", "drift mm", "in place"];
    let thirds = rows.iter().flat_map(|row| &row.windows).map(|w| {
        let (head, first) =
            if w.from == 1 { (w.setting.clone(), format!("{:.3}", w.ms_first)) } else { Default::default() };
        let to_best = w.to_best.map_or_else(String::new, |ratio| format!("{ratio:.2}"));
        let steps = format!("{} to {}", w.from, w.to);
        let times = [w.ms, w.ms_worst].map(|ms| format!("{ms:.3}"));
        let errors = [w.penetration_max, w.penetration_mean, w.speed_rms, w.drift].map(mm);
        let in_place = w.in_place.map_or_else(String::new, |n| format!("{n}/{}", w.bodies));
        [vec![head, steps], times.into(), vec![first, to_best], errors.into(), vec![in_place]].concat()
    });
    print_table(&heads, thirds);
    let heads = ["", "ms a step", "", "ratio", "deepest mm", "mean mm", "rms mm/s", "drift mm", "in place", "gap mm"];
    let halves = rows.iter().map(|row| {
        vec![
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
        ]
    });
    print_table(&heads, halves);
}

fn print_table(heads: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(heads);
    table.add_rows(rows);
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

//! `drystone-peers SCENE...`: drystone, Rapier and Box3D on the same scenes, time beside errors.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use comfy_table::{CellAlignment, Table, presets};
use drystone::{Error, Result, Scene};
use drystone_peers::{Engine, Race, Row, Setting};
use indicatif::{ProgressBar, ProgressStyle};

/// Runs scenes with drystone, Rapier and Box3D, each at its defaults and at the settings asked for.
///
/// Time is the median over the steps; of several repetitions, their median and in brackets the least and the greatest.
#[derive(Parser)]
#[command(max_term_width = 110)]
struct Args {
    /// Scenes: names of the catalogue, as tower or tower:n=20,top_ratio=100, and paths of scene files.
    #[arg(required = true)]
    scenes: Vec<String>,
    /// Who takes part.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Engine::Drystone, Engine::Rapier, Engine::Box3d])]
    engines: Vec<Engine>,
    /// Substeps to run besides the defaults.
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=4096))]
    substeps: Vec<u32>,
    /// Contact frequencies to run with each of the substeps, times the length of a substep; `own` is what an engine does by itself.
    #[arg(long, value_delimiter = ',', default_value = "0.125", value_parser = parse_frequency)]
    frequency: Vec<Frequency>,
    /// Threads of each engine.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=32))]
    threads: u16,
    /// How often everything is run.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    repetitions: u32,
    /// Steps; a scene says how many if this does not.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Write all rows as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
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
    fn settings(&self, dt: f32) -> Vec<Setting> {
        let mut settings: Vec<Setting> = Vec::new();
        for &engine in &self.engines {
            let asked = self
                .substeps
                .iter()
                .flat_map(|&substeps| self.frequency.iter().map(move |f| Setting { engine, substeps, frequency: f.0 }));
            for setting in std::iter::once(Setting::default_of(engine)).chain(asked) {
                if settings.iter().all(|s| s.label(dt) != setting.label(dt)) {
                    settings.push(setting);
                }
            }
        }
        settings
    }

    fn scene(&self, text: &str) -> Result<Scene> {
        let known = |name: &str| drystone::scenes::CATALOGUE.iter().any(|e| e.name == name);
        let mut scene = match text.split_once(':') {
            Some((name, parameters)) if known(name) => {
                Scene::find(name, &parameters.split(',').map(str::to_owned).collect::<Vec<_>>())?
            }
            _ => Scene::find(text, &[])?,
        };
        scene.name = text.to_owned();
        scene.steps = self.steps.unwrap_or(scene.steps);
        Ok(scene)
    }

    fn run(&self) -> Result<()> {
        let threads = usize::from(self.threads);
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(Error::input)?;
        // Every scene is read before the first is run.
        let scenes = self.scenes.iter().map(|text| self.scene(text)).collect::<Result<Vec<_>>>()?;
        let mut records = Vec::new();
        for scene in &scenes {
            let settings = self.settings(scene.dt);
            let race = Race { scene, settings: &settings, threads, repetitions: self.repetitions };
            let steps = settings.len() as u64 * u64::from(self.repetitions) * u64::from(scene.steps);
            let bar = ProgressBar::new(steps).with_style(
                ProgressStyle::with_template("{msg} {bar:40} {percent} %  {eta} left").expect("a fixed template"),
            );
            bar.set_message(scene.name.clone());
            let rows = race.run(|steps| bar.inc(steps.into()))?;
            bar.finish_and_clear();
            print_table(scene, &rows, self.threads);
            records.extend(rows.iter().map(|row| record(scene, row, self.threads)));
        }
        match &self.csv {
            Some(path) => write_csv(path, &records),
            None => Ok(()),
        }
    }
}

fn print_table(scene: &Scene, rows: &[Row], threads: u16) {
    let bodies = scene.world.dynamic_count();
    println!("{}: {bodies} dynamic bodies, {} steps, threads {threads}", scene.name, scene.steps);
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header([
        "",
        "ms a step",
        "",
        "deepest mm",
        "mean mm",
        "rms mm/s",
        "drift mm",
        "in place",
        "gap mm",
        "out",
    ]);
    for row in rows {
        let ([ms, least, greatest], score) = (row.spread(), row.score);
        let mm = |x: f64| format!("{:.3}", x * 1e3);
        table.add_row([
            row.setting.label(scene.dt),
            format!("{ms:.4}"),
            format!("({least:.4} {greatest:.4})"),
            mm(score.penetration.max),
            mm(score.penetration.mean),
            mm(score.rms_speed),
            mm(score.drift),
            format!("{}/{bodies}", score.in_place),
            mm(score.joint_gap),
            score.escaped.to_string(),
        ]);
    }
    table.column_iter_mut().skip(1).for_each(|column| column.set_cell_alignment(CellAlignment::Right));
    println!("{table}\n");
}

const COLUMNS: [&str; 18] = [
    "scene",
    "engine",
    "substeps",
    "contact_hertz",
    "threads",
    "bodies",
    "steps",
    "repetitions",
    "ms",
    "ms_least",
    "ms_greatest",
    "penetration_max_m",
    "penetration_mean_m",
    "rms_speed_m_s",
    "drift_m",
    "in_place",
    "joint_gap_m",
    "escaped",
];

fn record(scene: &Scene, row: &Row, threads: u16) -> Vec<String> {
    let (setting, score, [ms, least, greatest]) = (row.setting, row.score, row.spread());
    vec![
        scene.name.clone(),
        format!("{:?}", setting.engine).to_lowercase(),
        setting.substeps.to_string(),
        setting.hertz(scene.dt).to_string(),
        threads.to_string(),
        scene.world.dynamic_count().to_string(),
        scene.steps.to_string(),
        row.ms.len().to_string(),
        ms.to_string(),
        least.to_string(),
        greatest.to_string(),
        score.penetration.max.to_string(),
        score.penetration.mean.to_string(),
        score.rms_speed.to_string(),
        score.drift.to_string(),
        score.in_place.to_string(),
        score.joint_gap.to_string(),
        score.escaped.to_string(),
    ]
}

/// Whole or not at all: written next to the file, then moved there.
fn write_csv(path: &std::path::Path, records: &[Vec<String>]) -> Result<()> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS).map_err(Error::input)?;
    for record in records {
        writer.write_record(record).map_err(Error::input)?;
    }
    let text = writer.into_inner().map_err(Error::input)?;
    let unfinished = path.with_extension("part");
    std::fs::write(&unfinished, text).map_err(Error::file(&unfinished))?;
    std::fs::rename(&unfinished, path).map_err(Error::file(path))
}

fn main() -> ExitCode {
    match Args::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("drystone-peers: {}", e.to_string().replace(char::is_control, " "));
            e.exit_code().into()
        }
    }
}

//! `drystone bench`.

use std::path::PathBuf;

use clap::Args;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use super::output::{plain_table, print, print_json};
use super::progress::Progress;
use super::words;
use crate::files;
use crate::report::bench::{
    self, Bench, COUNTS, Change, FALLING, FALLING_QUICK, GROWTH, LIMITS, LIMITS_QUICK, Machine, QUICK, STANDARD,
    STATES, StagesRow, WORLDS, compare_with,
};
use crate::report::number::number;
use crate::settings;
use drystone::backend::{BackendChoice, choose};
use drystone::{Backend, Error, Result};

/// Measure the stage times and errors of scenes at rest, or the quantities that a flag selects.
#[derive(Args)]
pub struct BenchArgs {
    /// Scenes, as name:key=value,worlds=N; by default the standard scenes of the measurement.
    scenes: Vec<String>,
    /// Use smaller or fewer standard scenes, and fewer turns.
    #[arg(long)]
    quick: bool,
    /// Time scenes from their first step, in thirds: medians of all stages, the worst step, and the first step
    /// separately.
    #[arg(long, group = "subject")]
    falling: bool,
    /// Measure time per manifold and pass, and bytes per box, for islands of 1,000 to 1,000,000 boxes; with --quick up
    /// to 100,000.
    #[arg(long, group = "subject")]
    growth: bool,
    /// Count the steps per second of one world, in 1 to 4096 worlds; with --quick up to 256.
    #[arg(long, group = "subject")]
    worlds: bool,
    /// Measure the times to keep, restore, save and load a state, compared with a step, and the bytes per body.
    #[arg(long, group = "subject")]
    states: bool,
    /// Compare the bytes and operations of sweeps with the limits of memory (a triad) and of arithmetic (the peak).
    #[arg(long, group = "subject")]
    limits: bool,
    /// Number of steps of falling scenes.
    #[arg(long, requires = "falling", default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Number of turns of each scene; a turn is 10 steps, or one step with --states.
    #[arg(long, value_name = "N", conflicts_with_all = ["falling", "growth", "worlds"], value_parser = clap::value_parser!(u16).range(1..))]
    turns: Option<u16>,
    /// Backends that run the sweeps.
    #[arg(long, conflicts_with_all = ["growth", "worlds", "states", "limits"], value_parser = words::of::<BackendChoice>(), value_delimiter = ',', default_values = ["cpu"])]
    backend: Vec<BackendChoice>,
    /// Numbers of threads; 0 means one for each core.
    #[arg(long, value_delimiter = ',', default_values = ["0"], value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: Vec<u16>,
    /// Set any setting; can be repeated.
    #[arg(long, conflicts_with_all = ["growth", "worlds", "states", "limits"], value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Show time ratios to an earlier output of --json.
    ///
    /// Rows with a change beyond the spread are marked.
    #[arg(long, conflicts_with = "subject", value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV instead of a table.
    #[arg(long)]
    csv: bool,
}

impl BenchArgs {
    pub fn run(&self) -> Result<()> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads: Vec<_> = self.threads.iter().map(|&t| if t == 0 { cores } else { t.into() }).collect();
        let quiet = self.json || self.csv;
        let bar = |count: usize| Progress::steps(count as u32, quiet);
        if self.falling {
            let specs = self.specs(if self.quick { &FALLING_QUICK } else { &FALLING });
            let (config, steps) = (settings::awake(self.set.iter().map(String::as_str))?, self.steps as usize);
            let bar = bar(specs.len() * threads.len() * self.backend.len() * bench::turns(steps));
            self.show(&bench::falling(&specs, &config, &threads, &|| self.backends(), steps, &mut || bar.inc())?, &bar)
        } else if self.growth {
            let specs = self.specs(&GROWTH[..GROWTH.len() - usize::from(self.quick)]);
            let bar = bar(specs.len());
            self.show(&bench::growth(&specs, &threads, &mut || bar.inc())?, &bar)
        } else if self.worlds {
            let counts = &COUNTS[..COUNTS.len() - if self.quick { 2 } else { 0 }];
            let specs = self.specs(&WORLDS);
            let bar = bar(specs.len() * counts.len());
            self.show(&bench::worlds(&specs, counts, &threads, &mut || bar.inc())?, &bar)
        } else if self.states {
            let specs = self.specs(&STATES[..STATES.len() - usize::from(self.quick)]);
            let rounds = self.turns().into();
            let bar = bar(specs.len() * threads.len() * rounds);
            self.show(&bench::states(&specs, &threads, rounds, &mut || bar.inc())?, &bar)
        } else if self.limits {
            let specs = self.specs(if self.quick { &LIMITS_QUICK } else { &LIMITS });
            let turns = self.turns().into();
            let bar = bar(specs.len() * threads.len() * turns);
            self.show(&bench::limits(&specs, &threads, turns, &mut || bar.inc())?, &bar)
        } else {
            self.settled(&threads)
        }
    }

    fn specs(&self, usual: &[&str]) -> Vec<String> {
        if self.scenes.is_empty() { usual.iter().map(|&s| s.into()).collect() } else { self.scenes.clone() }
    }

    fn turns(&self) -> u16 {
        self.turns.unwrap_or(if self.quick { 3 } else { 9 })
    }

    fn backends(&self) -> Result<Vec<Box<dyn Backend>>> {
        // Only `auto` uses the number of bodies.
        self.backend.iter().map(|&b| Ok(choose(b, 0, false)?.0)).collect()
    }

    fn settled(&self, threads: &[usize]) -> Result<()> {
        let config = settings::awake(self.set.iter().map(String::as_str))?;
        // Refuse a bad file before the measurement, which takes minutes.
        let baseline = self.baseline.as_deref().map(Bench::read).transpose()?;
        let specs = self.specs(if self.quick { &QUICK } else { &STANDARD });
        let turns = self.turns();
        let bar = Progress::steps(specs.len() as u32 * (1 + u32::from(turns)), self.json || self.csv);
        let now = bench::bench(&specs, &config, threads, &|| self.backends(), turns.into(), &mut || bar.inc())?;
        bar.finish();
        if self.json {
            return print_json(&now);
        }
        if self.csv {
            return print(String::from_utf8_lossy(&files::csv(&now.rows)?).trim_end());
        }
        let changes = baseline.map(|then| compare_with(&now, &then));
        print(now.machine.line())?;
        print(table(&now.rows, changes.as_deref()))?;
        match changes {
            Some(changes) => {
                let slower = changes.iter().filter(|c| matches!(c, Change::Slower(_))).count();
                print(format_args!("{slower} of {} rows slower beyond the spread", changes.len()))
            }
            None => Ok(()),
        }
    }

    /// Prints rows in the requested form. The table has the columns of the CSV.
    fn show(&self, rows: &[impl Serialize], bar: &Progress) -> Result<()> {
        bar.finish();
        let machine = Machine::this();
        if self.json {
            return print_json(&serde_json::json!({"machine": machine, "rows": rows}));
        }
        let text = files::csv(rows)?;
        if self.csv {
            return print(String::from_utf8_lossy(&text).trim_end());
        }
        print(machine.line())?;
        let mut lines = csv::ReaderBuilder::new().has_headers(false).from_reader(&text[..]).into_records();
        let mut next = || lines.next().transpose().map_err(|e| Error::input(format!("a row as CSV: {e}")));
        let mut table = plain_table();
        table.set_header(next()?.unwrap_or_default().iter());
        while let Some(line) = next()? {
            table.add_row(line.iter().map(|cell| match cell.parse::<f64>() {
                Ok(x) if cell.contains('.') => number(x),
                _ => cell.to_owned(),
            }));
        }
        for column in table.column_iter_mut() {
            column.set_cell_alignment(CellAlignment::Right);
            column.set_padding((0, 1));
        }
        print(table)
    }
}

fn table(rows: &[StagesRow], changes: Option<&[Change]>) -> Table {
    let mut table = plain_table();
    let usual =
        "scene,backend,threads,bodies,manifolds,ms,quartiles,detect,color,prepare,run,store,overlap mm,residual,hash";
    let header: Vec<_> = usual.split(',').chain(changes.map(|_| "to baseline")).collect();
    table.set_header(&header);
    for (i, row) in rows.iter().enumerate() {
        let ms = |x: f64| format!("{x:.3}");
        let mut cells = vec![
            [&row.scene, " ", &row.settings].concat().trim_end().to_owned(),
            row.backend.clone(),
            row.threads.to_string(),
            row.bodies.to_string(),
            row.manifolds.to_string(),
            ms(row.ms),
            format!("{:.3}-{:.3}", row.ms_low, row.ms_high),
        ];
        cells.extend([row.detect, row.color, row.prepare, row.run, row.store].map(ms));
        cells.push(format!("{:.3}/{:.4}", row.penetration_max * 1e3, row.penetration_mean * 1e3));
        cells.push(row.residual.map_or("-".into(), |r| format!("{r:.1e}")));
        cells.push(row.hash.chars().take(8).collect());
        cells.extend(changes.map(|changes| match changes[i] {
            Change::New => "new".into(),
            Change::OtherScene => "another scene".into(),
            Change::OtherMachine => "another machine".into(),
            Change::Same(ratio) => format!("{ratio:.2}"),
            Change::Slower(ratio) => format!("{ratio:.2} SLOWER"),
            Change::Faster(ratio) => format!("{ratio:.2} faster"),
        }));
        table.add_row(cells);
    }
    for (column, name) in table.column_iter_mut().zip(header) {
        let text = ["scene", "backend", "hash", "to baseline"].contains(&name);
        column.set_cell_alignment(if text { CellAlignment::Left } else { CellAlignment::Right });
        column.set_padding((0, 1));
    }
    table
}

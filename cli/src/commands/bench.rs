//! `drystone bench`.

use std::path::PathBuf;

use clap::Args;
use comfy_table::{CellAlignment, Table};

use super::output::{plain_table, print, print_json};
use super::progress::Progress;
use super::words;
use crate::files;
use crate::report::bench::{Bench, Change, Machine, QUICK, STANDARD, StagesRow, bench, compare_with, limits};
use crate::settings;
use drystone::backend::{BackendChoice, choose};
use drystone::{Backend, Result};

#[derive(Args)]
pub struct BenchArgs {
    /// Scenes, as name:key=value,worlds=N; without any, the standard scenes.
    scenes: Vec<String>,
    /// Use smaller standard scenes and fewer turns.
    #[arg(long)]
    quick: bool,
    /// Compare sweeps of a pile with the limits of memory and arithmetic.
    #[arg(long, conflicts_with_all = ["scenes", "quick", "set", "baseline", "csv", "backend"])]
    limits: bool,
    /// Turns of each scene; a turn is 10 steps.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    turns: Option<u16>,
    /// Backends that run the sweeps.
    #[arg(long, value_parser = words::of::<BackendChoice>(), value_delimiter = ',', default_values = ["cpu"])]
    backend: Vec<BackendChoice>,
    /// Numbers of threads; 0 means one per core.
    #[arg(long, value_delimiter = ',', default_values = ["0"], value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: Vec<u16>,
    /// Any setting; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Show time ratios to an earlier output of --json.
    ///
    /// Rows that are slower or faster beyond the spread are marked.
    #[arg(long, value_name = "FILE")]
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
        if self.limits {
            return self.print_limits(&threads);
        }
        let config = settings::awake(self.set.iter().map(String::as_str))?;
        // A bad file is refused before the measurement, which takes minutes.
        let baseline = self.baseline.as_deref().map(Bench::read).transpose()?;
        let usual = if self.quick { &QUICK[..] } else { &STANDARD[..] };
        let specs =
            if self.scenes.is_empty() { usual.iter().map(|&s| s.into()).collect() } else { self.scenes.clone() };
        let turns = self.turns.unwrap_or(if self.quick { 3 } else { 9 });
        let open = || -> Result<Vec<Box<dyn Backend>>> {
            // Only `auto` uses the number of bodies.
            self.backend.iter().map(|&b| Ok(choose(b, 0, false)?.0)).collect()
        };
        let bar = Progress::steps(specs.len() as u32 * (1 + u32::from(turns)), self.json || self.csv);
        let now = bench(&specs, &config, &threads, &open, turns.into(), &mut || bar.inc())?;
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

    fn print_limits(&self, threads: &[usize]) -> Result<()> {
        let turns = self.turns.unwrap_or(9);
        let bar = Progress::steps(threads.len() as u32 * u32::from(turns), self.json);
        let rows = limits(15_000, threads, turns.into(), &mut || bar.inc())?;
        bar.finish();
        let machine = Machine::this();
        if self.json {
            return print_json(&serde_json::json!({"machine": machine, "rows": rows}));
        }
        print(machine.line())?;
        let alone = rows.first().map_or(f64::NAN, |r| r.sweeps / r.threads as f64);
        for row in &rows {
            print(format_args!(
                "{} threads: {:.1} million contact points swept a second, {:.2} times one; {:.0} operations each: {:.0} % of {:.1} G/s",
                row.threads,
                row.sweeps * 1e-6,
                row.sweeps / alone,
                row.operations,
                100.0 * row.of_peak(),
                row.peak * 1e-9
            ))?;
            for &(size, rate) in &row.triads {
                let (mib, share) = (size as f64 / f64::from(1 << 20), 100.0 * row.of_triad(rate));
                print(format_args!(
                    "    triad over {mib:.2} MiB: {:.1} GB/s, their stream is {share:.0} % of it",
                    rate * 1e-9
                ))?;
            }
        }
        Ok(())
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

//! `drystone soak`.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::hard::line;
use super::output::{print, replacing};
use super::progress::Progress;
use super::scene::set_threads;
use crate::files::{self, Draft};
use crate::hard::passes;
use crate::soak::{NAMES, ROWS, Row, Soaked, WORLDS, judge};
use drystone::backend::BackendChoice;
use drystone::{Error, Result};

#[derive(Args)]
pub struct SoakArgs {
    /// A world of --list, a scene of the catalogue as NAME:KEY=VALUE,..., or a scene file; by default the worlds of
    /// --list.
    scene: Vec<String>,
    /// Number of steps of each world.
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(i64::from(ROWS)..))]
    steps: u32,
    /// Write rows as CSV, each when it is measured. They remain if the run is interrupted.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Judge the rows of a file, and run nothing.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scene", "steps", "out"])]
    rows: Option<PathBuf>,
    /// List the worlds without running them.
    #[arg(long)]
    list: bool,
}

/// Rows that are written one by one. The file has only complete rows at any time.
struct Rows {
    path: PathBuf,
    /// `None` before the first row: until then, an older file stays.
    file: Option<File>,
    /// Size of all complete rows (bytes).
    length: u64,
}

impl Rows {
    /// Refuses a path that cannot be written.
    fn check(path: &Path) -> Result<Self> {
        Draft::of(path)?.create()?;
        Ok(Self { path: path.into(), file: None, length: 0 })
    }

    fn write(&mut self, row: &Row) -> Result<()> {
        let mut text = csv::WriterBuilder::new().has_headers(self.file.is_none()).from_writer(Vec::new());
        text.serialize(row).map_err(|e| Error::file(&self.path)(e.into()))?;
        let text = text.into_inner().map_err(|e| Error::file(&self.path)(e.into_error()))?;
        let open = || replacing(&self.path, || File::create(&self.path).map_err(Error::file(&self.path)));
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(open()?),
        };
        files::note_rows(&self.path);
        if let Err(error) = file.write_all(&text) {
            // Remove an incomplete row. The length of a device cannot be set.
            let _ = file.set_len(self.length);
            return Err(Error::file(&self.path)(error));
        }
        self.length += text.len() as u64;
        Ok(())
    }
}

impl SoakArgs {
    pub fn run(&self) -> Result<()> {
        if self.list {
            return WORLDS.iter().try_for_each(|(name, summary)| print(format_args!("{name:<10}  {summary}")));
        }
        let all = match &self.rows {
            Some(path) => by_scene(files::rows(path)?),
            None => self.measure()?,
        };
        let mut failed = Vec::new();
        for rows in &all {
            let name = &rows[0].scene;
            let checks = judge(rows)?;
            print(format_args!("{name}, {} steps", rows[rows.len() - 1].step))?;
            checks.iter().try_for_each(|check| print(line(check)))?;
            if !passes(&checks) {
                failed.push(name.as_str());
            }
        }
        if all.is_empty() || !failed.is_empty() {
            return Err(Error::input(format!(
                "not level: {}",
                if all.is_empty() { "no rows".into() } else { failed.join(", ") }
            )));
        }
        print(format_args!("{} of {} worlds are level", all.len(), all.len()))
    }

    /// The rows of each world.
    fn measure(&self) -> Result<Vec<Vec<Row>>> {
        set_threads(1, BackendChoice::default());
        let names: Vec<&str> =
            if self.scene.is_empty() { NAMES.into() } else { self.scene.iter().map(String::as_str).collect() };
        // Refuse an unknown name before anything runs.
        names.iter().try_for_each(|name| Soaked::new(name).map(drop))?;
        let mut out = self.out.as_deref().map(Rows::check).transpose()?;
        let bar = Progress::new("row", u64::from(ROWS) * names.len() as u64, false);
        let mut all = Vec::new();
        for name in names {
            bar.set_message(name);
            let (mut soaked, mut rows) = (Soaked::new(name)?, Vec::new());
            for k in 0..ROWS {
                let ends = |k: u32| (u64::from(self.steps) * u64::from(k) / u64::from(ROWS)) as u32;
                let row = soaked.go(ends(k + 1) - ends(k))?;
                out.iter_mut().try_for_each(|out| out.write(&row))?;
                rows.push(row);
                bar.inc();
            }
            all.push(rows);
        }
        bar.finish();
        Ok(all)
    }
}

/// The rows of each world, in the order of the file.
fn by_scene(rows: Vec<Row>) -> Vec<Vec<Row>> {
    rows.chunk_by(|a, b| a.scene == b.scene).map(<[Row]>::to_vec).collect()
}

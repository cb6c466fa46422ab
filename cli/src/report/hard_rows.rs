//! Hard cases as rows, so that several machines can run them and a stopped run can continue.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::comparison::Origin;
use super::shard::{Measured, gathered, last_run, missing};
use crate::files;
use crate::hard::{Case, Check, Limit, Setup};
use drystone::{Error, Result};

/// One check of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HardRow {
    pub case: String,
    /// Hash of the case, the settings and the backend.
    pub hash: String,
    /// As in [`Row`](super::comparison::Row).
    pub run: String,
    pub build: String,
    pub commit: String,
    pub machine: String,
    pub threads: usize,
    pub what: String,
    pub value: f64,
    /// Whether the limit is the smallest value that passes; otherwise it is the largest.
    pub at_least: bool,
    pub limit: f64,
    pub passed: bool,
}

impl Measured for HardRow {
    const FIRST: &'static str = "case";

    fn program(&self) -> [&str; 2] {
        [&self.build, &self.commit]
    }

    fn run(&self) -> [&str; 2] {
        [&self.run, &self.machine]
    }
}

impl HardRow {
    fn of(check: &Check, case: &Case, hash: &str, run: &str, origin: &Origin) -> Self {
        let (at_least, limit) = match check.limit {
            Limit::AtMost(limit) => (false, limit),
            Limit::AtLeast(limit) => (true, limit),
        };
        let Origin { build, commit, machine, threads } = origin.clone();
        let [case, hash, run] = [case.name, hash, run].map(str::to_owned);
        let what = check.what.clone();
        Self {
            case,
            hash,
            run,
            build,
            commit,
            machine,
            threads,
            what,
            value: check.value,
            at_least,
            limit,
            passed: check.passed,
        }
    }

    fn check(&self) -> Check {
        let limit = if self.at_least { Limit::AtLeast(self.limit) } else { Limit::AtMost(self.limit) };
        Check { what: self.what.clone(), value: self.value, limit, passed: self.passed }
    }
}

/// The checks of cases with one setup. Some of them can already have rows.
pub struct HardRows {
    /// The file that gets the rows of each case after its run.
    out: Option<PathBuf>,
    rows: Vec<HardRow>,
    /// The part of the hashes that is the same for all cases of this setup.
    setup: String,
    origin: Origin,
}

impl HardRows {
    /// The rows of a file for a backend name; empty if the file is missing.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn open(out: Option<&Path>, setup: &Setup, backend: &str) -> Result<Self> {
        let rows = out.filter(|path| path.is_file()).map_or(Ok(Vec::new()), files::rows)?;
        let config = serde_json::to_string(&setup.config).expect("settings serialize");
        // Only rows that go to a file need the hash of the program file.
        let origin = out.map_or_else(Origin::default, |_| Origin::here(None));
        Ok(Self { out: out.map(Path::to_owned), rows, setup: format!("{config} {backend}"), origin })
    }

    fn hash(&self, case: &Case) -> String {
        super::comparison::fnv(format!("{} {} {}", case.name, case.summary, self.setup).as_bytes())
    }

    /// The checks of a case, from rows that the same program measured on this machine, or from a run.
    ///
    /// # Errors
    /// The case cannot run, or its rows cannot be written.
    pub fn run(&mut self, case: &Case, setup: &Setup) -> Result<Vec<Check>> {
        let hash = self.hash(case);
        let Origin { build, machine, .. } = &self.origin;
        let own = |row: &&HardRow| row.hash == hash && row.build == *build && row.machine == *machine;
        if let Some(last) = self.rows.iter().rfind(own) {
            return Ok(self.rows.iter().filter(own).filter(|row| row.run == last.run).map(HardRow::check).collect());
        }
        let (run, checks) = (Origin::now(), case.run(setup)?);
        self.rows.extend(checks.iter().map(|check| HardRow::of(check, case, &hash, &run, &self.origin)));
        self.write()?;
        Ok(checks)
    }

    fn write(&self) -> Result<()> {
        let Some(path) = &self.out else { return Ok(()) };
        files::write(path, &files::csv(&self.rows)?)?;
        files::note_resumed(path);
        Ok(())
    }

    /// The checks of all cases, from files of rows of any machines. Writes these rows to the file.
    ///
    /// # Errors
    /// A case has no rows; rows come from different programs; a file cannot be read or written.
    pub fn merge(&mut self, cases: &[&Case], sources: &[PathBuf]) -> Result<Vec<Vec<Check>>> {
        let rows = gathered::<HardRow>(sources, "hard.csv")?;
        let (mut all, mut without) = (Vec::new(), Vec::new());
        self.rows.clear();
        for case in cases {
            let hash = self.hash(case);
            let last = last_run(rows.iter().filter(|row| row.hash == hash));
            if last.is_empty() {
                without.push(case.name);
            }
            all.push(last.iter().map(HardRow::check).collect());
            self.rows.extend(last);
        }
        if rows.is_empty() {
            return Err(Error::input("--merge: no rows of hard cases in these files"));
        }
        missing(&without)?;
        self.write()?;
        Ok(all)
    }
}

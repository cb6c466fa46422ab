//! Hard cases and worlds of families as rows, so that several machines can run them and a stopped run can continue.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::comparison::Origin;
use super::shard::{Measured, gathered, last_run, missing};
use crate::files;
use crate::hard::families::{Judged, judge_all};
use crate::hard::{Case, Check, Limit, Setup};
use drystone::{Error, Result};
use drystone_scenes::Family;

/// Longest time between two writes of the rows of worlds, of which thousands end in a minute.
const WRITE_EVERY: Duration = Duration::from_secs(5);

/// One check of a case, or of a world of a family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HardRow {
    /// Name of the case, or the world as `drystone run` takes it.
    pub case: String,
    /// Hash of the case or world, the settings and the backend.
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
    /// The times of [`Judged`]; empty for a case.
    #[serde(default)]
    pub ms: Option<f64>,
    #[serde(default)]
    pub seconds: Option<f64>,
}

/// A case, or a world of a family, with the law that it is checked against.
struct Item {
    name: String,
    summary: &'static str,
}

impl Item {
    fn case(case: &Case) -> Self {
        Self { name: case.name.to_owned(), summary: case.summary }
    }

    fn world(&(family, seed): &(Family, u64)) -> Self {
        Self { name: family.spec(seed), summary: family.summary() }
    }
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
    fn of(check: &Check, item: &Item, hash: &str, run: &str, times: Option<[f64; 2]>, origin: &Origin) -> Self {
        let (at_least, limit) = match check.limit {
            Limit::AtMost(limit) => (false, limit),
            Limit::AtLeast(limit) => (true, limit),
        };
        let Origin { build, commit, machine, threads } = origin.clone();
        let [case, hash, run] = [&item.name, hash, run].map(str::to_owned);
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
            ms: times.map(|[ms, _]| ms),
            seconds: times.map(|[_, seconds]| seconds),
        }
    }

    fn check(&self) -> Check {
        let limit = if self.at_least { Limit::AtLeast(self.limit) } else { Limit::AtMost(self.limit) };
        Check { what: self.what.clone(), value: self.value, limit, passed: self.passed }
    }
}

/// The result of a world from its rows.
fn judged(seed: u64, rows: &[HardRow]) -> Judged {
    let time = |of: fn(&HardRow) -> Option<f64>| rows.first().and_then(of).unwrap_or(f64::NAN);
    let checks = rows.iter().map(HardRow::check).collect();
    Judged { seed, checks, ms: time(|row| row.ms), seconds: time(|row| row.seconds) }
}

/// The checks of cases or worlds with one setup. Some of them can already have rows.
pub struct HardRows {
    /// The file that gets the rows.
    out: Option<PathBuf>,
    rows: Vec<HardRow>,
    /// The part of the hashes that is the same for all items of this setup.
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

    fn hash(&self, item: &Item) -> String {
        super::comparison::fnv(format!("{} {} {}", item.name, item.summary, self.setup).as_bytes())
    }

    /// The rows that the same program measured on this machine in the last run of an item; empty if there are none.
    fn known(&self, item: &Item) -> Vec<HardRow> {
        let (hash, Origin { build, machine, .. }) = (self.hash(item), &self.origin);
        last_run(self.rows.iter().filter(|row| row.hash == hash && row.build == *build && row.machine == *machine))
    }

    fn add(&mut self, item: &Item, run: &str, times: Option<[f64; 2]>, checks: &[Check]) {
        let hash = self.hash(item);
        self.rows.extend(checks.iter().map(|check| HardRow::of(check, item, &hash, run, times, &self.origin)));
    }

    /// The checks of a case, from rows that the same program measured on this machine, or from a run.
    ///
    /// # Errors
    /// The case cannot run, or its rows cannot be written.
    pub fn run(&mut self, case: &Case, setup: &Setup) -> Result<Vec<Check>> {
        let item = Item::case(case);
        let known = self.known(&item);
        if !known.is_empty() {
            return Ok(known.iter().map(HardRow::check).collect());
        }
        let (run, checks) = (Origin::now(), case.run(setup)?);
        self.add(&item, &run, None, &checks);
        self.write()?;
        Ok(checks)
    }

    /// The results of worlds, likewise. It calls `done` after each world.
    ///
    /// # Errors
    /// A world cannot run, or rows cannot be written. The rows of worlds that ended are kept.
    pub fn judge(
        &mut self,
        worlds: &[(Family, u64)],
        setup: &Setup,
        done: impl Fn() + Sync,
    ) -> Result<Vec<(Family, Judged)>> {
        let (mut all, mut rest) = (Vec::new(), Vec::new());
        for world in worlds {
            let known = self.known(&Item::world(world));
            if known.is_empty() {
                rest.push(*world);
            } else {
                all.push((world.0, judged(world.1, &known)));
                done();
            }
        }
        let run = Origin::now();
        let rows = Mutex::new((self, Instant::now()));
        let ran = judge_all(&rest, setup, |family, world| {
            let (rows, written) = &mut *rows.lock().expect("no panic");
            rows.add(&Item::world(&(family, world.seed)), &run, Some([world.ms, world.seconds]), &world.checks);
            done();
            if written.elapsed() < WRITE_EVERY {
                return Ok(());
            }
            *written = Instant::now();
            rows.write()
        });
        rows.into_inner().expect("no panic").0.write()?;
        all.extend(ran?);
        Ok(all)
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
        let items: Vec<_> = cases.iter().map(|case| Item::case(case)).collect();
        let merged = self.merge_items(&items, sources)?;
        Ok(merged.iter().map(|rows| rows.iter().map(HardRow::check).collect()).collect())
    }

    /// The results of all worlds, likewise.
    ///
    /// # Errors
    /// As in [`HardRows::merge`].
    pub fn merge_worlds(&mut self, worlds: &[(Family, u64)], sources: &[PathBuf]) -> Result<Vec<(Family, Judged)>> {
        let items: Vec<_> = worlds.iter().map(Item::world).collect();
        let merged = self.merge_items(&items, sources)?;
        Ok(worlds.iter().zip(&merged).map(|(&(family, seed), rows)| (family, judged(seed, rows))).collect())
    }

    fn merge_items(&mut self, items: &[Item], sources: &[PathBuf]) -> Result<Vec<Vec<HardRow>>> {
        let mut by_hash: HashMap<String, Vec<HardRow>> = HashMap::new();
        for row in gathered::<HardRow>(sources, "hard.csv")? {
            by_hash.entry(row.hash.clone()).or_default().push(row);
        }
        if by_hash.is_empty() {
            return Err(Error::input("--merge: no rows of hard cases or families in these files"));
        }
        let of = |item: &Item| by_hash.get(&self.hash(item)).map_or(Vec::new(), |rows| last_run(rows.iter()));
        let merged: Vec<_> = items.iter().map(of).collect();
        let without: Vec<_> = items.iter().zip(&merged).filter(|(_, rows)| rows.is_empty()).collect();
        missing(&without.iter().map(|(item, _)| item.name.as_str()).collect::<Vec<_>>())?;
        self.rows = merged.concat();
        self.write()?;
        Ok(merged)
    }
}

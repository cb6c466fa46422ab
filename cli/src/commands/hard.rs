//! `drystone hard`.

use std::path::PathBuf;
use std::sync::Mutex;

use clap::Args;
use serde_json::json;

use super::output::{print, print_json};
use super::progress::Progress;
use super::words;
use crate::hard::families::{self, FamilyShare, Judged};
use crate::hard::{Case, Check, Limit, Setup, passes};
use crate::report::hard_rows::HardRows;
use crate::report::{Shard, hard_cases, hard_families};
use crate::settings;
use drystone::backend::BackendKind;
use drystone::preset::Preset;
use drystone::{Result, SolverConfig};
use drystone_scenes::Family;

#[derive(Args)]
pub struct HardArgs {
    /// Run this case, such as H3, instead of all cases; can be repeated.
    #[arg(long, value_name = "NAME")]
    case: Vec<String>,
    /// Preset of the settings.
    #[arg(long, value_parser = words::of::<Preset>(), default_value_t)]
    preset: Preset,
    /// Set any setting; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Backend that runs the sweeps.
    #[arg(long, value_parser = words::of::<BackendKind>(), default_value = "cpu")]
    backend: BackendKind,
    /// Judge N random worlds of each family instead of the cases.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(conflicts_with_all = ["case", "short"])]
    families: Option<u32>,
    /// Judge only this family; can be repeated.
    #[arg(long, value_name = "NAME", value_parser = words::of::<Family>(), requires = "families")]
    family: Vec<Family>,
    /// Seed of the first world of each family; the next ones follow.
    #[arg(long, value_name = "S", default_value_t = 1, requires = "families")]
    seed: u64,
    /// Skip the cases that take minutes.
    #[arg(long)]
    short: bool,
    /// List the cases without running them.
    #[arg(long)]
    list: bool,
    /// Write the page of all cases, or of all families, into this directory.
    ///
    /// The page of cases has every preset on the CPU, and `balanced` on every backend. The page of families has the
    /// presets up to `accurate`.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["case", "set", "json", "out", "shard", "merge"])]
    page: Option<PathBuf>,
    /// Write the checks as CSV. An interrupted run continues after the cases or worlds in FILE.
    ///
    /// Each case is written when it ends, and the worlds of families every five seconds.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Run part I of N of the cases, or of the worlds of all families.
    #[arg(long, value_name = "I/N", requires = "out")]
    shard: Option<Shard>,
    /// Read the checks from --out files of shards with the same arguments, from any machines, and run nothing.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "shard")]
    merge: Vec<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl HardArgs {
    pub fn run(&self) -> Result<()> {
        if let Some(count) = self.families {
            return self.run_families(count);
        }
        let cases: Vec<&Case> = match &self.case[..] {
            [] => Case::ALL.iter().filter(|c| !(self.short && c.long)).collect(),
            names => names.iter().map(|name| Case::find(name)).collect::<Result<_>>()?,
        };
        if self.list {
            return cases.iter().try_for_each(|c| print(format_args!("{:<10}  {}", c.name, c.summary)));
        }
        if let Some(directory) = &self.page {
            let bar = Progress::new("case", hard_cases::count(&cases), false);
            let page = hard_cases::page(&cases, |what| {
                bar.set_message(what);
                bar.inc();
            })?;
            bar.finish();
            let path = directory.join("hard-cases.md");
            crate::files::write(&path, page.as_bytes())?;
            return print(path.display());
        }
        let setup = Setup { config: self.config()?, open: &|| self.backend.open(false) };
        let mut rows = HardRows::open(self.out.as_deref(), &setup, &self.backend.to_string())?;
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        let merged = if self.merge.is_empty() { None } else { Some(rows.merge(&cases, &self.merge)?) };
        let mut all = Vec::new();
        for (k, case) in cases.into_iter().enumerate().filter(|(k, _)| shard.has(*k)) {
            let checks = match &merged {
                Some(merged) => merged[k].clone(),
                None => rows.run(case, &setup)?,
            };
            if !self.json {
                print(format_args!("{}  {}", case.name, case.summary))?;
                checks.iter().try_for_each(|c| print(line(c)))?;
            }
            all.push((case, checks));
        }
        if self.json {
            let cases: Vec<_> = all.iter().map(|(case, checks)| json!({"case": case.name, "summary": case.summary, "passed": passes(checks), "checks": checks})).collect();
            return print_json(
                &json!({"preset": self.preset, "backend": self.backend, "config": setup.config, "cases": cases}),
            );
        }
        print(format_args!("{} of {} cases pass", all.iter().filter(|(_, checks)| passes(checks)).count(), all.len()))
    }

    fn config(&self) -> Result<SolverConfig> {
        let mut config = self.preset.config().without_sleep();
        self.set.iter().try_for_each(|assignment| settings::set(&mut config, assignment))?;
        config.check()?;
        Ok(config)
    }

    fn run_families(&self, count: u32) -> Result<()> {
        let families = if self.family.is_empty() { Family::ALL.to_vec() } else { self.family.clone() };
        if self.list {
            return families
                .iter()
                .try_for_each(|family| print(format_args!("{:<14}  {}", family.name(), family.summary())));
        }
        let seeds = families::seeds(self.seed, count)?;
        let worlds = families.iter().flat_map(|&family| seeds.iter().map(move |&seed| (family, seed)));
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        let worlds: Vec<_> = worlds.enumerate().filter(|(k, _)| shard.has(*k)).map(|(_, world)| world).collect();
        let judge = |rows: &mut HardRows, setup: &Setup, what: &str| {
            let bar = Mutex::new(Progress::new("world", worlds.len() as u64, false));
            bar.lock().expect("no panic").set_message(what);
            let judged = rows.judge(&worlds, setup, || bar.lock().expect("no panic").inc())?;
            bar.into_inner().expect("no panic").finish();
            Ok(judged)
        };
        if let Some(directory) = &self.page {
            let page = hard_families::page(&seeds, |preset| {
                let setup = Setup { config: preset.config().without_sleep(), open: &|| self.backend.open(false) };
                let mut rows = HardRows::open(None, &setup, &self.backend.to_string())?;
                Ok(families::shares(&families, &judge(&mut rows, &setup, preset.name())?))
            })?;
            let path = directory.join("families.md");
            crate::files::write(&path, page.as_bytes())?;
            return print(path.display());
        }
        let setup = Setup { config: self.config()?, open: &|| self.backend.open(false) };
        let mut rows = HardRows::open(self.out.as_deref(), &setup, &self.backend.to_string())?;
        let judged = match &self.merge[..] {
            [] => judge(&mut rows, &setup, self.preset.name())?,
            files => rows.merge_worlds(&worlds, files)?,
        };
        let shares = families::shares(&families, &judged);
        if self.json {
            let world = |family: Family, world: &Judged| json!({"seed": world.seed, "scene": family.spec(world.seed), "passed": passes(&world.checks), "ms": world.ms, "checks": world.checks});
            let families = shares.iter().map(|share| {
                let FamilyShare { family, worlds } = share;
                let worlds: Vec<_> = worlds.iter().map(|one| world(*family, one)).collect();
                json!({"family": family.name(), "summary": family.summary(), "count": worlds.len(), "passed": share.passed(),
                    "share": share.share(), "interval": share.interval(), "ms": share.ms(), "worlds": worlds})
            });
            let families: Vec<_> = families.collect();
            return print_json(
                &json!({"preset": self.preset, "backend": self.backend, "config": setup.config, "seed": self.seed, "families": families}),
            );
        }
        for share in &shares {
            print(format_args!("{}  {}", share.family, share.family.summary()))?;
            let [least, most] = share.interval().map(|x| 100.0 * x);
            let (passed, count, percent) = (share.passed(), share.worlds.len(), 100.0 * share.share());
            let us = 1e3 * share.ms();
            print(format_args!(
                "  {passed} of {count} pass: {percent:.1} %, {least:.1} to {most:.1} % with 95 % confidence; {us:.2} us a step and body"
            ))?;
            for world in share.failures() {
                print(format_args!("  drystone run {} --no-sleep", share.family.spec(world.seed)))?;
                world
                    .checks
                    .iter()
                    .filter(|check| !check.passed)
                    .try_for_each(|check| print(format_args!("  {}", line(check))))?;
            }
        }
        Ok(())
    }
}

/// `pass  what  value  (at most limit)`.
pub(super) fn line(check: &Check) -> String {
    let verdict = if check.passed { "pass" } else { "FAIL" };
    let limit = match check.limit {
        Limit::AtMost(limit) => format!("at most {limit}"),
        Limit::AtLeast(limit) => format!("at least {limit}"),
    };
    format!("  {verdict}  {}: {} ({limit})", check.what, hard_cases::number(check.value))
}

//! `drystone hard`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::output::{print, print_json};
use super::progress::Progress;
use super::words;
use crate::hard::{Case, Check, Limit, Setup, passes};
use crate::report::hard_rows::HardRows;
use crate::report::{Shard, hard_cases};
use crate::settings;
use drystone::Result;
use drystone::backend::BackendKind;
use drystone::preset::Preset;

#[derive(Args)]
pub struct HardArgs {
    /// Run this case, such as H3, instead of all; may be given several times.
    #[arg(long, value_name = "NAME")]
    case: Vec<String>,
    /// Preset of the settings.
    #[arg(long, value_parser = words::of::<Preset>(), default_value_t)]
    preset: Preset,
    /// Any setting; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Backend that runs the sweeps.
    #[arg(long, value_parser = words::of::<BackendKind>(), default_value = "cpu")]
    backend: BackendKind,
    /// Leave out the cases that take minutes.
    #[arg(long)]
    short: bool,
    /// List the cases without running them.
    #[arg(long)]
    list: bool,
    /// Write the page of all cases into this directory.
    ///
    /// The page has every preset on the CPU, and `balanced` on every backend.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["case", "set", "json", "out", "shard", "merge"])]
    page: Option<PathBuf>,
    /// Write the checks as CSV, those of a case as soon as it ran. A stopped run goes on after the cases in FILE.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Run part I of N of the cases.
    #[arg(long, value_name = "I/N", requires = "out")]
    shard: Option<Shard>,
    /// Take the checks from files of --out that shards wrote, with the same arguments, on machines of any kind, and run nothing.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "shard")]
    merge: Vec<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl HardArgs {
    pub fn run(&self) -> Result<()> {
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
        let mut config = self.preset.config().without_sleep();
        self.set.iter().try_for_each(|assignment| settings::set(&mut config, assignment))?;
        config.check()?;
        let setup = Setup { config, open: &|| self.backend.open(false) };
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

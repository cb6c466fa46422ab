//! `drystone conform`.

use std::path::PathBuf;

use clap::Args;

use super::output::{print, replacing, say};
use super::scene::OUTPUT;
use super::words;
use crate::files;
use crate::report::junit;
use drystone::Result;
use drystone::backend::gpu::{Faults, GpuOptions};
use drystone_conform::{Check, ConformOptions, Conformance, Group, Mode, Verdict, conform, one_percent_off};
use serde_json::{Value, json};

/// Check an adapter and its driver.
///
/// Prints one line for each check: verdict, mode, group, name, and measurement. The exit code is 0 if every check
/// passed, 1 if one failed, 2 for bad arguments or a file that cannot be written, and 3 if there is no such adapter.
#[derive(Args)]
pub struct ConformArgs {
    /// Check the first adapter whose name, API or driver contains this text; `drystone adapters` lists them.
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    adapter: String,
    /// Check only exact shaders.
    #[arg(long, conflicts_with = "plain")]
    exact: bool,
    /// Check only exact shaders in guarded WGSL, as on adapters that do not accept SPIR-V.
    #[arg(long, conflicts_with_all = ["exact", "plain"])]
    guarded: bool,
    /// Check only plain WGSL.
    #[arg(long)]
    plain: bool,
    /// Check only these groups.
    #[arg(long, value_name = "GROUP", value_parser = words::of::<Group>(), value_delimiter = ',', num_args = 1..)]
    group: Vec<Group>,
    /// Run only checks whose name contains one of these texts.
    #[arg(long, value_name = "TEXT", value_delimiter = ',', num_args = 1..)]
    name: Vec<String>,
    /// Change kernel arithmetic by one percent, to show that the checks detect it.
    #[arg(long)]
    perturb: bool,
    /// Check fewer variants of kernels and fewer steps of scenes.
    #[arg(long)]
    short: bool,
    /// Write a report in JUnit XML.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    junit: Option<PathBuf>,
    /// Write a report in JSON.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    json: Option<PathBuf>,
}

impl ConformArgs {
    /// Returns whether every check passed.
    pub fn run(&self) -> Result<bool> {
        let all = ConformOptions::default();
        let shader = self.perturb.then_some(one_percent_off as fn(&str, String) -> String);
        let faults = Faults { shader, ..Faults::default() };
        let options = ConformOptions {
            gpu: GpuOptions { name: self.adapter.clone(), guarded: self.guarded, faults, ..GpuOptions::default() },
            modes: match (self.exact || self.guarded, self.plain) {
                (true, _) => vec![Mode::Exact],
                (_, true) => vec![Mode::Plain],
                _ => all.modes,
            },
            groups: if self.group.is_empty() { all.groups } else { self.group.clone() },
            names: self.name.clone(),
            short: self.short,
        };
        let mut printed = Ok(());
        let found = conform(&options, &mut |check| {
            if printed.is_ok() {
                printed = print(line(check));
            }
        })?;
        if let Some(path) = &self.junit {
            replacing(path, || files::write(path, junit::text(&found).as_bytes()))?;
        }
        if let Some(path) = &self.json {
            let text = serde_json::to_string_pretty(&as_json(&found)).expect("a report serializes");
            replacing(path, || files::write(path, text.as_bytes()))?;
        }
        printed?;
        let [passed, failed] = Verdict::ALL.map(|verdict| found.count(verdict));
        say(format_args!("{}: {passed} passed, {failed} failed", found.adapter));
        Ok(failed == 0)
    }
}

fn line(check: &Check) -> String {
    let Check { group, mode, name, verdict, figure, seconds } = check;
    format!("{:<7} {:<5} {:<13} {name:<42} {seconds:>6.2} s  {figure}", verdict.name(), mode.name(), group.name())
}

fn as_json(found: &Conformance) -> Value {
    let adapter = &found.adapter;
    let [passed, failed] = Verdict::ALL.map(|verdict| found.count(verdict));
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "adapter": {"name": adapter.name, "api": adapter.api, "driver": adapter.driver, "kind": adapter.kind},
        "passed": passed, "failed": failed, "checks": found.checks,
    })
}

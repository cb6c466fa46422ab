//! The page of hard cases: every preset on the CPU, and the default on every backend.

use std::fmt::Write;

use crate::hard::{Case, Check, Limit, Setup};
use drystone::Result;
use drystone::backend::BackendKind;
use drystone::preset::Preset;

/// What is behind the failures.
const WHY: &str = "\n## Why they fail\n\n\
- **Mass ratios (H1, H3)**: a soft contact sinks by F/(m w²), and beyond some ratio by more than the body is high, or the tower on it\n  \
buckles. The law says with how many substeps not: `--max-penetration`.\n\
- **64 points (H4)**: with stiff contacts the whole overlap is a micrometer or less, and a pose in single precision is known to a tenth\n  \
of one. How rigid bodies share such a load is not determined anyway.\n\
- **Chain (H6)**: the gap of a joint falls with the square of the substeps, as overlap does.\n\
- **Many substeps in single precision (flip, rolling)**: what a substep of 0.1 ms adds to a velocity is little more than its\n  \
rounding, so that errors grow with the substeps from some number on. In f64 they fall.\n\
- **A rod at 1000 rad/s (H7)** turns by 17 rad in a step while the arms of its contacts stay. With 128 substeps it gains energy, in f64 too.\n\
- **Next to no inertia (H11)**: a cube of 1 kg and 1e-9 kg m² falls through the floor: each of its corners feels a mass of 1e-7 kg, and one\n  \
sweep a substep does not find that only all four together carry. Its numbers stay finite.\n\
- **Arch**: 31 stones at 0.12 of the radius, where statics ask for 0.1075, fall in some columns and not in others, perhaps since their 32 gaps of\n  \
0.1 mm close first. At 0.13 they stand from 8 substeps on.\n\
- **Release**: the springs of the contacts below hold the energy of the load. With 32 substeps it is 16 times less.\n";

/// What the columns are run with.
const COLUMNS: [(Preset, BackendKind); 6] = [
    (Preset::Fast, BackendKind::Cpu),
    (Preset::Balanced, BackendKind::Cpu),
    (Preset::Accurate, BackendKind::Cpu),
    (Preset::Reference, BackendKind::Cpu),
    (Preset::Balanced, BackendKind::F64),
    (Preset::Balanced, BackendKind::Gpu),
];

/// Whether a case is run in that column: what takes minutes on the CPU takes hours with many substeps or in a software adapter.
fn is_run(case: &Case, (preset, numbers): (Preset, BackendKind)) -> bool {
    !case.long || numbers == BackendKind::Cpu && preset.config().substeps <= Preset::Balanced.config().substeps
}

/// Runs that the page takes.
pub fn count(cases: &[&Case]) -> u64 {
    cases.iter().flat_map(|case| COLUMNS.iter().map(|&column| u64::from(is_run(case, column)))).sum()
}

/// The page as Markdown. `progress` is called with what begins next.
///
/// # Errors
/// Of the cases; no adapter.
pub fn page(cases: &[&Case], mut progress: impl FnMut(&str)) -> Result<String> {
    let mut passed = [0; COLUMNS.len()];
    let mut rows = String::new();
    for case in cases {
        let mut columns: Vec<Option<Vec<Check>>> = Vec::new();
        for (k, &(preset, numbers)) in COLUMNS.iter().enumerate() {
            if !is_run(case, COLUMNS[k]) {
                columns.push(None);
                continue;
            }
            progress(&format!("{} {preset} {numbers}", case.name));
            let checks = case.run(&Setup { config: preset.config().without_sleep(), open: &|| numbers.open(false) })?;
            passed[k] += usize::from(checks.iter().all(|c| c.passed));
            columns.push(Some(checks));
        }
        writeln!(rows, "| **{}** | {} ||||||||", case.name, case.summary).expect("text takes all");
        let asked = columns.iter().flatten().next().map_or(&[][..], |checks| checks);
        for (i, check) in asked.iter().enumerate() {
            let cells: Vec<_> = columns.iter().map(|c| c.as_ref().map_or("not run".into(), |c| cell(&c[i]))).collect();
            writeln!(rows, "| | {} | {} | {} |", check.what, limit(check.limit), cells.join(" | "))
                .expect("text takes all");
        }
    }
    let of = |k: usize| cases.iter().filter(|c| is_run(c, COLUMNS[k])).count();
    let totals: Vec<_> = passed.iter().enumerate().map(|(k, passed)| format!("{passed} of {}", of(k))).collect();
    let gpu = BackendKind::Gpu.open(false)?.adapter();
    let substeps = |preset: Preset| preset.config().substeps;
    let heads: Vec<_> =
        COLUMNS.iter().map(|&(preset, numbers)| format!("{preset} ({}), {numbers}", substeps(preset))).collect();
    Ok(format!(
        "# Hard cases\n\n\
         Made by `drystone hard --page docs`; one case by `drystone hard --case H3 --preset accurate`. What fails is in bold. The\n\
         columns are presets with their substeps, on the lanes of the processor in single precision (`cpu`), on the reference with sweeps in double\n\
         precision (`f64`), and in the shaders (`gpu`: {gpu}). `drystone hard --list` says what each case is.\n\n\
         | case | number | asked | {} |\n|---|---|---|{}\n| | **cases that pass** | | {} |\n{rows}{WHY}",
        heads.join(" | "),
        "---|".repeat(COLUMNS.len()),
        totals.join(" | ")
    ))
}

fn limit(limit: Limit) -> String {
    match limit {
        Limit::AtMost(x) => format!("≤ {x}"),
        Limit::AtLeast(x) => format!("≥ {x}"),
    }
}

fn cell(check: &Check) -> String {
    let value = number(check.value);
    if check.passed { value } else { format!("**{value}**") }
}

/// A number with as many digits as say something.
pub fn number(x: f64) -> String {
    if x == 0.0 || (x.fract() == 0.0 && x.abs() < 1e5) {
        format!("{x:.0}")
    } else if (1e-2..1e4).contains(&x.abs()) {
        format!("{x:.3}")
    } else {
        format!("{x:.1e}")
    }
}

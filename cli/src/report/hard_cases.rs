//! The page of hard cases: every preset on the CPU, and the default preset on every backend.

use std::fmt::Write;

use crate::hard::{Case, Check, Limit, Setup, passes};
use drystone::Result;
use drystone::backend::BackendKind;
use drystone::preset::Preset;

const COLUMNS: [(Preset, BackendKind); 6] = [
    (Preset::Fast, BackendKind::Cpu),
    (Preset::Balanced, BackendKind::Cpu),
    (Preset::Accurate, BackendKind::Cpu),
    (Preset::Reference, BackendKind::Cpu),
    (Preset::Balanced, BackendKind::F64),
    (Preset::Balanced, BackendKind::Gpu),
];

/// Whether a column has a case: a long case would take hours with many substeps or on a software adapter.
fn is_run(case: &Case, (preset, numbers): (Preset, BackendKind)) -> bool {
    !case.long || numbers == BackendKind::Cpu && preset.config().substeps <= Preset::Balanced.config().substeps
}

pub fn count(cases: &[&Case]) -> u64 {
    cases.iter().flat_map(|case| COLUMNS.iter().map(|&column| u64::from(is_run(case, column)))).sum()
}

/// The page as Markdown. `progress` gets the name of each run before it begins.
pub fn page(cases: &[&Case], mut progress: impl FnMut(&str)) -> Result<String> {
    let mut passed = [0; COLUMNS.len()];
    let mut rows = String::new();
    for case in cases {
        let mut columns: Vec<Option<Vec<Check>>> = Vec::new();
        for (k, &(preset, numbers)) in COLUMNS.iter().enumerate() {
            if !is_run(case, (preset, numbers)) {
                columns.push(None);
                continue;
            }
            progress(&format!("{} {preset} {numbers}", case.name));
            let checks = case.run(&Setup { config: preset.config().without_sleep(), open: &|| numbers.open(false) })?;
            passed[k] += usize::from(passes(&checks));
            columns.push(Some(checks));
        }
        let asked = columns.iter().flatten().next().map_or(&[][..], |checks| checks);
        let shown: Vec<_> = (0..asked.len()).filter(|&i| !is_far_below(&columns, i)).collect();
        let note = if shown.is_empty() { " (all left out)" } else { "" };
        writeln!(rows, "| **{}** | {}{note} ||||||||", case.name, case.summary).expect("text takes all");
        for i in shown {
            let check = &asked[i];
            let cell = |check: &Check| match (number(check.value), check.passed) {
                (value, true) => value,
                (value, false) => format!("**{value}**"),
            };
            let cells: Vec<_> = columns.iter().map(|c| c.as_ref().map_or("not run".into(), |c| cell(&c[i]))).collect();
            let limit = match check.limit {
                Limit::AtMost(x) => format!("≤ {x}"),
                Limit::AtLeast(x) => format!("≥ {x}"),
            };
            writeln!(rows, "| | {} | {limit} | {} |", check.what, cells.join(" | ")).expect("text takes all");
        }
    }
    let of = |k: usize| cases.iter().filter(|c| is_run(c, COLUMNS[k])).count();
    let totals: Vec<_> = passed.iter().enumerate().map(|(k, passed)| format!("{passed} of {}", of(k))).collect();
    let gpu = BackendKind::Gpu.open(false)?.adapter();
    let substeps = |preset: Preset| preset.config().substeps;
    let heads: Vec<_> =
        COLUMNS.iter().map(|&(preset, numbers)| format!("{preset} ({}), {numbers}", substeps(preset))).collect();
    Ok(format!(
        "{}| case | quantity | limit | {} |\n|---|---|---|{}\n| | **cases that pass** | | {} |\n{rows}{}",
        include_str!("hard_cases_head.md").replace("ADAPTER", &gpu),
        heads.join(" | "),
        "---|".repeat(COLUMNS.len()),
        totals.join(" | "),
        include_str!("hard_cases_tail.md")
    ))
}

/// Whether a quantity passes with at most a thousandth of its limit, of either sign, in every column that has the case.
fn is_far_below(columns: &[Option<Vec<Check>>], quantity: usize) -> bool {
    columns.iter().flatten().map(|checks| &checks[quantity]).all(|check| {
        let (Limit::AtMost(limit) | Limit::AtLeast(limit)) = check.limit;
        check.passed && check.value.abs() <= 1e-3 * limit
    })
}

/// A number with three or four significant digits, or a whole number.
pub fn number(x: f64) -> String {
    if x == 0.0 || (x.fract() == 0.0 && x.abs() < 1e5) {
        format!("{x:.0}")
    } else if (1e-2..1e4).contains(&x.abs()) {
        format!("{x:.3}")
    } else {
        format!("{x:.1e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_quantity_that_passes_far_below_its_limit_in_every_column_is_left_out() {
        let check = |value, limit: Limit| Check { what: "a check".into(), value, limit, passed: limit.holds(value) };
        let failed = Check { passed: false, ..check(0.0, Limit::AtMost(1.0)) };
        let cases = [
            (check(0.0, Limit::AtMost(1.0)), true),
            // Counts of failures have the limit 0.
            (check(0.0, Limit::AtMost(0.0)), true),
            (check(9e-4, Limit::AtMost(1.0)), true),
            (check(-9e-4, Limit::AtMost(1.0)), true),
            (check(2e-3, Limit::AtMost(1.0)), false),
            (check(-2e-3, Limit::AtMost(1.0)), false),
            (check(9e-4, Limit::AtMost(0.5)), false),
            (check(31.0, Limit::AtLeast(1.0)), false),
            (check(0.0, Limit::AtLeast(1.0)), false),
            (check(f64::NAN, Limit::AtMost(1.0)), false),
            (failed, false),
        ];
        for (other, left_out) in cases {
            let zero = check(0.0, Limit::AtMost(1.0));
            let columns = [Some(vec![zero.clone(), zero.clone()]), None, Some(vec![zero, other.clone()])];
            assert_eq!([0, 1].map(|quantity| is_far_below(&columns, quantity)), [true, left_out], "{other:?}");
        }
    }
}

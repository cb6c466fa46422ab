//! Substeps: height and load of towers that stand.

use std::fmt::Write as _;

use super::{RulesReport, Standing, stand};
use drystone::Result;

/// The number of boxes of the tallest standing tower, up to `most`, by doubling and bisection. Lower towers are assumed
/// to stand.
fn largest(most: u32, mut stands: impl FnMut(u32) -> Result<bool>) -> Result<u32> {
    let (mut good, mut bad) = (0, 1);
    while bad <= most && stands(bad)? {
        (good, bad) = (bad, bad * 2);
    }
    bad = bad.min(most + 1);
    while bad - good > 1 {
        let middle = (good + bad) / 2;
        if stands(middle)? { good = middle } else { bad = middle }
    }
    Ok(good)
}

const MAX_BOXES: u32 = 128;

pub(super) fn heights(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\n## Substeps\n\n\
         The table has the tallest tower, up to {MAX_BOXES} boxes shifted by 1 cm to alternate sides, that stands for \
         20 s. All islands\ntake the same substeps.\n\n\
         | substeps | soft, default | Baumgarte, as many sweeps |\n|---|---|---|"
    );
    for substeps in [1_u32, 4, 8, 16] {
        let mut tallest = |more: &str| {
            let settings = format!("substeps={substeps} max_substeps={substeps} {more}");
            let tallest =
                largest(MAX_BOXES, |n| Ok(stand(&format!("tower:n={n},offset=0.01"), &settings)?.fell.is_none()))?;
            after_run();
            Result::Ok(tallest)
        };
        let (soft, hard) = (tallest("")?, tallest("iterations=2 relax=0 stabilization=baumgarte")?);
        let _ = writeln!(report.page, "| {substeps} | {soft} | {hard} |");
    }
    Ok(())
}

pub(super) fn ratios(report: &mut RulesReport, after_run: &mut dyn FnMut()) -> Result<()> {
    let _ = writeln!(
        report.page,
        "\nThe second table has the heaviest top (1, 2, 5, ... 10,000 times the other boxes) on a tower of 10 that \
         stands for 20 s,\nand the overlap of one box under another of 1000 times its mass:\n\n\
         | substeps | heaviest top | overlap |\n|---|---|---|"
    );
    let tried = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000];
    for substeps in [4_u32, 16, 32, 64] {
        let settings = format!("substeps={substeps} max_substeps={substeps}");
        let tower = |n: u32, ratio: u32| stand(&format!("tower:n={n},top_ratio={ratio},offset=0.01"), &settings);
        let mut heaviest = 0;
        for ratio in tried {
            if tower(10, ratio)?.fell.is_some() {
                break;
            }
            heaviest = ratio;
        }
        after_run();
        let overlap = |s: Standing| match s.fell {
            None => format!("{:.2} mm", s.penetration * 1e3),
            Some(time) => format!("fell at {time:.1} s"),
        };
        let _ = writeln!(report.page, "| {substeps} | {heaviest} | {} |", overlap(tower(2, 1000)?));
        after_run();
    }
    Ok(())
}

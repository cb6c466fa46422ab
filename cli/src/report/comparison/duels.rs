//! Compares drystone with the other engines at equal error, as Markdown.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::pareto::{Fault, fastest};
use super::row::Row;
use crate::report::number::number;
use drystone::Result;

/// The engine that is compared with all others.
pub(super) const OWN: &str = "drystone";

/// A row of another engine that is ahead: it is faster than every own row with an error that is not larger.
struct Lead<'a> {
    row: &'a Row,
    fault: Fault,
    /// Time of the fastest own row with an error that is not larger, relative to the time of this row; infinite if no
    /// own row reaches the error.
    ratio: f64,
    /// Whether the quartiles of both times overlap.
    unsure: bool,
}

impl Lead<'_> {
    fn ratio(&self) -> String {
        let unsure = if self.unsure { "~" } else { "" };
        if self.ratio.is_finite() { format!("{unsure}{:.2}", self.ratio) } else { "not reached".into() }
    }
}

/// The rows of a scene that are ahead, sorted by error, then in the order of `rows`.
fn leads(rows: &[Row]) -> Result<Vec<Lead<'_>>> {
    let (own, others): (Vec<_>, Vec<_>) =
        rows.iter().filter(|row| row.backend != "gpu").partition(|row| row.engine == OWN);
    let faults = rows.first().map_or(&[][..], Fault::of_scene);
    let mut leads = Vec::new();
    for &fault in faults {
        for &row in others.iter().filter(|row| row.holds() && fault.of(row).is_finite()) {
            let (ratio, unsure) = match fastest(&own, fault, fault.of(row)) {
                Some(mine) => (mine.time_ratio(row)?, mine.ratio_low <= row.ratio_high),
                None => (f64::INFINITY, false),
            };
            if ratio > 1.0 {
                leads.push(Lead { row, fault, ratio, unsure });
            }
        }
    }
    Ok(leads)
}

/// The page. Each element of `results` has the rows of one scene. `None` without another engine.
pub fn page(results: &[Vec<Row>]) -> Result<Option<String>> {
    let others: BTreeSet<_> = results.iter().flatten().map(|row| &*row.engine).filter(|&name| name != OWN).collect();
    if others.is_empty() {
        return Ok(None);
    }
    let names = others.into_iter().collect::<Vec<_>>().join(", ");
    let mut text = format!(
        "# At equal error\n\n\
         All engines of a scene ran in one process in turns of ten steps. Time is the median over the turns of the second half, with its \
         quartiles. Errors are of the second half: deepest and mean overlap, speed at rest (rms) and drift, or the gap of joints. Another engine \
         ({names}) is ahead where each setting of {OWN} with an error no larger takes longer, or none has an error as small. The number is \
         the time of the fastest of these settings relative to that of the other engine. A ~ says that the quartiles of both times overlap.\n\n\
         ## Where another engine is ahead\n\n"
    );
    let (lost, ahead, compared) = ahead(results)?;
    text.push_str(&lost);
    let _ = writeln!(text, "\nAnother engine is ahead somewhere in {ahead} of {compared} pairs of scene and error.");
    for rows in results {
        table(&mut text, rows, &leads(rows)?, rows.first().map_or(&[][..], Fault::of_scene));
    }
    Ok(Some(text))
}

/// A table of the pairs of scene and error in which another engine is ahead, the number of these pairs, and the number
/// of all pairs.
pub(super) fn ahead(results: &[Vec<Row>]) -> Result<(String, usize, usize)> {
    let mut text =
        "| scene | error | rows | setting of the largest ratio | its error | relative time |\n|---|---|--:|---|--:|--:|\n".to_owned();
    let (mut ahead, mut compared) = (0, 0);
    for rows in results {
        let leads = leads(rows)?;
        let faults = rows.first().map_or(&[][..], Fault::of_scene);
        compared += faults.len();
        for &fault in faults {
            let of: Vec<_> = leads.iter().filter(|lead| lead.fault == fault).collect();
            let Some(worst) = of.iter().copied().max_by(|a, b| a.ratio.total_cmp(&b.ratio)) else { continue };
            ahead += 1;
            let (scene, setting) = (&worst.row.scene, worst.row.setting().label());
            let error = format!("{} {}", number(fault.of(worst.row) * 1e3), fault.unit());
            let (count, ratio) = (of.len(), worst.ratio());
            let _ = writeln!(text, "| {scene} | {} | {count} | {setting} | {error} | {ratio} |", fault.name());
        }
    }
    Ok((text, ahead, compared))
}

/// A table of all rows of a scene. For each row of another engine it lists the errors at which the row is ahead.
fn table(text: &mut String, rows: &[Row], leads: &[Lead], faults: &[Fault]) {
    let Some(first) = rows.first() else { return };
    let _ = write!(text, "\n## {}\n\n{} dynamic bodies, {} steps.\n\n", first.scene, first.bodies, first.steps);
    let heads: String = faults.iter().map(|fault| format!(" {} {} |", fault.name(), fault.unit())).collect();
    let _ = writeln!(text, "| setting | ms | quartiles |{heads} in place | ahead in |");
    let _ = writeln!(text, "|---|--:|--:|{}--:|---|", "--:|".repeat(faults.len()));
    for row in rows {
        let errors: String = faults.iter().map(|fault| format!(" {} |", number(fault.of(row) * 1e3))).collect();
        let place = match row.in_place {
            _ if !row.finite => "not finite".into(),
            Some(n) => format!("{n} of {}", row.bodies),
            None => String::new(),
        };
        let of = leads.iter().filter(|lead| std::ptr::eq(lead.row, row));
        let ahead = of.map(|lead| format!("{} {}", lead.fault.name(), lead.ratio())).collect::<Vec<_>>().join(", ");
        let (label, ms) = (row.setting().label(), number(row.ms));
        let quartiles = format!("{} {}", number(row.ms_low), number(row.ms_high));
        let _ = writeln!(text, "| {label} | {ms} | {quartiles} |{errors} {place} | {ahead} |");
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::row;
    use super::*;

    /// Rows with the same error of every kind.
    fn like(engine: &str, ms: f64, error: f64) -> Row {
        let quartiles = Row { ratio_low: 0.9 * ms, ratio_high: 1.1 * ms, ..row(engine, ms, error) };
        Row { speed_rms: error, drift: error, ..quartiles }
    }

    #[test]
    fn a_page_marks_the_rows_that_are_faster_or_reach_a_smaller_error() {
        let own = [like(OWN, 1.0, 2e-3), like(OWN, 4.0, 1e-4)];
        let others = [like("a", 2.0, 2e-3), like("b", 2.0, 1e-3), like("c", 3.9, 1e-4), like("d", 9.0, 5e-5)];
        let fallen = Row { in_place: Some(0), ..like("e", 0.1, 1e-6) };
        let rows: Vec<_> = own.into_iter().chain(others).chain([fallen]).collect();
        let found: Vec<_> =
            leads(&rows).unwrap().iter().map(|lead| format!("{} {}", lead.row.engine, lead.ratio())).collect();
        assert_eq!(found[..3], ["b 2.00", "c ~1.03", "d not reached"]);
        // Mean, 95 %, deepest, speed and drift.
        assert_eq!(found.len(), 15);
        let text = page(&[rows]).unwrap().unwrap();
        assert!(text.contains("| mean overlap | 3 | d  0x0"), "{text}");
        assert!(text.contains("ahead somewhere in 5 of 5 pairs"), "{text}");
    }

    #[test]
    fn a_page_without_losses_names_none_and_one_engine_has_no_page() {
        let rows = vec![like(OWN, 1.0, 1e-3), like("a", 1.1, 1e-3)];
        let text = page(&[rows]).unwrap().unwrap();
        assert!(text.contains("ahead somewhere in 0 of 5 pairs") && !text.contains("not reached"), "{text}");
        assert!(page(&[vec![like(OWN, 1.0, 1e-3)]]).unwrap().is_none());
    }
}

//! The page: one HTML file with all pictures and tables.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::duels::OWN;
use super::html::{cell, escape, inline, profile_picture, table};
use super::pareto::{Duel, FLOOR, Fault, fastest, front, least};
use super::problems::problems;
use super::row::Row;
use super::solves::SolveRow;
use crate::report::number::number;
use crate::report::plot::Scale::Decades;
use crate::report::plot::{Frame, Look, Series, grid, svg};
use drystone::Result;

pub struct Page {
    pub html: String,
    /// Time against error on every scene, as SVG.
    pub main: String,
}

/// Errors of the profiles over the scenes (m).
const LEVELS: [f64; 3] = [1e-2, 1e-3, 1e-4];

/// Makes the page. Each element of `results` has the rows of one scene.
pub fn page(results: &[Vec<Row>], solves: &[Vec<SolveRow>]) -> Result<Page> {
    let sides = sides(results);
    // A side with one setting, such as the shaders on a software adapter, has a row in tables but no line in pictures.
    let has_line = |side: &&String| results.iter().any(|rows| of_side(rows, side).len() > 1);
    let drawn: Vec<_> = sides.iter().filter(has_line).cloned().collect();
    let main =
        grid(&results.iter().map(|rows| picture(rows, &drawn, faults(rows)[0], (440, 320))).collect::<Vec<_>>(), 3);
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Speed against error</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<style>\n{}</style></head><body>\n<h1>Speed against error</h1>\n",
        include_str!("page.css")
    );
    head(&mut html, results);
    html.push_str(&inline(&main));
    duels(&mut html, results, &sides)?;
    profiles(&mut html, results, &drawn)?;
    for rows in results {
        scene(&mut html, rows, &sides, &drawn);
    }
    problems(&mut html, solves);
    html.push_str("</body></html>\n");
    Ok(Page { html, main })
}

/// The side of a comparison: an engine, and whether it runs on a GPU.
fn side(row: &Row) -> String {
    if row.backend == "gpu" { format!("{} gpu", row.engine) } else { row.engine.clone() }
}

/// The look of the engine, with a dashed line on a GPU.
fn look(side: &str) -> Look {
    match side.split_once(' ') {
        Some((engine, _)) => Look::of_engine(engine).dashed(),
        None => Look::of_engine(side),
    }
}

/// All sides: [`OWN`], the other engines, then the other sides of [`OWN`].
fn sides(results: &[Vec<Row>]) -> Vec<String> {
    let all: BTreeSet<_> = results.iter().flatten().map(side).collect();
    let (own, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|s| s == OWN);
    let (same, others): (Vec<_>, Vec<_>) = others.into_iter().partition(|s| s.starts_with(OWN));
    own.into_iter().chain(others).chain(same).collect()
}

pub(super) fn of_side<'a>(rows: &'a [Row], wanted: &str) -> Vec<&'a Row> {
    rows.iter().filter(|row| side(row) == wanted).collect()
}

fn present<'a>(rows: &'a [Row], sides: &'a [String]) -> impl Iterator<Item = (&'a String, Vec<&'a Row>)> {
    sides.iter().map(|name| (name, of_side(rows, name))).filter(|(_, rows)| !rows.is_empty())
}

pub(super) fn faults(rows: &[Row]) -> &'static [Fault] {
    rows.first().map_or(&[Fault::Mean], Fault::of_scene)
}

fn head(html: &mut String, results: &[Vec<Row>]) {
    let each = |of: fn(&Row) -> String| {
        let all: BTreeSet<_> = results.iter().flatten().map(of).collect();
        all.into_iter().map(|text| escape(&text)).collect::<Vec<_>>().join("; ")
    };
    let day = |row: &Row| row.run.chars().take(10).collect();
    let _ = writeln!(
        html,
        "<p>{}. Commit {}. Threads of each engine: {}. {}.</p>\n\
         <p>On each scene all engines step in rounds, ten steps each in turn, so that a slow machine slows all of them. Time \
         is the median over the rounds, of the {} clock. Errors are of the second half of the run, by one measure for all engines. A point is one setting with \
         the label substeps × sweeps. Filled points and the line are the Pareto front: no other setting of that engine is better in both time and \
         error. The picture leaves out settings with which a body falls that should stand. Errors below {} µm count as this value.</p>",
        each(|row| row.machine.clone()),
        each(|row| row.commit.clone()),
        each(|row| row.threads.to_string()),
        each(day),
        each(|row| row.clock.clone()).replace("; ", " clock, on a GPU of the "),
        FLOOR * 1e6
    );
}

fn picture(rows: &[Row], sides: &[String], fault: Fault, size: (u32, u32)) -> String {
    let place = |row: &Row| (row.ms, fault.of(row) * 1e3);
    let series = |(name, rows): (&String, Vec<&Row>)| Series {
        name: name.clone(),
        look: look(name),
        points: rows.iter().filter(|r| r.holds()).map(|r| (place(r).0, place(r).1, point_label(r))).collect(),
        line: front(&rows, fault).into_iter().map(place).collect(),
    };
    let series: Vec<_> = present(rows, sides).map(series).collect();
    let title = rows.first().map_or(String::new(), |row| row.scene.clone());
    let y = format!("{} [{}]", fault.name(), fault.unit());
    svg(&Frame { title: &title, x: "time of a step [ms]", y: &y, scales: (Decades, Decades), size }, &series)
}

fn point_label(row: &Row) -> String {
    format!("{}×{}", row.substeps, row.sweeps)
}

fn duels(html: &mut String, results: &[Vec<Row>], sides: &[String]) -> Result<()> {
    let others: Vec<_> = sides.iter().filter(|side| !side.starts_with(OWN)).collect();
    if others.is_empty() {
        return Ok(());
    }
    let names = others.iter().map(|s| escape(s)).collect::<Vec<_>>().join(" and ");
    let _ = writeln!(
        html,
        "<h2>At equal error</h2>\n<p>For each point on the common Pareto front of {names}: the least time of {OWN} at an error that is \
         no larger, relative to the time of the point. Below 1 {OWN} is faster.</p>"
    );
    let headings = ["scene", "error", &format!("least, {OWN}"), "least, others", "relative time, smallest", "largest"]
        .map(str::to_owned);
    let mut cells = Vec::new();
    for rows in results {
        let theirs: Vec<_> = rows.iter().filter(|row| !row.engine.starts_with(OWN)).collect();
        for &fault in faults(rows) {
            let duel = Duel::new(&of_side(rows, OWN), &theirs, fault)?;
            let shown = |error: f64| format!("{} {}", number(error * 1e3), fault.unit());
            let error = |error: f64| if error.is_finite() { shown(error) } else { "none holds".into() };
            let time = |ratio: f64| if ratio.is_finite() { format!("{ratio:.2}") } else { "not reached".into() };
            let time = |ratio| if duel.others.is_finite() { time(ratio) } else { String::new() };
            let (own, other, low, high) = (error(duel.own), error(duel.others), time(duel.best), time(duel.worst));
            let mut row: Vec<_> =
                [&*escape(&rows[0].scene), fault.name(), &own, &other, &low].map(|text| cell("", text)).into();
            row.push(cell(if duel.worst <= 1.0 { "best" } else { "" }, high));
            cells.push(row);
        }
    }
    table(html, &headings, cells);
    Ok(())
}

fn profiles(html: &mut String, results: &[Vec<Row>], sides: &[String]) -> Result<()> {
    html.push_str(
        "<h2>Performance profiles over the scenes</h2>\n<p>Share of the scenes in which an engine reaches the mean overlap, or the \
         gap of joints, within a factor of the time of the fastest engine that reaches it (Dolan and Moré 2002).</p>\n<div class=\"pictures\">",
    );
    for level in LEVELS {
        let cost = |side: &String| -> Result<Vec<Option<f64>>> {
            let of = |rows: &Vec<Row>| {
                let best = fastest(&of_side(rows, side), faults(rows)[0], level);
                best.map(|row| row.time_ratio(&rows[0])).transpose()
            };
            results.iter().map(of).collect()
        };
        let costs = sides.iter().map(cost).collect::<Result<Vec<_>>>()?;
        let title = format!("error of at most {} mm", level * 1e3);
        let named: Vec<_> = sides.iter().map(|side| (side.clone(), look(side))).collect();
        html.push_str(&inline(&profile_picture(&title, "share of scenes", results.len(), &named, &costs)));
    }
    html.push_str("</div>\n");
    Ok(())
}

fn scene(html: &mut String, rows: &[Row], sides: &[String], drawn: &[String]) {
    let Some(first) = rows.first() else { return };
    let (name, bodies, steps) = (escape(&first.scene), first.bodies, first.steps);
    let _ = writeln!(
        html,
        "<h2>{name}</h2>\n<p>{bodies} dynamic bodies, {steps} steps; hash of the scene {}, run {}.</p>\n<div class=\"pictures\">",
        first.hash, first.run
    );
    for &fault in faults(rows) {
        html.push_str(&inline(&picture(rows, drawn, fault, (610, 400))));
    }
    html.push_str("</div>\n");
    at_fixed_times(html, rows, sides);
    all_rows(html, rows);
}

fn at_fixed_times(html: &mut String, rows: &[Row], sides: &[String]) {
    // 1, 2, 4 and 8 ms, times the power of ten nearest to half of the first row's time.
    let scale = 10_f64.powf(rows.first().map_or(0.0, |row| (row.ms / 2.0).log10().round()));
    let times = [1.0, 2.0, 4.0, 8.0].map(|t| t * scale);
    html.push_str("<h3>Least error in a given time</h3>\n");
    let mut headings = vec!["error".to_owned(), "engine".to_owned()];
    headings.extend(times.map(|ms| format!("{} ms", number(ms))));
    let mut table_rows = Vec::new();
    for &fault in faults(rows) {
        for (name, rows) in present(rows, sides) {
            let own = if name == OWN { "own" } else { "" };
            let mut cells =
                vec![cell(own, format_args!("{} [{}]", fault.name(), fault.unit())), cell(own, escape(name))];
            cells.extend(times.map(|ms| match least(&rows, fault, ms) {
                Some(row) => cell(own, number(fault.of(row) * 1e3) + &format!(" <small>{}</small>", point_label(row))),
                None => cell(own, "-"),
            }));
            table_rows.push(cells);
        }
    }
    table(html, &headings, table_rows);
}

fn all_rows(html: &mut String, rows: &[Row]) {
    let faults = faults(rows);
    let _ = writeln!(html, "<details><summary>All {} settings</summary>", rows.len());
    let mut headings = ["setting", "ms a step", "quartiles", "relative time"].map(str::to_owned).to_vec();
    headings.extend(faults.iter().map(|fault| format!("{} [{}]", fault.name(), fault.unit())));
    headings.push("in place".to_owned());
    let cells = |row: &Row| {
        let mut cells = vec![
            cell("", escape(&row.setting().label())),
            cell("", number(row.ms)),
            cell("", format_args!("{} {}", number(row.ms_low), number(row.ms_high))),
            cell("", format_args!("{:.2}", row.ratio)),
        ];
        let class = if row.holds() { "" } else { "fell" };
        cells.extend(faults.iter().map(|fault| cell(class, number(fault.of(row) * 1e3))));
        cells.push(match row.in_place {
            _ if !row.finite => cell("", "not finite"),
            Some(n) => cell("", format_args!("{n} of {}", row.bodies)),
            None => cell("", ""),
        });
        cells
    };
    table(html, &headings, rows.iter().map(cells));
    html.push_str("</details>\n");
}

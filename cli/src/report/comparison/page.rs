//! The page: pictures and tables of what was measured, one HTML file that needs nothing else.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::measure::Row;
use super::pareto::{Duel, FLOOR, Fault, fastest, front, least, profile};
use super::solves::SolveRow;
use crate::report::plot::Scale::{Decades, Share};
use crate::report::plot::{Frame, Series, svg};
use drystone::Result;

/// The HTML, and the picture that stands for all of it.
pub struct Page {
    /// The page.
    pub html: String,
    /// Time against error on every scene, as SVG.
    pub main: String,
}

/// Whose rows the other sides are compared with.
const OWN: &str = "drystone";

/// Errors that the profiles over the scenes are made at (m).
const LEVELS: [f64; 3] = [1e-2, 1e-3, 1e-4];

/// Makes the page; each element of `results` has the rows of one scene.
pub fn page(results: &[Vec<Row>], solves: &[Vec<SolveRow>]) -> Result<Page> {
    let sides = sides(results);
    // One setting is a row of a table and no line of a picture: shaders on a software adapter are far off.
    let has_line = |side: &&String| results.iter().any(|rows| of_side(rows, side).len() > 1);
    let drawn: Vec<_> = sides.iter().filter(has_line).cloned().collect();
    let main =
        grid(&results.iter().map(|rows| picture(rows, &drawn, faults(rows)[0], (410, 320))).collect::<Vec<_>>(), 3);
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

/// What is compared: an engine, apart where it ran on a GPU.
fn side(row: &Row) -> String {
    if row.backend == "gpu" { format!("{} gpu", row.engine) } else { row.engine.clone() }
}

/// All sides; those of [`OWN`] first.
fn sides(results: &[Vec<Row>]) -> Vec<String> {
    let all: BTreeSet<_> = results.iter().flatten().map(side).collect();
    let (own, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|s| s == OWN);
    let (same, others): (Vec<_>, Vec<_>) = others.into_iter().partition(|s| s.starts_with(OWN));
    own.into_iter().chain(others).chain(same).collect()
}

fn of_side<'a>(rows: &'a [Row], wanted: &str) -> Vec<&'a Row> {
    rows.iter().filter(|row| side(row) == wanted).collect()
}

fn faults(rows: &[Row]) -> &'static [Fault] {
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

/// Time against one error in one scene.
fn picture(rows: &[Row], sides: &[String], fault: Fault, size: (u32, u32)) -> String {
    let place = |row: &Row| (row.ms, fault.of(row) * 1e3);
    let series: Vec<_> = sides
        .iter()
        .enumerate()
        .map(|(look, name)| (look, name, of_side(rows, name)))
        .filter(|(.., rows)| !rows.is_empty())
        .map(|(look, name, rows)| Series {
            name: name.clone(),
            look,
            points: rows.iter().filter(|r| r.holds()).map(|r| (place(r).0, place(r).1, point_label(r))).collect(),
            line: front(&rows, fault).into_iter().map(place).collect(),
        })
        .collect();
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
         no larger, relative to the time of the point. Below 1 {OWN} is faster.</p>\n<div class=\"wide\"><table><tr><th>scene</th><th>error</th>\
         <th>least, {OWN}</th><th>least, others</th><th>relative time, smallest</th><th>largest</th></tr>"
    );
    for rows in results {
        let theirs: Vec<_> = rows.iter().filter(|row| !row.engine.starts_with(OWN)).collect();
        for &fault in faults(rows) {
            let duel = Duel::new(&of_side(rows, OWN), &theirs, fault)?;
            let scene = escape(&rows[0].scene);
            let [own, other] = [duel.own, duel.others]
                .map(|error| if error.is_finite() { shown(fault, error) } else { "none holds".into() });
            let [low, high] = match duel.others.is_finite() {
                true => [duel.best, duel.worst]
                    .map(|r| if r.is_finite() { format!("{r:.2}") } else { "not reached".into() }),
                false => [const { String::new() }; 2],
            };
            let best = if duel.worst <= 1.0 { " class=\"best\"" } else { "" };
            let _ = writeln!(
                html,
                "<tr><td>{scene}</td><td>{}</td><td>{own}</td><td>{other}</td><td>{low}</td><td{best}>{high}</td></tr>",
                fault.name()
            );
        }
    }
    html.push_str("</table></div>\n");
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
        html.push_str(&inline(&profile_picture(&title, "share of scenes", results.len(), sides, &costs)));
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
        html.push_str(&inline(&picture(rows, drawn, fault, (590, 400))));
    }
    html.push_str("</div>\n");
    at_fixed_times(html, rows, sides);
    all_rows(html, rows);
}

/// 1, 2, 4 and 8 ms; in scenes that take a power of ten less or more, that power of ten times as much.
fn fixed_times(rows: &[Row]) -> [f64; 4] {
    let scale = 10_f64.powf(rows.first().map_or(0.0, |row| (row.ms / 2.0).log10().round()));
    [1.0, 2.0, 4.0, 8.0].map(|t| t * scale)
}

fn at_fixed_times(html: &mut String, rows: &[Row], sides: &[String]) {
    let times = fixed_times(rows);
    let columns = times.iter().fold(String::new(), |text, t| text + &format!("<th>{} ms</th>", number(*t)));
    let _ = writeln!(
        html,
        "<h3>Least error in a given time</h3>\n<div class=\"wide\"><table><tr><th>error</th><th>engine</th>{columns}</tr>"
    );
    for &fault in faults(rows) {
        for name in sides {
            let rows = of_side(rows, name);
            if rows.is_empty() {
                continue;
            }
            let own = if name == OWN { " class=\"own\"" } else { "" };
            let _ = write!(html, "<tr{own}><td>{} [{}]</td><td>{}</td>", fault.name(), fault.unit(), escape(name));
            for ms in times {
                let cell = match least(&rows, fault, ms) {
                    Some(row) => format!("{} <small>{}</small>", number(fault.of(row) * 1e3), point_label(row)),
                    None => "-".into(),
                };
                let _ = write!(html, "<td>{cell}</td>");
            }
            html.push_str("</tr>\n");
        }
    }
    html.push_str("</table></div>\n");
}

fn all_rows(html: &mut String, rows: &[Row]) {
    let faults = faults(rows);
    let columns = faults.iter().fold(String::new(), |text, f| text + &format!("<th>{} [{}]</th>", f.name(), f.unit()));
    let _ = writeln!(
        html,
        "<details><summary>All {} settings</summary>\n<div class=\"wide\"><table><tr><th>setting</th><th>ms a step</th><th>quartiles</th>\
         <th>relative time</th>{columns}<th>in place</th></tr>",
        rows.len()
    );
    for row in rows {
        let label = escape(&row.setting().label());
        let _ = write!(
            html,
            "<tr><td>{label}</td><td>{}</td><td>{} {}</td><td>{:.2}</td>",
            number(row.ms),
            number(row.ms_low),
            number(row.ms_high),
            row.ratio
        );
        let class = if row.holds() { "" } else { " class=\"fell\"" };
        for fault in faults {
            let _ = write!(html, "<td{class}>{}</td>", number(fault.of(row) * 1e3));
        }
        let in_place = match row.in_place {
            _ if !row.finite => "not finite".into(),
            Some(n) => format!("{n} of {}", row.bodies),
            None => String::new(),
        };
        let _ = writeln!(html, "<td>{in_place}</td></tr>");
    }
    html.push_str("</table></div></details>\n");
}

/// Errors that contact problems are solved to.
const SOLVED: [f64; 3] = [1e-1, 1e-2, 1e-3];

fn problems(html: &mut String, solves: &[Vec<SolveRow>]) {
    if solves.is_empty() {
        return;
    }
    // In the order of the rows.
    let mut solvers: Vec<String> = Vec::new();
    for solver in solves.iter().flatten().map(SolveRow::solver) {
        if !solvers.contains(&solver) {
            solvers.push(solver);
        }
    }
    let _ = writeln!(
        html,
        "<h2>Contact problems</h2>\n<p>The problems are single steps with hard contacts, solved from zero impulses. The error e_vel is the natural map in \
         velocities. Time is that of the sweeps one by one on one core, the least of three equal rounds, on the f64 reference or on the CPU lanes in f32 \
         (cpu). The curves show the share of {} problems that a solver solves to an error within a factor of the time of the fastest solver.</p>\n\
         <div class=\"pictures\">",
        solves.len()
    );
    for level in SOLVED {
        let costs: Vec<Vec<_>> =
            solvers.iter().map(|s| solves.iter().map(|rows| time_to(rows, s, level)).collect()).collect();
        let title = format!("e_vel of at most {level}");
        html.push_str(&inline(&profile_picture(&title, "share of problems", solves.len(), &solvers, &costs)));
    }
    html.push_str(
        "</div>\n<h3>Time to an error [ms]</h3>\n<div class=\"wide\"><table><tr><th>problem</th><th>contacts</th>",
    );
    for level in SOLVED {
        solvers.iter().for_each(|s| html.push_str(&format!("<th>{level}<br>{s}</th>")));
    }
    html.push_str("</tr>\n");
    for rows in solves {
        let _ = write!(html, "<tr><td>{}</td><td>{}</td>", escape(&rows[0].problem), rows[0].contacts);
        for level in SOLVED {
            for solver in &solvers {
                let _ = write!(html, "<td>{}</td>", time_to(rows, solver, level).map_or("-".into(), number));
            }
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n<h3>e_vel in a given time</h3>\n<div class=\"wide\"><table><tr><th>problem</th><th>contacts</th>");
    const TIMES: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
    for ms in TIMES {
        solvers.iter().for_each(|s| html.push_str(&format!("<th>{ms} ms<br>{s}</th>")));
    }
    html.push_str("</tr>\n");
    for rows in solves {
        let _ = write!(html, "<tr><td>{}</td><td>{}</td>", escape(&rows[0].problem), rows[0].contacts);
        for ms in TIMES {
            for solver in &solvers {
                let fit = rows.iter().filter(|row| row.solver() == *solver && row.ms_low <= ms).map(|row| row.e_vel);
                let cell = fit.min_by(f64::total_cmp).map_or("-".into(), |e| format!("{e:.1e}"));
                let _ = write!(html, "<td>{cell}</td>");
            }
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</table></div>\n<details><summary>Curves of all problems</summary><div class=\"pictures\">");
    for rows in solves {
        html.push_str(&inline(&curves(rows, &solvers)));
    }
    html.push_str("</div></details>\n");
}

/// Least time in which a solver had an error of at most `level` (ms).
fn time_to(rows: &[SolveRow], solver: &str, level: f64) -> Option<f64> {
    let fit = rows.iter().filter(|row| row.solver() == solver && row.e_vel <= level);
    fit.map(|row| row.ms_low).min_by(f64::total_cmp)
}

/// Time against error in one problem.
fn curves(rows: &[SolveRow], solvers: &[String]) -> String {
    let series = solvers.iter().enumerate().map(|(look, name)| {
        let of = rows.iter().filter(|row| row.solver() == *name && row.e_vel > 0.0);
        let line: Vec<_> = of.clone().map(|row| (row.ms_low, row.e_vel)).collect();
        let points = line.iter().map(|&(ms, e)| (ms, e, String::new())).collect();
        Series { name: name.clone(), look, points, line }
    });
    let frame =
        Frame { title: &rows[0].problem, x: "time [ms]", y: "e_vel", scales: (Decades, Decades), size: (400, 300) };
    svg(&frame, &series.collect::<Vec<_>>())
}

/// A profile of what each of some solvers costs on each of `count` problems.
fn profile_picture(title: &str, y: &str, count: usize, names: &[String], costs: &[Vec<Option<f64>>]) -> String {
    let named = names.iter().enumerate().zip(profile(costs));
    let series = |((look, name), ratios): ((usize, &String), Vec<f64>)| {
        let share = |n: usize| n as f64 / count as f64;
        let line = ratios.iter().enumerate().map(|(i, &ratio)| (ratio, share(i + 1))).collect();
        Series { name: name.clone(), look, points: Vec::new(), line }
    };
    let frame = Frame { title, x: "time, relative to the fastest", y, scales: (Decades, Share), size: (400, 280) };
    svg(&frame, &named.map(series).collect::<Vec<_>>())
}

/// An error in the unit for people, with the unit.
fn shown(fault: Fault, error: f64) -> String {
    format!("{} {}", number(error * 1e3), fault.unit())
}

/// Three digits.
fn number(x: f64) -> String {
    if !x.is_finite() || x == 0.0 {
        return if x.is_nan() { "-".into() } else { x.to_string() };
    }
    let digits = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{x:.digits$}")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A picture as part of a page: it needs no name space there.
fn inline(svg: &str) -> String {
    svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
}

/// Pictures of one size in rows of so many.
fn grid(pictures: &[String], columns: usize) -> String {
    let size = |name: &str| {
        let of = |p: &String| p.split(&format!(" {name}=\"")).nth(1)?.split('"').next()?.parse::<usize>().ok();
        pictures.first().and_then(of).unwrap_or(0)
    };
    let (width, height) = (size("width"), size("height"));
    let rows = pictures.len().div_ceil(columns);
    let (w, h) = (width * columns.min(pictures.len()), height * rows);
    let mut all =
        format!("<svg width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" xmlns=\"http://www.w3.org/2000/svg\">\n");
    for (i, picture) in pictures.iter().enumerate() {
        let (x, y) = (i % columns * width, i / columns * height);
        all.push_str(&picture.replacen("<svg ", &format!("<svg x=\"{x}\" y=\"{y}\" "), 1));
    }
    all + "</svg>\n"
}

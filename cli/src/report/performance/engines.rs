//! All engines, scene by scene: the table and the picture.

use std::fmt::Write as _;

use crate::report::comparison::WindowRow;
use crate::report::number::number;
use crate::report::plot::{Frame, Look, Scale, Series, grid, svg};

/// The engine of the page.
pub(super) const OWN: &str = "drystone";

/// Values in the order of their first occurrence.
pub(super) fn distinct<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut kept = Vec::new();
    all.for_each(|value| {
        if !kept.contains(&value) {
            kept.push(value);
        }
    });
    kept
}

/// The thirds of one setting in a scene, on one number of threads.
fn thirds<'a>(rows: &'a [WindowRow], scene: &str, threads: usize, setting: &str) -> Vec<&'a WindowRow> {
    rows.iter().filter(|r| (&*r.scene, r.threads, &*r.setting) == (scene, threads, setting)).collect()
}

/// `1 thread`, `2 threads`.
pub(super) fn thread_count(threads: usize) -> String {
    format!("{threads} {}", if threads == 1 { "thread" } else { "threads" })
}

/// The name of a setting in the table, without what the page says of all: the CPU, and the engines' defaults.
fn name(setting: &str) -> String {
    setting.replace(" cpu ", " ").replace(" 30 Hz", "")
}

fn cell(numbers: impl Iterator<Item = f64>) -> String {
    numbers.map(number).collect::<Vec<_>>().join(", ")
}

pub(super) fn table(rows: &[WindowRow]) -> String {
    let all_threads = distinct(rows.iter().map(|r| r.threads));
    let mut text = String::from("| scene, steps | engine |");
    for &threads in &all_threads {
        let _ = write!(text, " {}: ms in each third | to the best other |", thread_count(threads));
    }
    let _ = write!(text, " mean overlap mm | deepest mm | rms mm/s | in place |\n|---|---|");
    let _ = writeln!(text, "{}--:|--:|--:|--:|", "--:|--:|".repeat(all_threads.len()));
    for scene in distinct(rows.iter().map(|r| &*r.scene)) {
        let of_scene = || rows.iter().filter(|r| r.scene == scene);
        let steps = of_scene().map(|r| r.to).max().unwrap_or(0);
        for (k, setting) in distinct(of_scene().map(|r| &*r.setting)).into_iter().enumerate() {
            let head = if k == 0 { format!("{scene}, {steps}") } else { String::new() };
            let _ = write!(text, "| {head} | {} |", name(setting));
            for &threads in &all_threads {
                let own = thirds(rows, scene, threads, setting);
                let is_own = own.first().is_some_and(|r| r.engine == OWN);
                let to_best = cell(own.iter().filter(|_| is_own).filter_map(|r| r.to_best));
                let ms = cell(own.iter().map(|r| r.ms));
                let _ = write!(text, " {ms} | {to_best} |");
            }
            // Errors are those of the first number of threads, at the end of the run.
            let own = thirds(rows, scene, all_threads[0], setting);
            let Some(end) = own.last() else {
                let _ = writeln!(text, " | | | |");
                continue;
            };
            let place = end.in_place.map_or_else(String::new, |n| format!("{n} of {}", end.bodies));
            let [mean, deepest, speed] =
                [end.penetration_mean, end.penetration_max, end.speed_rms].map(|x| number(1e3 * x));
            let _ = writeln!(text, " {mean} | {deepest} | {speed} | {place} |");
        }
    }
    text
}

/// Time of a step over the run on the smallest number of threads, with one frame for each scene.
pub(super) fn picture(rows: &[WindowRow]) -> String {
    let threads = rows.iter().map(|r| r.threads).min().unwrap_or(1);
    let frame_of = |scene: &str| {
        let settings = distinct(rows.iter().filter(|r| r.scene == scene).map(|r| &*r.setting));
        let series = settings.iter().filter_map(|setting| {
            let own = thirds(rows, scene, threads, setting);
            let engine = &*own.first()?.engine;
            // The first setting of an engine is its default.
            let is_first = rows.iter().find(|r| r.engine == engine).is_some_and(|r| r.setting == **setting);
            let look = Look::of_engine(engine);
            let look = if is_first { look } else { look.dashed() };
            let line: Vec<_> = own.iter().map(|r| ((r.from - 1 + r.to) as f64 / 2.0, r.ms)).collect();
            let points = line.iter().map(|&(x, y)| (x, y, String::new())).collect();
            Some(Series { name: (*setting).to_owned(), look, points, line })
        });
        let title = format!("{scene}, threads: {threads}");
        let scales = (Scale::Linear, Scale::Decades);
        let frame = Frame { title: &title, x: "step", y: "ms a step", scales, size: (520, 300) };
        svg(&frame, &series.collect::<Vec<_>>())
    };
    grid(&distinct(rows.iter().map(|r| &*r.scene)).into_iter().map(frame_of).collect::<Vec<_>>(), 2)
}

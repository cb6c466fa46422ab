//! One paragraph for each finding, with figures from the rows.

use std::fmt::Write as _;

use super::Rows;
use super::engines::{OWN, distinct};
use crate::report::bench::{FallingRow, GrowthRow, LimitRow, OPERATIONS, StatesRow, WorldsRow};
use crate::report::comparison::WindowRow;
use crate::report::number::number;
use crate::report::prose::wrapped_page;

pub(super) fn findings(rows: &Rows) -> String {
    [
        (
            "Other engines",
            "engines-1.csv, engines-2.csv",
            format!("{}\n\n{}", beside(&rows.engines), stalls(&rows.engines)),
        ),
        ("Stages of a step, falling and at rest", "falling.csv", stages(&rows.falling)),
        ("One island of any size", "growth.csv", growth(&rows.growth)),
        ("Sweeps and hardware limits", "limits.csv", limits(&rows.limits)),
        ("Many worlds", "worlds.csv", worlds(&rows.worlds)),
        ("Saved states", "states.csv", states(&rows.states)),
    ]
    .map(|(title, files, text)| format!("\n## {title}\n\n{}\nRows: {}.\n", wrapped_page(&text), links(files)))
    .concat()
}

fn links(files: &str) -> String {
    files.split(", ").map(|file| format!("[{file}](performance/{file})")).collect::<Vec<_>>().join(", ")
}

/// `one thread`, `2 threads`.
fn on(threads: usize) -> String {
    if threads == 1 { "one thread".into() } else { format!("{threads} threads") }
}

/// The smallest and the largest number, as text.
fn range(numbers: impl Iterator<Item = f64> + Clone) -> String {
    let (low, high) = (numbers.clone().fold(f64::INFINITY, f64::min), numbers.fold(0.0, f64::max));
    format!("{} to {}", number(low), number(high))
}

fn beside(rows: &[WindowRow]) -> String {
    let own = || rows.iter().filter(|r| r.engine == OWN);
    let times = distinct(own().map(|r| r.threads)).into_iter().map(|threads| {
        let ratios = || own().filter(move |r| r.threads == threads).filter_map(|r| Some((r.to_best?, r)));
        let most = ratios().max_by(|a, b| a.0.total_cmp(&b.0));
        let of_most =
            most.map_or_else(String::new, |(_, r)| format!(", most in {}, steps {} to {}", r.scene, r.from, r.to));
        format!("{} ({}{of_most})", range(ratios().map(|r| r.0)), on(threads))
    });
    // Relative to the smallest overlap of another engine, for each third.
    let to_least = |mine: &WindowRow| {
        let same = |r: &&WindowRow| r.engine != OWN && (&r.run, r.from) == (&mine.run, mine.from);
        let least = rows.iter().filter(same).map(|r| r.penetration_mean).reduce(f64::min)?;
        Some(mine.penetration_mean / least)
    };
    let overlap = own().filter_map(to_least).fold(0.0, f64::max);
    format!(
        "In all thirds, {OWN} needs {} of the fastest other engine's time. Its mean overlap is at most {} of the least \
         mean overlap of the others.",
        times.collect::<Vec<_>>().join(" and "),
        number(overlap)
    )
}

fn stalls(rows: &[WindowRow]) -> String {
    let own = || rows.iter().filter(|r| r.engine == OWN);
    let largest = |of: fn(&WindowRow) -> f64| own().map(|r| (of(r), r)).max_by(|a, b| a.0.total_cmp(&b.0));
    let name = |found: Option<(f64, &WindowRow)>| {
        found.map_or_else(String::new, |(x, r)| format!("{} ({}, {})", number(x), r.scene, on(r.threads)))
    };
    let first = |r: &WindowRow| if r.from == 1 { r.ms_first / r.ms } else { 0.0 };
    format!(
        "The slowest later step takes at most {} times its third's median. The first step takes at most {} times that, \
         because it computes all pairs and colors and allocates all memory.",
        name(largest(|r| r.ms_worst / r.ms)),
        name(largest(first))
    )
}

/// The thirds of the largest scene on the smallest number of threads.
fn stages(rows: &[FallingRow]) -> String {
    let key = |r: &FallingRow| (r.bodies, std::cmp::Reverse(r.threads));
    let Some(most) = rows.iter().map(key).max() else { return String::new() };
    let shown: Vec<_> = rows.iter().filter(|r| key(r) == most).collect();
    let mut text = format!(
        "Medians of {}, {}, in ms:\n\n\
         | steps | step | detection | colors | rows | sweeps | store | pairs recomputed | manifolds |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        shown[0].scene,
        on(shown[0].threads)
    );
    for r in shown {
        let [ms, detect, color, prepare, run, store] = [r.ms, r.detect, r.color, r.prepare, r.run, r.store].map(number);
        let _ = writeln!(
            text,
            "| {} to {} | {ms} | {detect} | {color} | {prepare} | {run} | {store} | {} of {} | {} |",
            r.from, r.to, r.computed, r.pairs, r.manifolds
        );
    }
    text.trim_end().to_owned()
}

fn growth(rows: &[GrowthRow]) -> String {
    let mut text = String::from(
        "A plane pyramid is one island. Sweep time is the least of the stage `run` (in parentheses: relative to the \
         smallest island). Bytes are the process's peak. Other times are in ms.\n\n\
         | boxes | sweeps, ns per manifold and pass | bytes a box | threads | step | detection | rows | sweeps |\n\
         |--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for scene in distinct(rows.iter().map(|r| &r.scene)) {
        let own: Vec<_> = rows.iter().filter(|r| r.scene == *scene).collect();
        let times = own.iter().map(|r| format!("{} ({}) with {}", number(r.ns), number(r.growth), on(r.threads)));
        let memory = own[0].bytes_a_box.map_or_else(String::new, |bytes| format!("{bytes:.0}"));
        let [ms, detect, rows, run] = [own[0].ms, own[0].detect, own[0].prepare, own[0].run].map(number);
        let _ = writeln!(
            text,
            "| {} | {} | {memory} | {} | {ms} | {detect} | {rows} | {run} |",
            own[0].boxes,
            times.collect::<Vec<_>>().join(", "),
            on(own[0].threads)
        );
    }
    text.trim_end().to_owned()
}

fn limits(rows: &[LimitRow]) -> String {
    let mut text = format!(
        "One sweep over a point with friction between two cubes takes {OPERATIONS} counted scalar operations. Bytes \
         are those of the SIMD lanes (in parentheses: of the kernels over plain rows, which load a body for each \
         contact). The triad is a = b + s c over the MiB that the lanes hold; cached bodies can exceed 100 % of it. \
         The peak is for multiplications and additions on registers.\n\n\
         | scene | MiB | threads | ns a manifold | bytes a manifold | million points a second | of the triad, GB/s | of the peak, G/s |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for r in rows {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.0} ({:.0}) | {} | {:.0} % of {} | {:.0} % of {} |",
            r.scene,
            number(r.held as f64 / f64::from(1 << 20)),
            on(r.threads),
            number(r.ns),
            r.lane_bytes,
            r.kernel_bytes,
            number(r.sweeps * 1e-6),
            100.0 * r.of_triad,
            number(r.triad * 1e-9),
            100.0 * r.of_peak,
            number(r.peak * 1e-9)
        );
    }
    text.trim_end().to_owned()
}

fn worlds(rows: &[WorldsRow]) -> String {
    let mut text = String::from(
        "Steps of single worlds at rest per second (in parentheses: relative to the best number of worlds):\n\n",
    );
    for key in distinct(rows.iter().map(|r| (&r.scene, r.threads))) {
        let own = rows.iter().filter(|r| (&r.scene, r.threads) == key);
        let list = own.map(|r| format!("{:.0} ({}) of {}", r.per_second, number(r.of_best), r.worlds));
        let _ = writeln!(text, "* {}, {}: {} worlds", key.0, on(key.1), list.collect::<Vec<_>>().join(", "));
    }
    text.trim_end().to_owned()
}

fn states(rows: &[StatesRow]) -> String {
    let mut text = String::from(
        "The pile is awake and at rest. A step is in ms; other times are relative to it. `Rollback::push` copies a \
         state into allocated memory, `Simulation::restore` returns to it, and `save` and `load` convert it to and \
         from bytes.\n\n\
         | scene | threads | step | push | restore | save | load | bytes a body |\n|---|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for r in rows {
        let [push, back, save, load] = [r.snapshot, r.restore, r.save, r.load].map(|time| number(time / r.ms));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {push} | {back} | {save} | {load} | {:.0} |",
            r.scene,
            r.threads,
            number(r.ms),
            r.bytes_a_body
        );
    }
    text.trim_end().to_owned()
}

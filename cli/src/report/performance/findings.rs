//! One paragraph for each finding, with figures from the rows.

use std::fmt::Write as _;

use super::Rows;
use super::engines::{OWN, distinct, thread_count};
use crate::report::bench::{FallingRow, GrowthRow, LimitRow, OPERATIONS, StatesRow, WorldsRow};
use crate::report::comparison::WindowRow;
use crate::report::number::number;
use crate::report::prose::wrapped_page;

pub(super) fn findings(rows: &Rows) -> String {
    [
        ("Other engines", format!("{}\n\n{}", beside(&rows.engines), stalls(&rows.engines))),
        ("Stages of a step, falling and at rest", stages(&rows.falling)),
        ("One island of any size", growth(&rows.growth)),
        ("Sweeps and hardware limits", limits(&rows.limits)),
        ("Many worlds", worlds(&rows.worlds)),
        ("Saved states", states(&rows.states)),
    ]
    .map(|(title, text)| format!("\n## {title}\n\n{}", wrapped_page(&text)))
    .concat()
}

/// `one thread`, `2 threads`.
fn on(threads: usize) -> String {
    if threads == 1 { "one thread".into() } else { format!("{threads} threads") }
}

/// The smallest and the largest number, as text.
fn range(numbers: impl Iterator<Item = f64> + Clone) -> String {
    let (low, high) = (numbers.clone().fold(f64::INFINITY, f64::min), numbers.fold(0.0, f64::max));
    format!("between {} and {}", number(low), number(high))
}

fn beside(rows: &[WindowRow]) -> String {
    let own = || rows.iter().filter(|r| r.engine == OWN);
    let ratios = || own().filter_map(|r| Some((r.to_best?, r)));
    let times = distinct(own().map(|r| r.threads)).into_iter().map(|threads| {
        let of_threads = ratios().filter(move |(_, r)| r.threads == threads);
        format!("{} times ({})", range(of_threads.map(|(ratio, _)| ratio)), on(threads))
    });
    let most = ratios().max_by(|a, b| a.0.total_cmp(&b.0));
    let of_most = most
        .map_or_else(String::new, |(_, r)| format!("; its worst case is {}, steps {} to {}", r.scene, r.from, r.to));
    // Relative to the smallest overlap of another engine, for each third.
    let to_least = |mine: &WindowRow| {
        let same = |r: &&WindowRow| r.engine != OWN && (&r.run, r.from) == (&mine.run, mine.from);
        let least = rows.iter().filter(same).map(|r| r.penetration_mean).reduce(f64::min)?;
        Some(mine.penetration_mean / least)
    };
    let overlap = own().filter_map(to_least).fold(0.0, f64::max);
    format!(
        "In each third of a run, {OWN} takes {} as long as the fastest other engine{of_most}. Its mean overlap is at \
         most {} times the least of the other engines.",
        times.collect::<Vec<_>>().join(" and "),
        number(overlap)
    )
}

fn stalls(rows: &[WindowRow]) -> String {
    let most = |of: fn(&WindowRow) -> f64| {
        let own = rows.iter().filter(|r| r.engine == OWN).map(|r| (of(r), r)).max_by(|a, b| a.0.total_cmp(&b.0));
        let others = rows.iter().filter(|r| r.engine != OWN).map(of).fold(0.0, f64::max);
        own.map_or_else(String::new, |(x, r)| {
            format!("{} times as long ({}, {}; other engines {})", number(x), r.scene, on(r.threads), number(others))
        })
    };
    format!(
        "Compared with the median of its third, the slowest step after the first takes up to {}, and the first step \
         up to {}. The first step computes all pairs and colors, and allocates all memory.",
        most(|r| r.ms_worst / r.ms),
        most(|r| if r.from == 1 { r.ms_first / r.ms } else { 0.0 })
    )
}

/// The thirds of the largest scene on the smallest number of threads.
fn stages(rows: &[FallingRow]) -> String {
    let key = |r: &FallingRow| (r.bodies, std::cmp::Reverse(r.threads));
    let Some(most) = rows.iter().map(key).max() else { return String::new() };
    let shown: Vec<_> = rows.iter().filter(|r| key(r) == most).collect();
    let mut text = format!(
        "Medians of {}, {}, in ms ([rows](performance/falling.csv)):\n\n\
         | steps | step | detection | colors | rows | sweeps | pairs recomputed | manifolds |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|\n",
        shown[0].scene,
        on(shown[0].threads)
    );
    for r in shown {
        let [ms, detect, color, prepare, run] = [r.ms, r.detect, r.color, r.prepare, r.run].map(number);
        let _ = writeln!(
            text,
            "| {} to {} | {ms} | {detect} | {color} | {prepare} | {run} | {} of {} | {} |",
            r.from, r.to, r.computed, r.pairs, r.manifolds
        );
    }
    text.trim_end().to_owned()
}

fn growth(rows: &[GrowthRow]) -> String {
    let all_threads = distinct(rows.iter().map(|r| r.threads));
    let heads: Vec<_> = all_threads.iter().map(|&threads| thread_count(threads)).collect();
    let mut text = format!(
        "A plane pyramid is one island. Times per manifold are the least times of the stage `run`; the ratio to the \
         smallest island is in parentheses. Bytes are the peak of the process. Times in ms are on {} \
         ([rows](performance/growth.csv)).\n\n\
         | boxes | ns per manifold and pass, {} | bytes a box | step, ms | detection, ms | rows, ms | sweeps, ms |\n\
         |--:|{}--:|--:|--:|--:|--:|\n",
        on(all_threads[0]),
        heads.join(" | "),
        "--:|".repeat(heads.len())
    );
    for scene in distinct(rows.iter().map(|r| &r.scene)) {
        let own: Vec<_> = rows.iter().filter(|r| r.scene == *scene).collect();
        let time = |threads: &usize| {
            let found = own.iter().find(|r| r.threads == *threads);
            found.map_or_else(String::new, |r| format!("{} ({})", number(r.ns), number(r.growth)))
        };
        let times: Vec<_> = all_threads.iter().map(time).collect();
        let memory = own[0].bytes_a_box.map_or_else(String::new, |bytes| format!("{bytes:.0}"));
        let [ms, detect, rows, run] = [own[0].ms, own[0].detect, own[0].prepare, own[0].run].map(number);
        let (boxes, times) = (own[0].boxes, times.join(" | "));
        let _ = writeln!(text, "| {boxes} | {times} | {memory} | {ms} | {detect} | {rows} | {run} |");
    }
    text.trim_end().to_owned()
}

fn limits(rows: &[LimitRow]) -> String {
    let mut text = format!(
        "One sweep over a point with friction between two cubes takes {OPERATIONS} counted scalar operations. MiB is \
         the size of all SIMD lanes. Bytes count the reads and writes of a sweep. The triad is a = b + s c over arrays of \
         that size in total. The peak is for multiplications and additions on registers \
         ([rows](performance/limits.csv)).\n\n\
         | scene | MiB | threads | ns a manifold | bytes a manifold | of the triad, GB/s | of the peak, G/s |\n\
         |---|--:|--:|--:|--:|--:|--:|\n",
    );
    for r in rows {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.0} | {:.0} % of {} | {:.0} % of {} |",
            r.scene,
            number(r.held as f64 / f64::from(1 << 20)),
            r.threads,
            number(r.ns),
            r.lane_bytes,
            100.0 * r.of_triad,
            number(r.triad * 1e-9),
            100.0 * r.of_peak,
            number(r.peak * 1e-9)
        );
    }
    text.trim_end().to_owned()
}

fn worlds(rows: &[WorldsRow]) -> String {
    let counts = distinct(rows.iter().map(|r| r.worlds));
    let mut text = String::from(
        "Steps of single worlds at rest per second, by the number of worlds ([rows](performance/worlds.csv)):\n\n\
         | scene | threads |",
    );
    for (k, count) in counts.iter().enumerate() {
        let unit = match (k, count) {
            (0, 1) => " world",
            (0, _) => " worlds",
            _ => "",
        };
        let _ = write!(text, " {count}{unit} |");
    }
    let _ = writeln!(text, "\n|---|--:|{}", "--:|".repeat(counts.len()));
    for (scene, threads) in distinct(rows.iter().map(|r| (&r.scene, r.threads))) {
        let _ = write!(text, "| {scene} | {threads} |");
        for &count in &counts {
            let found = rows.iter().find(|r| (&r.scene, r.threads, r.worlds) == (scene, threads, count));
            let _ = write!(text, " {} |", found.map_or_else(String::new, |r| format!("{:.0}", r.per_second)));
        }
        text.push('\n');
    }
    text.trim_end().to_owned()
}

fn states(rows: &[StatesRow]) -> String {
    let mut text = String::from(
        "The pile is awake and at rest. A step is in ms; other times are relative to a step \
         ([rows](performance/states.csv)). \
         `Rollback::push` copies a state into allocated memory, `Simulation::restore` returns to it, and `save` and \
         `load` convert it to and from bytes.\n\n\
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

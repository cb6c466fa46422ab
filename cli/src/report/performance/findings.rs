//! A paragraph a finding, with the figures of the rows.

use std::fmt::Write as _;

use super::Rows;
use super::engines::{OWN, distinct};
use crate::report::bench::{FallingRow, GrowthRow, LimitRow, WorldsRow};
use crate::report::comparison::WindowRow;
use crate::report::number::number;

pub(super) fn findings(rows: &Rows) -> String {
    [
        ("Beside other engines", "engines-1.csv, engines-2.csv", beside(&rows.engines)),
        ("No step that stalls", "engines-1.csv, engines-2.csv", stalls(&rows.engines)),
        ("Stages of a step, falling and at rest", "falling.csv", stages(&rows.falling)),
        ("One island of any size", "growth.csv", growth(&rows.growth)),
        ("Sweeps and the limits of the machine", "limits.csv", limits(&rows.limits)),
        ("Many worlds", "worlds.csv", worlds(&rows.worlds)),
    ]
    .map(|(title, files, text)| format!("\n## {title}\n\n{text} Rows: {}.\n", links(files)))
    .concat()
}

fn links(files: &str) -> String {
    files.split(", ").map(|file| format!("[{file}](performance/{file})")).collect::<Vec<_>>().join(", ")
}

/// `one thread`, `2 threads`.
fn on(threads: usize) -> String {
    if threads == 1 { "one thread".into() } else { format!("{threads} threads") }
}

/// The least and the largest number, as text.
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
    // Of the overlap of the other engine that has least, third by third.
    let to_least = |mine: &WindowRow| {
        let same = |r: &&WindowRow| r.engine != OWN && (&r.run, r.from) == (&mine.run, mine.from);
        let least = rows.iter().filter(same).map(|r| r.penetration_mean).reduce(f64::min)?;
        Some(mine.penetration_mean / least)
    };
    let overlap = own().filter_map(to_least).fold(0.0, f64::max);
    format!(
        "Over all thirds of all scenes, {OWN} needs {} of the time of the fastest other engine. Its mean overlap is at most {} of the \
         least mean overlap of another engine at the end of the same third.",
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
        "The slowest step of a third takes at most {} times the median of the third. The first step of a run takes at most {} times \
         the median of the first third: it computes all pairs, chooses all colors and takes all memory.",
        name(largest(|r| r.ms_worst / r.ms)),
        name(largest(first))
    )
}

fn stages(rows: &[FallingRow]) -> String {
    let most = rows.iter().map(|r| r.bodies).max().unwrap_or(0);
    let of_scene = rows.iter().filter(|r| r.bodies == most);
    let thirds = of_scene.map(|r| {
        let [detect, color, prepare, run, store] = [r.detect, r.color, r.prepare, r.run, r.store].map(number);
        format!(
            "* {}, steps {} to {}, {}: {} ms; detection {detect}, colors {color}, rows {prepare}, sweeps {run}, store {store}; {} of {} pairs \
             computed anew",
            r.scene,
            r.from,
            r.to,
            on(r.threads),
            number(r.ms),
            r.computed,
            r.pairs
        )
    });
    format!("Medians of the largest falling scene:\n\n{}\n\n", thirds.collect::<Vec<_>>().join("\n"))
}

fn growth(rows: &[GrowthRow]) -> String {
    let mut text = String::from(
        "A plane pyramid is one island. The least time of the stage `run` for a manifold and a pass over all contacts:\n\n",
    );
    for row in rows {
        let memory = row.bytes_a_box.map_or_else(String::new, |bytes| format!("; {bytes:.0} bytes a box"));
        let _ = writeln!(
            text,
            "* {} boxes, {}: {} ns, {} times the smallest{memory}; a step {} ms, of it detection {}, rows {}, sweeps {}",
            row.boxes,
            on(row.threads),
            number(row.ns),
            number(row.growth),
            number(row.ms),
            number(row.detect),
            number(row.prepare),
            number(row.run)
        );
    }
    text + "\nThe bytes are of the whole process at its peak."
}

fn limits(rows: &[LimitRow]) -> String {
    let mut text = String::from(
        "A sweep over one point with friction takes 299.5 operations on single numbers, counted by running the kernel over a number type \
         that counts. Bytes are those that the lanes read and write, each body as often as a contact names it. The triad is a = b + s c over \
         as many bytes as the lanes hold; the peak is that of multiplications and additions on registers alone:\n\n",
    );
    for row in rows {
        let _ = writeln!(
            text,
            "* {}, {}, {} MiB of rows and bodies: {} ns and {:.0} bytes a manifold ({:.0} of the kernels over plain rows), {} million \
             points a second; {:.0} % of a triad of {} GB/s, {:.0} % of a peak of {} G/s",
            row.scene,
            on(row.threads),
            number(row.held as f64 / f64::from(1 << 20)),
            number(row.ns),
            row.lane_bytes,
            row.kernel_bytes,
            number(row.sweeps * 1e-6),
            100.0 * row.of_triad,
            number(row.triad * 1e-9),
            100.0 * row.of_peak,
            number(row.peak * 1e-9)
        );
    }
    text + "\nA share of the triad above 100 % means that bodies come from a cache more than once."
}

fn worlds(rows: &[WorldsRow]) -> String {
    let mut text = String::from("Steps of one world in a second, all worlds at rest:\n\n");
    for key in distinct(rows.iter().map(|r| (&r.scene, r.threads))) {
        let own = rows.iter().filter(|r| (&r.scene, r.threads) == key);
        let list = own.map(|r| format!("{:.0} ({}) of {}", r.per_second, number(r.of_best), r.worlds));
        let _ = writeln!(text, "* {}, {}: {} worlds", key.0, on(key.1), list.collect::<Vec<_>>().join(", "));
    }
    text + "\nIn brackets is the share of the best number of worlds."
}

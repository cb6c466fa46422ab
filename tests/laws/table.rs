//! What many runs came to: a table with a row for each family and kind, and a file with a line for each world.

use crate::laws::draw::Drawn;
use crate::laws::run::{MAX_DRIFT, MAX_GAP, Verdict};

/// A world, its run, and the time that it took (s).
pub type Row = (Drawn, (Verdict, f64));

/// The worlds of a family and a kind, one after another.
fn same(a: &Row, b: &Row) -> bool {
    (a.0.family, a.0.kind, a.0.collides) == (b.0.family, b.0.kind, b.0.collides)
}

/// The worlds of each family and kind.
pub fn groups(rows: &[Row]) -> impl Iterator<Item = &[Row]> {
    rows.chunk_by(same)
}

/// Those that are lost or break law 1, the worst first.
pub fn worst(rows: &[Row]) -> Vec<&Row> {
    let mut broken: Vec<_> = rows.iter().filter(|(_, (v, _))| v.lost.is_some() || v.excess > 0.0).collect();
    // Energy that was lost and comes back counts less than new energy.
    let size = |(_, (v, _)): &Row| {
        if v.lost.is_some() { f64::INFINITY } else { v.lasting_gain().max(1e-9 * v.gain()) }
    };
    broken.sort_by(|x, y| size(y).total_cmp(&size(x)));
    broken
}

fn line(name: &str, rows: &[Row], most_seeds: usize) -> String {
    let count = |is: &dyn Fn(&Verdict) -> bool| rows.iter().filter(|(_, (verdict, _))| is(verdict)).count();
    let share = |is: &dyn Fn(&Verdict) -> bool| format!("{:.1} %", 100.0 * count(is) as f64 / rows.len() as f64);
    let gained = |least: f64| move |v: &Verdict| v.lost.is_none() && v.lasting_gain() > least;
    let most = |of: &dyn Fn(&Verdict) -> f64| rows.iter().map(|(_, (v, _))| of(v)).fold(0.0, f64::max);
    let drift = |which: usize| move |v: &Verdict| v.drift.map_or(0.0, |drift| drift[which]);
    let finite_gain = |v: &Verdict| if v.lost.is_none() { v.lasting_gain() } else { 0.0 };
    let seeds: Vec<String> =
        self::worst(rows).into_iter().take(most_seeds).map(|(drawn, _)| drawn.seed.to_string()).collect();
    let seconds: f64 = rows.iter().map(|(_, (_, seconds))| seconds).sum();
    format!(
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {:.1e} | {} | {:.1e} | {} | {:.1e} | {} | {:.1e} | {:.3} | {} |\n",
        rows.len(),
        share(&|v| v.lost.is_some() || v.excess > 0.0),
        share(&|v| v.lost.is_some() || v.above_start > 0.0),
        share(&gained(0.01)),
        count(&gained(10.0)),
        count(&gained(1e6)),
        count(&|v| v.lost.is_some()),
        most(&finite_gain),
        share(&|v| v.gap.worst() > MAX_GAP),
        most(&|v| v.gap.worst()),
        share(&|v| drift(0)(v) > MAX_DRIFT),
        most(&drift(0)),
        share(&|v| drift(1)(v) > MAX_DRIFT),
        most(&drift(1)),
        seconds / rows.len() as f64,
        seeds.join(" "),
    )
}

/// The table, with the worst seeds of each row.
pub fn text(rows: &[Row], worst: usize) -> String {
    let mut text = String::from(
        "| worlds | number | break law 1 | above start | gain > 1 % | > 10x | > 1e6x | lost | worst | gap > 1 % | worst gap | drift | worst | spin drift | worst | s each | seeds |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for own in groups(rows) {
        let name = own[0].0.to_string();
        let name = name.rsplit_once('/').map_or(name.as_str(), |(group, _)| group);
        text += &line(name, own, worst);
    }
    text + &line("all", rows, 0)
}

/// A line for each world.
pub fn csv(rows: &[Row]) -> String {
    let mut text = String::from(
        "world,broken,gain,excess,above_start,scale,push,work,gap_share,gap_angle,drift,spin_drift,open,gap_at,substeps,broken_at,seconds,lost\n",
    );
    for (drawn, (v, seconds)) in rows {
        let [drift, spin] = v.drift.unwrap_or([f64::NAN; 2]);
        let at = v.broken_at.map_or(String::new(), |step| step.to_string());
        let lost = v.lost.as_deref().unwrap_or_default().replace([',', '\n'], ";");
        text += &format!(
            "{drawn},{},{:.3e},{:.3e},{:.3e},{:.3e},{:.3e},{:.3e},{:.2e},{:.2e},{drift:.2e},{spin:.2e},{},{},{},{at},{seconds:.3},{lost}\n",
            v.broken().join(" "),
            v.gain(),
            v.excess,
            v.above_start,
            v.scale,
            v.push,
            v.work,
            v.gap.share,
            v.gap.angle,
            v.open,
            v.gap_at,
            v.substeps,
        );
    }
    text
}

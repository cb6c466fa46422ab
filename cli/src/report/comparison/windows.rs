//! The thirds of a run. A run in which bodies fall, land and rest has no single step time.

use std::ops::Range;

use super::row::{BLOCK, Lane, Row, WindowRow};
use drystone::stats::{largest, median};

/// The windows of each contender that it finished, in the order of `thirds`, which are ranges of blocks.
pub(super) fn windows(rows: &[Row], lanes: &[Lane], thirds: &[Range<usize>]) -> Vec<Vec<WindowRow>> {
    let of = |row: &Row, lane: &Lane, third: &Range<usize>| {
        let errors = lane.errors.iter().find(|(block, _)| block + 1 == third.end).map(|(_, errors)| errors)?;
        let [from, to] = [third.start, third.end].map(|block| block * BLOCK as usize);
        let steps = &lane.steps[from.max(1)..to];
        let others = rows.iter().zip(lanes).filter(|(other, _)| other.engine != row.engine);
        let ratios = others.filter_map(|(_, other)| time_ratio(lane, other, third));
        Some(WindowRow {
            scene: row.scene.clone(),
            hash: row.hash.clone(),
            run: row.run.clone(),
            commit: row.commit.clone(),
            machine: row.machine.clone(),
            threads: row.threads,
            bodies: row.bodies,
            engine: row.engine.clone(),
            setting: row.setting().label(),
            clock: row.clock.clone(),
            from: from + 1,
            to,
            ms: median(steps),
            ms_worst: largest(0.0, steps.iter().copied()),
            ms_first: lane.steps[0],
            to_best: ratios.reduce(f64::max),
            penetration_max: errors.penetration.max,
            penetration_mean: errors.penetration.mean,
            speed_rms: errors.speed,
            drift: errors.drift,
            in_place: errors.in_place,
        })
    };
    let all = rows.iter().zip(lanes);
    all.map(|(row, lane)| thirds.iter().map_while(|third| of(row, lane, third)).collect()).collect()
}

/// Median over the blocks of a third: the time of a step relative to that of another contender in the same round.
/// `None` if the other did not finish the third.
fn time_ratio(own: &Lane, other: &Lane, third: &Range<usize>) -> Option<f64> {
    let block = |lane: &Lane, k: usize| lane.steps.chunks(BLOCK as usize).nth(k).map(median);
    let ratios: Option<Vec<_>> = third.clone().map(|k| Some(block(own, k)? / block(other, k)?)).collect();
    ratios.map(|ratios| median(&ratios))
}

#[cfg(test)]
mod tests {
    use super::super::measure::measure;
    use super::super::row::Errors;
    use super::super::{Contender, Drystone, Origin};
    use super::*;
    use crate::report::rounds::thirds;
    use drystone::SolverConfig;
    use drystone_scenes::Scene;

    /// A lane over six blocks. Its thirds have these times, and the first `finished` of them have errors.
    fn lane(ms: [f64; 3], finished: usize) -> Lane {
        let errors = |third: usize| (2 * third + 1, Errors { speed: 1e-3 * (third + 1) as f64, ..Errors::default() });
        Lane {
            steps: (0..20 * finished).map(|step| ms[step / 20]).collect(),
            errors: (0..finished).map(errors).collect(),
            ..Lane::default()
        }
    }

    #[test]
    fn a_window_has_its_median_and_its_worst_step_and_the_first_step_stands_apart() {
        let mut slow = lane([4.0, 8.0, 12.0], 3);
        (slow.steps[0], slow.steps[44]) = (40.0, 30.0);
        // The third engine is the fastest until its bodies are lost.
        let lanes = [slow, lane([2.0; 3], 3), lane([1.0; 3], 1)];
        let row = |engine: &str| Row { engine: engine.into(), bodies: 7, ..Row::default() };
        let all = windows(&["slow", "fast", "breaks"].map(row), &lanes, &thirds(6));
        let [slow, fast, breaks] = &all[..] else { panic!("three contenders") };
        let times = |w: &WindowRow| (w.from, w.to, w.ms, w.ms_worst, w.ms_first, w.to_best);
        let wanted = [
            (1, 20, 4.0, 4.0, 40.0, Some(4.0)),
            (21, 40, 8.0, 8.0, 40.0, Some(4.0)),
            (41, 60, 12.0, 30.0, 40.0, Some(6.0)),
        ];
        assert_eq!(slow.iter().map(times).collect::<Vec<_>>(), wanted);
        assert_eq!(slow.iter().map(|w| w.speed_rms).collect::<Vec<_>>(), [1e-3, 2e-3, 3e-3]);
        assert_eq!(fast.iter().map(|w| w.to_best).collect::<Vec<_>>(), [Some(2.0), Some(0.25), Some(1.0 / 6.0)]);
        assert_eq!((breaks.len(), breaks[0].to_best, breaks[0].bodies), (1, Some(0.5), 7));
    }

    #[test]
    fn every_step_is_timed_and_one_engine_alone_has_no_ratio() {
        let scene = Scene { steps: 30, ..Scene::find_spec("tower:n=2").unwrap() };
        let own = Drystone::new(&scene, "reference", &SolverConfig::default()).unwrap();
        let origin = Origin { build: String::new(), commit: "c0ffee".into(), machine: String::new(), threads: 1 };
        let rows = measure(&scene, &mut [Box::new(own) as Box<dyn Contender>], &origin, &mut || ()).unwrap();
        let windows = &rows[0].windows;
        assert_eq!(windows.iter().map(|w| (w.from, w.to)).collect::<Vec<_>>(), [(1, 10), (11, 20), (21, 30)]);
        for window in windows {
            assert!(window.ms > 0.0 && window.ms_worst >= window.ms && window.ms_first > 0.0, "{window:?}");
            assert_eq!((window.to_best, window.in_place, &*window.commit), (None, Some(2), "c0ffee"));
        }
    }
}

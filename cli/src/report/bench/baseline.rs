//! Comparison of a bench with an earlier one.

use super::{Bench, StagesRow};
use drystone::{Error, Result};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// The earlier bench has no such row.
    New,
    /// The scene has other content, so the times cannot be compared.
    OtherScene,
    /// The earlier bench ran on another machine, so the times cannot be compared.
    OtherMachine,
    /// Ratio of the new time to the earlier one. The difference is within the spread of both.
    Same(f64),
    /// The lower quartile is above the earlier upper one.
    Slower(f64),
    /// The upper quartile is below the earlier lower one.
    Faster(f64),
}

impl Bench {
    /// Reads the output of `drystone bench --json`.
    pub fn read(path: &std::path::Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
        serde_json::from_str(&text)
            .map_err(|e| Error::input(format!("{}: not what `drystone bench --json` prints: {e}", path.display())))
    }
}

pub fn compare_with(now: &Bench, then: &Bench) -> Vec<Change> {
    let change = |row: &StagesRow| {
        let Some(old) = then.rows.iter().find(|old| old.key() == row.key()) else { return Change::New };
        let ratio = row.ms / old.ms;
        match () {
            () if old.hash != row.hash => Change::OtherScene,
            () if !now.machine.is(&then.machine) => Change::OtherMachine,
            () if row.ms_low > old.ms_high => Change::Slower(ratio),
            () if row.ms_high < old.ms_low => Change::Faster(ratio),
            () => Change::Same(ratio),
        }
    };
    now.rows.iter().map(change).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::bench::bench;
    use drystone::{Backend, SolverConfig};

    fn measured() -> Bench {
        let open = || Ok(vec![Box::new(drystone::Cpu::new()) as Box<dyn Backend>]);
        let specs = ["tower:n=3".to_owned(), "pile:n=8,worlds=2".to_owned()];
        bench(&specs, &SolverConfig::default().without_sleep(), &[1], &open, 3, &mut || ()).expect("a bench")
    }

    #[test]
    fn a_bench_against_a_faster_one_is_marked_and_against_itself_is_not() {
        let now = measured();
        assert!(compare_with(&now, &now).iter().all(|c| *c == Change::Same(1.0)));
        let times = |factor: f64| {
            let mut then = now.clone();
            then.rows
                .iter_mut()
                .for_each(|r| [&mut r.ms, &mut r.ms_low, &mut r.ms_high].into_iter().for_each(|t| *t *= factor));
            compare_with(&now, &then)
        };
        assert!(times(0.01).iter().all(|c| matches!(c, Change::Slower(r) if (r - 100.0).abs() < 1e-6)));
        assert!(times(100.0).iter().all(|c| matches!(c, Change::Faster(_))));
    }

    #[test]
    fn rows_of_other_scenes_and_new_rows_have_no_ratio() {
        let now = measured();
        let mut then = now.clone();
        then.rows[0].hash = "0".repeat(16);
        then.rows[1].threads = 7;
        assert_eq!(compare_with(&now, &then), [Change::OtherScene, Change::New]);
        // A baseline is meant for another build on the same machine.
        let mut then = now.clone();
        then.machine.build = "0.0.1 release".into();
        assert_eq!(compare_with(&now, &then), [Change::Same(1.0); 2]);
        then.machine.processor = "another".into();
        assert_eq!(compare_with(&now, &then), [Change::OtherMachine; 2]);
    }

    #[test]
    fn a_row_has_counts_times_and_errors() {
        let bench = measured();
        let [tower, piles] = &bench.rows[..] else { panic!("two rows") };
        assert_eq!((tower.bodies, tower.worlds, piles.bodies, piles.worlds), (3, 1, 16, 2));
        assert!(tower.manifolds == 3 && tower.points == 12 && piles.manifolds > 8);
        for row in &bench.rows {
            let stages = row.detect + row.color + row.prepare + row.run + row.store;
            assert!(row.ms > 0.0 && row.ms_low <= row.ms && row.ms <= row.ms_high && stages < 2.0 * row.ms, "{row:?}");
            assert!(row.penetration_max < 1e-3 && row.residual.is_some_and(|r| r > 0.0 && r < 0.5), "{row:?}");
        }
    }

    #[test]
    fn a_time_within_the_spread_of_both_is_neither_slower_nor_faster() {
        let then = measured();
        let times = |ms: f64, low: f64, high: f64| {
            let mut bench = then.clone();
            bench.rows.iter_mut().for_each(|r| (r.ms, r.ms_low, r.ms_high) = (ms, low, high));
            bench
        };
        let then = times(1.0, 0.8, 1.2);
        for (now, expected) in [
            (times(1.5, 1.1, 1.9), Change::Same(1.5)),
            (times(1.5, 1.3, 1.9), Change::Slower(1.5)),
            (times(0.5, 0.2, 0.9), Change::Same(0.5)),
            (times(0.5, 0.2, 0.7), Change::Faster(0.5)),
        ] {
            assert!(compare_with(&now, &then).iter().all(|change| *change == expected), "{expected:?}");
        }
    }
}

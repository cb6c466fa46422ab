//! Fronts, comparisons and profiles of time and error over the rows of a run.

use super::row::Row;
use drystone::Result;

/// Smallest error that counts (m, m/s): the resolution of f32 poses some ten meters from the origin.
pub const FLOOR: f64 = 1e-6;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Deepest,
    /// The overlap that 95 % of the contacts do not exceed.
    P95,
    Mean,
    /// The speed of bodies that should be at rest.
    Speed,
    /// The horizontal motion of bodies that should stand.
    Drift,
    Gap,
}

impl Fault {
    /// The errors for the scene of a row. With joints it is the gap; else they are overlaps, speed, and drift if the
    /// scene stands.
    pub fn of_scene(row: &Row) -> &'static [Self] {
        use Fault::{Deepest, Drift, Gap, Mean, P95, Speed};
        match (row.joint_gap, row.in_place) {
            (Some(_), _) => &[Gap],
            (None, Some(_)) => &[Mean, P95, Deepest, Speed, Drift],
            (None, None) => &[Mean, P95, Deepest, Speed],
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Deepest => "deepest overlap",
            Self::P95 => "overlap of 95 %",
            Self::Mean => "mean overlap",
            Self::Speed => "speed at rest",
            Self::Drift => "drift",
            Self::Gap => "joint gap",
        }
    }

    /// The unit on pages: a thousandth of the unit in rows.
    pub fn unit(self) -> &'static str {
        if self == Self::Speed { "mm/s" } else { "mm" }
    }

    /// The error of a row (m, m/s), at least [`FLOOR`].
    pub fn of(self, row: &Row) -> f64 {
        let error = match self {
            Self::Deepest => row.penetration_max,
            Self::P95 => row.penetration_p95,
            Self::Mean => row.penetration_mean,
            Self::Speed => row.speed_rms,
            Self::Drift => row.drift,
            Self::Gap => row.joint_gap.unwrap_or(f64::NAN),
        };
        // `max` would discard a NaN.
        if error < FLOOR { FLOOR } else { error }
    }
}

/// The fastest row with an error of at most `most`.
pub fn fastest<'a>(rows: &[&'a Row], fault: Fault, most: f64) -> Option<&'a Row> {
    let fit = rows.iter().filter(|row| row.holds() && fault.of(row) <= most);
    fit.copied().min_by(|a, b| a.ratio.total_cmp(&b.ratio))
}

/// The row with the least error that takes at most `ms` per step.
pub fn least<'a>(rows: &[&'a Row], fault: Fault, ms: f64) -> Option<&'a Row> {
    let fit = rows.iter().filter(|row| row.holds() && row.ms <= ms && fault.of(row).is_finite());
    fit.copied().min_by(|a, b| fault.of(a).total_cmp(&fault.of(b)))
}

/// The Pareto front of time and error, the fastest row first.
pub fn front<'a>(rows: &[&'a Row], fault: Fault) -> Vec<&'a Row> {
    let mut sorted: Vec<_> = rows.iter().copied().filter(|row| row.holds() && fault.of(row).is_finite()).collect();
    sorted.sort_by(|a, b| a.ratio.total_cmp(&b.ratio).then(fault.of(a).total_cmp(&fault.of(b))));
    let mut best = f64::INFINITY;
    sorted.retain(|row| {
        let better = fault.of(row) < best;
        best = best.min(fault.of(row));
        better
    });
    sorted
}

/// Comparison of one side with the front of the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Duel {
    /// Largest relative time at equal error; infinite if no own row reaches some error.
    pub worst: f64,
    pub best: f64,
    pub own: f64,
    /// Least error of the other side; infinite if none of its rows holds.
    pub others: f64,
}

impl Duel {
    pub fn new(own: &[&Row], others: &[&Row], fault: Fault) -> Result<Self> {
        let mut duel = Self { worst: 0.0, best: f64::INFINITY, own: f64::INFINITY, others: f64::INFINITY };
        for theirs in front(others, fault) {
            let ratio = match fastest(own, fault, fault.of(theirs)) {
                Some(mine) => mine.time_ratio(theirs)?,
                None => f64::INFINITY,
            };
            duel.worst = duel.worst.max(ratio);
            duel.best = duel.best.min(ratio);
            duel.others = fault.of(theirs);
        }
        duel.own = front(own, fault).last().map_or(f64::INFINITY, |row| fault.of(row));
        Ok(duel)
    }
}

/// Performance profiles (Dolan and Moré 2002): for each solver the sorted ratios of its costs to the least cost of any
/// solver. The profile at a factor is the share of problems with at most that ratio. An unsolved problem has neither a
/// cost nor a ratio.
pub fn profile(costs: &[Vec<Option<f64>>]) -> Vec<Vec<f64>> {
    let problems = costs.first().map_or(0, Vec::len);
    let mut ratios = vec![Vec::new(); costs.len()];
    for problem in 0..problems {
        let best = costs.iter().filter_map(|of| of[problem]).fold(f64::INFINITY, f64::min);
        for (of, ratios) in costs.iter().zip(&mut ratios) {
            ratios.extend(of[problem].map(|cost| cost / best));
        }
    }
    ratios.iter_mut().for_each(|r| r.sort_by(f64::total_cmp));
    ratios
}

#[cfg(test)]
mod tests {
    use super::super::tests::row;
    use super::*;

    #[test]
    fn a_front_has_the_rows_that_no_other_row_beats_in_time_and_error() {
        let rows =
            [row("a", 1.0, 4e-3), row("b", 2.0, 5e-3), row("c", 3.0, 1e-3), row("d", 3.0, 2e-3), row("e", 4.0, 1e-9)];
        let fallen = Row { in_place: Some(0), ..row("f", 0.5, 1e-4) };
        let all: Vec<_> = rows.iter().chain([&fallen]).collect();
        let names = |rows: Vec<&Row>| rows.iter().map(|r| r.engine.clone()).collect::<Vec<_>>().concat();
        assert_eq!(names(front(&all, Fault::Mean)), "ace");
        assert_eq!(fastest(&all, Fault::Mean, 3e-3).unwrap().engine, "c");
        assert_eq!(fastest(&all, Fault::Mean, 1e-7), None);
        assert_eq!(least(&all, Fault::Mean, 2.5).unwrap().engine, "a");
        assert_eq!(least(&all, Fault::Mean, 0.7), None);
        assert_eq!(Fault::Mean.of(&rows[4]), FLOOR);
        let spoiled = row("g", 0.1, f64::NAN);
        assert!(front(&[&spoiled], Fault::Mean).is_empty());
    }

    #[test]
    fn a_duel_is_at_equal_error_and_only_within_one_run() {
        let own = [row("own", 1.0, 2e-3), row("own", 6.0, 1e-4)];
        let others = [row("other", 2.0, 3e-3), row("other", 4.0, 1e-3), row("other", 9.0, 5e-5)];
        let (own, mut others): (Vec<_>, Vec<_>) = (own.iter().collect(), others.iter().collect());
        let duel = Duel::new(&own, &others, Fault::Mean).unwrap();
        assert_eq!(duel, Duel { worst: f64::INFINITY, best: 0.5, own: 1e-4, others: 5e-5 });
        others.pop();
        assert_eq!(Duel::new(&own, &others, Fault::Mean).unwrap().worst, 1.5);

        let elsewhere = [("other run", "hash"), ("run", "other hash")];
        for (run, hash) in elsewhere.map(|(run, hash)| (run.to_owned(), hash.to_owned())) {
            let other = Row { run, hash, ..row("other", 2.0, 3e-3) };
            let message = Duel::new(&own, &[&other], Fault::Mean).unwrap_err().to_string();
            assert!(message.contains("cannot compare own") && message.contains("other"), "{message}");
        }
    }

    #[test]
    fn a_profile_has_the_ratios_to_the_best_solver() {
        let costs = [vec![Some(1.0), Some(4.0), None, None], vec![Some(2.0), Some(1.0), Some(5.0), None]];
        assert_eq!(profile(&costs), [vec![1.0, 4.0], vec![1.0, 1.0, 2.0]]);
    }
}

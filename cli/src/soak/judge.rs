//! Checks whether a world stayed level: it compares the last tenth of its steps with the second tenth. In the first
//! tenth the world settles.

use drystone::stats::median;
use drystone::{Error, Result};

use super::Row;
use crate::hard::{Check, Limit};

/// Smallest number of rows for a judgment.
const FEWEST: usize = 20;
/// Resident memory that a world can gain in any number of steps: the system's allocator keeps some for itself (B).
const GAIN: f64 = (1 << 20) as f64;
/// Resident memory that a world can gain in 100,000 steps (B). A body with its contacts takes 2,000 B or more.
const GAIN_A_STEP: f64 = (32 << 10) as f64 / 1e5;

/// The allowed change of a quantity from the second tenth to the last.
#[derive(Clone, Copy)]
enum Level {
    /// By at most this factor.
    Below(f64),
    /// By at most this factor up or down. A quantity that stops at zero is not level.
    Within(f64),
}

/// A quantity: its name, its value in a row, and its limit.
type Quantity = (&'static str, fn(&Row) -> f64, Level);

const LEVEL: [Quantity; 9] = [
    ("processor time of a step", |row| row.ms, Level::Below(1.5)),
    ("bytes of the saved state", |row| row.state, Level::Below(1.25)),
    ("bodies", |row| row.bodies, Level::Within(1.25)),
    ("places of bodies", |row| row.places, Level::Below(1.1)),
    ("joints", |row| row.joints, Level::Within(2.0)),
    ("pairs", |row| row.pairs, Level::Within(1.5)),
    ("slots of contacts", |row| row.slots, Level::Below(1.25)),
    ("bodies asleep", |row| row.asleep, Level::Within(2.0)),
    ("kinetic energy", |row| row.energy, Level::Within(2.0)),
];

/// The checks of the rows of one world, in the order of its steps.
///
/// # Errors
/// There are too few rows.
pub fn judge(rows: &[Row]) -> Result<Vec<Check>> {
    let (count, name) = (rows.len(), rows.first().map_or("soak", |row| &row.scene));
    if count < FEWEST {
        return Err(Error::input(format!("{name}: {count} rows: a judgment needs at least {FEWEST}")));
    }
    let (second, last) = (&rows[count / 10..count / 5], &rows[count - count / 10..]);
    let mut checks = Vec::new();
    let mut check = |what: String, value: f64, limit: Limit| {
        checks.push(Check { what, value, limit, passed: limit.holds(value) });
    };
    for (what, of, level) in LEVEL {
        let [then, now] = [second, last].map(|rows| median(&rows.iter().map(of).collect::<Vec<_>>()));
        // Treat a value below a hundredth as zero: rounding alone can change it by any factor.
        let ratio = if then.max(now) < 0.01 { 1.0 } else { now / then };
        let what = format!("{what}: last tenth of the steps divided by the second tenth");
        match level {
            Level::Below(most) => check(what, ratio, Limit::AtMost(most)),
            Level::Within(most) => {
                check(what.clone(), ratio, Limit::AtMost(most));
                check(what, ratio, Limit::AtLeast(1.0 / most));
            }
        }
    }
    let resident =
        |rows: &[Row]| rows.iter().map(|row| row.resident).collect::<Option<Vec<_>>>().map(|all| median(&all));
    if let (Some(then), Some(now)) = (resident(second), resident(last)) {
        let steps = f64::from(last[0].step - second[0].step);
        let what = "resident memory gained from the second tenth to the last [B]".to_owned();
        check(what, now - then, Limit::AtMost(GAIN + GAIN_A_STEP * steps));
    }
    let most = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a });
    let overlaps: Vec<_> = rows.iter().map(|row| row.overlap).collect();
    check("deepest overlap, median of the ends of rows [m]".into(), median(&overlaps), Limit::AtMost(5e-3));
    // A body after a fall of 2 m moves by 0.1 m a step, and a row can end in the middle of its hit.
    check("deepest overlap at the end of any row [m]".into(), most(|row| row.overlap), Limit::AtMost(0.1));
    check("bodies outside".into(), most(|row| row.outside), Limit::AtMost(0.0));
    check("handles that name a wrong body or none".into(), most(|row| row.lost), Limit::AtMost(0.0));
    Ok(checks)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(steps: u32) -> Vec<Row> {
        let row = |k: u32| Row {
            scene: "drum".into(),
            step: k * steps / 100,
            ms: if k == 50 { 9.0 } else { 0.1 },
            resident: Some(3e7),
            state: 2e4,
            bodies: 60.0,
            places: 61.0,
            joints: 5.0,
            pairs: 150.0,
            slots: 200.0,
            asleep: 0.0,
            energy: 40.0,
            overlap: 1e-3,
            outside: 0.0,
            lost: 0.0,
        };
        (1..=100).map(row).collect()
    }

    fn failed(change: impl Fn(f64, &mut Row)) -> Vec<String> {
        let mut rows = level(1_000_000);
        rows.iter_mut().zip(1_u8..).for_each(|(row, k)| change(f64::from(k) / 100.0, row));
        judge(&rows).expect("rows").into_iter().filter(|check| !check.passed).map(|check| check.what).collect()
    }

    #[test]
    fn what_grows_fails_and_what_is_level_passes() {
        assert!(failed(|_, _| ()).is_empty(), "{:?}", failed(|_, _| ()));
        type Change = fn(f64, &mut Row);
        let changes: [(&str, Change); 13] = [
            ("resident memory", |at, row| row.resident = Some(3e7 + 2e6 * at)),
            ("processor time", |at, row| row.ms *= 1.0 + at),
            ("saved state", |at, row| row.state *= 1.0 + 0.5 * at),
            ("places", |at, row| row.places *= 1.0 + 0.2 * at),
            ("slots", |at, row| row.slots *= 1.0 + 0.5 * at),
            ("pairs", |at, row| row.pairs *= 1.0 - 0.6 * at),
            ("kinetic energy", |at, row| row.energy *= 1.0 - at),
            ("kinetic energy", |at, row| row.energy *= 1.0 + 3.0 * at),
            ("kinetic energy", |_, row| row.energy = f64::NAN),
            ("overlap", |at, row| row.overlap = if at == 0.7 { 0.2 } else { 0.0 }),
            ("median", |_, row| row.overlap = 6e-3),
            ("outside", |at, row| row.outside = f64::from(u8::from(at == 0.3))),
            ("handles", |at, row| row.lost = f64::from(u8::from(at == 0.3))),
        ];
        for (word, change) in changes {
            let failed = failed(change);
            assert!(!failed.is_empty() && failed.iter().all(|what| what.contains(word)), "{word}: {failed:?}");
        }
    }

    #[test]
    fn too_few_rows_are_not_judged() {
        let message = judge(&level(100)[..19]).expect_err("too few").to_string();
        assert!(message.contains("drum: 19 rows"), "{message}");
    }
}

//! Tilts over time as text.

use std::fmt::Write;

use drystone::{Error, Result};

/// Largest tilt of the board about either axis (degrees).
pub const TILT_LIMIT: f32 = 8.0;

/// The wanted tilts of the board over time, linear between points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script {
    /// Ascending times (s) and tilts to the right and to the front (degrees).
    points: Vec<(f32, [f32; 2])>,
}

impl Script {
    /// Reads a script. Each line is `time right front` in seconds and degrees, and `#` starts a comment.
    pub fn parse(name: &str, text: &str) -> Result<Self> {
        let mut script = Self::default();
        for (line, row) in (1..).zip(text.lines()) {
            let refuse = |column: usize, what: String| {
                Error::input(format!("{name}: line {line}, column {}: {what}", column + 1))
            };
            let row = row.split('#').next().unwrap_or_default();
            let words: Vec<&str> = row.split_whitespace().collect();
            // The words are slices of the row, so the difference of the addresses is the column.
            let column = |word: &str| word.as_ptr() as usize - row.as_ptr() as usize;
            if words.is_empty() {
                continue;
            }
            let mut numbers = [0.0_f32; 3];
            if words.len() != 3 {
                let at = words.get(3).map_or(row.trim_end().len(), |w| column(w));
                return Err(refuse(at, format!("{} words; a line is `time right front`", words.len())));
            }
            for (number, word) in numbers.iter_mut().zip(&words) {
                let parsed = word.parse().ok().filter(|x: &f32| x.is_finite());
                *number = parsed.ok_or_else(|| refuse(column(word), format!("{word:?} is not a number")))?;
            }
            let [time, right, front] = numbers;
            if time < script.points.last().map_or(0.0, |p| p.0) {
                return Err(refuse(column(words[0]), format!("{time} s: time goes back")));
            }
            for (tilt, word) in [(right, words[1]), (front, words[2])] {
                if tilt.abs() > TILT_LIMIT {
                    let what = format!("{tilt} degrees: the board tilts by {TILT_LIMIT} at most");
                    return Err(refuse(column(word), what));
                }
            }
            script.points.push((time, [right, front]));
        }
        if script.points.is_empty() {
            return Err(Error::input(format!("{name}: line 1, column 1: a script without a line")));
        }
        Ok(script)
    }

    pub fn push(&mut self, time: f32, tilt: [f32; 2]) {
        self.points.push((time, tilt));
    }

    pub fn end(&self) -> f32 {
        self.points.last().map_or(0.0, |p| p.0)
    }

    /// Tilts to the right and to the front at a time (degrees). The tilt rises from zero at time 0 to the first point,
    /// and keeps its last value.
    pub fn at(&self, time: f32) -> [f32; 2] {
        let time = time.max(0.0);
        let after = self.points.partition_point(|p| p.0 <= time);
        let earlier = if after == 0 { (0.0, [0.0; 2]) } else { self.points[after - 1] };
        let Some(&later) = self.points.get(after) else { return earlier.1 };
        let share = (time - earlier.0) / (later.0 - earlier.0);
        std::array::from_fn(|k| earlier.1[k] + share * (later.1[k] - earlier.1[k]))
    }

    /// The script as text. [`Script::parse`] reads the same numbers from it.
    pub fn text(&self) -> String {
        let mut text = String::from("# time right front: seconds, degrees\n");
        for (time, [right, front]) in &self.points {
            // Writing to memory cannot fail.
            let _ = writeln!(text, "{time} {right} {front}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_is_linear_between_its_points() {
        let script = Script::parse("s", "# a comment\n1 2 -4\n\n3 4 0 # another\n").expect("a script");
        assert_eq!(script.at(0.5), [1.0, -2.0]);
        assert_eq!(script.at(2.0), [3.0, -2.0]);
        assert_eq!(script.at(-1.0), [0.0, 0.0]);
        assert_eq!(Script::parse("s", "0 1 1\n1 2 2").expect("a script").at(-1.0), [1.0, 1.0]);
        assert_eq!((script.at(9.0), script.end()), ([4.0, 0.0], 3.0));
        assert_eq!(Script::parse("s", &script.text()).expect("its own text"), script);
    }

    #[test]
    fn a_bad_script_is_refused_with_line_and_column() {
        let refusal = |text: &str| Script::parse("s", text).expect_err("a bad script").to_string();
        assert_eq!(refusal("0 1\n"), "s: line 1, column 4: 2 words; a line is `time right front`");
        assert_eq!(refusal("0 1 2 3\n"), "s: line 1, column 7: 4 words; a line is `time right front`");
        assert_eq!(refusal("0 1 1\n1  x 2\n"), "s: line 2, column 4: \"x\" is not a number");
        assert_eq!(refusal("0 nan 1\n"), "s: line 1, column 3: \"nan\" is not a number");
        assert_eq!(refusal("1 0 0\n0.5 0 0\n"), "s: line 2, column 1: 0.5 s: time goes back");
        assert_eq!(refusal("1 0 8.5\n"), "s: line 1, column 5: 8.5 degrees: the board tilts by 8 at most");
        assert_eq!(refusal("# nothing\n"), "s: line 1, column 1: a script without a line");
    }
}

//! Progress of a command: a bar on a terminal, elsewhere a line every ten seconds.

use std::cell::Cell;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::output::say;

/// Time between two lines if standard error is not a terminal.
const BETWEEN: Duration = Duration::from_secs(10);

/// The unit that shows progress as a share of the total.
pub const PERCENT: &str = "%";

pub struct Progress {
    bar: ProgressBar,
    unit: &'static str,
    /// Time of the last line; `None` on a terminal.
    last: Option<Cell<Instant>>,
}

impl Progress {
    /// Counts `count` units. `quiet` hides the bar.
    pub fn new(unit: &'static str, count: u64, quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let style = match unit {
            PERCENT => "{bar:40} {percent} %  {eta} left  {msg}".into(),
            _ => format!("{{bar:40}} {unit} {{pos}}/{{len}}  {{per_sec}}  {{eta}} left  {{msg}}"),
        };
        let style = ProgressStyle::with_template(&style).expect("a fixed template");
        let bar = if quiet || !terminal { ProgressBar::hidden() } else { ProgressBar::no_length() };
        bar.set_length(count);
        Self { bar: bar.with_style(style), unit, last: (!terminal).then(|| Cell::new(Instant::now())) }
    }

    pub fn steps(steps: u32, quiet: bool) -> Self {
        Self::new("step", steps.into(), quiet)
    }

    pub fn inc(&self) {
        self.bar.inc(1);
        self.line();
    }

    pub fn set(&self, done: u64, total: u64) {
        self.bar.set_length(total);
        self.bar.set_position(done);
        self.line();
    }

    pub fn set_message(&self, what: impl Into<String>) {
        self.bar.set_message(what.into());
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn line(&self) {
        if let Some(last) = self.last.as_ref().filter(|last| last.get().elapsed() >= BETWEEN) {
            last.set(Instant::now());
            say(self.text());
        }
    }

    /// `step 120/600` and the message.
    fn text(&self) -> String {
        let (unit, done, of) = (self.unit, self.bar.position(), self.bar.length().unwrap_or(0));
        let far = if unit == PERCENT { format!("{} %", 100 * done / of.max(1)) } else { format!("{unit} {done}/{of}") };
        format!("{far}  {}", self.bar.message()).trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_printed_when_it_is_due_and_not_before() {
        let mut progress = Progress::new("case", 5, true);
        let due = Instant::now() - BETWEEN;
        progress.last = Some(Cell::new(due));
        progress.set_message("H3");
        let when = |p: &Progress| p.last.as_ref().expect("no terminal").get();
        progress.inc();
        assert!(when(&progress) > due, "a line was due");
        assert_eq!(progress.text(), "case 1/5  H3");
        let printed = when(&progress);
        progress.inc();
        assert_eq!((when(&progress), progress.text()), (printed, "case 2/5  H3".into()));
        let survey = Progress::new(PERCENT, 1, true);
        survey.set(30, 90);
        assert_eq!(survey.text(), "33 %");
    }
}

//! Checks as JUnit's XML for CI services. Each mode and group is a suite, and each check is a case.

use std::fmt::Write;

use drystone_conform::{Check, Conformance, Verdict};

/// The text of the file.
pub fn text(found: &Conformance) -> String {
    let of_suite = |a: &Check, b: &Check| (a.mode, a.group) == (b.mode, b.group);
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let adapter = escaped(&found.adapter.to_string());
    writeln!(text, "<testsuites name=\"drystone conform, {adapter}\"{}>", counts(&found.checks)).expect(MEMORY);
    for suite in found.checks.chunk_by(of_suite) {
        let name = format!("{}.{}", suite[0].mode, suite[0].group);
        writeln!(text, "  <testsuite name=\"{name}\"{}>", counts(suite)).expect(MEMORY);
        for check in suite {
            let (case, figure) = (escaped(&check.name), escaped(&check.figure));
            let head = format!("<testcase classname=\"{name}\" name=\"{case}\" time=\"{:.3}\">", check.seconds);
            let inside = match check.verdict {
                Verdict::Passed => format!("<system-out>{figure}</system-out>"),
                Verdict::Failed => format!("<failure message=\"{figure}\"/>"),
            };
            writeln!(text, "    {head}{inside}</testcase>").expect(MEMORY);
        }
        text += "  </testsuite>\n";
    }
    text + "</testsuites>\n"
}

const MEMORY: &str = "memory takes it";

/// The attributes that count the cases of a suite.
fn counts(checks: &[Check]) -> String {
    let of = |verdict| checks.iter().filter(|check| check.verdict == verdict).count();
    let (all, failed) = (checks.len(), of(Verdict::Failed));
    let seconds: f64 = checks.iter().map(|check| check.seconds).sum();
    format!(" tests=\"{all}\" failures=\"{failed}\" errors=\"0\" skipped=\"0\" time=\"{seconds:.3}\"")
}

/// Text for an attribute, on one line. XML allows no control characters except white space.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&apos;",
            control if control.is_control() || matches!(control, '\u{fffe}' | '\u{ffff}') => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use drystone::backend::gpu::AdapterSummary;
    use drystone_conform::{Group, Mode};

    use super::*;

    #[test]
    fn text_of_drivers_stays_text() {
        assert_eq!(escaped("a<b> & \"c\"'\u{1}\n"), "a&lt;b&gt; &amp; &quot;c&quot;&apos;  ");
    }

    #[test]
    fn a_report_counts_its_cases_suite_by_suite() {
        let check = |mode, group, verdict| Check {
            group,
            mode,
            name: "a < b".into(),
            verdict,
            figure: "f".into(),
            seconds: 0.25,
        };
        let adapter = AdapterSummary {
            name: "A & B".into(),
            api: "Vulkan".into(),
            driver: "1".into(),
            kind: "software",
            hardware: false,
            takes_spirv: true,
            clock: true,
            buffer_limit: 1,
        };
        let checks = vec![
            check(Mode::Exact, Group::Kernels, Verdict::Passed),
            check(Mode::Exact, Group::Kernels, Verdict::Failed),
            check(Mode::Exact, Group::Scenes, Verdict::Failed),
            check(Mode::Plain, Group::Scenes, Verdict::Passed),
        ];
        let expected = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<testsuites name=\"drystone conform, A &amp; B (Vulkan, software; 1)\" tests=\"4\" failures=\"2\" errors=\"0\" skipped=\"0\" time=\"1.000\">
  <testsuite name=\"exact.kernels\" tests=\"2\" failures=\"1\" errors=\"0\" skipped=\"0\" time=\"0.500\">
    <testcase classname=\"exact.kernels\" name=\"a &lt; b\" time=\"0.250\"><system-out>f</system-out></testcase>
    <testcase classname=\"exact.kernels\" name=\"a &lt; b\" time=\"0.250\"><failure message=\"f\"/></testcase>
  </testsuite>
  <testsuite name=\"exact.scenes\" tests=\"1\" failures=\"1\" errors=\"0\" skipped=\"0\" time=\"0.250\">
    <testcase classname=\"exact.scenes\" name=\"a &lt; b\" time=\"0.250\"><failure message=\"f\"/></testcase>
  </testsuite>
  <testsuite name=\"plain.scenes\" tests=\"1\" failures=\"0\" errors=\"0\" skipped=\"0\" time=\"0.250\">
    <testcase classname=\"plain.scenes\" name=\"a &lt; b\" time=\"0.250\"><system-out>f</system-out></testcase>
  </testsuite>
</testsuites>
";
        assert_eq!(text(&Conformance { adapter, checks }), expected);
    }
}

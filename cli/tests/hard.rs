//! The short hard cases with 32 substeps.

use drystone::preset::Preset;
use drystone::{Backend, Cpu};
use drystone_cli::hard::{Case, Limit, Setup};

/// Checks that fail, by the beginning of their names. docs/hard-cases.md gives numbers for all presets and reasons.
const FAILS: &[(&str, &str)] = &[("H4", "64 points: asymmetry")];

#[test]
fn what_passes_passes_and_what_fails_is_known_to() {
    let open = || Ok(Box::new(Cpu::new()) as Box<dyn Backend>);
    let setup = Setup { config: Preset::Accurate.config().without_sleep(), open: &open };
    let mut failed = Vec::new();
    for case in Case::ALL.iter().filter(|c| !c.long) {
        let checks = case.run(&setup).expect(case.name);
        assert!(!checks.is_empty());
        failed.extend(checks.into_iter().filter(|c| !c.passed).map(|c| (case.name, c)));
    }
    let known = |case: &str, what: &str| FAILS.iter().any(|(c, w)| *c == case && what.starts_with(w));
    let surprises: Vec<_> = failed.iter().filter(|(case, check)| !known(case, &check.what)).collect();
    assert!(surprises.is_empty(), "{surprises:#?}");
    let passes =
        |(case, what): &&(&str, &str)| !failed.iter().any(|(c, check)| c == case && check.what.starts_with(what));
    let passing: Vec<_> = FAILS.iter().filter(passes).collect();
    assert!(passing.is_empty(), "pass now, take them off the list: {passing:?}");
}

#[test]
fn no_number_passes_no_limit() {
    assert!(Limit::AtMost(1.0).holds(1.0) && Limit::AtLeast(1.0).holds(1.0));
    for bad in [f64::NAN, 1.0 + 1e-9, f64::INFINITY] {
        assert!(!Limit::AtMost(1.0).holds(bad), "{bad}");
    }
    for bad in [f64::NAN, 1.0 - 1e-9, f64::NEG_INFINITY] {
        assert!(!Limit::AtLeast(1.0).holds(bad), "{bad}");
    }
}

#[test]
fn the_message_for_an_unknown_case_names_the_nearest_case_and_the_list() {
    let message = Case::find("H13").err().expect("no such case").to_string();
    assert!(
        message.contains("H13")
            && message.contains("did you mean \"H1")
            && message.contains("hard --list")
            && !message.contains('\n'),
        "{message}"
    );
    assert_eq!(Case::find("h3").expect("a case").name, "H3");
}

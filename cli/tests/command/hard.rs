//! The short hard cases with 8 and with 32 substeps.

use drystone::preset::Preset;
use drystone::{Backend, Cpu};
use drystone_cli::hard::{Case, Limit, Setup};

use crate::common::sample::is_full;

fn short_cases_pass(preset: Preset, is_run: fn(&Case) -> bool) {
    let open = || Ok(Box::new(Cpu::new()) as Box<dyn Backend>);
    let setup = Setup { config: preset.config().without_sleep(), open: &open };
    for case in Case::ALL.iter().filter(|case| !case.long && is_run(case)) {
        let checks = case.run(&setup).expect(case.name);
        assert!(!checks.is_empty());
        let failed: Vec<_> = checks.into_iter().filter(|check| !check.passed).collect();
        assert!(failed.is_empty(), "{}: {failed:#?}", case.name);
    }
}

#[test]
fn all_short_cases_pass_at_the_default() {
    short_cases_pass(Preset::Balanced, |_| true);
}

#[test]
fn short_cases_pass_with_32_substeps() {
    // These three take two thirds of the time.
    short_cases_pass(Preset::Accurate, |case| is_full() || !["H22", "kapla", "rolling"].contains(&case.name));
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

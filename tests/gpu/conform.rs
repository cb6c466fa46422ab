//! The checks of an adapter pass on one that is fit, and each group of them finds a kernel that is wrong.

use drystone::Error;
use drystone::backend::gpu::{Faults, GpuOptions};
use drystone_conform::{ConformOptions, Conformance, Group, Mode, Verdict, conform, one_percent_off};

use crate::common::sample::is_full;

tests! {
    exact_gpu {
        a_fit_adapter_passes_in_every_group,
        a_kernel_that_is_one_percent_off_fails_in_every_group,
        arithmetic_in_another_order_fails_in_exact_mode_and_passes_as_plain_wgsl,
    }
    any_gpu {
        a_driver_that_panics_or_refuses_a_shader_fails_in_one_line,
    }
    no_gpu {
        an_adapter_that_is_not_there_is_refused_by_name,
    }
}

/// Some checks of each group.
fn options(shader: Option<fn(&str, String) -> String>) -> ConformOptions {
    let names = "solve_contacts integrate_velocities subnormal pile chain large refused submission lost processor";
    ConformOptions {
        gpu: GpuOptions { faults: Faults { shader, ..Faults::default() }, ..GpuOptions::default() },
        names: names.split(' ').map(str::to_owned).collect(),
        short: true,
        ..ConformOptions::default()
    }
}

/// Runs the checks, and asserts that each is told of once, with a figure of one line.
fn run(options: &ConformOptions) -> Conformance {
    let mut told = 0;
    let found = conform(options, &mut |_| told += 1).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(told, found.checks.len());
    assert!(found.checks.iter().all(|check| !check.figure.is_empty() && check.figure.lines().count() == 1));
    found
}

fn lines(found: &Conformance, verdict: Verdict) -> Vec<String> {
    let wanted = found.checks.iter().filter(|check| check.verdict == verdict);
    wanted.map(|check| format!("{} {} {}: {}", check.mode, check.group, check.name, check.figure)).collect()
}

fn a_fit_adapter_passes_in_every_group() {
    let found = run(&options(None));
    measured!("{:#?}", lines(&found, Verdict::Passed));
    assert_eq!(lines(&found, Verdict::Failed), Vec::<String>::new());
    for mode in Mode::ALL {
        let count = |group| found.checks.iter().filter(|c| (c.mode, c.group) == (mode, group)).count();
        let counts = Group::ALL.map(count);
        assert_eq!(counts, [if mode == Mode::Exact { 3 } else { 2 }, 3, 3, 2, 3], "{mode}");
    }
}

fn a_kernel_that_is_one_percent_off_fails_in_every_group() {
    // The kernels of a mode take seconds to compile.
    let modes = if is_full() { Mode::ALL.to_vec() } else { vec![Mode::Plain] };
    let found = run(&ConformOptions { modes: modes.clone(), ..options(Some(one_percent_off)) });
    for (mode, group) in modes.into_iter().flat_map(|mode| Group::ALL.map(|group| (mode, group))) {
        let is_own = |check: &&drystone_conform::Check| (check.mode, check.group) == (mode, group);
        let failed = found.checks.iter().filter(is_own).filter(|check| check.verdict == Verdict::Failed).count();
        assert!(failed > 0, "{mode} {group}: {:#?}", lines(&found, Verdict::Passed));
    }
    // Those that need no right numbers pass, so that a failure says where the mistake is.
    measured!("{:#?}", lines(&found, Verdict::Failed));
}

/// A compiler that distributes a product over a sum.
fn arithmetic_in_another_order_fails_in_exact_mode_and_passes_as_plain_wgsl() {
    fn distributed(_: &str, source: String) -> String {
        source.replace("-(mass * (vn + bias))", "-(mass * vn + mass * bias)")
    }
    let groups = vec![Group::Kernels, Group::Scenes];
    let names = vec!["solve_contacts".into(), "pile".into()];
    let found = run(&ConformOptions { groups, names, ..options(Some(distributed)) });
    let failed = lines(&found, Verdict::Failed);
    assert!(failed.iter().all(|line| line.starts_with("exact ")), "{failed:#?}");
    assert!(Group::ALL[..2].iter().all(|g| failed.iter().any(|l| l.contains(g.name()))), "{failed:#?}");
}

fn a_driver_that_panics_or_refuses_a_shader_fails_in_one_line() {
    type Mistake = fn(&str, String) -> String;
    let faults: [(Mistake, &str); 2] = [
        (|_, _| std::panic::resume_unwind(Box::new("a defect of the driver")), "a defect of the driver"),
        (|_, _| "fn main( {".into(), "shader"),
    ];
    for (shader, part) in faults {
        let modes = vec![Mode::Plain];
        let found = run(&ConformOptions { groups: vec![Group::Kernels], modes, ..options(Some(shader)) });
        let failed = lines(&found, Verdict::Failed);
        assert_eq!(failed.len(), found.checks.len(), "{:?}", lines(&found, Verdict::Passed));
        assert!(failed.iter().all(|line| line.contains(part)), "{failed:?}");
    }
}

fn an_adapter_that_is_not_there_is_refused_by_name() {
    let gpu = GpuOptions { name: "no such adapter".into(), ..GpuOptions::default() };
    let Err(Error::Adapter(line)) = conform(&ConformOptions { gpu, ..options(None) }, &mut |_| ()) else {
        panic!("there is one")
    };
    assert!(line.contains("\"no such adapter\"") && line.lines().count() == 1, "{line}");
}

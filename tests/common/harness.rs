//! Runs the tests of a binary that has tests of a GPU, or of files that not every machine has. cargo's own harness knows only when
//! it compiles whether a test is ignored; this one asks the environment when it runs.

use std::collections::BTreeSet;
use std::process::ExitCode;
use std::sync::OnceLock;

use drystone::{Backend, Cpu, Reference};
use libtest_mimic::{Arguments, Trial};

use super::Open;
use super::gpu::{self, Need};

static ARGUMENTS: OnceLock<Arguments> = OnceLock::new();

/// Whether this harness runs the tests of this binary.
pub fn runs() -> bool {
    ARGUMENTS.get().is_some()
}

/// Whether tests are to print what they measure. This harness captures nothing, so that tests print only when asked.
pub fn shows_output() -> bool {
    ARGUMENTS.get().is_none_or(|arguments| arguments.nocapture || arguments.show_output)
}

/// A test, and why it is left out if it is.
pub struct Test(Trial, Option<String>);

impl Test {
    fn if_problems_are_given(self) -> Self {
        let missing = || std::env::var_os("DRYSTONE_PROBLEMS").is_none().then(|| "DRYSTONE_PROBLEMS is not set".into());
        let why = self.1.or_else(missing);
        Self(self.0.with_ignored_flag(why.is_some()), why)
    }
}

/// A test that fails unless its needs are met, whatever it does itself.
fn test(name: &str, needs: &'static [Need], run: impl FnOnce() + Send + 'static) -> Test {
    let value = |name| std::env::var(name).unwrap_or_default();
    let (adapter, without) = (value("DRYSTONE_ADAPTER"), value("DRYSTONE_WITHOUT"));
    let left_out = |need: &Need| {
        need.left_out(&adapter, &without).unwrap_or_else(|line| {
            eprintln!("{line}");
            std::process::exit(2)
        })
    };
    let left_out = needs.iter().find_map(left_out);
    let run = move || {
        needs.iter().for_each(|need| need.assert_met());
        run();
        Ok(())
    };
    Test(Trial::test(name, run).with_ignored_flag(left_out.is_some()), left_out)
}

/// A test that needs no GPU.
pub fn no_gpu(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[], run)]
}

/// A test that needs an adapter.
pub fn any_gpu(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[Need::Adapter], run)]
}

/// A test that needs an adapter with exact mode.
pub fn exact_gpu(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[Need::Exact], run)]
}

/// A test that needs an adapter with a clock.
pub fn timed_gpu(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[Need::Clock], run)]
}

/// A test that needs an adapter with exact mode and a clock.
pub fn exact_and_timed_gpu(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[Need::Exact, Need::Clock], run)]
}

/// A test on the contact problems of others, which is left out where `DRYSTONE_PROBLEMS` names no folder of them.
pub fn given_problems(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[], run).if_problems_are_given()]
}

/// The same, and it needs an adapter.
pub fn given_problems_and_any_gpu(name: &str, run: fn()) -> Vec<Test> {
    vec![test(name, &[Need::Adapter], run).if_problems_are_given()]
}

/// Three tests: on the reference, on the lanes of the CPU, and on the GPU.
pub fn every_backend(name: &str, run: fn(Open)) -> Vec<Test> {
    let on = |backend: &str, needs: &'static [Need], open: Open| {
        test(&format!("{backend}::{name}"), needs, move || run(open))
    };
    vec![
        on("reference", &[], || Box::new(Reference::<f32>::new()) as Box<dyn Backend>),
        on("cpu", &[], || Box::new(Cpu::new())),
        on("gpu", &[Need::Adapter], || Box::new(gpu::plain())),
    ]
}

/// Runs the tests that the command line asks for.
pub fn run(tests: Vec<Vec<Test>>) -> ExitCode {
    let arguments = ARGUMENTS.get_or_init(Arguments::from_args);
    let (trials, reasons): (Vec<_>, Vec<_>) = tests.into_iter().flatten().map(|Test(trial, why)| (trial, why)).unzip();
    if !arguments.list && !arguments.ignored && !arguments.include_ignored {
        let asked: Vec<_> =
            trials.iter().zip(&reasons).filter(|(trial, _)| !arguments.is_filtered_out(trial)).collect();
        let left_out: BTreeSet<_> = reasons.iter().flatten().collect();
        for why in left_out {
            let count = asked.iter().filter(|(_, of_trial)| of_trial.as_ref() == Some(why)).count();
            if count > 0 {
                eprintln!("{why}: {count} of {} tests are ignored", asked.len());
            }
        }
    }
    libtest_mimic::run(arguments, trials).exit_code()
}

/// The tests of a binary with `harness = false`, by what they need.
#[allow(unused_macros)]
macro_rules! tests {
    ($($need:ident { $($name:path,)* })*) => {
        fn main() -> std::process::ExitCode {
            crate::common::harness::run(vec![$($(crate::common::harness::$need(stringify!($name), $name)),*),*])
        }
    };
}

/// Prints a measurement where the command line asks for output.
#[allow(unused_macros)]
macro_rules! measured {
    ($($part:tt)*) => {
        if crate::common::harness::shows_output() {
            println!($($part)*);
        }
    };
}

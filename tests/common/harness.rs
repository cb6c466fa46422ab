//! Runs the tests of a binary that has tests of a GPU, or of files that not every machine has. cargo's own harness knows only when
//! it compiles whether a test is ignored; this one asks the environment when it runs.

use std::collections::BTreeSet;
use std::process::ExitCode;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use drystone::{Backend, Cpu, Reference};
use libtest_mimic::{Arguments, Trial};

use super::Open;
use super::gpu::{self, Need};
use super::sample::is_full;

static ARGUMENTS: OnceLock<Arguments> = OnceLock::new();

/// The argument with which `./tests/run` asks for the time of each test.
const REPORT_TIME: &str = "--report-time";

/// How long the tests took that ended.
static TIMES: Mutex<Vec<(Duration, String)>> = Mutex::new(Vec::new());

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
        self.only_if(std::env::var_os("DRYSTONE_PROBLEMS").is_some(), "DRYSTONE_PROBLEMS is not set")
    }

    fn at_night(self) -> Self {
        self.only_if(is_full(), "DRYSTONE_FULL is not 1")
    }

    fn only_if(self, runs: bool, otherwise: &str) -> Self {
        let why = self.1.or_else(|| (!runs).then(|| otherwise.into()));
        Self(self.0.with_ignored_flag(why.is_some()), why)
    }
}

/// A test that fails unless its needs are met, whatever it does itself. `module` begins with the name of the binary.
fn test(module: &str, name: &str, needs: &'static [Need], run: impl FnOnce() + Send + 'static) -> Test {
    let value = |name| std::env::var(name).unwrap_or_default();
    let (adapter, without) = (value("DRYSTONE_ADAPTER"), value("DRYSTONE_WITHOUT"));
    let left_out = |need: &Need| {
        need.left_out(&adapter, &without).unwrap_or_else(|line| {
            eprintln!("{line}");
            std::process::exit(2)
        })
    };
    let left_out = needs.iter().find_map(left_out);
    let name = module.split_once("::").map_or_else(|| name.to_owned(), |(_, module)| format!("{module}::{name}"));
    let timed = name.clone();
    let run = move || {
        let begin = Instant::now();
        needs.iter().for_each(|need| need.assert_met());
        run();
        TIMES.lock().unwrap_or_else(PoisonError::into_inner).push((begin.elapsed(), timed));
        Ok(())
    };
    Test(Trial::test(name, run).with_ignored_flag(left_out.is_some()), left_out)
}

/// A test that needs no GPU.
pub fn no_gpu(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[], run)]
}

/// A test that needs an adapter.
pub fn any_gpu(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[Need::Adapter], run)]
}

/// A test that needs an adapter with exact mode.
pub fn exact_gpu(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[Need::Exact], run)]
}

/// A test that needs an adapter with a clock.
pub fn timed_gpu(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[Need::Clock], run)]
}

/// A test that needs an adapter with exact mode and a clock.
pub fn exact_and_timed_gpu(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[Need::Exact, Need::Clock], run)]
}

/// A test on the contact problems of others, which is left out where `DRYSTONE_PROBLEMS` names no folder of them.
pub fn given_problems(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[], run).if_problems_are_given()]
}

/// The same, and it needs an adapter.
pub fn given_problems_and_any_gpu(module: &str, name: &str, run: fn()) -> Vec<Test> {
    vec![test(module, name, &[Need::Adapter], run).if_problems_are_given()]
}

/// Two tests: on the lanes of the CPU, and on the GPU. The lanes have the bits of the reference, as the tests of `lanes`, `determinism` and
/// `golden` hold.
pub fn every_backend(module: &str, name: &str, run: fn(Open)) -> Vec<Test> {
    let on = |backend: &str, needs: &'static [Need], open: Open| {
        test(module, &format!("{name}::{backend}"), needs, move || run(open))
    };
    vec![on("cpu", &[], || Box::new(Cpu::new())), on("gpu", &[Need::Adapter], || Box::new(gpu::plain()))]
}

/// The same, and by day the one on the GPU, which takes seconds, is left out: other tests compare every rule of the kernels by day.
pub fn every_backend_the_gpu_at_night(module: &str, name: &str, run: fn(Open)) -> Vec<Test> {
    let [cpu, gpu] = <[Test; 2]>::try_from(every_backend(module, name, run)).ok().expect("two backends");
    vec![cpu, gpu.at_night()]
}

/// The same, and a third on the reference.
pub fn every_backend_and_the_reference(module: &str, name: &str, run: fn(Open)) -> Vec<Test> {
    let reference = || Box::new(Reference::<f32>::new()) as Box<dyn Backend>;
    let on_reference = test(module, &format!("{name}::reference"), &[], move || run(reference));
    std::iter::once(on_reference).chain(every_backend(module, name, run)).collect()
}

/// Options of a test binary that take a value.
const WITH_VALUE: [&str; 6] = ["--test-threads", "--logfile", "--skip", "--color", "--format", "-Z"];

/// The arguments as `libtest_mimic` takes them, and the names to look for: cargo's own harness takes several, this one none or one.
fn split(given: impl Iterator<Item = String>) -> (Vec<String>, Vec<String>) {
    let (mut options, mut names) = (Vec::new(), Vec::new());
    for argument in given.filter(|argument| argument != REPORT_TIME) {
        let is_value = options.last().is_some_and(|last: &String| WITH_VALUE.contains(&last.as_str()));
        if options.is_empty() || is_value || argument.starts_with('-') { &mut options } else { &mut names }
            .push(argument);
    }
    (options, names)
}

/// Runs the tests that the command line asks for, side by side.
#[allow(dead_code)]
pub fn run(tests: impl IntoIterator<Item = Vec<Test>>) -> ExitCode {
    run_on(None, tests)
}

/// The same, one after another: for tests that draw. While one thread opens an adapter, Mesa's software adapter 22.3 changes memory that
/// other threads read as they compile shaders of pictures. A process aborted once when it ended; 420 more runs of it did not.
#[allow(dead_code)]
pub fn run_in_turn(tests: impl IntoIterator<Item = Vec<Test>>) -> ExitCode {
    run_on(Some(1), tests)
}

fn run_on(threads: Option<usize>, tests: impl IntoIterator<Item = Vec<Test>>) -> ExitCode {
    let (options, names) = split(std::env::args());
    let arguments = ARGUMENTS.get_or_init(|| {
        let given = Arguments::from_iter(options);
        Arguments { test_threads: given.test_threads.or(threads), ..given }
    });
    let is_named = |test: &Test| {
        let name = test.0.name();
        names.is_empty() || names.iter().any(|part| if arguments.exact { name == part } else { name.contains(part) })
    };
    let tests = tests.into_iter().flatten().filter(is_named);
    let (trials, reasons): (Vec<_>, Vec<_>) = tests.map(|Test(trial, why)| (trial, why)).unzip();
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
    let conclusion = libtest_mimic::run(arguments, trials);
    gpu::close();
    if std::env::args().any(|argument| argument == REPORT_TIME) {
        for (time, name) in TIMES.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            println!("test {name} ... took <{:.3}s>", time.as_secs_f64());
        }
    }
    conclusion.exit_code()
}

/// The tests of a module in a binary with `harness = false`, by what they need.
#[allow(unused_macros)]
macro_rules! tests {
    ($($need:ident { $($name:path,)* })*) => {
        pub(crate) fn tests() -> Vec<$crate::common::harness::Test> {
            let own = module_path!();
            [$($($crate::common::harness::$need(own, stringify!($name), $name)),*),*].into_iter().flatten().collect()
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

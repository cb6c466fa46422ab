//! Contact problems of others: the solver takes as many sweeps as an independent program with the same methods and order.
//!
//! Ignored unless the environment variable DRYSTONE_PROBLEMS names a folder with `NAME.contacts` and a table `anchors.csv`:
//! columns `problem`, `solver` (`pgs` or `accel`) and `it_1e-1` to `it_1e-3`, sweeps until e_vel is less than that.

use std::path::{Path, PathBuf};

use crate::common::contacts::{curve, sweeps_to};
use crate::common::gpu;
use drystone::config::Method;
use drystone::stats::median;
use drystone::{Backend, Cpu};
use drystone_problems::ContactProblem;
use drystone_problems::contacts::Operator;
use drystone_problems::residuals::Measure;
use drystone_problems::solver::newton::{Bodies, newton};
use drystone_problems::solver::{Order, Solver};

/// Errors to which sweeps are counted.
const ERRORS: [f64; 3] = [1e-1, 1e-2, 1e-3];
/// Sweeps after which counting ends.
const MOST: u32 = 60_000;

tests! {
    given_problems {
        contact_by_contact_sweeps_are_those_of_the_anchors,
        momentum_that_ends_with_a_step_back_saves_sweeps,
        manifold_by_manifold_sweeps_are_no_more,
        single_precision_leaves_the_errors_of_double_precision,
        acceleration_pays,
        newtons_method_solves_each_to_the_end,
    }
    given_problems_and_any_gpu {
        contact_by_contact_sweeps_of_the_gpu_are_those_of_the_anchors,
        single_precision_of_the_gpu_leaves_the_errors_of_double_precision,
    }
}

/// One line of the table.
struct Anchor {
    name: String,
    method: Method,
    sweeps: [u32; 3],
}

fn folder() -> PathBuf {
    std::env::var_os("DRYSTONE_PROBLEMS").expect("DRYSTONE_PROBLEMS names a folder").into()
}

fn anchors(folder: &Path) -> Vec<(Anchor, ContactProblem)> {
    let mut table = csv::Reader::from_path(folder.join("anchors.csv")).expect("a table");
    let columns = table.headers().expect("a header").clone();
    let lines = table.records().map(|line| {
        let line = line.expect("a line");
        let field = |name: &str| {
            let column = columns.iter().position(|c| c == name).unwrap_or_else(|| panic!("no column {name}"));
            line[column].to_owned()
        };
        let method = if field("solver") == "accel" { Method::Accelerated } else { Method::Plain };
        let sweeps = ["it_1e-1", "it_1e-2", "it_1e-3"].map(|column| field(column).parse().expect("a number"));
        let name = field("problem");
        let problem = ContactProblem::read(folder.join(format!("{name}.contacts"))).expect("a problem");
        (Anchor { name, method, sweeps }, problem)
    });
    lines.collect()
}

/// The problems, each once.
fn problems(folder: &Path) -> Vec<(String, ContactProblem)> {
    let plain = anchors(folder).into_iter().filter(|(anchor, _)| anchor.method == Method::Plain);
    plain.map(|(anchor, problem)| (anchor.name, problem)).collect()
}

fn lanes() -> Option<Box<dyn Backend>> {
    Some(Box::new(Cpu::new()))
}

fn plain_wgsl() -> Option<Box<dyn Backend>> {
    Some(Box::new(gpu::plain()))
}

/// Sweeps over those of the anchor, for each error.
fn ratios((anchor, problem): &(Anchor, ContactProblem), order: Order, backend: Option<Box<dyn Backend>>) -> [f64; 3] {
    let name = backend.as_ref().map_or("f64", |b| b.name());
    let sweeps = sweeps_to(problem, (anchor.method, order), backend, &ERRORS, MOST);
    let method = format!("{:?}", anchor.method);
    measured!("{:<18} {method:<12} {order:<10?} {name:<4} {sweeps:?}, anchor {:?}", anchor.name, anchor.sweeps);
    [0, 1, 2].map(|i| sweeps[i].map_or(f64::INFINITY, f64::from) / f64::from(anchor.sweeps[i]))
}

/// Fails unless sweeps are those of the anchors, within the share of them that is `allowed`.
fn assert_anchored(backend: fn() -> Option<Box<dyn Backend>>, allowed: f64) {
    for line in anchors(&folder()).into_iter().filter(|line| line.0.method == Method::Plain) {
        let ratios = ratios(&line, Order::Contacts, backend());
        assert!(ratios.iter().all(|r| (r - 1.0).abs() <= allowed), "{}: {ratios:?} of the anchor", line.0.name);
    }
}

fn contact_by_contact_sweeps_are_those_of_the_anchors() {
    assert_anchored(|| None, 0.02);
    assert_anchored(lanes, 0.1);
}

fn contact_by_contact_sweeps_of_the_gpu_are_those_of_the_anchors() {
    assert_anchored(plain_wgsl, 0.1);
}

fn momentum_that_ends_with_a_step_back_saves_sweeps() {
    // That of the anchors ends with every step that is longer than the one before.
    let lines = anchors(&folder()).into_iter().filter(|line| line.0.method == Method::Accelerated);
    let all: Vec<_> = lines.flat_map(|line| ratios(&line, Order::Contacts, None)).collect();
    measured!("ratios {all:.2?}, median {:.3}", median(&all));
    assert!(median(&all) < 1.0 && all.iter().all(|&r| r <= 1.15), "{all:?}");
}

fn manifold_by_manifold_sweeps_are_no_more() {
    for method in [Method::Plain, Method::Accelerated] {
        let lines = anchors(&folder()).into_iter().filter(|(anchor, _)| anchor.method == method);
        let all: Vec<_> = lines.flat_map(|line| ratios(&line, Order::Manifolds, None)).collect();
        measured!("{method:?}: ratios {all:.2?}, median {:.3}", median(&all));
        assert!(median(&all) <= 1.0, "the median of {all:?} is more than 1");
        assert!(all.iter().all(|&r| r <= 1.5), "the largest of {all:?} is more than 1.5");
    }
}

/// Largest change of e_vel, over `sweeps` plain ones in f64, when their impulses are rounded to f32.
fn by_rounding(problem: &ContactProblem, order: Order, sweeps: u32) -> f64 {
    let measure = Measure::new(problem);
    let mut solver = Solver::new(problem, Method::Plain, order, None).expect("good frames");
    let after_one = |_| {
        solver.advance(1).expect("it runs");
        let (exact, velocities) = (solver.impulses(), solver.velocities());
        let rounded: Vec<_> = exact.iter().map(|r| r.as_vec3().as_dvec3()).collect();
        (measure.of(&exact, &velocities).e_vel - measure.of(&rounded, &velocities).e_vel).abs()
    };
    (0..sweeps).map(after_one).fold(0.0, f64::max)
}

fn assert_as_double_precision(backend: fn() -> Option<Box<dyn Backend>>) {
    for (name, problem) in problems(&folder()) {
        for order in [Order::Contacts, Order::Manifolds] {
            // A tonne on a kilogram: no impulses in f32 are nearer than those of f64 rounded, 1.8e-5.
            let allowed = if name == "tower2_1_1000" { by_rounding(&problem, order, 500) } else { 1e-5 };
            let [exact, rounded] = [None, backend()].map(|b| curve(&problem, (Method::Plain, order), b, 500));
            let apart = exact.iter().zip(&rounded).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            measured!("{name:<18} {order:<10?} {apart:.1e} apart, {allowed:.1e} allowed");
            assert!(apart <= allowed && rounded.iter().all(|e| e.is_finite()), "{name}, {order:?}: {apart:e}");
        }
    }
}

fn single_precision_leaves_the_errors_of_double_precision() {
    assert_as_double_precision(lanes);
}

fn single_precision_of_the_gpu_leaves_the_errors_of_double_precision() {
    assert_as_double_precision(plain_wgsl);
}

fn acceleration_pays() {
    let (mut fewer, mut lower) = (Vec::new(), Vec::new());
    for (name, problem) in problems(&folder()) {
        let sweeps = |method| sweeps_to(&problem, (method, Order::Manifolds), None, &ERRORS, MOST);
        let (plain, accelerated) = (sweeps(Method::Plain), sweeps(Method::Accelerated));
        let after_32 = |method| curve(&problem, (method, Order::Manifolds), None, 32)[31];
        let gain = after_32(Method::Plain) / after_32(Method::Accelerated);
        measured!("{name:<18} {plain:?} and {accelerated:?} sweeps; after 32 {gain:.1} times lower");
        let counts =
            |sweeps: &[Option<u32>]| -> Vec<f64> { sweeps.iter().map(|s| s.expect("reached").into()).collect() };
        let (plain, accelerated) = (counts(&plain), counts(&accelerated));
        assert!(plain.iter().zip(&accelerated).all(|(p, a)| a <= p), "{name}: worse than plain");
        fewer.push(plain[2] / accelerated[2]);
        lower.push(gain);
    }
    measured!("median {:.2} times fewer to 1e-3, {:.1} times lower after 32", median(&fewer), median(&lower));
    assert!(median(&fewer) >= 2.4, "{fewer:?}");
    assert!(median(&lower) >= 5.0, "{lower:?}");
}

fn newtons_method_solves_each_to_the_end() {
    for (name, problem) in problems(&folder()) {
        let outcome = newton(&mut Bodies::new(&problem), 1e-8, MOST);
        let error =
            Measure::new(&problem).of(&outcome.impulses, &Operator::new(&problem).velocities(&outcome.impulses)).e_vel;
        measured!("{name:<18} {} steps, {} sweeps, {:?}: {error:.1e}", outcome.steps, outcome.sweeps, outcome.ended);
        assert!(error <= 1.01e-8 && outcome.steps <= 40 && outcome.sweeps <= 500, "{name}: {error:e}");
    }
}

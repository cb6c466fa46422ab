//! Contact problems of others: the solver takes as many sweeps as an independent program with the same methods and order.
//!
//! Runs where the environment variable DRYSTONE_PROBLEMS names a folder with `NAME.contacts` and a table `anchors.csv`: columns
//! `problem`, `solver` (`pgs` or `accel`) and `it_1e-1` to `it_1e-3`, sweeps until e_vel is less than that.

mod common;

use std::path::PathBuf;

use common::contacts::sweeps_to;
use drystone::ContactProblem;
use drystone::solver::{Method, Order};

/// Errors to which sweeps are counted.
const ERRORS: [f64; 3] = [1e-1, 1e-2, 1e-3];
/// Sweeps after which counting ends.
const MOST: u32 = 60_000;

/// One line of the table.
struct Anchor {
    name: String,
    method: Method,
    sweeps: [u32; 3],
}

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("DRYSTONE_PROBLEMS").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("not run: DRYSTONE_PROBLEMS names no folder");
    }
    folder
}

fn anchors(folder: &std::path::Path) -> Vec<(Anchor, ContactProblem)> {
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

/// Sweeps over those of the anchor, for each error.
fn ratios(anchor: &Anchor, problem: &ContactProblem, order: Order) -> [f64; 3] {
    let sweeps = sweeps_to::<f64>(problem, (anchor.method, order), &ERRORS, MOST);
    println!(
        "{:<18} {:<12} {order:<10?} {sweeps:?}, anchor {:?}",
        anchor.name,
        format!("{:?}", anchor.method),
        anchor.sweeps
    );
    [0, 1, 2].map(|i| sweeps[i].map_or(f64::INFINITY, f64::from) / f64::from(anchor.sweeps[i]))
}

#[test]
fn contact_by_contact_sweeps_are_those_of_the_anchors() {
    let Some(folder) = folder() else { return };
    for (anchor, problem) in anchors(&folder) {
        let ratios = ratios(&anchor, &problem, Order::Contacts);
        assert!(ratios.iter().all(|r| (r - 1.0).abs() <= 0.02), "{}: {ratios:?} of the anchor", anchor.name);
    }
}

#[test]
fn manifold_by_manifold_sweeps_are_no_more() {
    let Some(folder) = folder() else { return };
    let mut all = Vec::new();
    for (anchor, problem) in anchors(&folder) {
        all.extend(ratios(&anchor, &problem, Order::Manifolds));
    }
    all.sort_by(f64::total_cmp);
    println!("ratios {:.2?}", all);
    assert!(all[all.len() / 2] <= 1.0, "the median of {all:?} is more than 1");
    assert!(all[all.len() - 1] <= 1.5, "the largest of {all:?} is more than 1.5");
}

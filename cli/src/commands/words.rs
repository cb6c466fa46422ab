//! Kinds of the library as values of arguments: their names, with a line of help each.

use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use drystone::backend::{BackendChoice, BackendKind};
use drystone::config::Method;
use drystone::preset::Preset;
use drystone::solver::Order;

/// A name and its help.
type Word = (&'static str, &'static str);

const PRESETS: [Word; Preset::ALL.len()] = [
    ("fast", "4 substeps: for games and previews"),
    ("balanced", "8 substeps"),
    ("accurate", "32 substeps: heavy on light"),
    ("reference", "128 substeps: to hold the others against"),
];

const METHODS: [Word; Method::ALL.len()] = [
    ("plain", "One after another: projected Gauss-Seidel"),
    (
        "accelerated",
        "With Nesterov's momentum, and a restart as soon as steps grow. Pays from three sweeps on: the first two are the plain ones",
    ),
];

const ORDERS: [Word; Order::ALL.len()] = [
    (
        "contacts",
        "Every contact by itself: in the order of the file each takes the first color that is free on both of its bodies",
    ),
    (
        "manifolds",
        "Contacts of the same two bodies with one frame together, up to four, as in a step: manifolds are colored, those with something fixed come last",
    ),
];

const BACKENDS: [Word; BackendChoice::ALL.len()] = [
    (
        "auto",
        "A hardware GPU where there is one and the scene is large enough that it pays, as measured by some steps of a small pile on both; else the CPU",
    ),
    ("gpu", "The compute shaders, on the best adapter there is"),
    ("cpu", "The CPU, with as many threads as there are"),
    ("reference", "The CPU reference, one constraint at a time on one thread"),
];

const NUMBERS: [Word; BackendKind::ALL.len()] = [
    ("f64", "The reference in double precision"),
    ("reference", "The reference, one constraint at a time on one thread, in single precision"),
    ("cpu", "Sixteen constraints at a time, in single precision"),
    ("gpu", "The compute shaders, in single precision"),
];

/// Takes one of `words`, each the name of a `T`.
fn one_of<T>(words: &[Word]) -> impl TypedValueParser<Value = T> + use<T>
where
    T: FromStr<Err = drystone::Error> + Clone + Send + Sync + 'static,
{
    let values = words.iter().map(|&(name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<T>())
}

pub(super) fn preset() -> impl TypedValueParser<Value = Preset> {
    one_of(&PRESETS)
}

pub(super) fn method() -> impl TypedValueParser<Value = Method> {
    one_of(&METHODS)
}

/// A method of sweeps, or `newton`: none of them.
pub(super) fn solve_method() -> impl TypedValueParser<Value = SolveMethod> {
    let newton = ("newton", "Newton's method on the central path, with sweeps before it while they pay; in f64");
    one_of(&[&METHODS[..], &[newton]].concat())
}

/// How `drystone solve` solves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SolveMethod {
    Sweeps(Method),
    Newton,
}

impl FromStr for SolveMethod {
    type Err = drystone::Error;

    fn from_str(name: &str) -> drystone::Result<Self> {
        match name {
            "newton" => Ok(Self::Newton),
            _ => name.parse().map(Self::Sweeps),
        }
    }
}

pub(super) fn order() -> impl TypedValueParser<Value = Order> {
    one_of(&ORDERS)
}

pub(super) fn backend() -> impl TypedValueParser<Value = BackendChoice> {
    one_of(&BACKENDS)
}

pub(super) fn numbers() -> impl TypedValueParser<Value = BackendKind> {
    one_of(&NUMBERS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_offered_by_its_name() {
        fn same<T: ToString>(words: &[Word], all: &[T]) {
            let names: Vec<_> = all.iter().map(T::to_string).collect();
            assert_eq!(words.iter().map(|word| word.0).collect::<Vec<_>>(), names);
        }
        same(&PRESETS, &Preset::ALL);
        same(&METHODS, &Method::ALL);
        same(&ORDERS, &Order::ALL);
        same(&BACKENDS, &BackendChoice::ALL);
        same(&NUMBERS, &BackendKind::ALL);
    }
}

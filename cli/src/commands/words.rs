//! Enums of the library as argument values, each with its name and one line of help.

use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use drystone::backend::{BackendChoice, BackendKind};
use drystone::config::Method;
use drystone::preset::Preset;
#[cfg(feature = "gpu")]
use drystone_conform::Group;
use drystone_problems::solver::Order;
use drystone_scenes::Family;
#[cfg(feature = "view")]
use drystone_view::ColorBy;

pub(super) trait Named: FromStr<Err = drystone::Error> + Clone + Send + Sync + 'static {
    /// The name and the help text of each value.
    const WORDS: &'static [(&'static str, &'static str)];
}

/// Parses a value by its name.
pub(super) fn of<T: Named>() -> impl TypedValueParser<Value = T> {
    let values = T::WORDS.iter().map(|&(name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(values).try_map(|name| name.parse::<T>())
}

impl Named for Preset {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        ("fast", "4 substeps: for games and previews"),
        ("balanced", "8 substeps"),
        ("accurate", "32 substeps"),
        ("reference", "128 substeps: for comparison with other presets"),
    ];
}

impl Named for Family {
    const WORDS: &'static [(&'static str, &'static str)] = &{
        let mut words = [("", ""); Family::ALL.len()];
        let mut k = 0;
        while k < words.len() {
            words[k] = (Family::ALL[k].name(), Family::ALL[k].summary());
            k += 1;
        }
        words
    };
}

#[cfg(feature = "gpu")]
impl Named for Group {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        ("kernels", "Every kernel on random problems, compared with the reference"),
        ("scenes", "Every scene of the catalogue, small and short, compared with the reference"),
        ("limits", "Large buffers, and problems beyond the limits of buffers and memory"),
        ("long-dispatch", "Plans that would hold the device for a long time"),
        ("device-lost", "Devices that are lost between or during steps"),
    ];
}

impl Named for Method {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        ("plain", "Projected Gauss-Seidel"),
        (
            "accelerated",
            "Nesterov's momentum, restarted when the changes grow; differs from plain from the third sweep on",
        ),
    ];
}

impl Named for Order {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        ("contacts", "Color single contacts: each takes, in file order, the first color that is free on both bodies"),
        (
            "manifolds",
            "Color manifolds: up to four contacts with the same bodies and frame; manifolds with fixed bodies come last",
        ),
    ];
}

/// The solver of `drystone solve`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SolveMethod {
    Sweeps(Method),
    Newton,
}

impl FromStr for SolveMethod {
    type Err = drystone::Error;

    fn from_str(name: &str) -> drystone::Result<Self> {
        if name == "newton" { Ok(Self::Newton) } else { name.parse().map(Self::Sweeps) }
    }
}

impl Named for SolveMethod {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        Method::WORDS[0],
        Method::WORDS[1],
        ("newton", "Sweeps while they are efficient, then Newton's method on the central path; in double precision"),
    ];
}

impl Named for BackendChoice {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        (
            "auto",
            "A hardware GPU if a measurement on a pile of the size of the scene shows that it is faster; else the CPU",
        ),
        ("gpu", "The compute shaders, on the best adapter"),
        ("cpu", "The CPU lanes, on all threads"),
        ("reference", "The CPU reference, one constraint at a time on one thread"),
    ];
}

impl Named for BackendKind {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        ("f64", "The reference in double precision"),
        ("reference", "The reference in single precision, one constraint at a time on one thread"),
        ("cpu", "Sixteen constraints at a time, in single precision"),
        ("gpu", "The compute shaders, in single precision"),
    ];
}

#[cfg(feature = "view")]
impl Named for ColorBy {
    const WORDS: &'static [(&'static str, &'static str)] = &[
        ("material", "Density, friction and restitution: equal materials have equal colors"),
        ("batch", "The color in the constraint graph of the contact with the largest impulse on the body"),
        ("speed", "Speed of the center of mass, dark to light"),
        ("impulse", "Sum of the normal impulses on the body in the last substep, dark to light"),
        ("sleeping", "Sleeping bodies are dark, awake bodies light"),
        ("effort", "Substeps of the body's island, dark to light: each shade doubles them"),
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_offered_by_its_name() {
        fn same<T: ToString + Named>(all: &[T]) {
            let names: Vec<_> = all.iter().map(T::to_string).collect();
            assert_eq!(T::WORDS.iter().map(|word| word.0).collect::<Vec<_>>(), names);
        }
        same(&Preset::ALL);
        same(&Family::ALL);
        same(&Method::ALL);
        same(&Order::ALL);
        same(&BackendChoice::ALL);
        same(&BackendKind::ALL);
        #[cfg(feature = "view")]
        same(&ColorBy::ALL);
    }
}

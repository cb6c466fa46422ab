//! What drystone must bear: for each kind of input a function over bytes that panics where a promise is broken.
//!
//! The promises: no panic, no hang, an error is one line, nothing that is no number stays unreported, every backend and number of threads gives
//! the same bits, what is written is read back the same, nothing gains energy, nothing goes through a floor.

#![deny(unsafe_code)]

mod any;
mod calls;
mod drops;
mod run;
mod saved;
mod texts;

use std::sync::LazyLock;

use drystone::Error;

/// A kind of input.
pub struct Target {
    /// Its name, which is also that of its folders.
    pub name: &'static str,
    /// Panics where the input breaks a promise.
    pub check: fn(&[u8]),
    /// Good inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// The most bytes of an input that finds something new.
    pub longest: usize,
}

/// All kinds.
pub const TARGETS: &[Target] = &[
    Target { name: "scene", check: texts::scene, seeds: texts::scenes, longest: 4096 },
    Target { name: "spec", check: texts::spec, seeds: texts::specs, longest: 128 },
    Target { name: "problem", check: texts::problem, seeds: texts::problems, longest: 4096 },
    Target { name: "fclib", check: texts::fclib, seeds: texts::fclibs, longest: 16384 },
    Target { name: "settings", check: texts::settings, seeds: texts::setting_files, longest: 1024 },
    Target { name: "board", check: texts::board, seeds: texts::boards, longest: 1024 },
    Target { name: "script", check: texts::script, seeds: texts::scripts, longest: 512 },
    Target { name: "rows", check: texts::rows, seeds: texts::row_files, longest: 4096 },
    Target { name: "bench", check: texts::bench_file, seeds: texts::benches, longest: 4096 },
    Target { name: "saved", check: saved::state, seeds: saved::states, longest: 8192 },
    Target { name: "replay", check: saved::replay, seeds: saved::replays, longest: 16384 },
    Target { name: "calls", check: calls::check, seeds: calls::seeds, longest: 1024 },
    Target { name: "drops", check: drops::check, seeds: drops::seeds, longest: 256 },
];

/// The kind of this name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}

/// Prints what an input stands for, with `DRYSTONE_FUZZ_SHOW`.
fn show(input: &impl std::fmt::Debug) {
    static ASKED: LazyLock<bool> = LazyLock::new(|| std::env::var_os("DRYSTONE_FUZZ_SHOW").is_some());
    if *ASKED {
        println!("{input:#?}");
    }
}

/// An error that a user can read: one line that says something.
fn is_one_line(error: &Error) {
    let line = error.to_string();
    assert!(!line.trim().is_empty(), "an error without a word: {error:?}");
    assert!(!line.contains(char::is_control), "an error of several lines: {line:?}");
    assert!(line.len() < 4000, "an error of {} bytes: {}...", line.len(), line.chars().take(200).collect::<String>());
}

/// The value, or none after a look at the error, which must not be a mistake of the library.
fn good<T>(result: drystone::Result<T>) -> Option<T> {
    if let Err(error) = &result {
        assert!(!matches!(error, Error::Panicked(_)), "{error}");
    }
    borne(result)
}

/// The same, of what someone forged.
fn borne<T>(result: drystone::Result<T>) -> Option<T> {
    result.map_err(|error| is_one_line(&error)).ok()
}

//! Fuzz tests of drystone: for each kind of input, a function over bytes that panics if the library breaks a promise.
//!
//! The promises: no panic, no hang, each error is one line, every NaN is reported, every backend and number of threads
//! gives the same bits, written data is read back unchanged, no energy is gained, and nothing passes through a floor.

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
    /// Its name, which its folders share.
    pub name: &'static str,
    /// Panics if the input breaks a promise.
    pub check: fn(&[u8]),
    /// Valid inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// The largest number of bytes in a useful input.
    pub longest: usize,
}

/// All kinds of input.
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

/// The kind with this name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}

/// Prints the meaning of an input if `DRYSTONE_FUZZ_SHOW` is set.
fn show(input: &impl std::fmt::Debug) {
    static ASKED: LazyLock<bool> = LazyLock::new(|| std::env::var_os("DRYSTONE_FUZZ_SHOW").is_some());
    if *ASKED {
        println!("{input:#?}");
    }
}

/// Checks that an error is readable for a user: one line with a message.
fn is_one_line(error: &Error) {
    let line = error.to_string();
    assert!(!line.trim().is_empty(), "an error without a word: {error:?}");
    assert!(!line.contains(char::is_control), "an error of several lines: {line:?}");
    assert!(line.len() < 4000, "an error of {} bytes: {}...", line.len(), line.chars().take(200).collect::<String>());
}

/// The value, or `None` after a check of the error, which must not be a defect of the library.
fn good<T>(result: drystone::Result<T>) -> Option<T> {
    if let Err(error) = &result {
        assert!(!matches!(error, Error::Panicked(_)), "{error}");
    }
    borne(result)
}

/// The same for forged input.
fn borne<T>(result: drystone::Result<T>) -> Option<T> {
    result.map_err(|error| is_one_line(&error)).ok()
}

//! Where rows come from: rows of another program, machine or number of threads are not gone on with.

use std::hash::Hasher;
use std::process::Command;
use std::time::SystemTime;

use fnv::FnvHasher;

use crate::report::bench::Machine;

/// The program that runs, and what it runs on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Hash of the program's file, 16 hexadecimal digits.
    pub build: String,
    /// Commit of the sources that the program was built from, with a `+` if they were changed since; `unknown` without them.
    pub commit: String,
    /// Processor, cores, adapter, operating system.
    pub machine: String,
    /// Threads of the pool.
    pub threads: usize,
}

impl Origin {
    /// Of this program, here. `adapter` is the one that shaders run on.
    pub fn here(adapter: Option<String>) -> Self {
        let Machine { processor, cores, system, .. } = Machine::this();
        let facts = [Some(processor), Some(format!("{cores} cores")), Some(system), adapter];
        let machine = facts.into_iter().flatten().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(", ");
        Self { build: build(), commit: commit(), machine, threads: rayon::current_num_threads() }
    }

    /// The moment, as text that sorts.
    pub(super) fn now() -> String {
        humantime::format_rfc3339_micros(SystemTime::now()).to_string()
    }
}

fn build() -> String {
    let mut hasher = FnvHasher::default();
    let program = std::env::current_exe().and_then(std::fs::read);
    hasher.write(&program.unwrap_or_default());
    format!("{:016x}", hasher.finish())
}

fn commit() -> String {
    let git = ["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--exclude=*", "--dirty=+"];
    let said = Command::new("git").args(git).output().ok().filter(|o| o.status.success());
    said.and_then(|o| String::from_utf8(o.stdout).ok()).map_or("unknown".into(), |text| text.trim().to_owned())
}

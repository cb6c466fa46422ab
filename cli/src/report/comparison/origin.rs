//! The origin of rows: a report continues only rows of the same program, machine and number of threads.

use std::hash::Hasher;
use std::process::Command;
use std::time::SystemTime;

use fnv::FnvHasher;

use crate::report::bench::Machine;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Hash of the program file, 16 hexadecimal digits.
    pub build: String,
    /// Commit of the sources, with a `+` if they are changed; `unknown` without sources.
    pub commit: String,
    /// Processor, cores, adapter, operating system.
    pub machine: String,
    pub threads: usize,
}

impl Origin {
    /// The origin of rows of this process; `adapter` runs the shaders.
    pub fn here(adapter: Option<String>) -> Self {
        let Machine { processor, cores, system, .. } = Machine::this();
        let facts = [Some(processor), Some(format!("{cores} cores")), Some(system), adapter];
        let machine = facts.into_iter().flatten().filter(|s| !s.is_empty()).collect::<Vec<_>>().join(", ");
        let build = fnv(&std::env::current_exe().and_then(std::fs::read).unwrap_or_default());
        Self { build, commit: commit(), machine, threads: rayon::current_num_threads() }
    }

    /// The time as text that sorts.
    pub(in crate::report) fn now() -> String {
        humantime::format_rfc3339_micros(SystemTime::now()).to_string()
    }
}

/// 64-bit FNV-1a hash, as 16 hexadecimal digits.
pub(in crate::report) fn fnv(bytes: &[u8]) -> String {
    let mut hasher = FnvHasher::default();
    hasher.write(bytes);
    format!("{:016x}", hasher.finish())
}

fn commit() -> String {
    let git = ["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--exclude=*", "--dirty=+"];
    let said = Command::new("git").args(git).output().ok().filter(|o| o.status.success());
    said.and_then(|o| String::from_utf8(o.stdout).ok()).map_or("unknown".into(), |text| text.trim().to_owned())
}

//! The machine that a bench ran on.

use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the processor; empty if unknown.
    pub processor: String,
    pub cores: usize,
    /// Memory (MiB); 0 if unknown.
    pub memory: u64,
    pub system: String,
    /// Version of drystone, and `debug` or `release`.
    pub build: String,
}

impl Machine {
    pub fn this() -> Self {
        // Only Linux has these files.
        let said = |file: &str, key: &str| {
            let text = std::fs::read_to_string(file).unwrap_or_default();
            let line = text.lines().find(|line| line.starts_with(key)).unwrap_or_default();
            line.split_once(':').map(|(_, value)| value.trim().to_owned()).unwrap_or_default()
        };
        let kilobytes = said("/proc/meminfo", "MemTotal");
        let optimized = if cfg!(debug_assertions) { "debug" } else { "release" };
        Self {
            processor: said("/proc/cpuinfo", "model name"),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory: kilobytes.trim_end_matches(" kB").parse().unwrap_or(0) / 1024,
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            build: format!("{} {optimized}", env!("CARGO_PKG_VERSION")),
        }
    }

    /// Whether times of both can be compared.
    pub fn is(&self, other: &Self) -> bool {
        let of = |machine: &Self| (machine.processor.clone(), machine.cores, machine.system.clone());
        of(self) == of(other)
    }

    pub fn line(&self) -> String {
        let Self { processor, cores, memory, system, build } = self;
        format!("{processor}, {cores} cores, {memory} MiB, {system}; drystone {build}")
    }
}

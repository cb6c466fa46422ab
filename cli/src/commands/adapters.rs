//! `drystone adapters`.

use clap::Args;
use serde_json::json;

use super::output::{plain_table, print, print_json};
use drystone::Result;
use drystone::backend::gpu::{AdapterSummary, adapters};

#[derive(Args)]
pub struct AdaptersArgs {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl AdaptersArgs {
    pub fn run(&self) -> Result<()> {
        let found = adapters();
        if self.json {
            let adapter = |a: &AdapterSummary| {
                json!({"name": a.name, "api": a.api, "driver": a.driver, "kind": a.kind,
                    "hardware": a.hardware, "takes_spirv": a.takes_spirv, "buffer_limit": a.buffer_limit})
            };
            return print_json(&json!({"adapters": found.iter().map(adapter).collect::<Vec<_>>()}));
        }
        if found.is_empty() {
            return print("no adapters; everything runs on the CPU");
        }
        let mut table = plain_table();
        table.set_header(["name", "api", "kind", "driver", "exact mode", "largest buffer"]);
        for a in found {
            let exact = if a.takes_spirv { "by SPIR-V" } else { "by integers" };
            let buffer = format!("{} MiB", a.buffer_limit >> 20);
            table.add_row([a.name, a.api, a.kind.into(), a.driver, exact.into(), buffer]);
        }
        print(table)
    }
}

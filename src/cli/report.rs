//! `drystone report`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{print, progress};
use crate::error::Result;
use crate::report::{RUNS, rules};

/// Arguments of `drystone report`.
#[derive(Args)]
pub struct ReportArgs {
    /// Which page.
    #[arg(value_enum)]
    page: Page,
    /// Directory that the page and its pictures are written into.
    #[arg(long, default_value = "docs")]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Page {
    /// What each rule of the course sheet does.
    Rules,
}

impl ReportArgs {
    /// Makes the page.
    pub fn run(&self) -> Result<()> {
        match self.page {
            Page::Rules => {
                let bar = progress(RUNS as u32, false);
                let report = rules(|| bar.inc(1))?;
                bar.finish_and_clear();
                report.write(&self.out)?;
                print(self.out.join("rules.md").display())
            }
        }
    }
}

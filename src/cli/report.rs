//! `drystone report`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{print, progress};
use crate::error::{Error, Result};
use crate::files;
use crate::report::{RUNS, convergence, rules};

/// Arguments of `drystone report`.
#[derive(Args)]
pub struct ReportArgs {
    /// Which page.
    #[arg(value_enum)]
    page: Page,
    /// Directory that the page and its pictures are written into.
    #[arg(long, default_value = "docs")]
    out: PathBuf,
    /// Directory of contact problems that are solved besides those of the catalogue; for convergence.
    #[arg(long, value_name = "DIR")]
    problems: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Page {
    /// What each rule of the course sheet does.
    Rules,
    /// How many sweeps contact problems take to which error.
    Convergence,
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
            Page::Convergence => {
                let bar = progress(0, false);
                let page = convergence(self.problems.as_deref(), |problems| {
                    bar.set_length(problems as u64);
                    bar.inc(1);
                })?;
                bar.finish_and_clear();
                std::fs::create_dir_all(&self.out).map_err(Error::file(&self.out))?;
                let path = self.out.join("convergence.md");
                files::write(&path, page.as_bytes())?;
                print(path.display())
            }
        }
    }
}

//! `drystone report`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::output::{print, say};
use super::progress::{PERCENT, Progress};
use crate::adapter;
use crate::files;
use crate::report::comparison::{Extent, Origin, Report, Survey, Team, drystone, scene, scenes, tables};
use crate::report::{Convergence, RUNS, Shard, Solvers, convergence, performance, problems, rules, solvers};
use drystone::{Error, Result};

#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct ReportArgs {
    #[command(flatten)]
    survey: SurveyArgs,
    #[command(subcommand)]
    page: Option<Page>,
}

#[derive(Subcommand)]
enum Page {
    /// Measure the effect of each solver rule.
    Rules {
        /// Directory for the page and its pictures.
        #[arg(long, default_value = "docs")]
        out: PathBuf,
    },
    /// Compare times of a step with other engines and with the limits of the machine, from the rows in DIR/performance.
    ///
    /// `benches/performance` measures the rows and draws the page.
    Performance {
        /// Directory for the page. Its folder performance has the rows as CSV, and gets the picture.
        #[arg(long, default_value = "docs")]
        out: PathBuf,
    },
    /// Write the tables of README.md and docs/speed-vs-error.md, from the rows in docs/report and docs/performance.
    Tables {
        /// Directory with README.md and docs.
        #[arg(long, default_value = ".")]
        root: PathBuf,
        /// Write nothing; fail if a table differs from the rows.
        #[arg(long)]
        check: bool,
    },
    /// Count the sweeps that contact problems need to reach an error.
    Convergence {
        /// Directory for the page. Its folder convergence gets all rows as CSV, and the pictures.
        #[arg(long, default_value = "docs")]
        out: PathBuf,
        /// Directory with contact problems, in addition to the problems of catalogue scenes.
        #[arg(long, value_name = "DIR")]
        problems: Option<PathBuf>,
        /// Table of benches/against_siconos.py, for the section on other solvers and its profiles.
        #[arg(long, value_name = "TABLE")]
        siconos: Option<PathBuf>,
    },
}

/// Compare speed and error: a page of pictures and tables, and the rows behind it.
///
/// An interrupted report continues: it keeps the rows in DIR that the same program measured on the same machine.
#[derive(Args)]
pub struct SurveyArgs {
    /// Directory for index.html, speed-against-error.svg, scenes.csv, problems.csv and, with other engines,
    /// equal-error.md.
    #[arg(long, default_value = "report")]
    out: PathBuf,
    /// Run fewer scenes and settings, in less than two minutes.
    #[arg(long)]
    quick: bool,
    /// Run all kinds of scenes with few bodies and settings, and no contact problems: in less than a quarter of an hour
    /// with other engines.
    #[arg(long, conflicts_with = "quick")]
    brief: bool,
    /// Largest number of steps of each scene.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    steps: Option<u32>,
    /// Run only this scene, as tower or tower:n=20,top_ratio=100 or a file; can be repeated.
    #[arg(long, value_name = "SCENE")]
    scene: Vec<String>,
    /// Directory with contact problems, in addition to the problems of catalogue scenes.
    #[arg(long, value_name = "DIR")]
    problems: Option<PathBuf>,
    /// Number of threads of each engine.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Run part I of N, and leave its rows in DIR/shard-I-of-N for --merge.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Make the report from the rows in these shard folders or files, from any machines.
    ///
    /// It needs the arguments of the shards.
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "shard")]
    merge: Vec<PathBuf>,
    /// Draw the existing rows without running scenes.
    #[arg(long, conflicts_with_all = ["quick", "brief", "steps", "scene", "problems", "threads", "shard", "merge"])]
    draw: bool,
}

impl ReportArgs {
    pub fn run(&self) -> Result<()> {
        match &self.page {
            None => self.survey.run(&[]),
            Some(Page::Rules { out }) => {
                let bar = Progress::steps(RUNS as u32, false);
                let report = rules(|| bar.inc())?;
                bar.finish();
                report.write(out)?;
                print(out.join("rules.md").display())
            }
            Some(Page::Performance { out }) => {
                performance(out)?;
                print(out.join("performance.md").display())
            }
            Some(Page::Tables { root, check }) => {
                tables(root, *check)?.iter().try_for_each(|page| print(page.display()))
            }
            Some(Page::Convergence { out, problems, siconos }) => {
                // Refuse a bad table before anything runs.
                let others = siconos.as_deref().map(solvers).transpose()?;
                let (bar, mut done) = (Progress::steps(0, false), 0);
                let Convergence { mut page, mut folder } = convergence(problems.as_deref(), |problems| {
                    done += 1;
                    bar.set(done, problems as u64);
                })?;
                bar.finish();
                if let Some(Solvers { section, folder: more }) = others {
                    page.push_str(&section);
                    folder.extend(more);
                }
                let directory = out.join("convergence");
                std::fs::create_dir_all(&directory).map_err(Error::file(&directory))?;
                for (name, bytes) in folder {
                    files::write(&directory.join(name), &bytes)?;
                }
                let path = out.join("convergence.md");
                files::write(&path, page.as_bytes())?;
                print(path.display())
            }
        }
    }
}

impl SurveyArgs {
    pub fn threads(&self) -> usize {
        self.threads.into()
    }

    pub fn run(&self, others: &[&Team]) -> Result<()> {
        let report = if self.draw { Report::read(&self.out)? } else { self.measure(others)? };
        match self.shard {
            Some(shard) => print(self.folder_of(shard).display()),
            None => print(report.write(&self.out)?.display()),
        }
    }

    fn folder_of(&self, shard: Shard) -> PathBuf {
        self.out.join(format!("shard-{shard}"))
    }

    fn measure(&self, others: &[&Team]) -> Result<Report> {
        // This fails only if the pool exists already. This thread is one of its threads.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(self.threads()).use_current_thread().build_global();
        let extent = match (self.quick, self.brief) {
            (true, _) => Extent::Quick,
            (_, true) => Extent::Brief,
            _ => Extent::Full,
        };
        let mut scenes = match self.scene.is_empty() {
            true => scenes(extent)?,
            false => self.scene.iter().map(|word| scene(word)).collect::<Result<_>>()?,
        };
        scenes.iter_mut().for_each(|scene| scene.steps = scene.steps.min(self.steps.unwrap_or(u32::MAX)));
        let some = self.scene.is_empty() && extent != Extent::Brief || self.problems.is_some();
        let problems = if some { problems(self.problems.as_deref())? } else { Vec::new() };
        let own: &Team = &drystone;
        let teams = std::iter::once(own).chain(others.iter().copied()).collect();
        let out = self.shard.map_or_else(|| self.out.clone(), |shard| self.folder_of(shard));
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        let survey = Survey { scenes, teams, extent, problems, out, shard };
        if !self.merge.is_empty() {
            return survey.merge(&self.merge, self.threads(), &mut |line| say(line));
        }
        let adapter = adapter::best().map(|adapter| adapter.name);
        let bar = Progress::new(PERCENT, 1, false);
        let report = survey.run(&Origin::here(adapter), &mut |what, done, total| {
            bar.set_message(what);
            bar.set(done, total);
        })?;
        bar.finish();
        Ok(report)
    }
}

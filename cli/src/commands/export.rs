//! `drystone export`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{print, replacing};
use super::scene::check_touching;
use crate::files;
use crate::report::problem_of_step;
use drystone::{Error, Result};
use drystone_problems::ContactProblem;
use drystone_scenes::{CATALOGUE, Scene};

#[derive(Args)]
pub struct ExportArgs {
    /// A scene, or a contact problem.
    ///
    /// A catalogue name or a .json file is a scene; any other file is a contact problem.
    source: String,
    /// Set a parameter of the scene; can be repeated.
    #[arg(short, long = "parameter", value_name = "KEY=VALUE")]
    parameter: Vec<String>,
    /// Export the contact problem of step N of the scene; 1 is the first.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    step: Option<u32>,
    /// File for the problem in FCLIB's HDF5 format, global form.
    #[arg(long, value_name = "FILE")]
    fclib: PathBuf,
}

impl ExportArgs {
    pub fn run(&self) -> Result<()> {
        let path = Path::new(&self.source);
        let is_scene = CATALOGUE.iter().any(|e| e.name == self.source) || path.extension().is_none_or(|e| e == "json");
        let problem = if is_scene {
            let missing = || Error::input(format!("{}: a scene needs --step N", self.source));
            let problem = problem_of_step(Scene::find(&self.source, &self.parameter)?, self.step.ok_or_else(missing)?)?;
            check_touching(&problem)?;
            problem
        } else if self.step.is_some() || !self.parameter.is_empty() {
            return Err(Error::input(format!(
                "{}: --step and --parameter need a scene, not a contact problem",
                self.source
            )));
        } else {
            ContactProblem::read(path)?
        };
        replacing(&self.fclib, || files::write(&self.fclib, &problem.to_fclib()?))?;
        let (bodies, contacts) = (problem.bodies.len(), problem.contacts.len());
        print(format_args!("{}: {bodies} bodies, {contacts} contacts", self.fclib.display()))
    }
}

//! `drystone export`.

use std::path::PathBuf;

use clap::Args;

use super::print;
use crate::contacts::ContactProblem;
use crate::error::Result;

/// Arguments of `drystone export`.
#[derive(Args)]
pub struct ExportArgs {
    /// A contact problem; the format is in docs/contacts-format.md.
    file: PathBuf,
    /// Write it as FCLIB's HDF5, global form.
    #[arg(long, value_name = "FILE")]
    fclib: PathBuf,
}

impl ExportArgs {
    /// Reads the problem and writes it.
    pub fn run(&self) -> Result<()> {
        let problem = ContactProblem::read(&self.file)?;
        problem.write_fclib(&self.fclib)?;
        let (bodies, contacts) = (problem.bodies.len(), problem.contacts.len());
        print(format_args!("{}: {bodies} bodies, {contacts} contacts", self.fclib.display()))
    }
}

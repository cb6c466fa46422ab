//! Rows in a CSV file, which grows whenever a block of them is finished.

use std::path::PathBuf;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::files;
use drystone::{Error, Result};

/// Rows and the file that they are in.
pub struct Table<R> {
    path: PathBuf,
    rows: Vec<R>,
}

impl<R: Serialize + DeserializeOwned> Table<R> {
    /// The rows of a file; none if it is not there.
    pub fn open(path: PathBuf) -> Result<Self> {
        if !path.exists() {
            return Ok(Self { path, rows: Vec::new() });
        }
        let bytes = std::fs::read(&path).map_err(Error::file(&path))?;
        let parsed: std::result::Result<Vec<R>, _> = csv::Reader::from_reader(&bytes[..]).deserialize().collect();
        let rows = parsed.map_err(|e| {
            let line = e.position().map_or(1, csv::Position::line);
            let path = path.display();
            Error::input(format!("{path}: line {line}: not a row of this version; move the file away to begin anew"))
        })?;
        Ok(Self { path, rows })
    }

    /// Adds a block of rows: to the file too, which has all of them afterwards or none.
    pub fn add(&mut self, block: Vec<R>) -> Result<()> {
        self.rows.extend(block);
        files::write(&self.path, &files::csv(&self.rows)?)
    }

    /// All rows, the oldest first.
    pub fn rows(&self) -> &[R] {
        &self.rows
    }
}

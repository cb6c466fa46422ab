//! Rows in a CSV file that grows by blocks.

use std::path::PathBuf;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::files;
use drystone::{Error, Result};

pub struct Table<R> {
    path: PathBuf,
    rows: Vec<R>,
}

impl<R: Clone + Serialize + DeserializeOwned> Table<R> {
    /// Reads the rows of a file; a missing file has none.
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

    /// Returns the block `known`, or makes a block and adds it to the rows and to the file.
    pub fn add_unless(&mut self, known: Option<Vec<R>>, make: impl FnOnce() -> Result<Vec<R>>) -> Result<Vec<R>> {
        if let Some(known) = known {
            return Ok(known);
        }
        let block = make()?;
        self.rows.extend_from_slice(&block);
        files::write(&self.path, &files::csv(&self.rows)?)?;
        Ok(block)
    }

    pub fn rows(&self) -> &[R] {
        &self.rows
    }
}

//! Surveys on several machines: each machine runs a part, and the rows of all parts are merged.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::DeserializeOwned;

use crate::files;
use drystone::{Error, Result};

/// A part of a survey: the one with this number, counted from 1, of every `of` consecutive items.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Shard {
    /// The survey as one part.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Whether item `k` of the survey, counted from 0, is in this part.
    pub fn has(self, k: usize) -> bool {
        k % self.of + 1 == self.number
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-of-{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        let fit = parsed.filter(|(number, of)| (1..=*of).contains(number) && *of <= 100_000);
        fit.map(|(number, of)| Self { number, of }).ok_or_else(|| "write it as I/N: part I of N, counted from 1".into())
    }
}

/// A row of a survey, with its origin.
pub trait Measured: Clone + DeserializeOwned {
    /// The first column. No other kind of row has it.
    const FIRST: &'static str;

    /// Program file and commit.
    fn program(&self) -> [&str; 2];

    /// Start of the run, and the machine that it ran on.
    fn run(&self) -> [&str; 2];
}

/// The rows of the last run, among rows of one item.
pub fn last_run<'a, R: Measured + 'a>(rows: impl Iterator<Item = &'a R> + Clone) -> Vec<R> {
    let last = rows.clone().map(R::run).max();
    rows.filter(|row| Some(row.run()) == last).cloned().collect()
}

/// The rows of one kind from files, or from the file `name` of a folder.
///
/// # Errors
/// A file cannot be read, or rows come from different programs.
pub fn gathered<R: Measured>(sources: &[PathBuf], name: &str) -> Result<Vec<R>> {
    let mut all: Vec<(PathBuf, R)> = Vec::new();
    for source in sources {
        let path = if source.is_dir() { source.join(name) } else { source.clone() };
        if source.is_dir() && !path.exists() || !source.is_dir() && first_column(&path)? != R::FIRST {
            continue;
        }
        all.extend(files::rows::<R>(&path)?.into_iter().map(|row| (path.clone(), row)));
    }
    let is_other = |a: &R, b: &R| {
        let ([build, commit], [other_build, other_commit]) = (a.program(), b.program());
        build != other_build && (commit != other_commit || commit == "unknown")
    };
    if let Some((first, own)) = all.first()
        && let Some((path, row)) = all.iter().find(|(_, row)| is_other(own, row))
    {
        let program = |row: &R| format!("commit {}, program {}", row.program()[1], row.program()[0]);
        let (first, path) = (first.display(), path.display());
        let (own, row) = (program(own), program(row));
        return Err(Error::input(format!(
            "{first} has rows of {own}, and {path} of {row}: only rows of one program merge"
        )));
    }
    Ok(all.into_iter().map(|(_, row)| row).collect())
}

fn first_column(path: &Path) -> Result<String> {
    let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
    Ok(text.split([',', '\n']).next().unwrap_or_default().trim().to_owned())
}

/// The error for items without rows.
pub fn missing(names: &[&str]) -> Result<()> {
    let (count, some) = (names.len(), names.iter().take(5).copied().collect::<Vec<_>>().join(", "));
    let more = if count > 5 { format!(" and {} more", count - 5) } else { String::new() };
    if count == 0 { Ok(()) } else { Err(Error::input(format!("no rows of {some}{more}: run their shards to the end"))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thing_is_in_one_shard() {
        for of in 1..6 {
            let shards: Vec<Shard> = (1..=of).map(|i| format!("{i}/{of}").parse().expect("a shard")).collect();
            assert!((0..20).all(|k| shards.iter().filter(|shard| shard.has(k)).count() == 1));
        }
        assert!((0..9).all(|k| Shard::WHOLE.has(k)));
        for bad in ["0/4", "5/4", "1", "1/0", "a/b", "/", "-1/4", "1/4/4"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}

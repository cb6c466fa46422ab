//! Files that appear under their names only when they are complete.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use drystone::{Error, Result};

/// Hidden paths of all open drafts.
static DRAFTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file or folder under a hidden name beside the final one. `keep` renames it; a draft that is dropped is removed.
pub struct Draft {
    /// The path that the caller gave, for messages.
    path: PathBuf,
    /// The final path, with links resolved.
    target: PathBuf,
    /// The hidden path; none if the target is a device or a pipe, which is written directly.
    hidden: Option<PathBuf>,
}

impl Draft {
    /// Chooses the hidden path and creates nothing.
    pub fn of(path: &Path) -> Result<Self> {
        let there = std::fs::metadata(path);
        if there.as_ref().is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            return Ok(Self { path: path.into(), target: path.into(), hidden: None });
        }
        let target = if there.is_ok() { path.canonicalize().map_err(Error::file(path))? } else { path.into() };
        let nameless = || Error::file(path)(ErrorKind::InvalidFilename.into());
        let name = target.file_name().ok_or_else(nameless)?.to_string_lossy().into_owned();
        let hidden = target.with_file_name(format!(".{}.{name}", std::process::id()));
        drafts().push(hidden.clone());
        Ok(Self { path: path.into(), target, hidden: Some(hidden) })
    }

    pub fn place(&self) -> &Path {
        self.hidden.as_deref().unwrap_or(&self.target)
    }

    pub fn create(&self) -> Result<File> {
        let made = if self.target.is_dir() { Err(ErrorKind::IsADirectory.into()) } else { File::create(self.place()) };
        made.map_err(Error::file(&self.path))
    }

    /// Renames the draft; an existing file of that name is replaced.
    pub fn keep(mut self) -> Result<()> {
        let Some(hidden) = &self.hidden else { return Ok(()) };
        std::fs::rename(hidden, &self.target).map_err(Error::file(&self.path))?;
        self.forget();
        Ok(())
    }

    fn forget(&mut self) {
        if let Some(hidden) = self.hidden.take() {
            drafts().retain(|draft| *draft != hidden);
        }
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if let Some(hidden) = &self.hidden {
            discard(hidden);
        }
        self.forget();
    }
}

pub fn csv(rows: &[impl serde::Serialize]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    rows.iter().try_for_each(|row| writer.serialize(row)).map_err(|e| Error::input(format!("a row as CSV: {e}")))?;
    writer.into_inner().map_err(|e| Error::input(format!("rows as CSV: {e}")))
}

/// The rows of a CSV file.
pub fn rows<R: serde::de::DeserializeOwned>(path: &Path) -> Result<Vec<R>> {
    let bytes = std::fs::read(path).map_err(Error::file(path))?;
    let parsed: std::result::Result<Vec<R>, _> = csv::Reader::from_reader(&bytes[..]).deserialize().collect();
    parsed.map_err(|e| {
        let line = e.position().map_or(1, csv::Position::line);
        let path = path.display();
        Error::input(format!("{path}: line {line}: not a row of this version; move the file away to begin anew"))
    })
}

pub fn discard_drafts() {
    drafts().drain(..).for_each(|draft| discard(&draft));
}

fn drafts() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    DRAFTS.lock().unwrap_or_else(PoisonError::into_inner)
}

fn discard(draft: &Path) {
    // The draft may not exist yet.
    let _ = if draft.is_dir() { std::fs::remove_dir_all(draft) } else { std::fs::remove_file(draft) };
}

/// Writes a file at once: a reader finds the old contents or all of the new.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let draft = Draft::of(path)?;
    draft.create()?.write_all(bytes).map_err(Error::file(path))?;
    draft.keep()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let all = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut all: Vec<_> = all.collect();
        all.sort();
        all
    }

    #[test]
    fn an_unfinished_file_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write(&path, b"old").unwrap();
        let draft = Draft::of(&path).unwrap();
        draft.create().unwrap().write_all(b"half of a r").unwrap();
        assert_eq!((names(folder.path()).len(), std::fs::read(&path).unwrap()), (2, b"old".to_vec()));
        drop(draft);
        assert_eq!(names(folder.path()), ["a.csv"]);
        write(&path, b"new").unwrap();
        assert_eq!((names(folder.path()).len(), std::fs::read(&path).unwrap()), (1, b"new".to_vec()));
        let message = write(folder.path(), b"x").unwrap_err().to_string();
        assert!(message.contains("directory"), "{message}");
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_remain() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        std::fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write(&link, b"new").unwrap();
        assert_eq!((std::fs::read(&file).unwrap(), link.is_symlink()), (b"new".to_vec(), true));
        let null = Draft::of(Path::new("/dev/null")).unwrap();
        assert_eq!(null.place(), Path::new("/dev/null"));
        drop(null);
        assert!(Path::new("/dev/null").exists());
    }
}

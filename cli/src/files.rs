//! Files that appear under their names only when they are complete, and messages about them when a command ends early.

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use drystone::{Error, Result};

/// The state of the command's files.
struct Book {
    /// Drafts that are open.
    drafts: Vec<Entry>,
    /// Complete files, and rows that remain.
    kept: Vec<PathBuf>,
    /// Rows from which the same command can continue.
    resumed: Vec<PathBuf>,
    /// Files whose drafts were discarded.
    discarded: Vec<PathBuf>,
}

struct Entry {
    hidden: PathBuf,
    path: PathBuf,
}

static BOOK: Mutex<Book> =
    Mutex::new(Book { drafts: Vec::new(), kept: Vec::new(), resumed: Vec::new(), discarded: Vec::new() });

/// A file or folder under a hidden name beside the final one. `keep` renames it. A draft that is dropped is removed.
pub struct Draft {
    /// The path that the caller gave, for messages.
    path: PathBuf,
    /// The final path, with links resolved.
    target: PathBuf,
    /// The hidden path, or `None` if the target is a device or a pipe, which is written directly.
    hidden: Option<PathBuf>,
}

impl Draft {
    /// Chooses the hidden path. Creates nothing.
    pub fn of(path: &Path) -> Result<Self> {
        let there = std::fs::metadata(path);
        if there.as_ref().is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            return Ok(Self { path: path.into(), target: path.into(), hidden: None });
        }
        let target = if there.is_ok() { path.canonicalize().map_err(Error::file(path))? } else { path.into() };
        let nameless = || Error::file(path)(ErrorKind::InvalidFilename.into());
        let name = target.file_name().ok_or_else(nameless)?.to_owned();
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let target = folder.canonicalize().unwrap_or(folder.into()).join(&name);
        let name = name.to_string_lossy();
        let hidden = target.with_file_name(format!(".{}.{name}", std::process::id()));
        let mut book = book();
        if book.drafts.iter().any(|draft| draft.hidden == hidden) {
            return Err(Error::input(format!("{}: two outputs have this name", path.display())));
        }
        book.drafts.push(Entry { hidden: hidden.clone(), path: path.into() });
        Ok(Self { path: path.into(), target, hidden: Some(hidden) })
    }

    pub fn place(&self) -> &Path {
        self.hidden.as_deref().unwrap_or(&self.target)
    }

    pub fn create(&self) -> Result<File> {
        // While `stop` runs, no file may be created.
        let _book = book();
        let made = if self.target.is_dir() { Err(ErrorKind::IsADirectory.into()) } else { File::create(self.place()) };
        made.map_err(Error::file(&self.path))
    }

    /// Renames the draft. It replaces an existing file of that name. Some file systems report a full disk only when the
    /// contents are synchronized.
    pub fn keep(mut self) -> Result<()> {
        let Some(hidden) = &self.hidden else { return Ok(()) };
        if hidden.is_file() {
            let file = File::options().write(true).open(hidden);
            file.and_then(|file| file.sync_all()).map_err(Error::file(&self.path))?;
        }
        let mut book = book();
        std::fs::rename(hidden, &self.target).map_err(Error::file(&self.path))?;
        book.drafts.retain(|draft| draft.hidden != *hidden);
        note(&mut book.kept, &self.path);
        drop(book);
        self.hidden = None;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if let Some(hidden) = &self.hidden {
            let mut book = book();
            discard(hidden);
            book.drafts.retain(|draft| draft.hidden != *hidden);
            note(&mut book.discarded, &self.path);
        }
    }
}

/// Records a file that grows row by row and is complete at any time.
pub fn note_rows(path: &Path) {
    note(&mut book().kept, path);
}

/// Records that the same command can continue from the rows of a file.
pub fn note_resumed(path: &Path) {
    note(&mut book().resumed, path);
}

/// Ends the process with a line about the outputs. No draft remains, and no file is created from now on.
pub fn stop(say: impl FnOnce(&str), code: i32) -> ! {
    let mut book = book();
    for Entry { hidden, path } in std::mem::take(&mut book.drafts) {
        // Another thread can still add files to a folder.
        (0..100).take_while(|_| hidden.exists()).for_each(|_| discard(&hidden));
        note(&mut book.discarded, &path);
    }
    say(&left_of(&book));
    std::process::exit(code)
}

/// The remaining outputs: `; kept a.csv; b.csv is as before; c.csv was not written`, or nothing without outputs.
pub fn left() -> String {
    left_of(&book())
}

fn left_of(book: &Book) -> String {
    let list = |paths: &[&PathBuf]| paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let lost = book.discarded.iter().filter(|path| !book.kept.contains(path));
    let (old, none): (Vec<_>, Vec<_>) = lost.partition(|path| path.exists());
    let kept: Vec<_> = book.kept.iter().collect();
    let resumed: Vec<_> = book.resumed.iter().filter(|path| path.exists()).collect();
    let is = |paths: &[&PathBuf]| if paths.len() == 1 { "is" } else { "are" };
    let was = |paths: &[&PathBuf]| if paths.len() == 1 { "was" } else { "were" };
    let parts = [
        (!kept.is_empty()).then(|| format!("kept {}", list(&kept))),
        (!resumed.is_empty()).then(|| format!("the same command continues from {}", list(&resumed))),
        (!old.is_empty()).then(|| format!("{} {} as before", list(&old), is(&old))),
        (!none.is_empty()).then(|| format!("{} {} not written", list(&none), was(&none))),
    ];
    parts.into_iter().flatten().map(|part| format!("; {part}")).collect()
}

fn note(paths: &mut Vec<PathBuf>, path: &Path) {
    if !paths.iter().any(|known| known == path) {
        paths.push(path.into());
    }
}

fn book() -> MutexGuard<'static, Book> {
    BOOK.lock().unwrap_or_else(PoisonError::into_inner)
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
        Error::input(format!("{path}: line {line}: not a row of this version; move the file away to start again"))
    })
}

fn discard(draft: &Path) {
    // The draft may not exist yet.
    let _ = if draft.is_dir() { std::fs::remove_dir_all(draft) } else { std::fs::remove_file(draft) };
}

/// Writes a file atomically: a reader finds either the old contents or all of the new contents.
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

//! The bytes of a saved value: a header, then the content.

use super::{Reader, Writer, hash_of};
use crate::error::{Error, Result, ensure, input};
use crate::panics;

/// The version of the content. It grows with every change of a saved value.
const VERSION: u32 = 9;
/// Size of the header (bytes): the mark, the version, and the hash of the content.
const HEADER: usize = 8 + 4 + 8;

/// A kind of saved value.
pub(crate) struct Format {
    /// The name of a value in messages.
    pub name: &'static str,
    /// Its first bytes.
    pub mark: [u8; 8],
}

impl Format {
    /// The bytes of a value: the header, and the content that `write` writes.
    pub fn seal(&self, write: impl FnOnce(&mut Writer) -> Result<()>) -> Vec<u8> {
        let mut writer = Writer::default();
        writer.bytes.extend_from_slice(&[0; HEADER]);
        let written = write(&mut writer);
        debug_assert!(written.is_ok(), "{written:?}");
        let mut bytes = writer.bytes;
        let hash = hash_of(&bytes[HEADER..]);
        bytes[..8].copy_from_slice(&self.mark);
        bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
        bytes[12..HEADER].copy_from_slice(&hash.to_le_bytes());
        bytes
    }

    /// Reads a value with `read`, after its header. The hash detects damage, but not a deliberate forgery.
    ///
    /// # Errors
    /// The bytes have another mark or version, or are damaged or cut short.
    pub fn open<T>(&self, bytes: &[u8], read: impl FnOnce(&mut Reader) -> Result<T>) -> Result<T> {
        let refused = |why: &dyn std::fmt::Display| -> Error { input!("{} cannot be loaded: {why}", self.name) };
        let (header, content) = bytes.split_first_chunk::<HEADER>().ok_or_else(|| refused(&"cut short"))?;
        ensure(header[..8] == self.mark, || refused(&format_args!("these bytes are not {}", self.name)).to_string())?;
        let number =
            |from: usize, to: usize| header[from..to].iter().rev().fold(0, |sum, &byte| sum << 8 | u64::from(byte));
        let version = number(8, 12);
        let other = || format!("it has version {version}, but this program reads version {VERSION}");
        ensure(version == u64::from(VERSION), || refused(&other()).to_string())?;
        let damaged = || refused(&"it is damaged or cut short: the hash of its content differs").to_string();
        ensure(number(12, HEADER) == hash_of(content), damaged)?;
        let mut reader = Reader::new(content);
        let value = panics::caught(|| read(&mut reader));
        let value =
            value.map_err(|panic| refused(&format_args!("damaged: {}", panic.text)))?.map_err(|e| refused(&e))?;
        ensure(reader.is_at_end(), || refused(&"it has bytes after its end").to_string())?;
        Ok(value)
    }
}

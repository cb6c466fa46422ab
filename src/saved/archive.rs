//! Archives: a walk over a value writes to one or reads from one.

use std::any::Any;
use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::columns::Columns;
use crate::error::{Result, ensure, input};

/// A sequence of bytes that a walk writes or reads.
pub(crate) trait Archive: Sized {
    /// Whether the walk reads.
    const READS: bool;

    /// Writes or reads bytes.
    ///
    /// # Errors
    /// There are not enough bytes.
    fn bytes(&mut self, bytes: &mut [u8]) -> Result<()>;

    /// Writes or reads a number in groups of seven bits.
    fn number(&mut self, number: &mut u64) -> Result<()>;

    /// Writes or reads a count of items. Each item takes at least one bit, so a count above the number of bits is
    /// refused.
    fn count(&mut self, count: usize) -> Result<usize>;

    /// Writes or reads a shared value by `walk`. Values with the same address are written once, and share one address
    /// again after reading.
    fn shared<T: Clone + Send + Sync + 'static>(
        &mut self,
        value: &mut T,
        address: usize,
        walk: fn(&mut T, &mut Self) -> Result<()>,
    ) -> Result<()>;

    /// Writes or reads with `walk`. Content with the same bytes as earlier content takes a byte or two.
    fn repeated(&mut self, walk: impl FnMut(&mut Self) -> Result<()>) -> Result<()>;

    /// Walks `count` items. An item with the same bytes as the one before takes no space.
    fn runs(&mut self, count: usize, walk: impl FnMut(usize, &mut Self) -> Result<()>) -> Result<()>;

    /// Writes or reads `count` items in columns, on all threads, [`CHUNK`] neighbors at a time. Returns the results of
    /// `walk` for each chunk.
    fn chunks<T: Send>(
        &mut self,
        count: usize,
        columns: usize,
        walk: impl Fn(Range<usize>, &mut Columns) -> Result<T> + Sync,
    ) -> Result<Vec<T>>;
}

/// Number of items in one chunk. The bytes are the same for any number of threads.
const CHUNK: usize = 2048;

/// The chunks of `count` items.
fn chunks_of(count: usize) -> impl IndexedParallelIterator<Item = Range<usize>> {
    (0..count.div_ceil(CHUNK)).into_par_iter().map(move |chunk| chunk * CHUNK..((chunk + 1) * CHUNK).min(count))
}

/// An archive that writes.
#[derive(Default)]
pub(crate) struct Writer {
    pub bytes: Vec<u8>,
    /// The shared values that are already written, with their numbers, by address. Each is kept alive, so its address
    /// stays unique.
    shared: HashMap<usize, (u64, Shared)>,
    /// Numbers of byte strings that were already written, the last string, and memory for the next.
    repeated: HashMap<Vec<u8>, u64>,
    last: (Vec<u8>, u64),
    scratch: Vec<u8>,
}

impl Writer {
    /// Starts a writer after another one. It knows the shared values of that one.
    pub fn behind(other: Self) -> Self {
        Self { shared: other.shared, ..Self::default() }
    }
}

impl Archive for Writer {
    const READS: bool = false;

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    fn number(&mut self, number: &mut u64) -> Result<()> {
        let mut rest = *number;
        while rest >= 0x80 {
            self.bytes.push(rest as u8 | 0x80);
            rest >>= 7;
        }
        self.bytes.push(rest as u8);
        Ok(())
    }

    fn count(&mut self, count: usize) -> Result<usize> {
        self.number(&mut (count as u64))?;
        Ok(count)
    }

    fn shared<T: Clone + Send + Sync + 'static>(
        &mut self,
        value: &mut T,
        address: usize,
        walk: fn(&mut T, &mut Self) -> Result<()>,
    ) -> Result<()> {
        let next = self.shared.len() as u64;
        let known = self.shared.entry(address).or_insert_with(|| (next, Box::new(value.clone())));
        let mut number = known.0;
        self.number(&mut number)?;
        if number == next { walk(value, self) } else { Ok(()) }
    }

    /// New bytes are written as 0 and the bytes. Known bytes are written as the number of new strings since then.
    fn repeated(&mut self, mut walk: impl FnMut(&mut Self) -> Result<()>) -> Result<()> {
        self.scratch.clear();
        std::mem::swap(&mut self.bytes, &mut self.scratch);
        let walked = walk(self);
        std::mem::swap(&mut self.bytes, &mut self.scratch);
        walked?;
        let next = self.repeated.len() as u64;
        if next == 0 || self.last.0 != self.scratch {
            self.last.1 = self.repeated.get(&self.scratch).copied().unwrap_or(next);
            self.last.0.clone_from(&self.scratch);
        }
        let mut back = next - self.last.1;
        self.number(&mut back)?;
        if back == 0 {
            self.bytes.extend_from_slice(&self.scratch);
            self.repeated.insert(self.scratch.clone(), next);
        }
        Ok(())
    }

    /// Each run is its length, then its bytes, in the format of [`Self::repeated`].
    fn runs(&mut self, count: usize, mut walk: impl FnMut(usize, &mut Self) -> Result<()>) -> Result<()> {
        let (mut run, mut own, mut next) = (0_u64, Vec::new(), Vec::new());
        for i in 0..=count {
            next.clear();
            if i < count {
                std::mem::swap(&mut self.bytes, &mut next);
                let walked = walk(i, self);
                std::mem::swap(&mut self.bytes, &mut next);
                walked?;
            }
            if run > 0 && (i == count || next != own) {
                self.number(&mut run)?;
                self.repeated(|writer| writer.bytes(&mut own))?;
                run = 0;
            }
            std::mem::swap(&mut own, &mut next);
            run += 1;
        }
        Ok(())
    }

    fn chunks<T: Send>(
        &mut self,
        count: usize,
        columns: usize,
        walk: impl Fn(Range<usize>, &mut Columns) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let write = |range| {
            let mut own = Columns::new(columns, CHUNK);
            let made = walk(range, &mut own)?;
            Ok((made, own.to_bytes()))
        };
        let all = chunks_of(count).map(write).collect::<Result<Vec<_>>>()?;
        let put = |(made, bytes): (T, Vec<u8>)| {
            self.count(bytes.len())?;
            self.bytes.extend_from_slice(&bytes);
            Ok(made)
        };
        all.into_iter().map(put).collect()
    }
}

/// A value that several items share.
type Shared = Box<dyn Any + Send + Sync>;

/// An archive that reads.
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
    /// Total number of bytes.
    length: usize,
    shared: Vec<Shared>,
    repeated: Vec<&'a [u8]>,
}

impl<'a> Reader<'a> {
    /// Reads these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, length: bytes.len(), shared: Vec::new(), repeated: Vec::new() }
    }

    /// Reads these bytes after those of another reader. It knows the shared values of that one.
    pub fn behind(other: Reader, bytes: &'a [u8]) -> Self {
        Self { rest: bytes, length: bytes.len(), shared: other.shared, repeated: Vec::new() }
    }

    /// Whether all bytes are read.
    pub fn is_at_end(&self) -> bool {
        self.rest.is_empty()
    }
}

impl Archive for Reader<'_> {
    const READS: bool = true;

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<()> {
        let (own, rest) = self.rest.split_at_checked(bytes.len()).ok_or_else(cut_short)?;
        bytes.copy_from_slice(own);
        self.rest = rest;
        Ok(())
    }

    fn number(&mut self, number: &mut u64) -> Result<()> {
        *number = 0;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.rest.split_first().ok_or_else(cut_short)?;
            self.rest = rest;
            *number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(());
            }
        }
        Err(input!("a number of more than 64 bits"))
    }

    fn count(&mut self, _: usize) -> Result<usize> {
        let mut count = 0;
        self.number(&mut count)?;
        ensure(count <= 8 * self.length as u64, || format!("{count} things in {} bytes", self.length))?;
        Ok(count as usize)
    }

    fn shared<T: Clone + Send + Sync + 'static>(
        &mut self,
        value: &mut T,
        _: usize,
        walk: fn(&mut T, &mut Self) -> Result<()>,
    ) -> Result<()> {
        let mut number = 0;
        self.number(&mut number)?;
        if number == self.shared.len() as u64 {
            walk(value, self)?;
            self.shared.push(Box::new(value.clone()));
        }
        let known = self.shared.get(number as usize).and_then(|known| known.downcast_ref::<T>());
        value.clone_from(known.ok_or_else(|| input!("shape {number} of {}", self.shared.len()))?);
        Ok(())
    }

    fn repeated(&mut self, mut walk: impl FnMut(&mut Self) -> Result<()>) -> Result<()> {
        let mut back = 0;
        self.number(&mut back)?;
        if back == 0 {
            let from = self.rest;
            walk(self)?;
            self.repeated.push(&from[..from.len() - self.rest.len()]);
            return Ok(());
        }
        let number = (self.repeated.len() as u64).checked_sub(back);
        let own = number.ok_or_else(|| input!("{back} back of {}", self.repeated.len()))?;
        let rest = std::mem::replace(&mut self.rest, self.repeated[own as usize]);
        let walked = walk(self);
        self.rest = rest;
        walked
    }

    fn runs(&mut self, count: usize, mut walk: impl FnMut(usize, &mut Self) -> Result<()>) -> Result<()> {
        let mut first = 0;
        while first < count {
            let mut run = 0;
            self.number(&mut run)?;
            ensure(0 < run && run <= (count - first) as u64, || format!("{run} of {} things", count - first))?;
            let end = first + run as usize;
            self.repeated(|reader| {
                let from = reader.rest;
                walk(first, reader)?;
                let own = &from[..from.len() - reader.rest.len()];
                let rest = reader.rest;
                for i in first + 1..end {
                    reader.rest = own;
                    walk(i, reader)?;
                }
                reader.rest = rest;
                Ok(())
            })?;
            first = end;
        }
        Ok(())
    }

    fn chunks<T: Send>(
        &mut self,
        count: usize,
        columns: usize,
        walk: impl Fn(Range<usize>, &mut Columns) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let mut slice = |_| {
            let mut length = 0;
            self.number(&mut length)?;
            let length = usize::try_from(length).unwrap_or(usize::MAX);
            let (own, rest) = self.rest.split_at_checked(length).ok_or_else(cut_short)?;
            self.rest = rest;
            Ok(own)
        };
        let slices = (0..count.div_ceil(CHUNK)).map(&mut slice).collect::<Result<Vec<_>>>()?;
        let read = |(range, bytes): (Range<usize>, &[u8])| {
            let mut own = Columns::read(columns, bytes)?;
            let made = walk(range, &mut own)?;
            ensure(own.are_at_end(), || "more numbers than things".to_owned())?;
            Ok(made)
        };
        chunks_of(count).zip(slices).map(read).collect()
    }
}

fn cut_short() -> crate::error::Error {
    input!("cut short")
}

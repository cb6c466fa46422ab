//! Where a walk writes to, or reads from.

use std::collections::HashMap;
use std::sync::Arc;

use super::shapes::content;
use crate::error::{Result, ensure, input};
use crate::world::Shape;

/// Bytes that a walk writes, or reads back.
pub(crate) trait Archive: Sized {
    /// Whether the walk reads.
    const READS: bool;

    /// Writes these bytes, or reads them.
    ///
    /// # Errors
    /// There are not so many.
    fn bytes(&mut self, bytes: &mut [u8]) -> Result<()>;

    /// Writes a number in groups of seven bits, or reads one.
    fn number(&mut self, number: &mut u64) -> Result<()>;

    /// Writes the number of things that take a byte or more each, or reads it: no more than bytes are left.
    fn count(&mut self, count: usize) -> Result<usize>;

    /// Writes a shape, or reads it: what was one shape is one again.
    fn shape(&mut self, shape: &mut Shape) -> Result<()>;
}

/// Writes.
#[derive(Default)]
pub(crate) struct Writer {
    pub bytes: Vec<u8>,
    /// The numbers of the shapes that are written, by their addresses.
    shapes: HashMap<usize, u64>,
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

    fn shape(&mut self, shape: &mut Shape) -> Result<()> {
        let next = self.shapes.len() as u64;
        let mut number = *self.shapes.entry(Arc::as_ptr(&shape.0.0).addr()).or_insert(next);
        self.number(&mut number)?;
        if number == next { content(shape, self) } else { Ok(()) }
    }
}

/// Reads.
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
    shapes: Vec<Shape>,
}

impl<'a> Reader<'a> {
    /// Reads these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, shapes: Vec::new() }
    }

    /// Whether all is read.
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
        ensure(count <= self.rest.len() as u64, || format!("{count} things in {} bytes", self.rest.len()))?;
        Ok(count as usize)
    }

    fn shape(&mut self, shape: &mut Shape) -> Result<()> {
        let mut number = 0;
        self.number(&mut number)?;
        if number == self.shapes.len() as u64 {
            content(shape, self)?;
            self.shapes.push(shape.clone());
        }
        let known = self.shapes.get(number as usize);
        *shape = known.ok_or_else(|| input!("shape {number} of {}", self.shapes.len()))?.clone();
        Ok(())
    }
}

fn cut_short() -> crate::error::Error {
    input!("cut short")
}

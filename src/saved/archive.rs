//! Where a walk writes to, or reads from.

use std::any::Any;
use std::collections::HashMap;

use glam::Vec3;

use crate::error::{Result, ensure, input};

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

    /// Writes a value by `walk`, or reads it: values of the same address are written once, and read they share one address again.
    fn shared<T: Clone + Send + Sync + 'static>(
        &mut self,
        value: &mut T,
        address: usize,
        walk: fn(&mut T, &mut Self) -> Result<()>,
    ) -> Result<()>;

    /// Writes or reads what `walk` does. What has the same bytes as before takes a byte or two.
    fn repeated(&mut self, walk: impl FnMut(&mut Self) -> Result<()>) -> Result<()>;

    /// Writes a number that is near a guess, or reads it: the nearer, the fewer bytes.
    fn index(&mut self, value: &mut u32, guess: u32) -> Result<()> {
        let apart = value.wrapping_sub(guess) as i32;
        let mut folded = u64::from((apart << 1 ^ apart >> 31) as u32);
        self.number(&mut folded)?;
        let folded = u32::try_from(folded).map_err(|_| input!("the number {folded} is too large"))?;
        *value = guess.wrapping_add((folded >> 1) ^ 0_u32.wrapping_sub(folded & 1));
        Ok(())
    }

    /// The same by the bits.
    fn near(&mut self, value: &mut f32, guess: f32) -> Result<()> {
        let mut bits = value.to_bits();
        self.index(&mut bits, guess.to_bits())?;
        *value = f32::from_bits(bits);
        Ok(())
    }

    /// The same of all components.
    fn near_vector(&mut self, value: &mut Vec3, guess: Vec3) -> Result<()> {
        (0..3).try_for_each(|k| self.near(&mut value[k], guess[k]))
    }
}

/// Writes.
#[derive(Default)]
pub(crate) struct Writer {
    pub bytes: Vec<u8>,
    /// The shared values that are written, with their numbers, by their addresses: a value that is kept keeps its address.
    shared: HashMap<usize, (u64, Shared)>,
    /// The numbers of bytes that were written once, the last such bytes, and memory for the next.
    repeated: HashMap<Vec<u8>, u64>,
    last: (Vec<u8>, u64),
    scratch: Vec<u8>,
}

impl Writer {
    /// Writes behind bytes of another one, in which shared values stood.
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

    /// New bytes are a 0 and themselves; others are by how many new ones they came before the next.
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
}

/// A value that several things share.
type Shared = Box<dyn Any + Send + Sync>;

/// Reads.
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
    shared: Vec<Shared>,
    repeated: Vec<&'a [u8]>,
}

impl<'a> Reader<'a> {
    /// Reads these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, shared: Vec::new(), repeated: Vec::new() }
    }

    /// Reads these bytes, behind those of another one in which shared values stood.
    pub fn behind(other: Reader, bytes: &'a [u8]) -> Self {
        Self { rest: bytes, shared: other.shared, repeated: Vec::new() }
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
}

fn cut_short() -> crate::error::Error {
    input!("cut short")
}

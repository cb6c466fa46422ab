//! Columns: numbers of one kind are stored together, so that each kind has its own code.

use glam::Quat;

use super::code::{Coded, decode, encode};
use crate::error::{Result, ensure, input};

/// Columns of numbers. They are read in the order in which they were written.
pub(crate) struct Columns {
    all: Vec<Vec<Coded>>,
    /// The next number to read in each column; `None` while writing.
    next: Option<Vec<usize>>,
}

impl Columns {
    /// New columns for writing, each with room for one number per item.
    pub fn new(columns: usize, things: usize) -> Self {
        Self { all: (0..columns).map(|_| Vec::with_capacity(things)).collect(), next: None }
    }

    /// Reads columns from bytes.
    pub fn read(columns: usize, mut bytes: &[u8]) -> Result<Self> {
        let all = (0..columns).map(|_| decode(&mut bytes)).collect::<Result<Vec<_>>>()?;
        ensure(bytes.is_empty(), || "numbers of an unknown kind".to_owned())?;
        Ok(Self { all, next: Some(vec![0; columns]) })
    }

    /// Converts the columns to bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.all.iter().for_each(|column| encode(column, &mut bytes));
        bytes
    }

    /// Whether the columns are for reading.
    pub fn reads(&self) -> bool {
        self.next.is_some()
    }

    /// Whether all numbers are read.
    pub fn are_at_end(&self) -> bool {
        self.next.as_ref().is_none_or(|next| next.iter().zip(&self.all).all(|(next, column)| *next == column.len()))
    }

    /// Writes or reads a number.
    #[inline(always)]
    fn coded(&mut self, column: usize, number: impl FnOnce() -> Coded) -> Result<Coded> {
        let Some(next) = &mut self.next else {
            let number = number();
            self.all[column].push(number);
            return Ok(number);
        };
        let number = self.all[column].get(next[column]).ok_or_else(|| input!("too few numbers of a kind"))?;
        next[column] += 1;
        Ok(*number)
    }

    /// Writes or reads one of few values.
    #[inline]
    pub fn byte(&mut self, column: usize, byte: &mut u8) -> Result<()> {
        *byte = self.coded(column, || Coded::byte(*byte))?.to_byte();
        Ok(())
    }

    /// Writes or reads a number with a guess: the better the guess, the fewer bits.
    #[inline]
    pub fn index(&mut self, column: usize, value: &mut u32, guess: u32) -> Result<()> {
        let folded = |apart: i32| (apart << 1 ^ apart >> 31) as u32;
        let coded = self.coded(column, || Coded::number(folded(value.wrapping_sub(guess) as i32), false))?;
        *value = guess.wrapping_add(unfolded(coded.to_number().0));
        Ok(())
    }

    /// The same for the bits of a float. The sign is separate.
    #[inline]
    pub fn near(&mut self, column: usize, value: &mut f32, guess: f32) -> Result<()> {
        const SIGN: u32 = 1 << 31;
        let guess = guess.to_bits();
        let coded = self.coded(column, || {
            let bits = value.to_bits();
            let apart = ((bits & !SIGN).wrapping_sub(guess & !SIGN)) as i32;
            Coded::number((apart << 1 ^ apart >> 31) as u32, (bits ^ guess) & SIGN != 0)
        })?;
        let (folded, has_other_sign) = coded.to_number();
        let size = (guess & !SIGN).wrapping_add(unfolded(folded)) & !SIGN;
        *value = f32::from_bits(size | (guess ^ u32::from(has_other_sign) << 31) & SIGN);
        Ok(())
    }

    /// Writes or reads a number that has about the size of others of its kind.
    #[inline]
    pub fn float(&mut self, column: usize, value: &mut f32) -> Result<()> {
        *value = self.coded(column, || Coded::float(*value))?.to_float();
        Ok(())
    }

    /// Writes or reads a rotation near another one, in two columns. Its length is known, so its largest component
    /// follows from the others, except for rounding.
    pub fn near_rotation(&mut self, column: usize, rotation: &mut Quat, near: Quat) -> Result<()> {
        let (mut own, near) = (rotation.to_array(), near.to_array());
        let largest = (1..4).fold(0, |best, k| if near[k].abs() > near[best].abs() { k } else { best });
        let mut square = 1.0;
        for k in (0..4).filter(|&k| k != largest) {
            self.near(column, &mut own[k], near[k])?;
            square -= f64::from(own[k]) * f64::from(own[k]);
        }
        self.near(column + 1, &mut own[largest], (square.max(0.0).sqrt() as f32).copysign(near[largest]))?;
        *rotation = Quat::from_array(own);
        Ok(())
    }
}

fn unfolded(folded: u32) -> u32 {
    (folded >> 1) ^ 0_u32.wrapping_sub(folded & 1)
}

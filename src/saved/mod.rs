//! Saves state as bytes, and copies state into reusable memory.
//!
//! One walk over the fields of a value both writes and reads it ([`Saved`]). The walk names every field: a new field
//! does not compile until it is either saved or marked as scratch. Scratch is memory that every step overwrites.

mod archive;
mod code;
mod columns;
mod format;
mod plain;

pub(crate) use archive::{Archive, Reader, Writer};
pub(crate) use columns::Columns;
pub(crate) use format::Format;

use crate::error::Result;

/// State that can be saved as bytes and restored bit for bit.
pub(crate) trait Saved: Sized {
    /// A value to read into.
    fn blank() -> Self;

    /// Writes all fields, or replaces them by fields that it reads.
    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()>;
}

/// Writes or reads the fields of a value, in this order. Scratch fields stay unchanged.
macro_rules! walk {
    ($own:expr, $archive:expr, { $($field:ident),* $(,)? } $(scratch { $($scratch:ident),* $(,)? })?) => {{
        let Self { $($field,)* $($($scratch: _,)*)? } = $own;
        $($crate::saved::Saved::walk($field, $archive)?;)*
        Ok(())
    }};
}
pub(crate) use walk;

/// Implements [`Saved`] by the fields, in this order. Scratch fields stay unchanged.
macro_rules! fields {
    ($type:ty { $($field:ident),* $(,)? } $(scratch { $($scratch:ident),* $(,)? })?) => {
        impl $crate::saved::Saved for $type {
            fn blank() -> Self {
                Self { $($field: $crate::saved::Saved::blank(),)* $($($scratch: Default::default(),)*)? }
            }

            fn walk<A: $crate::saved::Archive>(&mut self, archive: &mut A) -> $crate::error::Result<()> {
                $crate::saved::walk!(self, archive, { $($field),* } $(scratch { $($scratch),* })?)
            }
        }
    };
}
pub(crate) use fields;

/// Implements `Clone` so that `clone_from` reuses memory. Scratch is not copied.
macro_rules! cloned {
    ($type:ty { $($field:ident),* $(,)? } $(scratch { $($scratch:ident),* $(,)? })?) => {
        impl Clone for $type {
            fn clone(&self) -> Self {
                let Self { $($field,)* $($($scratch: _,)*)? } = self;
                Self { $($field: Clone::clone($field),)* $($($scratch: Default::default(),)*)? }
            }

            fn clone_from(&mut self, from: &Self) {
                let Self { $($field,)* $($($scratch: _,)*)? } = from;
                $(Clone::clone_from(&mut self.$field, $field);)*
            }
        }
    };
}
pub(crate) use cloned;

/// Both of the above.
macro_rules! state {
    ($($all:tt)*) => {
        $crate::saved::fields!($($all)*);
        $crate::saved::cloned!($($all)*);
    };
}
pub(crate) use state;

/// Implements [`Saved`] for an enum without fields. A value is saved as its index in this list.
macro_rules! kinds {
    ($type:ident { $first:ident $(, $value:ident)* $(,)? }) => {
        impl $crate::saved::Saved for $type {
            fn blank() -> Self {
                Self::$first
            }

            fn walk<A: $crate::saved::Archive>(&mut self, archive: &mut A) -> $crate::error::Result<()> {
                #[repr(u8)]
                enum Place { $first $(, $value)* }
                let mut place = match self {
                    Self::$first => Place::$first as u8,
                    $(Self::$value => Place::$value as u8,)*
                };
                $crate::saved::Saved::walk(&mut place, archive)?;
                if place == Place::$first as u8 {
                    *self = Self::$first;
                    return Ok(());
                }
                $(if place == Place::$value as u8 {
                    *self = Self::$value;
                    return Ok(());
                })*
                Err($crate::error::input!("unknown {}: number {place}", stringify!($type)))
            }
        }
    };
}
pub(crate) use kinds;

/// A hash of bytes. It works on words of eight bytes, so that it takes less time than writing them.
pub fn hash_of(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let words = words.iter().chain([&last]).map(|word| u64::from_le_bytes(*word));
    words.fold(bytes.len() as u64, |hash, word| (hash.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

//! State as bytes, and copies of state into memory that stands.
//!
//! One walk over the fields of a value writes it and reads it back ([`Saved`]). The walk names every field, so that a field that is added
//! later does not compile until it is saved, or named as scratch: memory that every step uses again.

mod archive;
mod code;
mod columns;
mod plain;

pub(crate) use archive::{Archive, Reader, Writer};
pub(crate) use columns::Columns;

use crate::error::Result;

/// State that goes into bytes and comes back bit by bit.
pub(crate) trait Saved: Sized {
    /// A value to read into.
    fn blank() -> Self;

    /// Writes all fields, or reads them in place of what they are.
    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()>;
}

/// Implements [`Saved`] by the fields, in this order; those named as scratch stay as they are.
macro_rules! fields {
    ($type:ty { $($field:ident),* $(,)? } $(scratch { $($scratch:ident),* $(,)? })?) => {
        impl $crate::saved::Saved for $type {
            fn blank() -> Self {
                Self { $($field: $crate::saved::Saved::blank(),)* $($($scratch: Default::default(),)*)? }
            }

            fn walk<A: $crate::saved::Archive>(&mut self, archive: &mut A) -> $crate::error::Result<()> {
                let Self { $($field,)* $($($scratch: _,)*)? } = self;
                $($crate::saved::Saved::walk($field, archive)?;)*
                Ok(())
            }
        }
    };
}
pub(crate) use fields;

/// Implements `Clone` so that `clone_from` goes on with the memory that stands; scratch is not copied.
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

/// Implements [`Saved`] for a kind without fields, by the places of its values in this list.
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
                Err($crate::error::input!("{} of number {place} is not known", stringify!($type)))
            }
        }
    };
}
pub(crate) use kinds;

/// A hash of bytes: by words of eight, so that it takes less time than writing them.
pub(crate) fn hash_of(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let words = words.iter().chain([&last]).map(|word| u64::from_le_bytes(*word));
    words.fold(bytes.len() as u64, |hash, word| (hash.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

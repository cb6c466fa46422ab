//! Saves numbers, vectors and collections.

use std::collections::{BTreeMap, HashSet};
use std::hash::{BuildHasher, Hash};

use glam::{Quat, Vec3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose;

use super::{Archive, Saved};
use crate::error::{Result, input};

/// Numbers by their bytes, little-endian.
macro_rules! by_bytes {
    ($($type:ty),*) => {
        $(impl Saved for $type {
            fn blank() -> Self {
                Self::default()
            }

            fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
                let mut bytes = self.to_le_bytes();
                archive.bytes(&mut bytes)?;
                *self = Self::from_le_bytes(bytes);
                Ok(())
            }
        })*
    };
}
by_bytes!(u8, f32, f64);

/// Numbers that are usually small.
macro_rules! by_size {
    ($($type:ty),*) => {
        $(impl Saved for $type {
            fn blank() -> Self {
                Self::default()
            }

            fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
                let mut number = *self as u64;
                archive.number(&mut number)?;
                *self = Self::try_from(number).map_err(|_| input!("the number {number} is too large"))?;
                Ok(())
            }
        })*
    };
}
by_size!(u32, u64, usize);

impl Saved for bool {
    fn blank() -> Self {
        false
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let mut byte = u8::from(*self);
        byte.walk(archive)?;
        *self = byte != 0;
        Ok(())
    }
}

impl<T: Saved, const N: usize> Saved for [T; N] {
    fn blank() -> Self {
        std::array::from_fn(|_| T::blank())
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        self.iter_mut().try_for_each(|own| own.walk(archive))
    }
}

impl<T: Saved, U: Saved> Saved for (T, U) {
    fn blank() -> Self {
        (T::blank(), U::blank())
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        self.0.walk(archive)?;
        self.1.walk(archive)
    }
}

impl Saved for Vec3 {
    fn blank() -> Self {
        Self::ZERO
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        self.as_mut().walk(archive)
    }
}

impl Saved for Quat {
    fn blank() -> Self {
        Self::IDENTITY
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let mut all = self.to_array();
        all.walk(archive)?;
        *self = Self::from_array(all);
        Ok(())
    }
}

impl Saved for Pose {
    fn blank() -> Self {
        Self::IDENTITY
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        self.translation.walk(archive)?;
        self.rotation.walk(archive)
    }
}

impl Saved for Aabb {
    fn blank() -> Self {
        Self::new(Vec3::ZERO, Vec3::ZERO)
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        self.mins.walk(archive)?;
        self.maxs.walk(archive)
    }
}

impl<T: Saved> Saved for Option<T> {
    fn blank() -> Self {
        None
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let mut is_some = self.is_some();
        is_some.walk(archive)?;
        if A::READS {
            *self = is_some.then(T::blank);
        }
        self.as_mut().map_or(Ok(()), |own| own.walk(archive))
    }
}

impl<T: Saved> Saved for Vec<T> {
    fn blank() -> Self {
        Self::new()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let count = archive.count(self.len())?;
        if !A::READS {
            return self.iter_mut().try_for_each(|own| own.walk(archive));
        }
        self.clear();
        for _ in 0..count {
            let mut own = T::blank();
            own.walk(archive)?;
            self.push(own);
        }
        Ok(())
    }
}

impl Saved for String {
    fn blank() -> Self {
        Self::new()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let mut bytes = std::mem::take(self).into_bytes();
        bytes.walk(archive)?;
        *self = Self::from_utf8(bytes).map_err(|_| input!("a name is not valid text"))?;
        Ok(())
    }
}

impl<T: Saved + Ord + Hash + Copy, S: BuildHasher + Default> Saved for HashSet<T, S> {
    fn blank() -> Self {
        Self::default()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        let mut all: Vec<T> = self.iter().copied().collect();
        all.sort_unstable();
        all.walk(archive)?;
        if A::READS {
            self.clear();
            self.extend(all);
        }
        Ok(())
    }
}

impl<K: Saved + Ord + Copy, V: Saved> Saved for BTreeMap<K, V> {
    fn blank() -> Self {
        Self::new()
    }

    fn walk<A: Archive>(&mut self, archive: &mut A) -> Result<()> {
        if !A::READS {
            archive.count(self.len())?;
            return self.iter_mut().try_for_each(|(key, value)| {
                let mut key = *key;
                key.walk(archive)?;
                value.walk(archive)
            });
        }
        let mut all: Vec<(K, V)> = Vec::new();
        all.walk(archive)?;
        *self = all.into_iter().collect();
        Ok(())
    }
}

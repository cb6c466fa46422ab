//! The access to elements that the lists of bodies and of joints share.

/// Makes a list usable as a slice. A handle names an element as an index does.
macro_rules! list {
    ($List:ident of $Item:ident, $name:literal by $Handle:ident, $index_of:ident) => {
        impl std::ops::Deref for $List {
            type Target = [$Item];
            fn deref(&self) -> &[$Item] {
                &self.all
            }
        }

        impl<I: std::slice::SliceIndex<[$Item]>> std::ops::Index<I> for $List {
            type Output = I::Output;
            fn index(&self, index: I) -> &I::Output {
                &self.all[index]
            }
        }

        impl std::ops::IndexMut<usize> for $List {
            fn index_mut(&mut self, index: usize) -> &mut $Item {
                &mut self.all[index]
            }
        }

        /// # Panics
        #[doc = concat!("The ", $name, " is gone. [`World::", $name, "`](super::World::", $name, ")")]
        /// returns `None` instead.
        impl std::ops::Index<$Handle> for $List {
            type Output = $Item;
            fn index(&self, handle: $Handle) -> &$Item {
                &self.all[self.$index_of(handle).unwrap_or_else(|| gone(handle))]
            }
        }

        /// # Panics
        #[doc = concat!("The ", $name, " is gone. [`World::", $name, "_mut`](super::World::", $name, "_mut)")]
        /// returns `None` instead.
        impl std::ops::IndexMut<$Handle> for $List {
            fn index_mut(&mut self, handle: $Handle) -> &mut $Item {
                let index = self.$index_of(handle).unwrap_or_else(|| gone(handle));
                &mut self.all[index]
            }
        }

        #[cold]
        fn gone(handle: $Handle) -> ! {
            panic!("{handle:?} names no {} of this world", $name)
        }

        impl<'a> IntoIterator for &'a $List {
            type Item = &'a $Item;
            type IntoIter = std::slice::Iter<'a, $Item>;
            fn into_iter(self) -> Self::IntoIter {
                self.all.iter()
            }
        }

        impl<'a> IntoIterator for &'a mut $List {
            type Item = &'a mut $Item;
            type IntoIter = std::slice::IterMut<'a, $Item>;
            fn into_iter(self) -> Self::IntoIter {
                self.all.iter_mut()
            }
        }
    };
}
pub(super) use list;

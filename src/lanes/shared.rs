//! A slice that several threads write, each its own elements.

#![allow(unsafe_code)]

use std::marker::PhantomData;
use std::ops::Range;

/// A slice with elements that several threads can write through a shared reference.
///
/// Safe Rust has no cheaper way for the threads of one color to write their bodies: locks or atomics for each element
/// cost as much as the sweep itself. Colors guarantee that no element is written twice.
#[derive(Clone, Copy)]
pub struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    borrowed: PhantomData<&'a mut [T]>,
}

// SAFETY: a `Shared` only hands out elements through functions whose callers promise that nobody writes an element
// that another thread uses.
unsafe impl<T: Send> Send for Shared<'_, T> {}
unsafe impl<T: Send> Sync for Shared<'_, T> {}

impl<'a, T: Copy> Shared<'a, T> {
    /// Shares a slice for as long as it is borrowed.
    pub fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), borrowed: PhantomData }
    }

    /// The address of the first element. Access through it has the same safety requirements as the functions below.
    #[inline(always)]
    pub fn as_ptr(&self) -> *mut T {
        self.start
    }

    /// Whether there is no element.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Some elements, mutable in place.
    ///
    /// # Safety
    /// No other thread reads or writes them meanwhile.
    #[inline(always)]
    pub unsafe fn slice(&self, range: Range<usize>) -> &'a mut [T] {
        assert!(range.start <= range.end && range.end <= self.len);
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start), range.len()) }
    }

    /// Writes one element.
    ///
    /// # Safety
    /// No other thread reads or writes it meanwhile.
    #[inline(always)]
    pub unsafe fn write(&self, i: usize, value: T) {
        assert!(i < self.len);
        unsafe { *self.start.add(i) = value }
    }
}

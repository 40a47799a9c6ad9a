//! Arrays that are owned, shared or lent by somebody else, on huge pages where walks read them;
//! stacks; levels; sizes that may fail.

mod levels;
mod pages;
mod prefetch;
mod stack;

pub(crate) use levels::Levels;
pub(crate) use pages::{Pages, Zeroed, zeroed};
pub(crate) use prefetch::prefetch;
pub(crate) use stack::{Room, Stack};

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Deref;

/// A read-only array that is cheap to clone: the bytes belong to whoever made them.
///
/// Made from a `Vec` (no copy), or from anything that can show a slice for as long as it lives
/// (a memory map, a foreign buffer) with [`Array::shared`].
pub struct Array<T: 'static>(Arc<dyn AsRef<[T]> + Send + Sync>);

impl<T: Send + Sync + 'static> Array<T> {
    /// Borrows the slice that `owner` shows, and keeps `owner` alive.
    pub fn shared(owner: Arc<dyn AsRef<[T]> + Send + Sync>) -> Self {
        Self(owner)
    }

    /// Whether both are the same array in memory, not merely equal.
    pub fn same(&self, other: &Self) -> bool {
        core::ptr::eq(self.as_ptr_range().start, other.as_ptr_range().start)
            && self.len() == other.len()
    }
}

impl<T> Clone for Array<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        (*self.0).as_ref()
    }
}

impl<T: Send + Sync + 'static> From<Vec<T>> for Array<T> {
    fn from(items: Vec<T>) -> Self {
        Self(Arc::new(items))
    }
}

impl<T: Clone + Send + Sync + 'static> From<&[T]> for Array<T> {
    fn from(items: &[T]) -> Self {
        items.to_vec().into()
    }
}

impl<T: Send + Sync + 'static, const N: usize> From<[T; N]> for Array<T> {
    fn from(items: [T; N]) -> Self {
        Self(Arc::new(items))
    }
}

impl<T: Send + Sync + 'static> Default for Array<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T: fmt::Debug> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Array[{}]", self.len())
    }
}

/// An allocation whose size follows from the input was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("out of memory: {bytes} bytes for {what}; close other programs or use a smaller scene")]
pub struct OutOfMemory {
    /// How much was asked for.
    pub bytes: u64,
    /// What it was for.
    pub what: &'static str,
}

/// An empty vector with room for `len` items, or an error instead of an abort.
pub(crate) fn try_with_capacity<T>(len: usize, what: &'static str) -> Result<Vec<T>, OutOfMemory> {
    let mut items = Vec::new();
    try_reserve(&mut items, len, what)?;
    Ok(items)
}

/// Room for `more` items, or an error instead of an abort.
pub(crate) fn try_reserve<T>(
    items: &mut Vec<T>,
    more: usize,
    what: &'static str,
) -> Result<(), OutOfMemory> {
    let bytes = (more as u64).saturating_mul(size_of::<T>() as u64);
    items.try_reserve(more).map_err(|_| OutOfMemory { bytes, what })
}

/// `len` copies of `item`, or an error instead of an abort.
pub(crate) fn try_filled<T: Clone>(
    item: T,
    len: usize,
    what: &'static str,
) -> Result<Vec<T>, OutOfMemory> {
    let mut items = try_with_capacity(len, what)?;
    items.resize(len, item);
    Ok(items)
}

//! The bytes an import may still spend, and vectors that grow within it and never abort.

use std::cell::Cell;

use treelet::memory::OutOfMemory;

use crate::error::Fault;
use crate::options::{HARMLESS_BYTES, Limits};

/// What is left of [`Limits`]. Spent bytes do not come back: the limit bounds the work of an import
/// as well as its memory.
///
/// Besides the absolute limit, every byte of a file earns the right to a few hundred bytes of
/// arrays, so that a small file that names the same bytes over and over stays small.
#[derive(Debug)]
pub(crate) struct Budget {
    left: Cell<u64>,
    earned: Cell<u64>,
    ratio: u64,
}

impl Budget {
    pub(crate) fn new(limits: &Limits) -> Self {
        let earned = Cell::new(HARMLESS_BYTES);
        Self { left: Cell::new(limits.max_bytes), earned, ratio: limits.max_ratio }
    }

    /// Bytes of a file, unpacked, that are about to be there.
    pub(crate) fn earn(&self, bytes: u64) {
        let earned = bytes.saturating_mul(self.ratio.saturating_add(1));
        self.earned.set(self.earned.get().saturating_add(earned));
    }

    /// Bytes that may still be spent.
    pub(crate) fn left(&self) -> u64 {
        self.left.get()
    }

    /// Takes `bytes` off, or says what they were wanted for.
    pub(crate) fn spend(&self, bytes: u64, what: &'static str) -> Result<(), Fault> {
        let limit = self.left.get();
        let Some(left) = limit.checked_sub(bytes) else {
            return Err(Fault::TooBig { what, needed: bytes, limit });
        };
        let Some(earned) = self.earned.get().checked_sub(bytes) else {
            return Err(Fault::Repeats { what, ratio: self.ratio });
        };
        self.left.set(left);
        self.earned.set(earned);
        Ok(())
    }

    /// An empty vector with room for `len` items.
    pub(crate) fn vec<T>(&self, len: usize, what: &'static str) -> Result<Vec<T>, Fault> {
        let mut items = Vec::new();
        self.reserve(&mut items, len, what)?;
        Ok(items)
    }

    /// `len` copies of `item`.
    pub(crate) fn filled<T: Clone>(
        &self,
        item: T,
        len: usize,
        what: &'static str,
    ) -> Result<Vec<T>, Fault> {
        let mut items = self.vec(len, what)?;
        items.resize(len, item);
        Ok(items)
    }

    /// Appends `item`.
    #[inline(always)]
    pub(crate) fn push<T>(
        &self,
        items: &mut Vec<T>,
        item: T,
        what: &'static str,
    ) -> Result<(), Fault> {
        if items.len() == items.capacity() {
            self.reserve(items, items.len().max(FIRST_ROOM), what)?;
        }
        items.push(item);
        Ok(())
    }

    /// Makes room for `extra` more items, to the item. What the vector grows by is spent; room that
    /// it has was paid for.
    #[cold]
    pub(crate) fn reserve<T>(
        &self,
        items: &mut Vec<T>,
        extra: usize,
        what: &'static str,
    ) -> Result<(), Fault> {
        let room = items.capacity() - items.len();
        let bytes = (extra.saturating_sub(room) as u64).saturating_mul(size_of::<T>() as u64);
        self.spend(bytes, what)?;
        items.try_reserve_exact(extra).map_err(|_| OutOfMemory { bytes, what })?;
        Ok(())
    }
}

/// The room that a growing vector starts with.
const FIRST_ROOM: usize = 16;

#[cfg(test)]
mod tests {
    use super::Budget;
    use crate::options::Limits;

    #[test]
    fn what_is_spent_is_the_capacity() {
        let limits = Limits::default();
        let budget = Budget::new(&limits);
        let mut items: Vec<u32> =
            budget.vec(100, "items").unwrap_or_else(|fault| panic!("{fault}"));
        items.push(0);
        for extra in [10, 150, 151, 400] {
            let grown = budget.reserve(&mut items, extra, "items");
            assert!(grown.is_ok() && items.capacity() > extra);
            assert_eq!(limits.max_bytes - budget.left(), 4 * items.capacity() as u64);
        }
    }
}

//! A stack whose first entries live on the machine's stack, not written before they are needed: to
//! clear them for every ray would cost more than many rays do.

#![allow(unsafe_code, reason = "part of the wall: entries that are not initialised yet")]

use alloc::vec::Vec;
use core::mem::MaybeUninit;

/// Last in, first out. Never full: when the near part is, its older half moves to the heap.
pub(crate) struct Stack<T, const N: usize> {
    /// The newest entries; the first `len` are initialised.
    near: [MaybeUninit<T>; N],
    len: usize,
    /// The oldest entries.
    far: Vec<T>,
}

impl<T: Copy, const N: usize> Stack<T, N> {
    /// An empty stack.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        const { assert!(N >= 2) }
        Self { near: [const { MaybeUninit::uninit() }; N], len: 0, far: Vec::new() }
    }

    /// Puts `item` on top.
    #[inline(always)]
    pub(crate) fn push(&mut self, item: T) {
        if self.len >= N {
            self.spill(N / 2);
        }
        self.near[self.len] = MaybeUninit::new(item);
        self.len += 1;
    }

    /// Puts the first `count` of `items` on top, the last of them uppermost. All are copied, which
    /// is one store where `count` of them would be a loop.
    #[inline(always)]
    pub(crate) fn push_first<const W: usize>(&mut self, items: [T; W], count: usize) {
        const { assert!(2 * W <= N) }
        debug_assert!(count <= W);
        if self.len > N - W {
            self.spill(N / 2);
        }
        // SAFETY: `len <= N - W`, now if not before (`spill` leaves at most half, and 2 W <= N), so
        // `W` entries from `len` on are inside `near`; any bits may be written there.
        unsafe { self.near.as_mut_ptr().add(self.len).cast::<[T; W]>().write_unaligned(items) };
        self.len += if count < W { count } else { W };
    }

    /// Takes what is on top.
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        if self.len == 0 {
            return self.far.pop();
        }
        self.len -= 1;
        let item = self.near.get(self.len)?;
        // SAFETY: entries below the old `len` are initialised.
        Some(unsafe { item.assume_init() })
    }

    /// Moves all but the newest `keep` entries to the heap.
    #[cold]
    #[inline(never)]
    fn spill(&mut self, keep: usize) {
        let old = self.len.saturating_sub(keep);
        for item in &self.near[..old] {
            // SAFETY: `old <= len`, and entries below `len` are initialised.
            self.far.push(unsafe { item.assume_init() });
        }
        self.near.copy_within(old..self.len, 0);
        self.len -= old;
    }
}

#[cfg(test)]
mod tests {
    use super::Stack;
    use alloc::vec::Vec;

    #[test]
    fn last_in_first_out_beyond_the_near_part() {
        let mut stack = Stack::<u32, 8>::new();
        let mut model = Vec::new();
        let mut state = 1_u32;
        for round in 0..10_000_u32 {
            state = state.wrapping_mul(0x0019_660D).wrapping_add(0x3C6E_F35F);
            // Grow for a while, shrink for a while, so that both parts fill and empty.
            let growing = (round / 100) % 2 == 0;
            match (state >> 16) % 4 {
                0 => {
                    stack.push(round);
                    model.push(round);
                }
                1 if growing => {
                    let count = (state >> 20) as usize % 5;
                    stack.push_first([round, round + 1, round + 2, round + 3], count);
                    model.extend((round..).take(count));
                }
                _ if growing => {}
                _ => assert_eq!(stack.pop(), model.pop(), "round {round}"),
            }
        }
        while let Some(item) = model.pop() {
            assert_eq!(stack.pop(), Some(item));
        }
        assert_eq!(stack.pop(), None);
    }
}

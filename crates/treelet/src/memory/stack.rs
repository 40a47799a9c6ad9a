//! A stack whose first entries live on the machine's stack, not written before they are needed: to
//! clear them for every ray would cost more than many rays do.

#![allow(unsafe_code, reason = "part of the wall: entries that are not initialised yet")]

use alloc::vec::Vec;
use core::mem::MaybeUninit;

/// Where a stack keeps its entries.
pub(crate) struct Room<T, const N: usize> {
    /// The newest entries.
    near: [MaybeUninit<T>; N],
    /// The oldest entries.
    far: Vec<T>,
}

impl<T, const N: usize> Room<T, N> {
    /// For an empty stack.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { near: [const { MaybeUninit::uninit() }; N], far: Vec::new() }
    }
}

/// Last in, first out. Never full: when the near part is, its older half moves to the heap.
///
/// The entries are borrowed, not owned, so that the number of them can stay in a register although
/// the room is known to functions that are not inlined.
pub(crate) struct Stack<'a, T, const N: usize> {
    room: &'a mut Room<T, N>,
    /// The first `len` near entries are initialised.
    len: usize,
}

impl<'a, T: Copy, const N: usize> Stack<'a, T, N> {
    /// An empty stack.
    #[inline(always)]
    pub(crate) fn new(room: &'a mut Room<T, N>) -> Self {
        const { assert!(N >= 2) }
        Self { room, len: 0 }
    }

    /// Whether there may be no room for `W` more near entries.
    #[inline(always)]
    pub(crate) fn is_tight<const W: usize>(&self) -> bool {
        const { assert!(2 * W <= N) }
        self.len > N - W
    }

    /// Puts `item` on top. For loops that must stay free of calls: where `is_tight` was not asked
    /// before, and says yes, the entry is lost.
    #[inline(always)]
    pub(crate) fn push_near(&mut self, item: T) {
        debug_assert!(self.len < N);
        if let Some(place) = self.room.near.get_mut(self.len) {
            *place = MaybeUninit::new(item);
            self.len += 1;
        }
    }

    /// Puts the first `count` of `items` on top, the last of them uppermost; as `push_near`, for
    /// `W` entries. All are copied, which is one store where `count` of them would be a loop.
    #[inline(always)]
    pub(crate) fn push_first<const W: usize>(&mut self, items: [T; W], count: usize) {
        debug_assert!(!self.is_tight::<W>() && count <= W);
        if self.is_tight::<W>() {
            return;
        }
        // SAFETY: `len <= N - W`, so `W` entries from `len` on are inside `near`; any bits may be
        // written there.
        unsafe {
            self.room.near.as_mut_ptr().add(self.len).cast::<[T; W]>().write_unaligned(items);
        }
        self.len += if count < W { count } else { W };
    }

    /// Puts `item` on top.
    #[inline(always)]
    pub(crate) fn push(&mut self, item: T) {
        self.make_room::<1>();
        self.push_near(item);
    }

    /// Sees to it that the stack is not tight.
    #[inline(always)]
    pub(crate) fn make_room<const W: usize>(&mut self) {
        if self.is_tight::<W>() {
            self.len = spill(self.room, self.len);
        }
    }

    /// Takes what is on top of the near entries.
    #[inline(always)]
    pub(crate) fn pop_near(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: entries below the old `len` are initialised, and `len <= N`.
        Some(unsafe { self.room.near.get_unchecked(self.len).assume_init() })
    }

    /// Takes what is on top.
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        match self.pop_near() {
            None => self.room.far.pop(),
            item => item,
        }
    }
}

/// Moves the older half of `len` near entries to the heap; returns how many stay.
#[cold]
#[inline(never)]
fn spill<T: Copy, const N: usize>(room: &mut Room<T, N>, len: usize) -> usize {
    let old = len - len / 2;
    for item in &room.near[..old] {
        // SAFETY: only `Stack` calls this, and its first `len` entries are initialised.
        room.far.push(unsafe { item.assume_init() });
    }
    room.near.copy_within(old..len, 0);
    len - old
}

#[cfg(test)]
mod tests {
    use super::{Room, Stack};
    use alloc::vec::Vec;

    #[test]
    fn last_in_first_out_beyond_the_near_part() {
        let mut room = Room::<u32, 8>::new();
        let mut stack = Stack::new(&mut room);
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
                    stack.make_room::<4>();
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

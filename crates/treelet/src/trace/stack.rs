//! A stack whose first entries live on the machine's stack: rarely more are needed, and never is
//! there too little room.

use alloc::vec::Vec;

pub(super) struct Stack<T, const N: usize> {
    near: [T; N],
    len: usize,
    /// Entries beyond the first `N`.
    far: Vec<T>,
}

impl<T: Copy, const N: usize> Stack<T, N> {
    /// An empty stack; `filler` fills the unused room.
    #[inline(always)]
    pub(super) fn new(filler: T) -> Self {
        Self { near: [filler; N], len: 0, far: Vec::new() }
    }

    #[inline(always)]
    pub(super) fn push(&mut self, item: T) {
        match self.near.get_mut(self.len) {
            Some(place) => *place = item,
            None => self.far.push(item),
        }
        self.len += 1;
    }

    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        match self.near.get(self.len) {
            Some(&item) => Some(item),
            None => self.far.pop(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Stack;

    #[test]
    fn last_in_first_out_beyond_the_near_part() {
        let mut stack = Stack::<u32, 3>::new(0);
        for round in 0..3 {
            (0..10).for_each(|i| stack.push(i + round));
            (0..10).rev().for_each(|i| assert_eq!(stack.pop(), Some(i + round)));
            assert_eq!(stack.pop(), None);
        }
    }
}

//! Values by depth: the first ones live on the machine's stack, not written before they are needed; those
//! of deeper levels on the heap.

#![allow(unsafe_code, reason = "part of the wall: entries that are not initialised yet")]

use alloc::vec::Vec;
use core::mem::MaybeUninit;

/// A value for each depth from 0 on. What was set stays there to be read until it is set again, also
/// when somebody has meanwhile gone up and down.
pub(crate) struct Levels<T, const N: usize> {
    near: [MaybeUninit<T>; N],
    /// The first so many near ones are initialised.
    known: usize,
    far: Vec<T>,
}

impl<T: Copy, const N: usize> Levels<T, N> {
    /// A value at depth 0 only.
    #[inline(always)]
    pub(crate) fn new(outermost: T) -> Self {
        const { assert!(N > 0) }
        let mut near = [const { MaybeUninit::uninit() }; N];
        near[0].write(outermost);
        Self { near, known: 1, far: Vec::new() }
    }

    /// What is there.
    #[inline(always)]
    pub(crate) fn get(&self, depth: usize) -> Option<&T> {
        if depth < N {
            // SAFETY: those below `known` are initialised.
            (depth < self.known).then(|| unsafe { self.near[depth].assume_init_ref() })
        } else {
            self.far.get(depth - N)
        }
    }

    /// What is there and at the next depth, to be changed where they are: to make a value elsewhere and copy
    /// it is to wait until it has been written. If nothing is at the next depth yet, `blank` comes there.
    #[inline(always)]
    pub(crate) fn pair(
        &mut self,
        depth: usize,
        blank: impl FnOnce(&T) -> T,
    ) -> Option<(&mut T, &mut T)> {
        if depth + 1 >= N {
            return self.far_pair(depth, blank);
        }
        let [first, second, ..] = self.near.get_mut(depth..)? else { return None };
        if depth >= self.known {
            return None;
        }
        // SAFETY: those below `known` are initialised.
        let first = unsafe { first.assume_init_mut() };
        if depth + 1 == self.known {
            second.write(blank(first));
            self.known += 1;
        }
        // SAFETY: as above.
        Some((first, unsafe { second.assume_init_mut() }))
    }

    /// The same where the second one at least is on the heap.
    #[cold]
    #[inline(never)]
    fn far_pair(&mut self, depth: usize, blank: impl FnOnce(&T) -> T) -> Option<(&mut T, &mut T)> {
        let at = depth + 1 - N;
        if at == self.far.len() {
            let blank = blank(self.get(depth)?);
            self.far.push(blank);
        }
        let (before, second) = self.far.split_at_mut_checked(at)?;
        let first = match before.last_mut() {
            // SAFETY: as above.
            None => (depth < self.known).then(|| unsafe { self.near[depth].assume_init_mut() })?,
            Some(first) => first,
        };
        Some((first, second.first_mut()?))
    }
}

#[cfg(test)]
mod tests {
    use super::Levels;

    #[test]
    fn each_depth_keeps_what_was_set_last() {
        let mut levels = Levels::<u32, 2>::new(1);
        assert_eq!((levels.get(0), levels.get(1), levels.get(2)), (Some(&1), None, None));
        assert_eq!(levels.pair(1, |_| 7), None);
        for depth in [0, 1, 2, 3] {
            let (at, next) = levels.pair(depth, |at| 10 * at).unwrap();
            assert_eq!(*next, 10 * *at);
        }
        // What is there stays.
        for depth in [2, 0, 3, 1] {
            let (at, next) = levels.pair(depth, |_| 0).unwrap();
            *at += 1;
            *next += 2;
        }
        let all: [_; 6] = core::array::from_fn(|depth| levels.get(depth).copied());
        assert_eq!(all, [Some(2), Some(13), Some(103), Some(1003), Some(10_002), None]);
        assert_eq!(levels.pair(5, |_| 7), None);
    }
}

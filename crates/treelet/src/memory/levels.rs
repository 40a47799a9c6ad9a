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
    /// Nothing at any depth.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { near: [const { MaybeUninit::uninit() }; N], known: 0, far: Vec::new() }
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

    /// What is there, to be changed.
    #[inline(always)]
    pub(crate) fn get_mut(&mut self, depth: usize) -> Option<&mut T> {
        if depth < N {
            // SAFETY: as above.
            (depth < self.known).then(|| unsafe { self.near[depth].assume_init_mut() })
        } else {
            self.far.get_mut(depth - N)
        }
    }

    /// Puts a value at a depth that has one, or at the first that has none.
    #[inline(always)]
    pub(crate) fn set(&mut self, depth: usize, item: T) {
        debug_assert!(depth <= self.known + self.far.len());
        if depth < N {
            self.near[depth].write(item);
            self.known = if self.known > depth { self.known } else { depth + 1 };
        } else {
            set_far(&mut self.far, depth - N, item);
        }
    }
}

/// The same among the deeper ones.
#[cold]
#[inline(never)]
fn set_far<T>(far: &mut Vec<T>, at: usize, item: T) {
    match far.get_mut(at) {
        Some(place) => *place = item,
        None => far.push(item),
    }
}

#[cfg(test)]
mod tests {
    use super::Levels;

    #[test]
    fn each_depth_keeps_what_was_set_last() {
        let mut levels = Levels::<u32, 2>::new();
        assert_eq!((levels.get(0), levels.get(2)), (None, None));
        for depth in [0, 1, 2, 3, 4] {
            levels.set(depth, 10 * depth as u32);
        }
        levels.set(1, 11);
        levels.set(3, 31);
        let all: [_; 6] = core::array::from_fn(|depth| levels.get(depth).copied());
        assert_eq!(all, [Some(0), Some(11), Some(20), Some(31), Some(40), None]);
        *levels.get_mut(1).unwrap() += 1;
        *levels.get_mut(4).unwrap() += 1;
        assert_eq!((levels.get(1), levels.get(4)), (Some(&12), Some(&41)));
    }
}

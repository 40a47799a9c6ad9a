//! Arrays that walks read at random: cache-line aligned, zeroed, and, when large, on huge pages.
//!
//! A walk through a large tree touches a new page at almost every step. With 4 KiB pages the
//! translation of addresses misses its cache as often as the data does; 2 MiB pages are worth up to
//! twice the speed per node visit on trees of hundreds of megabytes. The kernel is asked
//! (`madvise(MADV_HUGEPAGE)`), never forced; where it declines, all still works.
//!
//! Fresh mappings are zero without being written, so each page is first touched by the thread that
//! fills it.

#![allow(unsafe_code, reason = "part of the wall: allocation with alignment, and memory maps")]

use super::OutOfMemory;
use alloc::alloc::{Layout, alloc_zeroed, dealloc};
use core::ops::{Deref, DerefMut};
use core::ptr::NonNull;

/// Cache lines, and the widest vector register.
const ALIGN_MIN: usize = 64;
/// A huge page of x86-64 and of most AArch64 systems.
#[cfg(any(test, all(unix, feature = "std")))]
const HUGE: usize = 2 << 20;

/// Whole huge pages are taken if no more than this is left over; otherwise the end lies on small pages.
#[cfg(all(unix, feature = "std"))]
const WASTE: usize = HUGE / 4;
/// No system has larger small pages.
#[cfg(all(unix, feature = "std"))]
const SMALL: usize = 64 << 10;

/// Types for which all bits zero is a value, and which need no `Drop`.
///
/// # Safety
///
/// Every bit pattern that is zero throughout is a valid value of the type, and dropping one does nothing.
pub(crate) unsafe trait Zeroed: Send + Sync {}

// SAFETY: if zero is an item, as many zeroes are that many items.
unsafe impl<T: Zeroed, const N: usize> Zeroed for [T; N] {}

/// Makes a type [`Zeroed`] whose fields, all of them to be listed, are. Checked: that the listed ones
/// are `Zeroed`. `zeroed! { Type<N> [const N: usize]: FieldOne, FieldTwo }`
macro_rules! zeroed {
    ($type:ty [$($generics:tt)*]: $($field:ty),+) => {
        #[allow(unsafe_code, reason = "written in `memory`, for a type that it must not know")]
        // SAFETY: zero is a value of every field, which the bound asks for.
        unsafe impl<$($generics)*> $crate::memory::Zeroed for $type
        where
            $($field: $crate::memory::Zeroed),+
        {
        }
    };
}
pub(crate) use zeroed;

// SAFETY: zero is a number of each of them.
unsafe impl Zeroed for u8 {}
// SAFETY: as above.
unsafe impl Zeroed for u16 {}
// SAFETY: as above.
unsafe impl Zeroed for u32 {}
// SAFETY: as above.
unsafe impl Zeroed for f32 {}
// SAFETY: as above.
unsafe impl Zeroed for core::sync::atomic::AtomicU64 {}

/// A fixed number of `T`, aligned to cache lines at least.
pub(crate) struct Pages<T> {
    start: NonNull<T>,
    len: usize,
    source: Source,
}

/// Who gets the bytes back.
#[derive(Clone, Copy)]
enum Source {
    Nobody,
    Heap(Layout),
    #[cfg(all(unix, feature = "std"))]
    Map {
        bytes: usize,
    },
}

// SAFETY: `Pages` owns its items, as a `Vec` does.
unsafe impl<T: Send> Send for Pages<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for Pages<T> {}

impl<T> Default for Pages<T> {
    /// Nothing.
    fn default() -> Self {
        Self { start: NonNull::dangling(), len: 0, source: Source::Nobody }
    }
}

impl<T: Zeroed> Pages<T> {
    /// `len` zeroes.
    pub(crate) fn zeroed(len: usize, what: &'static str) -> Result<Self, OutOfMemory> {
        if len == 0 || size_of::<T>() == 0 {
            return Ok(Self { start: NonNull::dangling(), len, source: Source::Nobody });
        }
        let refused =
            || OutOfMemory { bytes: (len as u64).saturating_mul(size_of::<T>() as u64), what };
        let layout = Layout::array::<T>(len).map_err(|_| refused())?;
        let layout = layout.align_to(ALIGN_MIN).map_err(|_| refused())?;
        let (start, source) = obtain(layout).ok_or_else(refused)?;
        Ok(Self { start: start.cast(), len, source })
    }
}

/// Zeroed bytes for the layout: a mapping of its own on huge pages if that is worth it.
///
/// For a tree of 50,000 instances (1.9 MB) 480 small pages were a third of the time that it took to move one.
fn obtain(layout: Layout) -> Option<(NonNull<u8>, Source)> {
    #[cfg(all(unix, feature = "std"))]
    if layout.size() >= HUGE - WASTE {
        return map(layout.size());
    }
    // SAFETY: the caller's layout is not of zero size.
    let start = NonNull::new(unsafe { alloc_zeroed(layout) })?;
    Some((start, Source::Heap(layout)))
}

/// A private mapping that begins at a huge page.
#[cfg(all(unix, feature = "std"))]
fn map(size: usize) -> Option<(NonNull<u8>, Source)> {
    let whole = size.checked_next_multiple_of(HUGE)?;
    let bytes = if whole - size <= WASTE { whole } else { size.next_multiple_of(SMALL) };
    let wide = bytes.checked_add(HUGE)?;
    let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS;
    let protection = libc::PROT_READ | libc::PROT_WRITE;
    // SAFETY: an anonymous private mapping at an address of the kernel's choice.
    let found = unsafe { libc::mmap(core::ptr::null_mut(), wide, protection, flags, -1, 0) };
    if found == libc::MAP_FAILED {
        return None;
    }
    // Give back what lies before the first huge page and after the last one.
    let found: *mut u8 = found.cast();
    let before = found.align_offset(HUGE).min(HUGE);
    // SAFETY: `before <= HUGE`, so all three pieces lie in the mapping, which has `bytes + HUGE`
    // bytes; pieces of length 0 are not unmapped.
    let start = unsafe {
        let start = found.add(before);
        if before > 0 {
            libc::munmap(found.cast(), before);
        }
        if before < HUGE {
            libc::munmap(start.add(bytes).cast(), HUGE - before);
        }
        #[cfg(any(target_os = "linux", target_os = "android"))]
        libc::madvise(start.cast(), bytes, libc::MADV_HUGEPAGE);
        start
    };
    Some((NonNull::new(start)?, Source::Map { bytes }))
}

/// Asks for huge pages where so much room has not been touched yet that they save most of the faults: the system clears
/// the pages of a large array in a third of the time that it takes with small ones.
pub(super) fn prefer_huge<T>(room: &mut [core::mem::MaybeUninit<T>]) {
    #[cfg(all(any(target_os = "linux", target_os = "android"), feature = "std"))]
    {
        let bytes = size_of_val(room);
        let start: *mut u8 = room.as_mut_ptr().cast();
        let before = start.align_offset(HUGE);
        if bytes < 2 * HUGE || before > bytes - HUGE {
            return;
        }
        let whole = (bytes - before) / HUGE * HUGE;
        // SAFETY: `before + whole <= bytes`, so these are pages of `room` alone; the advice changes no byte.
        unsafe {
            libc::madvise(start.add(before).cast(), whole, libc::MADV_HUGEPAGE);
        }
    }
    #[cfg(not(all(any(target_os = "linux", target_os = "android"), feature = "std")))]
    let _ = room;
}

impl<T> Drop for Pages<T> {
    fn drop(&mut self) {
        match self.source {
            Source::Nobody => {}
            // SAFETY: `start` came from `alloc_zeroed` with this layout.
            Source::Heap(layout) => unsafe { dealloc(self.start.as_ptr().cast(), layout) },
            #[cfg(all(unix, feature = "std"))]
            // SAFETY: `start` begins a mapping of `bytes` bytes that nobody else knows.
            Source::Map { bytes } => unsafe {
                libc::munmap(self.start.as_ptr().cast(), bytes);
            },
        }
    }
}

impl<T> Deref for Pages<T> {
    type Target = [T];
    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: `len` items from `start` on are ours and were valid from the beginning (`Zeroed`).
        unsafe { core::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Pages<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: as above, and `self` is borrowed mutably.
        unsafe { core::slice::from_raw_parts_mut(self.start.as_ptr(), self.len) }
    }
}

impl<T> core::fmt::Debug for Pages<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Pages[{}]", self.len)
    }
}

#[cfg(test)]
mod tests {
    use super::{HUGE, Pages};

    #[test]
    fn zeroed_aligned_writable_of_any_size() {
        for len in [0, 1, 1000, HUGE / 4 + 1, HUGE, 3 * HUGE + 5] {
            let mut pages = Pages::<u32>::zeroed(len, "a test").unwrap();
            assert_eq!(pages.len(), len);
            assert!(pages.iter().all(|&item| item == 0));
            if len > 0 {
                assert_eq!(pages.as_ptr().align_offset(64), 0);
                pages[len - 1] = 7;
                assert_eq!(pages[len - 1], 7);
            }
            if len * 4 >= 2 * HUGE && cfg!(all(unix, feature = "std")) {
                assert_eq!(pages.as_ptr().align_offset(HUGE), 0);
            }
        }
    }

    #[test]
    fn sizes_beyond_memory_are_errors() {
        let addressable = 1_usize.checked_shl(52).unwrap_or(usize::MAX / 2);
        for len in [usize::MAX, usize::MAX / 4, addressable] {
            let error = Pages::<u32>::zeroed(len, "a test").unwrap_err();
            assert!(error.bytes >= len as u64);
        }
    }
}

//! What waits on a walk's stack, and in which order a node's children get there.

use crate::layout::wide::Child;
use crate::memory::Stack;
use crate::simd::{Floats, Simd, Wide};

/// Entries of the stack that need no allocation: several a level of a well-shaped tree.
pub(super) const STACK_NEAR: usize = 128;

/// A child to be visited later.
pub(crate) trait Pending: Copy {
    /// The child, and the bits of the distance at which the ray enters its box.
    fn new(child: Child, entry: u32) -> Self;
    /// What to visit.
    fn child(self) -> Child;
    /// Whether nothing in it can be at `t_max` or nearer.
    fn is_beyond(self, t_max: f32) -> bool;
}

/// For walks that stop at any hit: the child alone.
impl Pending for Child {
    #[inline(always)]
    fn new(child: Child, _: u32) -> Self {
        child
    }

    #[inline(always)]
    fn child(self) -> Child {
        self
    }

    #[inline(always)]
    fn is_beyond(self, _: f32) -> bool {
        false
    }
}

/// The child below the distance: sorted by distance as integers are. (Negative distances, which need
/// a negative `t_min`, sort wrongly among each other: that costs time, never answers.)
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ByEntry(u64);

impl Pending for ByEntry {
    #[inline(always)]
    fn new(child: Child, entry: u32) -> Self {
        Self(u64::from(entry) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }

    #[inline(always)]
    fn is_beyond(self, t_max: f32) -> bool {
        f32::from_bits((self.0 >> 32) as u32) > t_max
    }
}
/// How a node's children that are met go on the stack.
pub(crate) trait Order: Pending {
    /// Stacks all but one of the children of the mask, which has some; returns that one, to go on
    /// with.
    fn spread<S: Wide<W>, const W: usize>(
        simd: S,
        children: &[Child; W],
        mask: u32,
        entry: S::F,
        stack: &mut Stack<'_, Self, STACK_NEAR>,
    ) -> Child;
}

impl Order for ByEntry {
    /// The nearest is visited first, the farthest last.
    #[inline(always)]
    fn spread<S: Wide<W>, const W: usize>(
        simd: S,
        children: &[Child; W],
        mask: u32,
        entry: S::F,
        stack: &mut Stack<'_, Self, STACK_NEAR>,
    ) -> Child {
        // Most nodes have one child that is met: no sorting, no distances.
        if mask & (mask - 1) == 0 {
            return children[mask.trailing_zeros() as usize % W];
        }
        let mut met = Met::<W>::new(simd, children, mask, entry.lanes());
        let (mut nearest, farther) = ordered(met.next(), met.next());
        let count = mask.count_ones() as usize;
        if count == 2 {
            stack.push_near(farther);
            return nearest.child();
        }
        if count == 3 {
            let (near, far) = ordered(nearest, met.next());
            let (far, farthest) = ordered(farther, far);
            stack.push_near(farthest);
            stack.push_near(far);
            return near.child();
        }
        // Rarely more: insertion, the farthest first.
        let mut sorted = [farther; W];
        for i in 2..count {
            let (near, far) = ordered(nearest, met.next());
            nearest = near;
            let mut at = i - 1;
            while at > 0 && sorted[(at - 1) % W] < far {
                sorted[at % W] = sorted[(at - 1) % W];
                at -= 1;
            }
            sorted[at % W] = far;
        }
        stack.push_first(sorted, count - 1);
        nearest.child()
    }
}

impl Order for Child {
    /// In the node's order, its last child uppermost: the likeliest to stop the ray for what it costs.
    #[inline(always)]
    fn spread<S: Wide<W>, const W: usize>(
        simd: S,
        children: &[Child; W],
        mask: u32,
        _: S::F,
        stack: &mut Stack<'_, Self, STACK_NEAR>,
    ) -> Child {
        let last = (u32::BITS - 1 - mask.leading_zeros()) as usize;
        let mut rest = mask & !(1 << last);
        if S::COMPRESSES {
            let packed = simd.compress(rest, &words(children));
            stack.push_first(packed.map(Child), rest.count_ones() as usize);
        } else {
            while rest != 0 {
                stack.push_near(children[rest.trailing_zeros() as usize % W]);
                rest &= rest - 1;
            }
        }
        children[last % W]
    }
}

/// The children of a mask, one after the other, with where the ray enters them.
struct Met<const W: usize> {
    children: [u32; W],
    entries: [u32; W],
    /// Where the instruction set moves them together, a counter; else the bits that are left.
    left: u32,
    packed: bool,
}

impl<const W: usize> Met<W> {
    #[inline(always)]
    fn new<S: Simd>(simd: S, children: &[Child; W], mask: u32, entries: [f32; W]) -> Self {
        let (children, entries) = (words(children), bits(entries));
        if S::COMPRESSES {
            let (children, entries) =
                (simd.compress(mask, &children), simd.compress(mask, &entries));
            return Self { children, entries, left: 0, packed: true };
        }
        Self { children, entries, left: mask, packed: false }
    }

    /// The next of them, of which there is one.
    #[inline(always)]
    fn next(&mut self) -> ByEntry {
        let at = if self.packed { self.left } else { self.left.trailing_zeros() } as usize % W;
        self.left = if self.packed { self.left + 1 } else { self.left & self.left.wrapping_sub(1) };
        ByEntry::new(Child(self.children[at]), self.entries[at])
    }
}

/// The children as plain words.
#[inline(always)]
fn words<const W: usize>(children: &[Child; W]) -> [u32; W] {
    let mut out = [0; W];
    for lane in 0..W {
        out[lane] = children[lane].0;
    }
    out
}

/// Floats as they are stored.
#[inline(always)]
fn bits<const W: usize>(lanes: [f32; W]) -> [u32; W] {
    let mut out = [0; W];
    for lane in 0..W {
        out[lane] = lanes[lane].to_bits();
    }
    out
}

/// The nearer first.
#[inline(always)]
fn ordered(a: ByEntry, b: ByEntry) -> (ByEntry, ByEntry) {
    if b < a { (b, a) } else { (a, b) }
}

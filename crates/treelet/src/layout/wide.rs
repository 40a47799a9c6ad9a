//! The wide layouts: a node holds the boxes of up to 8 or 16 children, structure of arrays, so that
//! one vector instruction does one step of the slab test for all of them.
//!
//! | bytes (8 wide) | (16 wide) | field      | meaning                                             |
//! |----------------|-----------|------------|-----------------------------------------------------|
//! | 0..192         | 0..384    | `planes`   | by axis: `lo` of every child, then `hi` of every child |
//! | 192..224       | 384..448  | `children` | one [`Child`] word each                             |
//!
//! Children stand in the order of `layout/order.rs`, the likeliest to stop a ray last; unused slots
//! hold the empty box, which no ray enters.
//!
//! | child word | meaning                                                                   |
//! |------------|---------------------------------------------------------------------------|
//! | bit 31     | 0: bits 0..31 are the index of a node                                     |
//! |            | 1: a leaf: bits 29..31 are its entries less one, bits 0..29 the first one |
//!
//! Entries are numbered triangles first, instances after them, these by their numbers in the scene, then primitives of other
//! kinds by their ids; a leaf holds triangles or one of anything else. A leaf's
//! triangles are one block of words, ten a triangle, in rows as long as the leaf has triangles: `x`,
//! `y` and `z` of the first corners, of the second, of the third, then the ids. So four triangles are
//! loaded as vectors, and a leaf of one costs 40 bytes, not 160.
//!
//! Source: H. Dammertz, J. Hanika, A. Keller, "Shallow Bounding Volume Hierarchies for Fast SIMD Ray
//! Tracing of Incoherent Rays", EGSR 2008; leaves differ.

use super::packing::{Block, Packing};
use crate::bounds::{Aabb, Interval, SlabRay};
use crate::build::Info;
use crate::geometry::TriangleRay;
use crate::geometry::block::{BlockHits, BlockTest};
use crate::memory::{Pages, prefetch, zeroed};
use crate::simd::{Floats, Simd, Wide as Vectors};
use crate::tree::PRIMS_MAX;
use alloc::vec::Vec;

/// The catalogue's entry for 8 children.
pub const INFO_8: Info = Info {
    name: "wide8",
    summary: "up to 8 children a node, 224 bytes; 40 bytes a triangle",
    source: "Dammertz, Hanika, Keller 2008",
};

/// The catalogue's entry for 16 children.
pub const INFO_16: Info = Info {
    name: "wide16",
    summary: "up to 16 children a node, 448 bytes; 40 bytes a triangle",
    source: "Dammertz, Hanika, Keller 2008",
};

/// Slots of the widest node.
pub(super) const SLOTS_MAX: usize = 16;

/// Entries of the fullest leaf.
pub const LEAF_MAX: usize = 4;

/// The most entries of all leaves of a level: child words have 29 bits for them, and the last words
/// mean something else. Primitives that are in several leaves count as often.
pub const ENTRIES_MAX: usize = PRIMS_MAX;

/// 32-bit words that a leaf stores for each triangle.
pub const TRIANGLE_WORDS: usize = 10;

/// What a block is read as: the rows of four triangles, and as much again as a vector may reach
/// past the last row of a smaller leaf.
pub const BLOCK_WORDS: usize = LEAF_MAX * TRIANGLE_WORDS + LEAF_MAX;

/// Up to `W` children.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Node<const W: usize> {
    /// By axis: the lower planes, then the upper ones.
    pub planes: [[[f32; W]; 2]; 3],
    /// What is behind each box.
    pub children: [Child; W],
}

const _: () = assert!(size_of::<Node<8>>() == 224 && size_of::<Node<16>>() == 448);

impl<const W: usize> Node<W> {
    /// A node without children.
    pub(crate) const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; W], [f32::NEG_INFINITY; W]]; 3],
        children: [Child::END; W],
    };

    /// Puts a child into a slot.
    pub(crate) fn set(&mut self, slot: usize, bounds: &Aabb, child: Child) {
        for axis in 0..3 {
            self.planes[axis][0][slot] = bounds.lo[axis];
            self.planes[axis][1][slot] = bounds.hi[axis];
        }
        self.children[slot] = child;
    }
}

/// What is behind a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Child(pub(crate) u32);

/// The decoded form of a [`Child`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// Another node.
    Inner {
        /// Its index.
        node: usize,
    },
    /// Entries: triangles or instances.
    Leaf {
        /// The first.
        first: usize,
        /// How many: `1..=LEAF_MAX`.
        count: usize,
    },
}

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 29;
const FIRST_MASK: u32 = (1 << COUNT_SHIFT) - 1;

impl Child {
    /// Where a walk leaves a level; never a child.
    pub(crate) const END: Self = Self(u32::MAX);
    /// Where a walk has to look further; never a child.
    pub(crate) const NONE: Self = Self(u32::MAX - 1);

    /// Another node.
    pub(crate) const fn inner(node: u32) -> Self {
        debug_assert!(node < LEAF);
        Self(node)
    }

    /// A leaf of `1..=LEAF_MAX` entries.
    pub(crate) const fn leaf(first: usize, count: usize) -> Self {
        debug_assert!(first + count <= ENTRIES_MAX && 1 <= count && count <= LEAF_MAX);
        Self(LEAF | (count as u32 - 1) << COUNT_SHIFT | first as u32)
    }

    /// Whether a node is meant.
    #[inline(always)]
    pub fn is_inner(self) -> bool {
        self.0 & LEAF == 0
    }

    /// Decodes it.
    #[inline(always)]
    pub fn kind(self) -> ChildKind {
        if self.is_inner() {
            return ChildKind::Inner { node: self.0 as usize };
        }
        let count = (self.0 >> COUNT_SHIFT) & 3;
        ChildKind::Leaf { first: (self.0 & FIRST_MASK) as usize, count: count as usize + 1 }
    }
}

zeroed! { Child []: u32 }
zeroed! { Node<W> [const W: usize]: [[[f32; W]; 2]; 3], [Child; W] }

/// Nodes as above, and leaves as blocks of words.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain;

impl<const W: usize> Packing<W> for Plain {
    type Node = Node<W>;
    type Unit = f32;
    type Leaf = Block;

    #[inline(always)]
    fn children(node: &Node<W>) -> &[Child; W] {
        &node.children
    }

    #[inline(always)]
    fn slots(_: &Node<W>) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    fn planes<S: Vectors<W>>(simd: S, node: &Node<W>, axis: usize, side: usize) -> S::F {
        S::F::load(simd, &node.planes[axis][side & 1])
    }

    #[inline(always)]
    fn bounds(node: &Node<W>, slot: usize) -> Aabb {
        let [x, y, z] = &node.planes;
        let slot = slot % W;
        Aabb { lo: [x[0][slot], y[0][slot], z[0][slot]], hi: [x[1][slot], y[1][slot], z[1][slot]] }
    }

    #[inline(always)]
    fn leaf(words: &[f32], first: usize) -> &Block {
        const EMPTY: &Block = &[0.0; BLOCK_WORDS];
        words.get(first * TRIANGLE_WORDS..).and_then(<[f32]>::first_chunk).unwrap_or(EMPTY)
    }

    #[inline(always)]
    fn expect_ids(words: &[f32], first: usize, count: usize) {
        prefetch(words, first * TRIANGLE_WORDS + 9 * count);
    }

    #[inline(always)]
    fn hits<S: Simd>(
        simd: S,
        leaf: &Block,
        count: usize,
        ray: (&TriangleRay, &SlabRay),
        clip: &Interval,
        range: (f32, f32),
    ) -> BlockHits {
        simd.apply::<BlockTest<'_, _>>((leaf, count), ray, clip, range)
    }

    #[inline(always)]
    fn id(leaf: &Block, count: usize, triangle: usize) -> u32 {
        leaf[9 * count + triangle].to_bits()
    }

    #[inline(always)]
    fn block<'b, S: Simd>(
        _: S,
        leaf: &'b Block,
        count: usize,
        _: &'b mut Block,
    ) -> (&'b Block, usize) {
        (leaf, count)
    }
}

/// A tree of wide nodes, and the triangles of its leaves.
#[derive(Debug)]
pub(crate) struct Wide<const W: usize, K: Packing<W> = Plain> {
    /// Parents before children; when built, each is followed by its largest child's subtree.
    pub(crate) nodes: Pages<K::Node>,
    /// Where a walk begins; [`Child::END`] for the tree of nothing.
    pub(crate) root: Child,
    /// The leaves, and padding for the last one.
    pub(crate) words: Pages<K::Unit>,
    /// Entries from here on are instances.
    pub(crate) triangles: usize,
}

impl<const W: usize, K: Packing<W>> Wide<W, K> {
    /// The tree of nothing.
    pub(crate) fn nothing() -> Self {
        Self { nodes: Pages::default(), root: Child::END, words: Pages::default(), triangles: 0 }
    }

    /// The children of a node and their boxes; none of a leaf.
    pub(crate) fn below(&self, child: Child) -> Vec<(Child, Aabb)> {
        let ChildKind::Inner { node } = child.kind() else { return Vec::new() };
        let Some(node) = self.nodes.get(node) else { return Vec::new() };
        let children = K::children(node).iter().enumerate();
        let used = children.filter(|(_, child)| **child != Child::END);
        used.map(|(slot, &child)| (child, K::bounds(node, slot))).collect()
    }

    /// Bytes that walks read.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn child_words_decode_to_what_they_were_made_of() {
        assert_eq!(Child::inner(7).kind(), ChildKind::Inner { node: 7 });
        for count in 1..=LEAF_MAX {
            for first in [0, 9, ENTRIES_MAX - count] {
                let child = Child::leaf(first, count);
                assert_eq!(child.kind(), ChildKind::Leaf { first, count });
                assert_ne!(child, Child::END);
            }
        }
    }
}

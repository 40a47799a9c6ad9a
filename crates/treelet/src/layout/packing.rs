//! How nodes and leaves of a wide tree are written down: all that a walk knows of a layout.

use super::wide::{BLOCK_WORDS, Child};
use crate::bounds::{Aabb, Interval, SlabRay};
use crate::geometry::TriangleRay;
use crate::geometry::block::BlockHits;
use crate::memory::Zeroed;
use crate::simd::{Simd, Wide};
use core::fmt::Debug;

/// The triangles of a leaf: ten rows, as many words apart as the layout says (see
/// [`super::wide`]), and anything beyond.
pub(crate) type Block = [f32; BLOCK_WORDS];

/// Bytes that are fetched together, on most processors.
const CACHE_LINE: usize = 64;

/// A way to write nodes of `W` children, and leaves.
pub(crate) trait Packing<const W: usize>: Copy + Debug + Send + Sync + 'static {
    /// A node.
    type Node: Zeroed + Debug;
    /// What leaves are arrays of.
    type Unit: Zeroed + Debug;
    /// What a leaf is read as.
    type Leaf;

    /// What is behind each box.
    fn children(node: &Self::Node) -> &[Child; W];

    /// The slots that may hold a child, a bit each: where it is set and there is none, the box is
    /// empty.
    fn slots(node: &Self::Node) -> u32;

    /// The lower (0) or the upper (1) planes of an axis. They contain the boxes that the tree had.
    fn planes<S: Wide<W>>(simd: S, node: &Self::Node, axis: usize, side: usize) -> S::F;

    /// The box of a child, the same planes.
    fn bounds(node: &Self::Node, slot: usize) -> Aabb;

    /// The leaf that begins at `first`.
    fn leaf(leaves: &[Self::Unit], first: usize) -> &Self::Leaf;

    /// Asks for the line in which the ids of a leaf's `count` triangles are.
    fn expect_ids(leaves: &[Self::Unit], first: usize, count: usize);

    /// Which of the `count` triangles of a leaf the ray hits (see [`BlockTest`]).
    ///
    /// [`BlockTest`]: crate::geometry::block::BlockTest
    fn hits<S: Simd>(
        simd: S,
        leaf: &Self::Leaf,
        count: usize,
        ray: (&TriangleRay, &SlabRay),
        clip: &Interval,
        range: (f32, f32),
    ) -> BlockHits;

    /// The id of one of the `count` triangles of a leaf.
    fn id(leaf: &Self::Leaf, count: usize, triangle: usize) -> u32;

    /// The `count` triangles of a leaf as a block, and how far its rows are apart: for many rays.
    fn block<'b, S: Simd>(
        simd: S,
        leaf: &'b Self::Leaf,
        count: usize,
        room: &'b mut Block,
    ) -> (&'b Block, usize);
}

/// Asks for the cache lines of a node or a leaf.
#[inline(always)]
pub(crate) fn fetch<S: Simd, T>(simd: S, item: &T) {
    let start = core::ptr::from_ref(item).cast::<[u8; CACHE_LINE]>();
    for line in 0..size_of::<T>().div_ceil(CACHE_LINE) {
        simd.prefetch(start.wrapping_add(line));
    }
}

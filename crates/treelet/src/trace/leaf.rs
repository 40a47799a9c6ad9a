//! A leaf's triangles one by one, for walks that test several rays against each.

use crate::bounds::Aabb;
use crate::layout::packing::{Block, Packing};
use crate::layout::wide::{BLOCK_WORDS, Wide as WideTree};
use crate::simd::Simd;

/// The triangles of a leaf, in rows.
#[derive(Clone, Copy)]
pub(super) struct Leaf<'a> {
    pub(super) rows: &'a Block,
    /// How far the rows are apart.
    pub(super) stride: usize,
    pub(super) count: usize,
    /// Around them.
    pub(super) bounds: Aabb,
}

/// Where the rows of a leaf are put whose layout has none.
pub(super) const ROOM: Block = [0.0; BLOCK_WORDS];

impl<'a> Leaf<'a> {
    /// The triangles from `first` on.
    #[inline(always)]
    pub(super) fn new<K: Packing<W>, S: Simd, const W: usize>(
        simd: S,
        wide: &'a WideTree<W, K>,
        (first, count): (usize, usize),
        bounds: Aabb,
        room: &'a mut Block,
    ) -> Self {
        let (rows, stride) = K::block(simd, K::leaf(&wide.words, first), count, room);
        Self { rows, stride, count, bounds }
    }

    #[inline(always)]
    pub(super) fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        let word = |row: usize| self.word(row, triangle);
        [[word(0), word(1), word(2)], [word(3), word(4), word(5)], [word(6), word(7), word(8)]]
    }

    #[inline(always)]
    pub(super) fn id(&self, triangle: usize) -> u32 {
        self.word(9, triangle).to_bits()
    }

    #[inline(always)]
    fn word(&self, row: usize, triangle: usize) -> f32 {
        self.rows.get(row * self.stride + triangle).copied().unwrap_or(0.0)
    }
}

//! A leaf's triangles one by one, for walks that test several rays against each.

use crate::bounds::Aabb;
use crate::layout::wide::BLOCK_WORDS;

/// The triangles of a leaf, in rows.
#[derive(Clone, Copy)]
pub(super) struct Leaf<'a> {
    pub(super) rows: &'a [f32; BLOCK_WORDS],
    pub(super) count: usize,
    /// Around them.
    pub(super) bounds: Aabb,
}

impl Leaf<'_> {
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
        self.rows.get(row * self.count + triangle).copied().unwrap_or(0.0)
    }
}

//! Who belongs to whom: leaves numbered from left to right, so that a subtree is a range of them.

use super::{Kind, Tree};
use alloc::vec::Vec;
use core::ops::Range;

/// The numbering of a tree's leaves, and where each primitive is.
pub(super) struct Kinship {
    /// By node: the leaves below it.
    leaves: Vec<(u32, u32)>,
    /// By primitive: where its leaves begin in `homes`; one more at the end.
    first_home: Vec<u32>,
    /// The leaves of one primitive after the other, in order.
    homes: Vec<u32>,
}

impl Kinship {
    /// O(n).
    pub(super) fn new(tree: &Tree) -> Self {
        // Count leaves from the bottom up, then number them from the top down.
        let mut counts: Vec<u32> = alloc::vec![1; tree.nodes.len()];
        for (at, node) in tree.nodes.iter().enumerate().rev() {
            if let Kind::Inner { left } = node.kind() {
                counts[at] = counts[left] + counts[left + 1];
            }
        }
        let mut leaves = alloc::vec![(0, 0); tree.nodes.len()];
        for (at, node) in tree.nodes.iter().enumerate() {
            leaves[at].1 = leaves[at].0 + counts[at];
            if let Kind::Inner { left } = node.kind() {
                leaves[left].0 = leaves[at].0;
                leaves[left + 1].0 = leaves[at].0 + counts[left];
            }
        }

        // Sort the leaves of each primitive by counting.
        let prims = tree.prims.iter().max().map_or(0, |&last| last as usize + 1);
        let mut first_home = alloc::vec![0; prims + 1];
        tree.prims.iter().for_each(|&prim| first_home[prim as usize + 1] += 1);
        for prim in 0..prims {
            first_home[prim + 1] += first_home[prim];
        }
        let mut next = first_home.clone();
        let mut homes = alloc::vec![0; tree.prims.len()];
        for (node, &(leaf, _)) in tree.nodes.iter().zip(&leaves) {
            if let Kind::Leaf { first, count } = node.kind() {
                for &prim in &tree.prims[first..first + count] {
                    homes[next[prim as usize] as usize] = leaf;
                    next[prim as usize] += 1;
                }
            }
        }
        for prim in 0..prims {
            homes[first_home[prim] as usize..first_home[prim + 1] as usize].sort_unstable();
        }
        Self { leaves, first_home, homes }
    }

    /// Primitives are named by numbers below this.
    pub(super) fn prims(&self) -> u32 {
        self.first_home.len() as u32 - 1
    }

    /// Whether some primitive is in several leaves.
    pub(super) fn repeats(&self) -> bool {
        (0..self.prims()).any(|prim| self.homes(prim).len() > 1)
    }

    /// Whether a primitive is in a leaf at all.
    pub(super) fn is_housed(&self, prim: u32) -> bool {
        !self.homes(prim).is_empty()
    }

    /// Whether a primitive is in a leaf below `node`, or in it.
    #[inline]
    pub(super) fn belongs(&self, prim: u32, node: usize) -> bool {
        let Range { start, end } = self.below(node);
        match self.homes(prim) {
            &[leaf] => start <= leaf && leaf < end,
            homes => {
                homes.get(homes.partition_point(|&leaf| leaf < start)).is_some_and(|&l| l < end)
            }
        }
    }

    /// Whether `node` lies below `above`, or is it.
    #[inline]
    pub(super) fn is_below(&self, node: usize, above: usize) -> bool {
        let (node, above) = (self.below(node), self.below(above));
        above.start <= node.start && node.end <= above.end
    }

    fn below(&self, node: usize) -> Range<u32> {
        let (start, end) = self.leaves[node];
        start..end
    }

    fn homes(&self, prim: u32) -> &[u32] {
        let [start, end] = [0, 1].map(|next| self.first_home[prim as usize + next] as usize);
        &self.homes[start..end]
    }
}

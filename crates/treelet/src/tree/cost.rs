//! What a tree costs, by the surface area heuristic, and its vital statistics.
//!
//! Sources: J. Goldsmith and J. Salmon, "Automatic Creation of Object Hierarchies for Ray Tracing",
//! IEEE CG&A 7(5), 1987; J. D. MacDonald and K. S. Booth, "Heuristics for Ray Tracing Using Space
//! Subdivision", The Visual Computer 6(3), 1990: a long random ray that meets a convex body meets a
//! smaller one inside it with the probability of the ratio of their surface areas.

use super::{Kind, Node, Tree};
use crate::context::{Cancel, Cancelled};

/// Prices, in any one unit: only their ratio changes which tree is best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SahConstants {
    /// Of visiting an inner node.
    pub visit: f64,
    /// Of testing one primitive.
    pub prim: f64,
}

impl Default for SahConstants {
    /// One each, so that a cost reads as "box pairs plus triangles".
    fn default() -> Self {
        Self { visit: 1.0, prim: 1.0 }
    }
}

/// The vital statistics of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeStats {
    /// Primitives in its leaves, counted once for each leaf.
    pub prims: u64,
    /// Inner nodes and leaves.
    pub nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// Nodes on the longest path from the root, the root included; 0 for the tree of nothing.
    pub depth: u32,
    /// Primitives in the fullest leaf.
    pub leaf_max: u32,
    /// Expected cost of a long random ray that meets the root, under [`SahConstants::default`].
    pub sah: f64,
}

impl TreeStats {
    /// Primitives in the average leaf; 0 for the tree of nothing.
    pub fn leaf_mean(&self) -> f64 {
        if self.leaves == 0 { 0.0 } else { self.prims as f64 / self.leaves as f64 }
    }
}

impl Tree {
    /// The expected cost of a long random ray that meets the root: the sum over all nodes of their
    /// price times their surface area relative to the root's. O(n).
    ///
    /// A tree whose root has no area (one point, one line) counts every node as met.
    pub fn sah(&self, constants: &SahConstants) -> f64 {
        let met = self.chances();
        self.nodes.iter().map(|node| constants.price(node) * met(node)).sum()
    }

    /// Counts and measures the tree. O(n).
    pub fn stats(&self) -> TreeStats {
        // A flag that nobody holds is never raised.
        self.measure(&Cancel::new()).unwrap_or_default()
    }

    /// [`Tree::stats`], to be stopped at any time.
    pub(crate) fn measure(&self, cancel: &Cancel) -> Result<TreeStats, Cancelled> {
        let constants = SahConstants::default();
        let mut stats = TreeStats { nodes: self.nodes.len() as u64, ..TreeStats::default() };
        let mut depths = alloc::vec![1; self.nodes.len()];
        // Divided once, not node by node.
        let root = self.bounds().half_area();
        let flat = root <= 0.0;
        let mut area = 0.0;
        for (at, node) in self.nodes.iter().enumerate() {
            cancel.check()?;
            if !flat {
                area += constants.price(node) * node.bounds.half_area();
            } else {
                area += constants.price(node);
            }
            let depth: u32 = depths[at];
            stats.depth = stats.depth.max(depth);
            match node.kind() {
                Kind::Inner { left } => depths[left..left + 2].fill(depth + 1),
                Kind::Leaf { count, .. } => {
                    stats.leaves += 1;
                    stats.prims += count as u64;
                    stats.leaf_max = stats.leaf_max.max(count as u32);
                }
            }
        }
        stats.sah = if flat { area } else { area / root };
        Ok(stats)
    }

    /// The chance that a ray which meets the root meets a node. Relative to the root's own area, so
    /// that extents near the ends of f32 do not matter.
    fn chances(&self) -> impl Fn(&Node) -> f64 {
        let root = self.bounds().half_area();
        move |node| if root > 0.0 { node.bounds.half_area() / root } else { 1.0 }
    }
}

impl SahConstants {
    /// Of visiting a node, or of testing all that a leaf holds.
    pub(super) fn price(&self, node: &Node) -> f64 {
        match node.kind() {
            Kind::Inner { .. } => self.visit,
            Kind::Leaf { count, .. } => self.prim * count as f64,
        }
    }
}

//! What a tree costs, by the surface area heuristic, and its vital statistics.
//!
//! Sources: J. Goldsmith and J. Salmon, "Automatic Creation of Object Hierarchies for Ray Tracing",
//! IEEE CG&A 7(5), 1987; J. D. MacDonald and K. S. Booth, "Heuristics for Ray Tracing Using Space
//! Subdivision", The Visual Computer 6(3), 1990: a long random ray that meets a convex body meets a
//! smaller one inside it with the probability of the ratio of their surface areas.

use super::{Kind, Tree};

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
        // Scaled by the root's own area, so that extents near the ends of f32 do not matter.
        let root = self.bounds().half_area();
        let met = |area: f64| if root > 0.0 { area / root } else { 1.0 };
        let price = |node: &super::Node| match node.kind() {
            Kind::Inner { .. } => constants.visit,
            Kind::Leaf { count, .. } => constants.prim * count as f64,
        };
        self.nodes.iter().map(|node| price(node) * met(node.bounds.half_area())).sum()
    }

    /// Counts and measures the tree. O(n).
    pub fn stats(&self) -> TreeStats {
        let mut stats = TreeStats {
            nodes: self.nodes.len() as u64,
            depth: self.depths().into_iter().max().map_or(0, |deepest| deepest + 1),
            sah: self.sah(&SahConstants::default()),
            ..TreeStats::default()
        };
        for node in &self.nodes {
            if let Kind::Leaf { count, .. } = node.kind() {
                stats.leaves += 1;
                stats.prims += count as u64;
                stats.leaf_max = stats.leaf_max.max(count as u32);
            }
        }
        stats
    }
}

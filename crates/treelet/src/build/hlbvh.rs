//! HLBVH: Morton codes cut the fine parts of the scene, the surface area heuristic the coarse ones.
//!
//! Sources: J. Pantaleoni and D. Luebke, "HLBVH: Hierarchical LBVH Construction for Real-Time Ray
//! Tracing of Dynamic Geometry", HPG 2010; K. Garanzha, J. Pantaleoni and D. McAllister, "Simpler and
//! Faster HLBVH with Work Queues", HPG 2011, from which the binned heuristic above the clusters is.
//! Differs from them: clusters are the cells of a curve that halves the longest edge, not of a cube's
//! grid; the top is built by `binned_sah`, each cluster counting as one.
//!
//! O(n) time, and O(c log c) for `c` clusters. A tree too deep is given up for that of `lbvh`.

use super::bottom_up::{self, Below, Cluster, Cut, Handed, Join, Part};
use super::curve_leaves::Mark;
use super::curve_order::BUCKET_BITS_MAX;
use super::lbvh::Lbvh;
use super::{BinnedSah, BuildError, Builder, Info, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::Context;
use crate::math::morton::CODE_BITS;
use crate::tree::{DEPTH_MAX, Kind, Tree};
use alloc::vec::Vec;
use core::sync::atomic::AtomicU64;

/// Cuts small parts along the Morton curve, large ones by the surface area heuristic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hlbvh {
    /// Most primitives in a leaf, in `1..=64`. Ranges of the curve up to this size are leaves.
    pub leaf_max: u32,
    /// Primitives whose codes agree in this many bits, `11..=30`, are a cluster. More make better and
    /// more expensive tops.
    pub cluster_bits: u32,
}

impl Hlbvh {
    /// Leaves of up to four, 32,768 cells.
    pub const DEFAULT: Self = Self { leaf_max: 4, cluster_bits: 15 };
}

/// The most `cluster_bits`.
const CLUSTER_BITS_MAX: u32 = 30;

impl Builder for Hlbvh {
    fn info(&self) -> Info {
        Info {
            name: "hlbvh",
            summary: "cuts small parts along the Morton curve, large ones by surface area",
            source: "Pantaleoni and Luebke 2010; Garanzha et al. 2011",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        // Pieces of the curve are whole buckets: no cluster may be larger than one.
        let allowed = f64::from(BUCKET_BITS_MAX)..=f64::from(CLUSTER_BITS_MAX);
        check_option("cluster_bits", f64::from(self.cluster_bits), allowed, "11..=30")?;
        let cut = Cut { leaf_max: self.leaf_max, code_bits: CODE_BITS };
        let (tree, depth) = bottom_up::build(self, cut, bounds, context)?;
        if depth > DEPTH_MAX {
            return Lbvh { leaf_max: self.leaf_max, ..Lbvh::DEFAULT }.build(bounds, context);
        }
        Ok(tree)
    }
}

impl Hlbvh {
    /// Whether neighbours that part at this level are in different clusters.
    fn parts_clusters(&self, level: u8) -> bool {
        u32::from(level) <= self.cluster_bits
    }
}

impl Join for Hlbvh {
    /// The clusters of the piece, then those parts of the last one that wait for a right sibling.
    type Open = Vec<(Cluster, u8)>;

    #[inline(always)]
    fn push(&self, open: &mut Self::Open, part: &Part<'_>, below: &mut Below<'_>) {
        let mut last = part.clusters[0];
        while let Some((left, parts)) = open.last()
            && *parts > part.level
            && !self.parts_clusters(*parts)
        {
            last = below.join(left, &last);
            open.pop();
        }
        open.push((last, part.level));
    }

    fn finish(&self, open: &mut Self::Open, _count: usize, _below: &mut Below<'_>) -> Vec<Cluster> {
        open.drain(..).map(|(cluster, _)| cluster).collect()
    }

    fn keep(&self, _clusters: usize, marks: &mut [AtomicU64]) -> usize {
        let ends = |mark: &mut AtomicU64| self.parts_clusters(Mark::unpack(*mark.get_mut()).level);
        marks.iter_mut().map(ends).filter(|&ends| ends).count()
    }

    fn join_pieces(
        &self,
        pieces: Vec<Handed>,
        below: &mut Below<'_>,
        context: &Context<'_>,
    ) -> Result<Cluster, BuildError> {
        let clusters: Vec<Cluster> = pieces.into_iter().flat_map(|piece| piece.clusters).collect();
        let bounds: Vec<Aabb> = clusters.iter().map(|cluster| cluster.root.bounds).collect();
        let quiet = Context { cancel: context.cancel.clone(), progress: None };
        let sah = BinnedSah { leaf_max: 1, block: 1, ..BinnedSah::DEFAULT };
        let mut top = sah.build(&bounds, &quiet)?;

        // Each leaf of the top is the root of a cluster.
        let mut heights = alloc::vec![0; top.nodes.len()];
        for at in (0..top.nodes.len()).rev() {
            match top.nodes[at].kind() {
                Kind::Inner { left } => heights[at] = heights[left].max(heights[left + 1]) + 1,
                Kind::Leaf { first, .. } => {
                    let cluster = &clusters[top.prims[first] as usize];
                    (top.nodes[at], heights[at]) = (cluster.root, cluster.height);
                }
            }
        }
        below.fill(&top.nodes[1..]);
        Ok(Cluster { root: top.nodes[0], height: heights[0] })
    }
}

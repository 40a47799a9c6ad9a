//! HLBVH: Morton codes cut the fine parts of the scene, the surface area heuristic the coarse ones.
//!
//! Sources: J. Pantaleoni and D. Luebke, "HLBVH: Hierarchical LBVH Construction for Real-Time Ray
//! Tracing of Dynamic Geometry", HPG 2010; K. Garanzha, J. Pantaleoni and D. McAllister, "Simpler and
//! Faster HLBVH with Work Queues", HPG 2011, from which the binned heuristic above the clusters is.
//! Differs from them: clusters are the cells of a curve that halves the longest edge, not of a cube's
//! grid; the top is built by `binned_sah`, each cluster counting as one.
//!
//! O(n) time, and O(c log c) for `c` clusters. A tree too deep is given up for that of `lbvh`.
//!
//! Measured as in `lbvh`, M triangles/s and cost (which is not the order of tracing speeds between
//! families of builders), by bits of a cluster:
//!
//! | | coffee | kitchen | car | fur |
//! |---|---|---|---|---|
//! | 12 | 27, 11.5 | 28, 39.3 | 31, 72.9 | 28, 167 |
//! | 15, as in the paper | 27, 11.7 | 28, 37.9 | 30, 71.5 | 27, 166 |
//! | 18 | 27, 11.9 | 28, 38.6 | 26, 69.7 | 22, 162 |
//! | 21 | 25, 11.9 | 26, 38.4 | 21, 69.4 | 14, 153 |
//! | `lbvh` | 28, 13.1 | 29, 47.9 | 32, 78.0 | 29, 170 |

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

    fn keep(&self, leaves: &mut [AtomicU64]) -> usize {
        let ends = |mark: &mut AtomicU64| self.parts_clusters(Mark::unpack(*mark.get_mut()).level);
        leaves.iter_mut().map(ends).filter(|&ends| ends).count()
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

        // Each leaf of the top is the root of a cluster; of siblings, what comes first on the curve is
        // left, so that a tree of two leaves keeps the order of its primitives.
        let mut heights = alloc::vec![0; top.nodes.len()];
        let mut firsts = alloc::vec![0; top.nodes.len()];
        for at in (0..top.nodes.len()).rev() {
            match top.nodes[at].kind() {
                Kind::Inner { left } => {
                    heights[at] = heights[left].max(heights[left + 1]) + 1;
                    firsts[at] = firsts[left].min(firsts[left + 1]);
                    if firsts[left] > firsts[left + 1] {
                        top.nodes.swap(left, left + 1);
                    }
                }
                Kind::Leaf { first, .. } => {
                    firsts[at] = top.prims[first];
                    let cluster = &clusters[firsts[at] as usize];
                    (top.nodes[at], heights[at]) = (cluster.root, cluster.height);
                }
            }
        }
        below.fill(&top.nodes[1..]);
        Ok(Cluster { root: top.nodes[0], height: heights[0] })
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve_order::Split;
    use super::*;
    use crate::math::morton::Curve;
    use alloc::collections::{BTreeMap, BTreeSet};

    fn build(hlbvh: &Hlbvh, bounds: &[Aabb]) -> Tree {
        hlbvh.build(bounds, &Context::default()).unwrap()
    }

    fn random_boxes(count: usize) -> Vec<Aabb> {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let mut one = || {
            let lo = [(); 3].map(|()| random().powi(3));
            Aabb { lo, hi: lo.map(|x| x + 0.01 * random()) }
        };
        (0..count).map(|_| one()).collect()
    }

    /// The primitives of every node, in order.
    fn sets(tree: &Tree) -> Vec<Vec<u32>> {
        let mut below = alloc::vec![Vec::new(); tree.nodes.len()];
        for at in (0..tree.nodes.len()).rev() {
            below[at] = match tree.nodes[at].kind() {
                Kind::Leaf { first, count } => tree.prims[first..first + count].to_vec(),
                Kind::Inner { left } => [below[left].as_slice(), &below[left + 1]].concat(),
            };
            below[at].sort_unstable();
        }
        below
    }

    #[test]
    fn cells_are_subtrees_of_lbvh_under_a_top_of_binned_sah() {
        for (count, cluster_bits) in [(1, 15), (300, 11), (3000, 12), (20_000, 15), (3000, 18)] {
            let bounds = random_boxes(count);
            let context = Context::default();
            let ours = sets(&build(&Hlbvh { leaf_max: 1, cluster_bits }, &bounds));
            let lbvh = Lbvh { leaf_max: 1, ..Lbvh::DEFAULT }.build(&bounds, &context).unwrap();

            // Cells, from the definition.
            let points = bounds.iter().map(Aabb::center);
            let centers = points.fold(Aabb::EMPTY, |all, p| all.union(&Aabb { lo: p, hi: p }));
            let split = Split::new(count, CODE_BITS);
            let curve = Curve::new(centers.lo, centers.hi, split.coarse_bits);
            let cell = |prim: u32| {
                let code = curve.coarse(curve.cell(bounds[prim as usize].center()));
                code >> (split.coarse_bits - cluster_bits)
            };
            let mut cells = BTreeMap::<_, Vec<u32>>::new();
            (0..count as u32).for_each(|prim| cells.entry(cell(prim)).or_default().push(prim));
            let cells: Vec<Vec<u32>> = cells.into_values().collect();

            let is_inside = |set: &Vec<u32>| set.iter().all(|&prim| cell(prim) == cell(set[0]));
            let mut expected: BTreeSet<_> = sets(&lbvh).into_iter().filter(is_inside).collect();
            let around = |cell: &Vec<u32>| {
                cell.iter().fold(Aabb::EMPTY, |all, &prim| all.union(&bounds[prim as usize]))
            };
            let boxes: Vec<Aabb> = cells.iter().map(around).collect();
            let sah = BinnedSah { leaf_max: 1, block: 1, ..BinnedSah::DEFAULT };
            for set in sets(&sah.build(&boxes, &context).unwrap()) {
                let mut prims: Vec<u32> =
                    set.iter().flat_map(|&cell| cells[cell as usize].clone()).collect();
                prims.sort_unstable();
                expected.insert(prims);
            }
            assert_eq!(ours.len(), 2 * count - 1);
            let ours: BTreeSet<_> = ours.into_iter().collect();
            assert!(ours == expected, "{count} boxes, cells of {cluster_bits} bits");
            assert!(count < 1000 || (20..count).contains(&cells.len()), "{} cells", cells.len());
        }
    }

    #[test]
    fn options_out_of_range_are_named() {
        for cluster_bits in [0, 10, 31, u32::MAX] {
            let error = Hlbvh { leaf_max: 4, cluster_bits }.build(&[], &Context::default());
            let value = f64::from(cluster_bits);
            let option = "cluster_bits";
            assert_eq!(error, Err(BuildError::Option { option, value, allowed: "11..=30" }));
        }
    }
}

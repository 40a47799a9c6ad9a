//! Agglomerative clustering: of all pairs of clusters, those with the smallest common box are joined
//! first. Exact: the same clusters as by looking at all pairs each time.
//!
//! Source: B. Walter, K. Bala, M. Kulkarni and K. Pingali, "Fast Agglomerative Clustering for
//! Rendering", IEEE Symposium on Interactive Ray Tracing, 2008, locally-ordered clustering: follow
//! nearest neighbours until two chose each other. Differs from it: neighbours that are still to be
//! left wait in a chain, so that no search is for nothing (F. Murtagh, "A Survey of Recent Advances
//! in Hierarchical Clustering Algorithms", The Computer Journal 26(4), 1983); they are searched for in
//! a tree over the Morton curve (`search`); ties have a rule; subtrees that fit become leaves.
//!
//! # Why the order does not matter
//!
//! Pairs are compared by the area of their common box, then by how many primitives are in both
//! together, then by the bits in which the clusters' numbers differ, a cluster's number being the
//! least place on the Morton curve of its primitives. No two pairs of one cluster are equal. Let `a`
//! and `b` be each other's best. If `x` and `y`, others, are joined, `a` with both of them has an area
//! no less than `a` with `x` (areas are rounded, but never less for larger boxes), and more primitives;
//! so that pair is worse than `a` with `x`, which is worse than `a` with `b`. Hence `a` and `b` stay
//! each other's best until they are joined, whenever that is; and joining the best pair of all first
//! joins them too. Equal boxes become a balanced tree.
//!
//! One thread, as in the paper; about `3n` searches of O(log n) each where boxes are small beside the
//! scene; 170 to 230 bytes a primitive of scratch. Clusters so deep in the tree that its depth runs out
//! are not the exact ones (`fill_leaves`): a coffee machine has some.
//!
//! Measured as in `lbvh`, M triangles/s and cost (which is not the order of tracing speeds between
//! families of builders): coffee 0.40, 11.5; kitchen 0.32, 32.3; car 0.40, 74.1; fur 0.31, 151.

mod search;

use super::bottom_up::{Below, Cluster};
use super::curve_order::Order;
use super::fill_leaves::fill_leaves;
use super::{BuildError, Builder, Info, check_leaf_max};
use crate::bounds::Aabb;
use crate::context::{Context, Stage};
use crate::math::morton::CODE_BITS;
use crate::memory;
use crate::tree::{Node, PRIMS_MAX, Tree};
use alloc::vec::Vec;
use search::{Found, Search};

/// Joins the pair with the smallest box, of all pairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agglomerative {
    /// Most primitives in a leaf, in `1..=64`. Subtrees up to this size become leaves.
    pub leaf_max: u32,
}

impl Agglomerative {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4 };
}

impl Builder for Agglomerative {
    fn info(&self) -> Info {
        Info {
            name: "agglomerative",
            summary: "joins the pair of clusters with the smallest box, of all pairs",
            source: "Walter et al. 2008",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        let count = bounds.len();
        if count > PRIMS_MAX {
            return Err(BuildError::TooManyPrims { prims: count as u64 });
        }
        let stage = Stage::new(context, "build", count as u64);
        stage.check()?;
        if count == 0 {
            return Ok(Tree::default());
        }
        let tree = join_all(bounds, &stage)?;
        fill_leaves(&tree, self.leaf_max, &stage)
    }
}

/// Progress is told this many times, and once more at the end.
const TELLS: usize = 64;
/// Joins are interrupted this many apart.
const CHECK_EVERY: usize = 256;

/// Joins single primitives until one cluster is left.
fn join_all(bounds: &[Aabb], stage: &Stage<'_>) -> Result<Tree, BuildError> {
    let count = bounds.len();
    let mut order = Order::new(bounds, CODE_BITS, stage)?;
    let mut prims = memory::try_filled(0, count, "the tree's primitives")?;
    order.find_leaves(bounds, 1, &mut prims, stage)?;
    drop(order);

    let unwritten = Node::leaf(Aabb::EMPTY, 0, 1);
    let mut nodes = memory::try_filled(unwritten, 2 * count - 1, "the tree's nodes")?;
    let (root, rest) = nodes.split_at_mut(1);
    let below = Below::new(rest, 1);
    let mut joining = Joining::new(bounds, &prims, below)?;
    let tell_every = count.div_ceil(TELLS);
    for joined in 1..count {
        if joined % CHECK_EVERY == 0 {
            stage.check()?;
        }
        joining.join_next();
        if joined % tell_every == 0 {
            stage.advance(tell_every as u64);
        }
    }
    stage.advance((count - (count - 1) / tell_every * tell_every) as u64);
    root[0] = joining.last();
    Ok(Tree { nodes, prims })
}

/// Clusters that are not joined yet.
struct Joining<'a> {
    search: Search,
    /// By slot of the search.
    clusters: Vec<Cluster>,
    /// Each one the best choice of the one before it, and `found` by it.
    chain: Vec<Found>,
    /// No cluster is in a slot before this one, unless the search was made anew.
    cursor: usize,
    /// A candidate for the last of the chain, whose best choice was joined with another.
    hint: Option<usize>,
    below: Below<'a>,
}

impl<'a> Joining<'a> {
    fn new(bounds: &[Aabb], prims: &[u32], below: Below<'a>) -> Result<Self, BuildError> {
        let mut clusters = memory::try_with_capacity(bounds.len(), "clusters")?;
        clusters.extend(prims.iter().enumerate().map(|(place, &prim)| Cluster {
            root: Node::leaf(bounds[prim as usize], place, 1),
            height: 0,
        }));
        let search = Search::new(clusters.iter().map(|cluster| cluster.root.bounds))?;
        Ok(Self { search, clusters, chain: Vec::new(), cursor: 0, hint: None, below })
    }

    /// The only cluster that is left.
    fn last(&self) -> Node {
        let slot = (0..self.clusters.len()).find(|&slot| self.search.is_live(slot));
        self.clusters[slot.unwrap_or(0)].root
    }

    /// Follows best choices until two chose each other, and joins them.
    fn join_next(&mut self) {
        loop {
            let Some(&last) = self.chain.last() else {
                self.begin_chain();
                continue;
            };
            let before = self.chain.len().checked_sub(2).map(|at| self.chain[at].slot);
            let mut best = before.map_or(Found::NOTHING, |slot| last.of(slot));
            if let Some(slot) = self.hint.take() {
                best = best.better(self.search.pair(last.slot, slot));
            }
            let found = self.search.best(last.slot, best);
            if Some(found.slot) != before {
                self.chain.push(found);
                continue;
            }
            self.chain.truncate(self.chain.len() - 2);
            self.hint = Some(self.join([found.slot, last.slot]));
            if self.chain.is_empty() {
                self.hint = None;
            }
            return;
        }
    }

    /// Begins a chain at the next cluster along the curve.
    fn begin_chain(&mut self) {
        while !self.search.is_live(self.cursor) {
            self.cursor = (self.cursor + 1) % self.clusters.len();
        }
        self.chain.push(Found::NOTHING.of(self.cursor));
    }

    /// Joins two clusters; the slot of what they become.
    fn join(&mut self, slots: [usize; 2]) -> usize {
        let (left, right) = (slots[0].min(slots[1]), slots[0].max(slots[1]));
        self.clusters[left] = self.below.join(&self.clusters[left], &self.clusters[right]);
        self.search.join(left, right);
        if !self.search.is_sparse() {
            return left;
        }
        // Close the gaps, once half the slots are empty.
        let mut to = alloc::vec![0_u32; self.clusters.len()];
        let mut used = 0;
        for slot in 0..self.clusters.len() {
            to[slot] = used as u32;
            if self.search.is_live(slot) {
                self.clusters[used] = self.clusters[slot];
                used += 1;
            }
        }
        self.clusters.truncate(used);
        self.search.close_gaps();
        for found in &mut self.chain {
            found.slot = to[found.slot] as usize;
        }
        self.cursor = to[self.cursor] as usize % used;
        to[left] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::random_boxes;
    use super::*;
    use crate::tree::Kind;
    use alloc::collections::BTreeSet;

    /// A cluster's box, and the places of its primitives on the curve, in order.
    type Naive = (Aabb, Vec<u32>);

    /// Area, primitives, bits in which numbers differ.
    fn price((a, of_a): &Naive, (b, of_b): &Naive) -> (f32, usize, u32) {
        let around = a.union(b);
        let [x, y, z] = [0, 1, 2].map(|axis| around.hi[axis] - around.lo[axis]);
        let area = x * y + (x + y) * z;
        let area = if area < f32::MAX { area } else { f32::MAX };
        (area, of_a.len() + of_b.len(), of_a[0] ^ of_b[0])
    }

    /// The definition: look at all pairs, join the best one, again and again.
    fn greedy(bounds: &[Aabb], prims: &[u32]) -> BTreeSet<Vec<u32>> {
        let single = |(place, prim): (u32, &u32)| (bounds[*prim as usize], alloc::vec![place]);
        let mut clusters: Vec<Naive> = (0..).zip(prims).map(single).collect();
        let mut made = BTreeSet::new();
        while clusters.len() > 1 {
            let mut best = (0, 1);
            for b in 1..clusters.len() {
                for a in 0..b {
                    let at = price(&clusters[a], &clusters[b]);
                    if at < price(&clusters[best.0], &clusters[best.1]) {
                        best = (a, b);
                    }
                }
            }
            let (around, places) = clusters.swap_remove(best.1);
            let into = &mut clusters[best.0];
            into.0 = into.0.union(&around);
            into.1.extend(places);
            into.1.sort_unstable();
            made.insert(into.1.clone());
        }
        made
    }

    /// The clusters of a tree whose leaves are single primitives.
    fn clusters(tree: &Tree) -> BTreeSet<Vec<u32>> {
        let mut below = alloc::vec![Vec::new(); tree.nodes.len()];
        let mut made = BTreeSet::new();
        for at in (0..tree.nodes.len()).rev() {
            match tree.nodes[at].kind() {
                Kind::Leaf { first, .. } => below[at].push(first as u32),
                Kind::Inner { left } => {
                    let mut all = [below[left].as_slice(), &below[left + 1]].concat();
                    all.sort_unstable();
                    made.insert(all.clone());
                    below[at] = all;
                }
            }
        }
        made
    }

    #[test]
    fn makes_the_clusters_that_looking_at_all_pairs_makes() {
        let context = Context::default();
        let stage = Stage::new(&context, "test", 0);
        let row = |i: u32| Aabb { lo: [i as f32, 0.0, 0.0], hi: [i as f32 + 1.0, 1.0, 0.0] };
        let nested = |i: i32| Aabb { lo: [-(1.5_f32.powi(i % 100)); 3], hi: [1.5_f32.powi(i); 3] };
        let scale = |bounds: Vec<Aabb>, scale: f32| -> Vec<Aabb> {
            let by = |b: &Aabb| Aabb { lo: b.lo.map(|x| x * scale), hi: b.hi.map(|x| x * scale) };
            bounds.iter().map(by).collect()
        };
        let mut walls = random_boxes(280, 0.05, 1.0e6);
        walls.extend(random_boxes(40, 1.0, 1.0e6));
        for (name, bounds) in [
            ("random", random_boxes(512, 0.1, 1.0e6)),
            ("small among large", walls),
            ("on a lattice", random_boxes(400, 0.5, 4.0)),
            ("points on a lattice", random_boxes(400, 0.0, 5.0)),
            ("a row of equal boxes", (0..300).map(row).collect()),
            ("all equal", alloc::vec![row(5); 203]),
            ("nested", (0..85).map(nested).collect()),
            ("beyond f32", scale(random_boxes(200, 0.5, 1.0e6), f32::MAX / 2.0)),
            ("near nothing", scale(random_boxes(200, 0.5, 1.0e6), 1.0e-38)),
            ("one", alloc::vec![row(0)]),
            ("two", random_boxes(2, 0.1, 1.0e6)),
            ("three", random_boxes(3, 0.1, 1.0e6)),
            ("65", random_boxes(65, 0.1, 1.0e6)),
        ] {
            let tree = join_all(&bounds, &stage).unwrap();
            let expected = greedy(&bounds, &tree.prims);
            assert!(clusters(&tree) == expected, "{name}");
            assert_eq!(expected.len(), bounds.len() - 1, "{name}");
        }
    }

    #[test]
    fn equal_boxes_do_not_become_chains() {
        let bounds = alloc::vec![Aabb { lo: [0.0; 3], hi: [1.0; 3] }; 1 << 14];
        let tree = Agglomerative { leaf_max: 1 }.build(&bounds, &Context::default()).unwrap();
        assert_eq!(tree.stats().depth, 15, "a balanced tree");
    }

    #[test]
    fn chains_that_are_too_deep_are_halved_near_their_ends() {
        let around = |i: i32| {
            let half = 1.01_f32.powi(i - 2500);
            Aabb { lo: [-half; 3], hi: [half; 3] }
        };
        let bounds: Vec<Aabb> = (0..5000).map(around).collect();
        let context = Context::default();
        let tree = join_all(&bounds, &Stage::new(&context, "test", 0)).unwrap();
        assert!(tree.stats().depth > 4000, "the test must make a deep tree");
        let tree = Agglomerative { leaf_max: 1 }.build(&bounds, &context).unwrap();
        tree.validate(&bounds).unwrap();
        // As many of the largest boxes as there is depth for stay by themselves.
        let Kind::Inner { left } = tree.nodes[0].kind() else { panic!("a leaf") };
        let leaf = |node: &&Node| matches!(node.kind(), Kind::Leaf { .. });
        assert_eq!(tree.nodes[left..left + 2].iter().filter(leaf).count(), 1);
        assert_eq!(tree.stats().depth, crate::tree::DEPTH_MAX);
    }
}

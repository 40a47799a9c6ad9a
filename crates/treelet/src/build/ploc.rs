//! PLOC: clusters along the Morton curve join, round by round, with that neighbour in a window with
//! which they share the smallest box, if it chose them too.
//!
//! Sources: D. Meister and J. Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume
//! Hierarchy Construction", IEEE TVCG 24(3), 2018; for areas that are computed once a pair, C. Benthin,
//! R. Drabinski, L. Tessari and A. Dittebrandt, "PLOC++: Parallel Locally-Ordered Clustering for
//! Bounding Volume Hierarchy Construction Revisited", HPG 2022. Differs from them: of equal areas the
//! nearer neighbour wins, and at the same distance the pairs that tile the list, a rule that is the
//! same from both sides of a pair, so that every round joins something and a row of equal boxes
//! becomes a balanced tree; subtrees that fit become leaves without asking for the price.
//!
//! O(n r) time for a window of `r` to each side; 130 bytes a primitive of scratch, most of it the
//! nodes before leaves are filled.
//!
//! Measured as in `lbvh`, M triangles/s and cost (which is not the order of tracing speeds between
//! families of builders), by radius:
//!
//! | | coffee | kitchen | car | fur |
//! |---|---|---|---|---|
//! | 8 | 6.3, 11.3 | 4.4, 32.3 | 5.1, 69.6 | 4.6, 154 |
//! | 16 | 4.8, 11.5 | 3.8, 31.8 | 4.0, 70.1 | 4.1, 154 |
//! | 32 | 3.6, 11.5 | 2.9, 31.7 | 3.0, 70.2 | 3.4, 154 |
//! | 64 | 2.2, 11.5 | 1.9, 31.6 | 2.0, 71.0 | 2.4, 154 |
//! | `hploc` | 22, 11.6 | 23, 34.5 | 25, 70.8 | 24, 160 |
//!
//! So a wider window than 16 buys nothing here, and 8 loses 1.5 % in the kitchen, which has the
//! largest walls.

mod nearest;

use super::curve_order::Order;
use super::fill_leaves::fill_leaves;
use super::{BuildError, Builder, Info, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::math::morton::CODE_BITS;
use crate::memory;
use crate::tree::{Node, PRIMS_MAX, Tree};
use alloc::vec::Vec;
use nearest::{Nearest, RADIUS_MAX};

/// Joins neighbours in a window of the Morton curve by the area of their common box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ploc {
    /// Most primitives in a leaf, in `1..=64`. Subtrees up to this size become leaves.
    pub leaf_max: u32,
    /// How many neighbours to each side a cluster looks at, in `1..=128`. More make better trees, at
    /// a price that grows with them.
    pub radius: u32,
}

impl Ploc {
    /// Leaves of up to four, sixteen neighbours to each side.
    pub const DEFAULT: Self = Self { leaf_max: 4, radius: 16 };
}

impl Builder for Ploc {
    fn info(&self) -> Info {
        Info {
            name: "ploc",
            summary: "joins neighbours in a window of the Morton curve by the area of their box",
            source: "Meister and Bittner 2018",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        let allowed = 1.0..=RADIUS_MAX as f64;
        check_option("radius", f64::from(self.radius), allowed, "1..=128")?;
        let count = bounds.len();
        if count > PRIMS_MAX {
            return Err(BuildError::TooManyPrims { prims: count as u64 });
        }
        let stage = Stage::new(context, "build", count as u64);
        stage.check()?;
        if count == 0 {
            return Ok(Tree::default());
        }
        let tree = self.join(bounds, &stage)?;
        let tree = fill_leaves(&tree, self.leaf_max, &stage)?;
        stage.advance(1);
        Ok(tree)
    }
}

/// Clusters are looked at and joined this many at a time.
const CHUNK: usize = 4096;

impl Ploc {
    /// Joins single primitives until one cluster is left.
    fn join(&self, bounds: &[Aabb], stage: &Stage<'_>) -> Result<Tree, BuildError> {
        let count = bounds.len();
        let mut order = Order::new(bounds, CODE_BITS, stage)?;
        let mut prims = memory::try_filled(0, count, "the tree's primitives")?;
        order.find_leaves(bounds, 1, &mut prims, stage)?;
        drop(order);

        let unwritten = Node::leaf(Aabb::EMPTY, 0, 1);
        let mut clusters = memory::try_filled(unwritten, count, "clusters")?;
        load(bounds, &prims, &mut clusters, stage)?;
        let mut next = memory::try_filled(unwritten, count, "clusters")?;
        let mut partners = memory::try_filled(0_i16, count, "neighbours")?;
        // What is joined later lies above: children come after their parents.
        let mut nodes = memory::try_filled(unwritten, 2 * count - 1, "the tree's nodes")?;
        let mut free = nodes.len();

        let nearest = Nearest::new(self.radius as usize);
        let mut left = count;
        while left > 1 {
            let (from, partners) = (&clusters[..left], &mut partners[..left]);
            find_partners(&nearest, from, partners, stage)?;
            let joined = join_pairs(from, partners, &mut next, &mut nodes[..free], stage)?;
            free -= 2 * joined;
            left -= joined;
            core::mem::swap(&mut clusters, &mut next);
            stage.advance(joined as u64);
        }
        nodes[0] = clusters[0];
        debug_assert!(free == 1);
        Ok(Tree { nodes, prims })
    }
}

/// A cluster for each primitive, along the curve.
fn load(
    bounds: &[Aabb],
    prims: &[u32],
    clusters: &mut [Node],
    stage: &Stage<'_>,
) -> Result<(), Cancelled> {
    let chunks: Vec<_> = prims.chunks(CHUNK).zip(clusters.chunks_mut(CHUNK)).enumerate().collect();
    let loaded = parallel::map(chunks, |(chunk, (prims, clusters))| {
        stage.check()?;
        for ((prim, cluster), place) in prims.iter().zip(clusters).zip(chunk * CHUNK..) {
            *cluster = Node::leaf(bounds[*prim as usize], place, 1);
        }
        Ok(())
    });
    loaded.into_iter().collect()
}

/// How far from each cluster the one is that it would join.
fn find_partners(
    nearest: &Nearest,
    clusters: &[Node],
    partners: &mut [i16],
    stage: &Stage<'_>,
) -> Result<(), Cancelled> {
    let chunks: Vec<_> = partners.chunks_mut(CHUNK).enumerate().collect();
    let found = parallel::map(chunks, |(chunk, partners)| {
        stage.check()?;
        nearest.find(clusters, chunk * CHUNK, partners);
        Ok(())
    });
    found.into_iter().collect()
}

/// What becomes of a cluster in a round.
enum Fate {
    /// It and the one so far to the right become one, in its place.
    Joins(usize),
    /// The one to its left takes it.
    Leaves,
    Stays,
}

#[inline(always)]
fn fate(partners: &[i16], at: usize) -> Fate {
    let partner = partners[at];
    let agreed = partners[at.wrapping_add_signed(isize::from(partner))] == -partner;
    match partner {
        1.. if agreed => Fate::Joins(partner as usize),
        _ if agreed => Fate::Leaves,
        _ => Fate::Stays,
    }
}

/// Joins the pairs that chose each other, their nodes going to the end of `nodes`; writes what is
/// left to `next`, and returns how many pairs there were.
fn join_pairs(
    clusters: &[Node],
    partners: &[i16],
    next: &mut [Node],
    nodes: &mut [Node],
    stage: &Stage<'_>,
) -> Result<usize, Cancelled> {
    // Count what each chunk joins and keeps, so that each knows its places.
    let counts = parallel::map_chunks(partners, CHUNK, |begin, chunk| {
        let (mut joins, mut leaves) = (0, 0);
        for at in begin..begin + chunk.len() {
            match fate(partners, at) {
                Fate::Joins(_) => joins += 1,
                Fate::Leaves => leaves += 1,
                Fate::Stays => {}
            }
        }
        (joins, chunk.len() - leaves)
    });
    let joined: usize = counts.iter().map(|(joins, _)| joins).sum();

    let mut base = nodes.len() - 2 * joined;
    let (mut nodes, mut next) = (&mut nodes[base..], next);
    let mut tasks = Vec::with_capacity(counts.len());
    for (chunk, (joins, kept)) in counts.into_iter().enumerate() {
        let (pairs, rest) = core::mem::take(&mut nodes).split_at_mut(2 * joins);
        let (kept, more) = core::mem::take(&mut next).split_at_mut(kept);
        (nodes, next) = (rest, more);
        tasks.push((chunk * CHUNK, base, pairs, kept));
        base += 2 * joins;
    }
    let written = parallel::map(tasks, |(begin, mut base, pairs, kept)| {
        stage.check()?;
        let (mut pairs, mut kept) = (pairs.chunks_exact_mut(2), kept.iter_mut());
        for at in begin..clusters.len().min(begin + CHUNK) {
            let cluster = match fate(partners, at) {
                Fate::Leaves => continue,
                Fate::Stays => clusters[at],
                Fate::Joins(distance) => {
                    let (left, right) = (clusters[at], clusters[at + distance]);
                    if let Some(pair) = pairs.next() {
                        pair.copy_from_slice(&[left, right]);
                    }
                    base += 2;
                    Node::inner(left.bounds.union(&right.bounds), base - 2)
                }
            };
            if let Some(place) = kept.next() {
                *place = cluster;
            }
        }
        Ok(())
    });
    written.into_iter().collect::<Result<(), _>>()?;
    Ok(joined)
}

#[cfg(test)]
mod tests {
    use super::super::samples::random_boxes;
    use super::*;

    /// Area, distance, tile: what makes one pair better than another.
    fn price(clusters: &[Node], a: usize, b: usize) -> (u32, usize, usize) {
        let (left, distance) = (a.min(b), a.abs_diff(b));
        let area = nearest::area(&clusters[a].bounds, &clusters[b].bounds);
        (area.to_bits(), distance, left / distance % 2)
    }

    /// The definition, pair by pair.
    fn sequential(bounds: &[Aabb], prims: &[u32], radius: usize) -> Vec<Node> {
        let leaf = |(place, prim): (usize, &u32)| Node::leaf(bounds[*prim as usize], place, 1);
        let mut clusters: Vec<Node> = prims.iter().enumerate().map(leaf).collect();
        let mut nodes = Vec::new();
        let all = 2 * bounds.len() - 1;
        while clusters.len() > 1 {
            let choice = |a: usize| {
                let around = a.saturating_sub(radius)..clusters.len().min(a + radius + 1);
                around.filter(|&b| b != a).min_by_key(|&b| price(&clusters, a, b)).unwrap()
            };
            let choices: Vec<usize> = (0..clusters.len()).map(choice).collect();
            let agreed = |a: &usize| choices[choices[*a]] == *a;
            let lefts: Vec<usize> = (0..clusters.len()).filter(agreed).collect();
            let lefts: Vec<usize> = lefts.into_iter().filter(|&a| choices[a] > a).collect();
            assert!(!lefts.is_empty(), "a round in which nothing is joined");
            let first = all - nodes.len() - 2 * lefts.len();
            let mut pairs = Vec::new();
            for (nth, &a) in lefts.iter().enumerate() {
                let (left, right) = (clusters[a], clusters[choices[a]]);
                pairs.extend([left, right]);
                clusters[a] = Node::inner(left.bounds.union(&right.bounds), first + 2 * nth);
            }
            nodes.splice(0..0, pairs);
            let gone: Vec<usize> = lefts.iter().map(|&a| choices[a]).collect();
            let mut at = 0;
            clusters.retain(|_| {
                at += 1;
                !gone.contains(&(at - 1))
            });
        }
        nodes.insert(0, clusters[0]);
        nodes
    }

    fn scaled(bounds: &[Aabb], scale: f32) -> Vec<Aabb> {
        let large = |b: &Aabb| Aabb { lo: b.lo.map(|x| x * scale), hi: b.hi.map(|x| x * scale) };
        bounds.iter().map(large).collect()
    }

    #[test]
    fn joins_what_the_sequential_twin_joins() {
        let context = Context::default();
        let stage = Stage::new(&context, "test", 0);
        let random = random_boxes(9000, 0.1, 1.0e6);
        let row = |i: u32| Aabb { lo: [i as f32, 0.0, 0.0], hi: [i as f32 + 1.0, 1.0, 0.0] };
        let nested = |i: i32| Aabb { lo: [-(1.01_f32.powi(i)); 3], hi: [1.01_f32.powi(i); 3] };
        for (name, bounds) in [
            ("random", random.clone()),
            ("on a lattice", random_boxes(9000, 0.5, 16.0)),
            ("a row of equal boxes", (0..1000).map(row).collect()),
            ("all equal", alloc::vec![row(5); 5000]),
            ("nested", (0..400).map(nested).collect()),
            ("beyond f32", scaled(&random[..2000], f32::MAX / 4.0)),
            ("near nothing", scaled(&random[..2000], 1.0e-38)),
            ("one", alloc::vec![row(0)]),
            ("two", random_boxes(2, 0.1, 1.0e6)),
            ("three", random_boxes(3, 0.1, 1.0e6)),
            ("257", random_boxes(257, 0.1, 1.0e6)),
        ] {
            for radius in [1, 3, 16, 128] {
                // Windows as wide as half the list take the twin a while.
                let bounds = if radius == 128 { &bounds[..bounds.len().min(600)] } else { &bounds };
                let tree = Ploc { leaf_max: 1, radius }.join(bounds, &stage).unwrap();
                let expected = sequential(bounds, &tree.prims, radius as usize);
                assert!(tree.nodes == expected, "{name}, radius {radius}");
                tree.validate(bounds).unwrap_or_else(|error| {
                    // What is too deep is mended later.
                    assert!(matches!(error, crate::tree::TreeError::Depth { .. }), "{error}");
                });
            }
        }
    }

    #[test]
    fn equal_boxes_do_not_become_chains() {
        let bounds = alloc::vec![Aabb { lo: [0.0; 3], hi: [1.0; 3] }; 1 << 14];
        for radius in [1, 2, 3, 16] {
            let tree = Ploc { leaf_max: 1, radius }.build(&bounds, &Context::default()).unwrap();
            assert_eq!(tree.stats().depth, 15, "a balanced tree for radius {radius}");
        }
    }

    #[test]
    fn wider_windows_make_better_trees() {
        let bounds = random_boxes(20_000, 0.1, 1.0e6);
        let cost = |radius| {
            let ploc = Ploc { radius, ..Ploc::DEFAULT };
            ploc.build(&bounds, &Context::default()).unwrap().stats().sah
        };
        let [one, four, sixteen] = [1, 4, 16].map(cost);
        assert!(sixteen < four && four < one, "{one}, {four}, {sixteen}");
    }

    #[test]
    fn options_out_of_range_are_named() {
        for radius in [0, 129, u32::MAX] {
            let error = Ploc { radius, ..Ploc::DEFAULT }.build(&[], &Context::default());
            let value = f64::from(radius);
            assert_eq!(
                error,
                Err(BuildError::Option { option: "radius", value, allowed: "1..=128" })
            );
        }
        assert!(Ploc { leaf_max: 0, ..Ploc::DEFAULT }.build(&[], &Context::default()).is_err());
    }
}

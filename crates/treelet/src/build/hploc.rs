//! H-PLOC: neighbours on the Morton curve are joined with whom they share the smallest box, range by
//! range of the curve's own hierarchy. treelet's fast builder.
//!
//! Sources: C. Benthin, D. Meister, J. Barczak, R. Mehalwal, J. Tsakok and A. Kensler, "H-PLOC:
//! Hierarchical Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction",
//! Proceedings of the ACM on Computer Graphics and Interactive Techniques 7(3), 2024; D. Meister and
//! J. Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction",
//! IEEE TVCG 24(3), 2018. Differs from them: it starts from leaves that the curve cut, not from
//! primitives; ranges are visited depth first on one stack, so that their lists of clusters are
//! neighbours in memory and nothing is copied; ties are settled by a rule that is the same from both
//! sides of a pair.
//!
//! Tried and lost: the same code compiled for AVX2 and AVX-512, which takes a kitchen as long and a car
//! 9 % longer: longer stores are waited for where the next loads are shifted against them.
//!
//! O(n) time. A tree too deep (ever larger boxes side by side) is given up for that of `lbvh`.

use super::bottom_up::{self, Below, Cluster, Cut, Join, Part};
use super::lbvh::Lbvh;
use super::{BuildError, Builder, Info, check_leaf_max};
use crate::bounds::Aabb;
use crate::context::Context;
use crate::math::morton::CODE_BITS;
use crate::tree::{DEPTH_MAX, Tree};
use alloc::vec::Vec;
use core::sync::atomic::AtomicU64;

/// Joins neighbours on the Morton curve by the area of their common box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hploc {
    /// Most primitives in a leaf, in `1..=64`. Ranges of the curve up to this size are leaves.
    pub leaf_max: u32,
}

impl Hploc {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4 };
}

impl Builder for Hploc {
    fn info(&self) -> Info {
        Info {
            name: "hploc",
            summary: "joins neighbours on the Morton curve by the area of their common box",
            source: "Benthin et al. 2024; Meister and Bittner 2018",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        let cut = Cut { leaf_max: self.leaf_max, code_bits: CODE_BITS };
        let (tree, depth) = bottom_up::build(self, cut, bounds, context)?;
        if depth > DEPTH_MAX {
            return Lbvh { leaf_max: self.leaf_max, ..Lbvh::DEFAULT }.build(bounds, context);
        }
        Ok(tree)
    }
}

/// A range of the curve is handed upward with at most this many clusters.
const HANDED_MAX: usize = 16;
/// Most clusters that are joined at once: two lists.
const JOINED_MAX: usize = 2 * HANDED_MAX;
/// How many neighbours on each side a cluster looks at. 8, as in the paper, took 7 to 12 percent more
/// time; its cost by the surface area heuristic was 4 percent lower in a kitchen, equal to within
/// one percent in a car and in hair, and 2 to 4 percent higher in terrain and among random triangles.
const RADIUS: usize = 4;
/// How many clusters a piece hands to the top of the tree.
const KEPT: usize = 8;

/// Ranges that wait for their right sibling.
#[derive(Default)]
pub(super) struct Open {
    /// The lists of all ranges, one after the other.
    clusters: Vec<Cluster>,
    /// Where the list of each begins, and at which level it parts from the next; levels rise.
    ranges: Vec<(usize, u8)>,
}

impl Join for Hploc {
    type Open = Open;

    #[inline(always)]
    fn push(&self, open: &mut Open, part: &Part<'_>, below: &mut Below<'_>) {
        let mut begin = open.clusters.len();
        open.clusters.extend_from_slice(part.clusters);
        while let Some(&(left, parts)) = open.ranges.last()
            && parts > part.level
        {
            open.ranges.pop();
            begin = left;
            if open.clusters.len() - begin > HANDED_MAX {
                let count = reduce(&mut open.clusters[begin..], HANDED_MAX, 0, below);
                open.clusters.truncate(begin + count);
            }
        }
        open.ranges.push((begin, part.level));
    }

    fn finish(&self, open: &mut Open, count: usize, below: &mut Below<'_>) -> Vec<Cluster> {
        // Level 0 ended every range.
        let left = reduce(&mut open.clusters, count, count, below);
        open.clusters.truncate(left);
        open.ranges.clear();
        core::mem::take(&mut open.clusters)
    }

    fn keep(&self, leaves: &mut [AtomicU64]) -> usize {
        leaves.len().min(KEPT)
    }
}

/// Joins clusters until at most `most` are left, never fewer than `least`; returns how many.
#[inline(never)]
fn reduce(clusters: &mut [Cluster], most: usize, least: usize, below: &mut Below<'_>) -> usize {
    let mut count = clusters.len();
    let mut table = Table::EMPTY;
    while count > most {
        table.fill(&clusters[..count]);
        let nearest = table.nearest(count);
        count = join_pairs(&mut clusters[..count], &nearest, count - least, below);
    }
    count
}

/// A pair of neighbours: the area of their common box above a code for the pair.
///
/// The code is the same from both sides and differs between the pairs of one cluster, so the least
/// pair of all is the choice of both its members, and every round joins at least one. Of equal areas
/// the nearer pair wins, and at the same distance the pairs that tile the list: equal boxes in a row
/// become a balanced tree, not a chain.
type Pair = f32;

/// Bits of an area that give way to the code: two pairs of a cluster at each distance.
const CODE_MASK: u32 = 2 * RADIUS as u32 - 1;
const _: () = assert!(RADIUS.is_power_of_two(), "codes fill their bits");

/// `CODES[distance - 1][left end]`: a cluster is the left end of one pair at a distance and the
/// right end of another, which begins at the tile before.
const CODES: [[u32; JOINED_MAX]; RADIUS] = {
    let mut codes = [[0; JOINED_MAX]; RADIUS];
    let mut distance = 1;
    while distance <= RADIUS {
        let mut left = 0;
        while left < JOINED_MAX {
            codes[distance - 1][left] = 2 * (distance as u32 - 1) + (left / distance % 2) as u32;
            left += 1;
        }
        distance += 1;
    }
    codes
};

/// Lanes of the loops over a table: two registers of the baseline.
const LANES: usize = 8;
/// A table and what pairs reach beyond it.
const PADDED: usize = JOINED_MAX + RADIUS;

/// The boxes of some clusters, one array a coordinate, with boxes of everything behind them, which
/// nobody chooses. Lower and upper faces alternate: `lo x, hi x, lo y, ...`.
struct Table {
    faces: [[f32; PADDED]; 6],
    /// `[distance - 1][RADIUS + left end]`, with pairs that nobody chooses in front.
    pairs: [[Pair; RADIUS + JOINED_MAX]; RADIUS],
}

impl Table {
    const EMPTY: Self =
        Self { faces: [[0.0; PADDED]; 6], pairs: [[Pair::INFINITY; RADIUS + JOINED_MAX]; RADIUS] };

    fn fill(&mut self, clusters: &[Cluster]) {
        for (at, cluster) in clusters.iter().enumerate() {
            let Aabb { lo, hi } = cluster.root.bounds;
            for axis in 0..3 {
                self.faces[2 * axis][at] = lo[axis];
                self.faces[2 * axis + 1][at] = hi[axis];
            }
        }
        for axis in 0..3 {
            self.faces[2 * axis][clusters.len()..].fill(f32::NEG_INFINITY);
            self.faces[2 * axis + 1][clusters.len()..].fill(f32::INFINITY);
        }
    }

    /// The pair that each cluster would choose.
    fn nearest(&mut self, count: usize) -> [Pair; JOINED_MAX] {
        let mut nearest = [Pair::INFINITY; JOINED_MAX];
        for block in (0..count).step_by(LANES) {
            self.measure(block);
        }
        for block in (0..count).step_by(LANES) {
            let mut least = [Pair::INFINITY; LANES];
            for distance in 1..=RADIUS {
                let pairs = &self.pairs[distance - 1];
                let as_left: [Pair; LANES] = window(pairs, RADIUS + block);
                let as_right: [Pair; LANES] = window(pairs, RADIUS + block - distance);
                for lane in 0..LANES {
                    least[lane] = lesser(as_left[lane], least[lane]);
                    least[lane] = lesser(as_right[lane], least[lane]);
                }
            }
            nearest[block..block + LANES].copy_from_slice(&least);
        }
        nearest
    }

    /// The pairs whose left ends are in a block.
    #[inline(always)]
    fn measure(&mut self, block: usize) {
        let here: [[f32; LANES]; 6] = self.block(block);
        for distance in 1..=RADIUS {
            let there = self.block(block + distance);
            let codes: [u32; LANES] = window(&CODES[distance - 1], block);
            let mut out = [0.0; LANES];
            for lane in 0..LANES {
                let length = |axis: usize| {
                    let lo = lesser(here[2 * axis][lane], there[2 * axis][lane]);
                    let hi = greater(here[2 * axis + 1][lane], there[2 * axis + 1][lane]);
                    hi - lo
                };
                let (x, y, z) = (length(0), length(1), length(2));
                let area = x * y + (x + y) * z;
                // An infinite area becomes NaN, or stays infinite: neither is less than anything.
                out[lane] = Pair::from_bits(area.to_bits() & !CODE_MASK | codes[lane]);
            }
            self.pairs[distance - 1][RADIUS + block..][..LANES].copy_from_slice(&out);
        }
    }

    #[inline(always)]
    fn block(&self, first: usize) -> [[f32; LANES]; 6] {
        let face = |at: usize| window(&self.faces[at], first);
        [face(0), face(1), face(2), face(3), face(4), face(5)]
    }
}

/// `N` neighbouring items.
#[inline(always)]
fn window<T: Copy + Default, const N: usize>(items: &[T], first: usize) -> [T; N] {
    let mut out = [T::default(); N];
    out.copy_from_slice(&items[first..first + N]);
    out
}

/// The lesser one, and `b` if `a` is NaN.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater one.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Joins, from the left, up to `limit` pairs whose members chose each other; the joined one takes the
/// left one's place. Returns how many clusters are left.
fn join_pairs(
    clusters: &mut [Cluster],
    nearest: &[Pair; JOINED_MAX],
    limit: usize,
    below: &mut Below<'_>,
) -> usize {
    // Mark the left members, without a branch that would often be guessed wrong.
    let mut lefts = 0_u32;
    for at in 0..clusters.len() {
        let pair = nearest[at].to_bits();
        let distance = ((pair & CODE_MASK) / 2) as usize;
        let other = at + distance + 1;
        // Nobody's choice looks like that of 0 and 1, 2 and 3, ...: without areas, they join.
        let is_left = CODES[distance][at] == pair & CODE_MASK;
        let agreed = nearest[other % JOINED_MAX].to_bits() == pair;
        lefts |= u32::from(is_left & agreed & (other < clusters.len())) << at;
    }

    // Join, then close the gaps that the right members leave.
    let mut gone = 0_u32;
    for _ in 0..limit.min(lefts.count_ones() as usize) {
        let at = lefts.trailing_zeros() as usize;
        lefts &= lefts - 1;
        let other = at + ((nearest[at].to_bits() & CODE_MASK) / 2) as usize + 1;
        clusters[at] = below.join(&clusters[at], &clusters[other]);
        gone |= 1 << other;
    }
    let mut count = 0;
    for at in 0..clusters.len() {
        clusters[count] = clusters[at];
        count += usize::from(gone >> at & 1 == 0);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::super::samples::random_boxes;
    use super::*;
    use core::ops::Range;

    /// The definition, range by range and pair by pair.
    struct Naive;

    impl Join for Naive {
        /// Groups and the levels at which they part from the next.
        type Open = Vec<(Vec<Cluster>, u8)>;

        fn push(&self, open: &mut Self::Open, part: &Part<'_>, _: &mut Below<'_>) {
            open.push((part.clusters.to_vec(), part.level));
        }

        fn finish(
            &self,
            open: &mut Self::Open,
            count: usize,
            below: &mut Below<'_>,
        ) -> Vec<Cluster> {
            let groups = core::mem::take(open);
            let all = range(&groups, 0..groups.len(), below);
            naive_reduce(all, count, count, below)
        }

        fn keep(&self, leaves: &mut [AtomicU64]) -> usize {
            leaves.len().min(KEPT)
        }
    }

    fn range(
        groups: &[(Vec<Cluster>, u8)],
        of: Range<usize>,
        below: &mut Below<'_>,
    ) -> Vec<Cluster> {
        if of.len() == 1 {
            return groups[of.start].0.clone();
        }
        // The highest cut is the one of least level.
        let cuts = of.start..of.end - 1;
        let cut = cuts.min_by_key(|&at| groups[at].1).unwrap() + 1;
        let mut all = range(groups, of.start..cut, below);
        all.extend(range(groups, cut..of.end, below));
        if all.len() > HANDED_MAX { naive_reduce(all, HANDED_MAX, 0, below) } else { all }
    }

    /// Area, distance, tile: what makes one pair better than another.
    fn price(clusters: &[Cluster], a: usize, b: usize) -> (u32, usize, usize) {
        let (left, distance) = (a.min(b), a.abs_diff(b));
        let around = clusters[a].root.bounds.union(&clusters[b].root.bounds);
        let [x, y, z] = [0, 1, 2].map(|axis| around.hi[axis] - around.lo[axis]);
        let area = x * y + (x + y) * z;
        (area.to_bits() >> 3, distance, left / distance % 2)
    }

    fn naive_reduce(
        mut clusters: Vec<Cluster>,
        most: usize,
        least: usize,
        below: &mut Below<'_>,
    ) -> Vec<Cluster> {
        while clusters.len() > most {
            let choice = |a: usize| {
                let around = a.saturating_sub(RADIUS)..clusters.len().min(a + RADIUS + 1);
                around.filter(|&b| b != a).min_by_key(|&b| price(&clusters, a, b)).unwrap()
            };
            let choices: Vec<usize> = (0..clusters.len()).map(choice).collect();
            let mut limit = clusters.len() - least;
            let mut next = Vec::new();
            let mut gone = alloc::vec![false; clusters.len()];
            for a in 0..clusters.len() {
                let b = choices[a];
                if gone[a] {
                    continue;
                }
                if b > a && choices[b] == a && limit > 0 {
                    limit -= 1;
                    gone[b] = true;
                    next.push(below.join(&clusters[a], &clusters[b]));
                } else {
                    next.push(clusters[a]);
                }
            }
            clusters = next;
        }
        clusters
    }

    #[test]
    fn joins_what_the_definition_joins() {
        let context = Context::default();
        let grid = |i: u32| {
            let lo = [(i % 128) as f32, (i / 128) as f32, 0.0];
            Aabb { lo, hi: [lo[0] + 1.0, lo[1] + 1.0, 0.0] }
        };
        for (name, bounds) in [
            ("random", random_boxes(20_000, 0.1, 1.0e6)),
            ("on a lattice", random_boxes(20_000, 0.5, 16.0)),
            ("a grid of equal boxes", (0..128 * 128).map(grid).collect()),
            ("all equal", alloc::vec![grid(5); 5000]),
            ("two", random_boxes(2, 0.1, 1.0e6)),
            ("nine", random_boxes(9, 0.1, 1.0e6)),
        ] {
            for leaf_max in [1, 4] {
                let cut = Cut { leaf_max, code_bits: CODE_BITS };
                let (tree, depth) =
                    bottom_up::build(&Hploc::DEFAULT, cut, &bounds, &context).unwrap();
                let (expected, _) = bottom_up::build(&Naive, cut, &bounds, &context).unwrap();
                assert!(tree == expected, "{name}, leaves of {leaf_max}");
                assert_eq!(depth, tree.stats().depth, "{name}, leaves of {leaf_max}");
                tree.validate(&bounds).unwrap();
            }
        }
    }

    #[test]
    fn equal_boxes_do_not_become_chains() {
        let bounds = alloc::vec![Aabb { lo: [0.0; 3], hi: [1.0; 3] }; 1 << 14];
        let tree = Hploc { leaf_max: 1 }.build(&bounds, &Context::default()).unwrap();
        assert_eq!(tree.stats().depth, 15, "a balanced tree");
    }

    #[test]
    fn what_would_be_too_deep_is_left_to_lbvh() {
        // Each box around all before it: a chain, sixteen deep for every level of the curve.
        let around = |i: i32| {
            let half = 1.01_f32.powi(i - 2500);
            Aabb { lo: [-half; 3], hi: [half; 3] }
        };
        let bounds: Vec<Aabb> = (0..5000).map(around).collect();
        let context = Context::default();
        let cut = Cut { leaf_max: 1, code_bits: CODE_BITS };
        let (_, depth) = bottom_up::build(&Hploc::DEFAULT, cut, &bounds, &context).unwrap();
        assert!(depth > DEPTH_MAX, "the test must make a deep tree: {depth}");
        let tree = Hploc { leaf_max: 1 }.build(&bounds, &context).unwrap();
        tree.validate(&bounds).unwrap();
        let lbvh = Lbvh { leaf_max: 1, ..Lbvh::DEFAULT };
        assert_eq!(tree, lbvh.build(&bounds, &context).unwrap());
    }

    #[test]
    fn areas_beyond_f32_are_no_trouble() {
        for scale in [f32::MAX / 4.0, 1.0e25, 1.0e-30, 1.0e-38] {
            let large =
                |b: &Aabb| Aabb { lo: b.lo.map(|x| x * scale), hi: b.hi.map(|x| x * scale) };
            let bounds: Vec<Aabb> = random_boxes(3000, 0.1, 1.0e6).iter().map(large).collect();
            let tree = Hploc::DEFAULT.build(&bounds, &Context::default()).unwrap();
            tree.validate(&bounds).unwrap_or_else(|error| panic!("{scale:e}: {error}"));
        }
    }
}

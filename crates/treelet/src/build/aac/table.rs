//! A list of clusters that is clustered greedily: the pair with the smallest box first.
//!
//! Each cluster knows the best pair that it makes with those before it in the list, and with those
//! that share its block of eight; so the least of those pairs is the least of all. A joined pair takes
//! the place of its right member. No pair gets better by that: a box around more is no smaller. So who
//! lost its partner looks again only when the pair it had would be the best of all.

use super::super::bottom_up::{Below, Cluster};
use crate::bounds::Aabb;
use crate::simd::{Floats, Kernel, Simd};
use alloc::vec::Vec;

/// Lanes of a vector, and clusters of a block.
const LANES: usize = 8;

/// A pair's area, times a little more the higher its trees are together.
///
/// Of equal areas the lower pair wins: equal boxes become a balanced tree, not a chain.
type Price = f32;

/// What a level of height adds to 1: eight times what f32 can tell from 1.
const HEIGHT_WEIGHT: f32 = 8.0 * f32::EPSILON;
/// The height of a cluster counts up to this one.
const HEIGHT_MAX: u32 = 15;
/// Beyond it all areas are equal; NaN (an infinite edge times an empty one) counts as that.
const AREA_MAX: f32 = f32::MAX / 4.0;
/// Added to areas, so that heights tell where there is none.
const AREA_MIN: f32 = f32::MIN_POSITIVE;
/// The weight of places where no cluster is: no pair is worse.
const NOBODY: f32 = f32::INFINITY;

/// What makes a pair with oneself worse than all others, by lane.
const ONESELF: [[f32; LANES]; LANES] = {
    let mut out = [[0.0; LANES]; LANES];
    let mut lane = 0;
    while lane < LANES {
        out[lane][lane] = NOBODY;
        lane += 1;
    }
    out
};

/// Eight clusters.
#[derive(Clone, Copy)]
struct Block {
    /// Lower and upper faces alternate: `lo x, hi x, lo y, ...`.
    faces: [[f32; LANES]; 6],
    /// Of their heights.
    weights: [f32; LANES],
}

impl Block {
    const EMPTY: Self = Self { faces: [[0.0; LANES]; 6], weights: [NOBODY; LANES] };
}

/// One cluster in every lane.
#[derive(Clone, Copy)]
struct One<S: Simd> {
    lo: [S::F8; 3],
    hi: [S::F8; 3],
    /// Of its height, and 1.
    weight: S::F8,
}

impl<S: Simd> One<S> {
    #[inline(always)]
    fn new(simd: S, block: &Block, lane: usize) -> Self {
        let Block { faces: [a, b, c, d, e, f], weights } = block;
        Self {
            lo: [
                S::F8::splat(simd, a[lane]),
                S::F8::splat(simd, c[lane]),
                S::F8::splat(simd, e[lane]),
            ],
            hi: [
                S::F8::splat(simd, b[lane]),
                S::F8::splat(simd, d[lane]),
                S::F8::splat(simd, f[lane]),
            ],
            weight: S::F8::splat(simd, 1.0 + weights[lane]),
        }
    }

    /// Of the pairs with those in a block.
    #[inline(always)]
    fn prices(&self, simd: S, block: &Block) -> S::F8 {
        let (x, y, z) =
            (self.edge(simd, block, 0), self.edge(simd, block, 1), self.edge(simd, block, 2));
        let area = x.mul(y).add(x.add(y).mul(z));
        let area = area.min(S::F8::splat(simd, AREA_MAX)).add(S::F8::splat(simd, AREA_MIN));
        area.mul(self.weight.add(S::F8::load(simd, &block.weights)))
    }

    #[inline(always)]
    fn edge(&self, simd: S, block: &Block, axis: usize) -> S::F8 {
        let lo = self.lo[axis].min(S::F8::load(simd, &block.faces[2 * axis]));
        let hi = self.hi[axis].max(S::F8::load(simd, &block.faces[2 * axis + 1]));
        hi.sub(lo)
    }
}

/// Reused from list to list.
#[derive(Default)]
pub(super) struct Table {
    blocks: Vec<Block>,
    /// Of the best pair that each cluster knows.
    prices: Vec<[Price; LANES]>,
    /// The other one of that pair; [`LOST`] if it is to be looked for again, which no price gets better
    /// by; [`NONE`].
    partners: Vec<u32>,
    /// Of the pairs that one cluster makes.
    row: Vec<[Price; LANES]>,
}

/// No partner.
const NONE: u32 = u32::MAX;
/// No partner any more.
const LOST: u32 = u32::MAX - 1;

/// Joins clusters until `most` are left, in front; returns how many. The same at every level.
pub(super) struct Reduce<'a, 'b> {
    pub(super) table: &'a mut Table,
    pub(super) clusters: &'a mut [Cluster],
    pub(super) most: usize,
    pub(super) below: &'a mut Below<'b>,
}

impl Kernel for Reduce<'_, '_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> usize {
        let Self { table, clusters, most, below } = self;
        table.fill(clusters);
        for at in 0..clusters.len() {
            table.search(simd, at);
        }
        for _ in most..clusters.len() {
            let pair = table.best(simd);
            let (left, right) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            clusters[right] = below.join(&clusters[left], &clusters[right]);
            table.put(right, &clusters[right]);
            table.remove(left);
            table.search(simd, right);
            let lost = [left as u32, right as u32];
            for partner in &mut table.partners[left / LANES * LANES..] {
                *partner = if lost.contains(partner) { LOST } else { *partner };
            }
        }

        // Close the gaps.
        let mut count = 0;
        for at in 0..clusters.len() {
            clusters[count] = clusters[at];
            count += usize::from(table.blocks[at / LANES].weights[at % LANES] != NOBODY);
        }
        count
    }
}

impl Table {
    #[inline(always)]
    fn fill(&mut self, clusters: &[Cluster]) {
        let blocks = clusters.len().div_ceil(LANES);
        self.blocks.clear();
        self.blocks.resize(blocks, Block::EMPTY);
        self.prices.clear();
        self.prices.resize(blocks, [Price::INFINITY; LANES]);
        self.partners.clear();
        self.partners.resize(clusters.len(), NONE);
        self.row.resize(self.row.len().max(blocks), [0.0; LANES]);
        for (at, cluster) in clusters.iter().enumerate() {
            self.put(at, cluster);
        }
    }

    #[inline(always)]
    fn put(&mut self, at: usize, cluster: &Cluster) {
        let (block, lane) = (&mut self.blocks[at / LANES], at % LANES);
        let Aabb { lo, hi } = cluster.root.bounds;
        for axis in 0..3 {
            block.faces[2 * axis][lane] = lo[axis];
            block.faces[2 * axis + 1][lane] = hi[axis];
        }
        block.weights[lane] = cluster.height.min(HEIGHT_MAX) as f32 * HEIGHT_WEIGHT;
    }

    #[inline(always)]
    fn remove(&mut self, at: usize) {
        self.blocks[at / LANES].weights[at % LANES] = NOBODY;
        self.prices[at / LANES][at % LANES] = Price::INFINITY;
        self.partners[at] = NONE;
    }

    /// Finds the best pair that a cluster knows; of equal ones that with the last other.
    #[inline(always)]
    fn search<S: Simd>(&mut self, simd: S, at: usize) {
        let (own, lane) = (at / LANES, at % LANES);
        let block = &self.blocks[own];
        let one = One::new(simd, block, lane);
        let prices = one.prices(simd, block).add(S::F8::load(simd, &ONESELF[lane]));
        let mut least = prices;
        self.row[own] = prices.lanes();
        for (block, out) in self.blocks[..own].iter().zip(&mut self.row) {
            let prices = one.prices(simd, block);
            *out = prices.lanes();
            least = prices.min(least);
        }
        let least = least_lane(least.lanes());
        self.prices[own][lane] = least;
        if least == Price::INFINITY {
            self.partners[at] = NONE;
            return;
        }
        for block in (0..=own).rev() {
            let found = S::F8::load(simd, &self.row[block]).le(S::F8::splat(simd, least));
            if found != 0 {
                self.partners[at] = (block * LANES) as u32 + found.ilog2();
                break;
            }
        }
    }

    /// The best pair; of equal ones that which the first cluster knows.
    #[inline(always)]
    fn best<S: Simd>(&mut self, simd: S) -> [usize; 2] {
        loop {
            let at = self.least(simd);
            let partner = self.partners[at];
            if partner != LOST {
                return [at, partner as usize];
            }
            self.search(simd, at);
        }
    }

    /// Who knows the best pair, or knew it.
    #[inline(always)]
    fn least<S: Simd>(&self, simd: S) -> usize {
        let mut least = S::F8::splat(simd, Price::INFINITY);
        for prices in &self.prices {
            least = S::F8::load(simd, prices).min(least);
        }
        let least = least_lane(least.lanes());
        for (block, prices) in self.prices.iter().enumerate() {
            let found = S::F8::load(simd, prices).le(S::F8::splat(simd, least));
            if found != 0 {
                return block * LANES + found.trailing_zeros() as usize;
            }
        }
        0
    }
}

#[inline(always)]
fn least_lane(lanes: [f32; LANES]) -> f32 {
    let [a, b, c, d, e, f, g, h] = lanes;
    lesser(lesser(lesser(a, b), lesser(c, d)), lesser(lesser(e, f), lesser(g, h)))
}

/// The lesser one.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Level;
    use crate::tree::Node;

    /// The definition: of all pairs the best, again and again; of equal ones that which the first
    /// cluster knows, with the last other that it knows.
    fn naive(clusters: &[Cluster], most: usize, below: &mut Below<'_>) -> Vec<Cluster> {
        let mut slots: Vec<Option<Cluster>> = clusters.iter().copied().map(Some).collect();
        let price = |a: &Cluster, b: &Cluster| {
            let around = a.root.bounds.union(&b.root.bounds);
            let [x, y, z] = [0, 1, 2].map(|axis| around.hi[axis] - around.lo[axis]);
            let area = x * y + (x + y) * z;
            let area = if area < f32::MAX / 4.0 { area } else { f32::MAX / 4.0 };
            let height = (a.height.min(15) + b.height.min(15)) as f32;
            (area + f32::MIN_POSITIVE) * (1.0 + height * 8.0 * f32::EPSILON)
        };
        for _ in most..clusters.len() {
            let mut best = None;
            for one in 0..slots.len() {
                let known = slots.len().min((one / 8 + 1) * 8);
                for other in (0..known).rev().filter(|&other| other != one) {
                    if let (Some(a), Some(b)) = (&slots[one], &slots[other])
                        && best.is_none_or(|(least, _, _)| price(a, b) < least)
                    {
                        best = Some((price(a, b), one.min(other), one.max(other)));
                    }
                }
            }
            let (_, left, right) = best.unwrap();
            let joined = below.join(&slots[left].take().unwrap(), &slots[right].unwrap());
            slots[right] = Some(joined);
        }
        slots.into_iter().flatten().collect()
    }

    #[test]
    fn joins_what_the_definition_joins() {
        let mut state = 1_u32;
        let mut random = |steps: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 8) as f32 / 16_777_216.0 * steps).trunc() / steps
        };
        let mut table = Table::default();
        for (count, most) in [(2, 1), (3, 2), (8, 1), (9, 4), (20, 10), (64, 30), (150, 1)] {
            for (steps, size, scale) in [
                (1.0e6, 0.3, 1.0),
                (4.0, 1.0, 1.0),
                (1.0, 0.0, 1.0),
                (1.0e6, 0.3, f32::MAX / 2.0),
                (1.0e6, 0.3, 1.0e-30),
            ] {
                let mut one = |place: usize| {
                    let lo = [(); 3].map(|()| random(steps));
                    let hi = lo.map(|x| (x + size * random(steps)) * scale);
                    let bounds = Aabb { lo: lo.map(|x| x * scale), hi };
                    Cluster { root: Node::leaf(bounds, place, 1), height: place as u32 % 3 }
                };
                let clusters: Vec<Cluster> = (0..count).map(&mut one).collect();
                let empty = alloc::vec![Node::leaf(Aabb::EMPTY, 0, 1); 2 * (count - most)];
                let mut expected = empty.clone();
                let naive = naive(&clusters, most, &mut Below::new(&mut expected, 1));
                let roots = |list: &[Cluster]| -> Vec<(Node, u32)> {
                    list.iter().map(|cluster| (cluster.root, cluster.height)).collect()
                };
                for level in Level::ALL.iter().filter_map(|level| level.checked()) {
                    let (mut nodes, mut list) = (empty.clone(), clusters.clone());
                    let below = &mut Below::new(&mut nodes, 1);
                    let left =
                        level.run(Reduce { table: &mut table, clusters: &mut list, most, below });
                    let who = alloc::format!("{count} to {most}, {steps} steps, scale {scale:e}");
                    assert!(nodes == expected, "{who}");
                    assert_eq!(roots(&list[..left]), roots(&naive), "{who}");
                }
            }
        }
    }
}

//! The cheapest binary tree over up to seven boxes, for eight sets of boxes at once.
//!
//! Source: Karras and Aila 2013, section 3.2. The cost of a set is its area and the least that two
//! parts of it cost together, or only its area if its primitives are few enough to be tested at once; a
//! set's parts have smaller numbers, so one pass over the numbers knows all that it needs. What hangs at
//! the treelet's edge and is larger than such a block costs the same in every tree, so it counts as
//! nothing.
//!
//! Differs from the paper: lanes are treelets, so every load, sum and minimum is one of whole vectors.
//!
//! Cost: 127 areas and 966 pairs of parts.

use super::treelet::LEAVES;
use crate::simd::{Floats, Kernel, Simd};

/// Treelets side by side.
pub(super) const LANES: usize = 8;

/// Sets of a treelet's leaves, by their bits.
const SETS: usize = 1 << LEAVES;

/// The ways to part a set in two, of all sets together: (3^7 - 2 * 2^7 + 1) / 2.
const PARTS: usize = 966;

/// A number of each treelet.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct Lanes([f32; LANES]);

impl Lanes {
    const ZERO: Self = Self([0.0; LANES]);
}

/// The sets of each treelet, and what they cost.
pub(super) struct Sets {
    /// Of each leaf: the least corner, the greatest, and how many primitives are in it.
    leaves: [[Lanes; 7]; LEAVES],
    costs: [Lanes; SETS],
    /// What two parts of a set cost together at least.
    least: [Lanes; SETS],
    /// Sets of up to so many primitives are tested at once.
    block: f32,
}

impl Sets {
    pub(super) fn new(block: u32) -> Self {
        Self {
            leaves: [[Lanes::ZERO; 7]; LEAVES],
            costs: [Lanes::ZERO; SETS],
            least: [Lanes::ZERO; SETS],
            block: block as f32,
        }
    }

    /// Says where a leaf of a treelet is, in units of about the treelet's size, and what is below.
    pub(super) fn put(&mut self, [lane, leaf]: [usize; 2], [lo, hi]: [[f32; 3]; 2], prims: u32) {
        let numbers = [lo[0], lo[1], lo[2], hi[0], hi[1], hi[2], prims as f32];
        for (lanes, number) in self.leaves[leaf].iter_mut().zip(numbers) {
            lanes.0[lane] = number;
        }
        // What is larger than a block costs the same wherever it is.
        let [x, y, z] = [hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]];
        let fits = prims as f32 <= self.block;
        self.costs[1 << leaf].0[lane] = if fits { x * y + y * z + z * x } else { 0.0 };
    }

    /// What the best tree over a set costs.
    pub(super) fn cost(&self, lane: usize, set: usize) -> f32 {
        self.costs[set % SETS].0[lane]
    }

    /// The two parts of a set that cost least together; the first ones of several.
    pub(super) fn split(&self, lane: usize, set: usize) -> [usize; 2] {
        let least = self.least[set % SETS].0[lane];
        let cost = |part: u8| self.cost(lane, usize::from(part));
        // The very sum that was the least.
        let parts = parts(set).iter().find(|&&[a, b]| cost(a) + cost(b) == least);
        parts.map_or([0, 0], |parts| parts.map(usize::from))
    }
}

/// Finds the cost of every set of two leaves or more.
pub(super) struct Solve<'a>(pub(super) &'a mut Sets);

impl Kernel for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self(sets) = self;
        let load = |lanes: &Lanes| S::F8::load(simd, &lanes.0);
        let block = S::F8::splat(simd, sets.block);
        // By its lowest bit, the set that was looked at last; a set without its lowest bit is that for
        // its own, since only sets with lower bits come between the two.
        let mut around = [[Lanes::ZERO; 7]; LEAVES];
        for set in 1..SETS {
            let (leaf, rest) = (set.trailing_zeros() as usize % LEAVES, set & (set - 1));
            if rest == 0 {
                around[leaf] = sets.leaves[leaf];
                continue;
            }
            let (rest, more) = (around[rest.trailing_zeros() as usize % LEAVES], sets.leaves[leaf]);
            let lo = |axis: usize| load(&rest[axis]).min(load(&more[axis]));
            let hi = |axis: usize| load(&rest[3 + axis]).max(load(&more[3 + axis]));
            let (lo, hi) = ([lo(0), lo(1), lo(2)], [hi(0), hi(1), hi(2)]);
            let prims = load(&rest[6]).add(load(&more[6]));
            let here = &mut around[leaf];
            for axis in 0..3 {
                here[axis] = Lanes(lo[axis].lanes());
                here[3 + axis] = Lanes(hi[axis].lanes());
            }
            here[6] = Lanes(prims.lanes());

            // The least that two parts cost together.
            let mut least = S::F8::splat(simd, f32::INFINITY);
            for &[a, b] in parts(set) {
                let a = load(&sets.costs[usize::from(a) % SETS]);
                let b = load(&sets.costs[usize::from(b) % SETS]);
                least = a.add(b).min(least);
            }
            sets.least[set] = Lanes(least.lanes());

            let [x, y, z] = [hi[0].sub(lo[0]), hi[1].sub(lo[1]), hi[2].sub(lo[2])];
            let area = x.mul(y).add(y.mul(z)).add(z.mul(x));
            // What fits into a block costs its area alone, and that is less.
            let cost = area.min_where(prims.le(block), area.add(least));
            sets.costs[set] = Lanes(cost.lanes());
        }
    }
}

/// The ways to part a set in two; the first part has the lowest bit.
#[inline(always)]
fn parts(set: usize) -> &'static [[u8; 2]] {
    static TABLE: ([[u8; 2]; PARTS], [u16; SETS + 1]) = table();
    let (parts, starts) = &TABLE;
    &parts[usize::from(starts[set])..usize::from(starts[set + 1])]
}

const fn table() -> ([[u8; 2]; PARTS], [u16; SETS + 1]) {
    let mut parts = [[0; 2]; PARTS];
    let mut starts = [0; SETS + 1];
    let mut count = 0;
    let mut set = 1;
    while set < SETS {
        starts[set] = count as u16;
        // Every other part that is not empty and lacks the lowest bit.
        let high = set & (set - 1);
        let mut other = high;
        while other > 0 {
            parts[count] = [(set ^ other) as u8, other as u8];
            count += 1;
            other = (other - 1) & high;
        }
        set += 1;
    }
    starts[SETS] = count as u16;
    assert!(count == PARTS);
    (parts, starts)
}

//! The cheapest binary tree over up to seven boxes, for eight sets of boxes at once.
//!
//! Source: Karras and Aila 2013, section 3.2. The cost of a set is its area and the least that two
//! parts of it cost together; a set's parts have smaller numbers, so one pass over the numbers knows
//! all that it needs. A tree's cost is the sum of its inner nodes' areas: what hangs at the treelet's
//! edge costs the same in every tree.
//!
//! Differs from the paper: lanes are treelets, so every load, sum and minimum is one of whole vectors.
//!
//! Cost: 127 areas and 966 pairs of parts.

use super::treelet::LEAVES;

/// Treelets side by side.
pub(super) const LANES: usize = 8;

/// Sets of a treelet's leaves, by their bits.
const SETS: usize = 1 << LEAVES;

/// The ways to part a set in two, of all sets together: (3^7 - 2 * 2^7 + 1) / 2.
const PARTS: usize = 966;

type Lanes = [f32; LANES];

/// A box in every lane: the least corner, then the greatest.
#[derive(Clone, Copy)]
struct Box8 {
    lo: [Lanes; 3],
    hi: [Lanes; 3],
}

impl Box8 {
    const POINT: Self = Self { lo: [[0.0; LANES]; 3], hi: [[0.0; LANES]; 3] };

    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for axis in 0..3 {
            for lane in 0..LANES {
                let (lo, hi) = (other.lo[axis][lane], other.hi[axis][lane]);
                let (a, b) = (&mut out.lo[axis][lane], &mut out.hi[axis][lane]);
                *a = if lo < *a { lo } else { *a };
                *b = if hi > *b { hi } else { *b };
            }
        }
        out
    }

    #[inline(always)]
    fn half_area(&self) -> Lanes {
        let mut out = [0.0; LANES];
        for lane in 0..LANES {
            let x = self.hi[0][lane] - self.lo[0][lane];
            let y = self.hi[1][lane] - self.lo[1][lane];
            let z = self.hi[2][lane] - self.lo[2][lane];
            out[lane] = x * y + y * z + z * x;
        }
        out
    }
}

/// What every set of every treelet costs.
pub(super) struct Sets {
    leaves: [Box8; LEAVES],
    costs: [Lanes; SETS],
}

impl Sets {
    pub(super) fn new() -> Self {
        Self { leaves: [Box8::POINT; LEAVES], costs: [[0.0; LANES]; SETS] }
    }

    /// Says where a leaf of a treelet is, in units of about the treelet's size.
    pub(super) fn put(&mut self, lane: usize, leaf: usize, lo: [f32; 3], hi: [f32; 3]) {
        for axis in 0..3 {
            self.leaves[leaf].lo[axis][lane] = lo[axis];
            self.leaves[leaf].hi[axis][lane] = hi[axis];
        }
    }

    /// Finds the cost of every set.
    pub(super) fn solve(&mut self) {
        // By its lowest bit, the box of the set that was looked at last; a set without its lowest bit
        // is that for its own, since only sets with lower bits come between the two.
        let mut boxes = [Box8::POINT; LEAVES];
        for set in 1..SETS {
            let (leaf, rest) = (set.trailing_zeros() as usize % LEAVES, set & (set - 1));
            if rest == 0 {
                boxes[leaf] = self.leaves[leaf];
                continue;
            }
            let around = boxes[rest.trailing_zeros() as usize % LEAVES];
            boxes[leaf] = around.union(&self.leaves[leaf]);
            let area = boxes[leaf].half_area();
            let least = self.least(set);
            for lane in 0..LANES {
                self.costs[set][lane] = area[lane] + least[lane];
            }
        }
    }

    /// The least that two parts of a set cost together.
    #[inline(always)]
    fn least(&self, set: usize) -> Lanes {
        let mut least = [f32::INFINITY; LANES];
        for &[a, b] in parts(set) {
            let (a, b) = (&self.costs[usize::from(a) % SETS], &self.costs[usize::from(b) % SETS]);
            for lane in 0..LANES {
                let sum = a[lane] + b[lane];
                least[lane] = if sum < least[lane] { sum } else { least[lane] };
            }
        }
        least
    }

    /// The two parts of a set that cost least together; the first ones of several.
    pub(super) fn split(&self, lane: usize, set: usize) -> [usize; 2] {
        let cost = |part: u8| self.costs[usize::from(part) % SETS][lane];
        let sum = |&&[a, b]: &&[u8; 2]| cost(a) + cost(b);
        let best = parts(set).iter().min_by(|a, b| sum(a).total_cmp(&sum(b)));
        best.map_or([0, 0], |parts| parts.map(usize::from))
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

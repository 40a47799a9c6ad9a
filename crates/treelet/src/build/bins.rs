//! Bins: centers dropped into a few slots an axis, and the cheapest edge between two of them.
//!
//! All three axes are priced side by side, one in each lane.

use super::lanes::{Around, Box4, Ref};
use crate::simd::Simd;
use crate::simd::f4::F4;
use alloc::boxed::Box;

/// The most bins an axis that there is room for; a power of two.
pub(super) const BINS_MAX: usize = 32;

/// How centers map to bins: monotone along each axis, in range for whatever comes, NaN included.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: F4,
    scale: F4,
    pub(super) bins: usize,
}

impl Grid {
    /// A grid over twice the centers, of up to [`BINS_MAX`] bins.
    #[inline(always)]
    pub(super) fn new([low, high]: [F4; 2], bins: usize) -> Self {
        // An axis without extent gets scale 0: everything in bin 0, no edge there.
        let [x, y, z, _] = high.sub(low).to_array();
        let along = |e: f32| if e > 0.0 { bins as f32 / e } else { 0.0 };
        Self { origin: low, scale: F4::new(along(x), along(y), along(z), 0.0), bins }
    }

    /// Where a center lies, in bins; never negative, and 0 where there is no telling.
    #[inline(always)]
    fn place(&self, center2: F4) -> F4 {
        center2.sub(self.origin).mul(self.scale).max(F4::splat(0.0))
    }

    /// About where bin `bin` begins, in twice the center.
    pub(super) fn edge(&self, axis: usize, bin: usize) -> f32 {
        self.origin.to_array()[axis] + bin as f32 / self.scale.to_array()[axis]
    }

    /// Whether a primitive lies below the plane: exactly those that `fill` drops below it.
    #[inline(always)]
    pub(super) fn is_below(&self, item: &Ref, plane: &Plane) -> usize {
        let below = self.place(item.center2()).less_bits(F4::splat(plane.bin as f32));
        (below >> plane.axis) & 1
    }
}

/// Bins below `bin` of `axis` go left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) axis: usize,
    pub(super) bin: usize,
    /// Leaf tests, weighted by half area in the unit of [`unit`].
    pub(super) cost: f32,
}

/// The scale of edges at which areas of parts of `bounds` are compared: they neither overflow nor,
/// where it matters, vanish.
#[inline(always)]
pub(super) fn unit(bounds: Box4) -> F4 {
    let [x, y, z, _] = bounds.edges().to_array();
    let longest = x.max(y).max(z);
    F4::splat(if longest > 0.0 { 1.0 / longest } else { 0.0 })
}

/// What is in the bins.
pub(super) struct Bins {
    /// Around the primitives: `[bin][axis]`.
    boxes: [[Box4; 3]; BINS_MAX],
    /// How many: `[bin][axis]`, one for show.
    counts: [[u32; 4]; BINS_MAX],
}

impl Bins {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self { boxes: [[Box4::EMPTY; 3]; BINS_MAX], counts: [[0; 4]; BINS_MAX] })
    }

    /// Drops every primitive into one bin an axis.
    #[inline(always)]
    pub(super) fn fill<'a, S: Simd>(
        &mut self,
        simd: S,
        grid: &Grid,
        refs: impl Iterator<Item = &'a Ref>,
    ) {
        self.boxes[..grid.bins].fill([Box4::EMPTY; 3]);
        self.counts[..grid.bins].fill([0; 4]);
        let top = F4::splat((grid.bins - 1) as f32);
        for item in refs {
            let bounds = Around::load(simd, item.bounds());
            let grown = |bin: &Box4| Around::load(simd, bin).union(bounds).store();
            let [x, y, z] = grid.place(item.center2()).min(top).to_indices();
            let (x, y, z) = (x % BINS_MAX, y % BINS_MAX, z % BINS_MAX);
            self.boxes[x][0] = grown(&self.boxes[x][0]);
            self.boxes[y][1] = grown(&self.boxes[y][1]);
            self.boxes[z][2] = grown(&self.boxes[z][2]);
            self.counts[x][0] += 1;
            self.counts[y][1] += 1;
            self.counts[z][2] += 1;
        }
    }

    /// The cheapest plane that leaves something on both sides; the lowest axis wins a tie, then the
    /// first bin.
    ///
    /// A side of `n` primitives has `ceil(n / block)` leaf tests, `block` being a power of two.
    #[inline(always)]
    pub(super) fn cheapest<S: Simd>(
        &self,
        simd: S,
        bins: usize,
        unit: F4,
        block: u32,
    ) -> Option<Plane> {
        let bins = bins.min(BINS_MAX);
        let never = F4::splat(f32::INFINITY);
        let (more, share) = (F4::splat((block - 1) as f32), F4::splat(1.0 / block as f32));
        let tests = |count: F4| count.add(more).mul(share).trunc();
        let areas = |sides: &[Around<S>; 3]| {
            let edges = |side: Around<S>| side.store().edges().mul(unit);
            F4::half_areas([edges(sides[0]), edges(sides[1]), edges(sides[2])])
        };
        let grow = |sides: &mut [Around<S>; 3], by: &[Box4; 3]| {
            for axis in 0..3 {
                sides[axis] = sides[axis].union(Around::load(simd, &by[axis]));
            }
        };

        // From the right: the cost of everything from each bin on.
        let mut right_cost = [never; BINS_MAX];
        let (mut right, mut after) = ([Around::empty(simd); 3], F4::splat(0.0));
        for bin in (1..bins).rev() {
            grow(&mut right, &self.boxes[bin]);
            after = after.add(F4::from_counts(&self.counts[bin]));
            right_cost[bin] = price(after, areas(&right).mul(tests(after)));
        }

        // From the left: add the cost of everything before it.
        let (mut left, mut before) = ([Around::empty(simd); 3], F4::splat(0.0));
        let (mut best, mut best_bin) = (never, F4::splat(0.0));
        for bin in 1..bins {
            grow(&mut left, &self.boxes[bin - 1]);
            before = before.add(F4::from_counts(&self.counts[bin - 1]));
            let cost = price(before, areas(&left).mul(tests(before)).add(right_cost[bin]));
            best_bin = cost.less_pick(best, F4::splat(bin as f32), best_bin);
            best = cost.min(best);
        }

        let (costs, at) = (best.to_array(), best_bin.to_array());
        let mut axis = 0;
        for other in 1..3 {
            if costs[other] < costs[axis] {
                axis = other;
            }
        }
        let bin = at[axis] as usize;
        (bin > 0).then_some(Plane { axis, bin, cost: costs[axis] })
    }
}

/// The price of a side; an empty one rules the plane out.
#[inline(always)]
fn price(count: F4, price: F4) -> F4 {
    F4::splat(0.0).less_pick(count, price, F4::splat(f32::INFINITY))
}

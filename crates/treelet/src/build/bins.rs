//! Bins: centers dropped into a few slots an axis, and the cheapest edge between two of them.

use super::lanes::{Box4, Extent4, Lanes, Ref, max, min, mul, sub};

/// The most bins an axis that there is room for; a power of two.
pub(super) const BINS_MAX: usize = 32;

/// Added to a number in `0 ..= 2^22`, leaves the nearest integer in the low bits of the sum.
const TO_BITS: f32 = 12_582_912.0;

/// How centers map to bins: monotone along each axis, in range for whatever comes, NaN included.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: Lanes,
    scale: Lanes,
    top: Lanes,
    pub(super) bins: usize,
}

impl Grid {
    /// A grid over twice the centers, of up to [`BINS_MAX`] bins.
    #[inline(always)]
    pub(super) fn new(centers: Box4, bins: usize) -> Self {
        let extent = centers.extent();
        // Just less than `bins`, so that the last center is in the last bin without its clamp. An
        // axis without extent gets scale 0: everything in bin 0, no edge there.
        let fill = bins as f32 * 0.999_99;
        let along = |e: f32| if e > 0.0 { fill / e } else { 0.0 };
        Self {
            origin: centers.lo,
            scale: [along(extent[0]), along(extent[1]), along(extent[2]), 0.0],
            top: [(bins - 1) as f32; 4],
            bins,
        }
    }

    /// The bins of a center, by axis.
    #[inline(always)]
    pub(super) fn bins(&self, center2: Lanes) -> [usize; 3] {
        let place = sub(mul(sub(center2, self.origin), self.scale), [0.5; 4]);
        let place = min(max(place, [0.0; 4]), self.top);
        let bits = |i: usize| (place[i] + TO_BITS).to_bits() as usize % BINS_MAX;
        [bits(0), bits(1), bits(2)]
    }

    /// About where bin `bin` begins, in twice the center.
    pub(super) fn edge(&self, axis: usize, bin: usize) -> f32 {
        self.origin[axis] + bin as f32 / self.scale[axis]
    }

    /// The bin of a center along one axis: the same arithmetic.
    #[inline(always)]
    pub(super) fn bin(&self, center2: f32, axis: usize) -> usize {
        let place = (center2 - self.origin[axis]) * self.scale[axis] - 0.5;
        let place = if place > 0.0 { place } else { 0.0 };
        let place = if place < self.top[0] { place } else { self.top[0] };
        (place + TO_BITS).to_bits() as usize % BINS_MAX
    }
}

/// What is in the bins.
pub(super) struct Bins {
    boxes: [[Box4; BINS_MAX]; 3],
    counts: [[u32; BINS_MAX]; 3],
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
pub(super) fn unit(bounds: Box4) -> Lanes {
    let [x, y, z, _] = bounds.extent();
    let longest = x.max(y).max(z);
    [if longest > 0.0 { 1.0 / longest } else { 0.0 }; 4]
}

impl Bins {
    pub(super) const EMPTY: Self =
        Self { boxes: [[Box4::EMPTY; BINS_MAX]; 3], counts: [[0; BINS_MAX]; 3] };

    /// Drops every primitive into one bin an axis.
    #[inline(always)]
    pub(super) fn fill<'a>(&mut self, grid: &Grid, refs: impl Iterator<Item = &'a Ref>) {
        for axis in 0..3 {
            self.boxes[axis][..grid.bins].fill(Box4::EMPTY);
            self.counts[axis][..grid.bins].fill(0);
        }
        for item in refs {
            let bounds = item.bounds();
            let [x, y, z] = grid.bins(bounds.center2());
            self.boxes[0][x] = self.boxes[0][x].union(bounds);
            self.boxes[1][y] = self.boxes[1][y].union(bounds);
            self.boxes[2][z] = self.boxes[2][z].union(bounds);
            self.counts[0][x] += 1;
            self.counts[1][y] += 1;
            self.counts[2][z] += 1;
        }
    }

    /// The cheapest plane that leaves something on both sides; the first one wins a tie.
    ///
    /// A side of `n` primitives has `ceil(n / 2^block_bits)` leaf tests.
    #[inline(always)]
    pub(super) fn cheapest(&self, bins: usize, unit: Lanes, block_bits: u32) -> Option<Plane> {
        let mut best = Plane { axis: 0, bin: 0, cost: f32::INFINITY };
        let more = (1_u32 << block_bits) - 1;
        let tests = |count: u32| ((count + more) >> block_bits) as f32;
        for axis in 0..3 {
            let (boxes, counts) = (&self.boxes[axis], &self.counts[axis]);
            // From the right: the cost of everything from each bin on.
            let mut right_cost = [0.0_f32; BINS_MAX];
            let (mut right, mut total) = (Box4::EMPTY, 0);
            for bin in (1..bins).rev() {
                right = right.union(boxes[bin]);
                total += counts[bin];
                // An empty side rules the plane out.
                let price = right.half_area(unit) * tests(total);
                right_cost[bin] = if total > 0 { price } else { f32::INFINITY };
            }
            // From the left: add the cost of everything before it.
            let (mut left, mut before) = (Box4::EMPTY, 0);
            for bin in 1..bins {
                left = left.union(boxes[bin - 1]);
                before += counts[bin - 1];
                let cost = left.half_area(unit) * tests(before) + right_cost[bin];
                let cost = if before > 0 { cost } else { f32::INFINITY };
                if cost < best.cost {
                    best = Plane { axis, bin, cost };
                }
            }
        }
        (best.bin > 0).then_some(best)
    }
}

/// The extent of some references.
#[inline(always)]
pub(super) fn extent_of<'a>(refs: impl Iterator<Item = &'a Ref>) -> Extent4 {
    refs.fold(Extent4::EMPTY, |mut extent, item| {
        extent.add(item);
        extent
    })
}

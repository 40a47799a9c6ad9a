//! Binned SAH: drop the centers into a few bins an axis, cut at the cheapest bin edge.
//!
//! Source: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", IEEE Symposium
//! on Interactive Ray Tracing, 2007. Differs from it: every axis is tried, not only the widest one,
//! and the extents of the two sides are taken exactly while partitioning.
//!
//! O(n log n) time, in place; the bins live on the stack.

use super::prim_ref::{self, CHUNK, Cutter, PrimRef};
use super::top_down::{Cut, Range};
use super::{BuildError, Builder, Info, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::tree::Tree;

/// The most bins that the stack has room for.
const BINS_MAX: usize = 32;

/// Cuts at the cheapest of a few planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinnedSah {
    /// Most primitives in a leaf, in `1..=64`.
    pub leaf_max: u32,
    /// Bins an axis, in `2..=32`. More find better cuts in large ranges and cost time in small ones.
    pub bins: u32,
    /// Price of visiting a node in units of one primitive test, in `0..=1000`. Higher makes fuller
    /// leaves.
    pub visit_cost: f32,
}

impl BinnedSah {
    /// Sixteen bins, leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4, bins: 16, visit_cost: 1.0 };
}

impl Builder for BinnedSah {
    fn info(&self) -> Info {
        Info {
            name: "binned-sah",
            summary: "cuts at the cheapest of a few planes by the surface area heuristic",
            source: "Wald 2007",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_option("bins", f64::from(self.bins), 2.0..=BINS_MAX as f64, "2..=32")?;
        check_option("visit_cost", f64::from(self.visit_cost), 0.0..=1000.0, "0..=1000")?;
        prim_ref::build(self, bounds, context)
    }
}

impl Cutter for BinnedSah {
    fn leaf_max(&self) -> u32 {
        self.leaf_max
    }

    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        let grid = Grid::new(&range.extent.centers, self.bins as usize);
        let bins = fill(&grid, range.slots, stage)?;
        let Some(plane) = cheapest(&grid, &bins) else { return Ok(None) };

        let count = range.slots.len();
        let area = range.extent.bounds.half_area();
        let split_pays = plane.cost + f64::from(self.visit_cost) * area < count as f64 * area;
        if count <= self.leaf_max as usize && !split_pays {
            return Ok(None);
        }
        let goes_left = |item: &PrimRef| grid.bin(item.bounds.center(), plane.axis) < plane.bin;
        prim_ref::partition(range.slots, goes_left, stage)
    }
}

/// How centers map to bins.
struct Grid {
    origin: [f32; 3],
    scale: [f32; 3],
    bins: usize,
}

impl Grid {
    fn new(centers: &Aabb, bins: usize) -> Self {
        // An axis without extent gets scale 0: everything in bin 0, no plane there.
        let scale = centers.extent().map(|e| if e > 0.0 { bins as f32 / e } else { 0.0 });
        Self { origin: centers.lo, scale, bins }
    }

    /// The bin of a center; NaN (an extent whose reciprocal overflows) lands in bin 0.
    #[inline(always)]
    fn bin(&self, center: [f32; 3], axis: usize) -> usize {
        let place = (center[axis] - self.origin[axis]) * self.scale[axis];
        (place as usize).min(self.bins - 1)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, count: 0 };

    fn add(&mut self, other: &Self) {
        self.bounds = self.bounds.union(&other.bounds);
        self.count += other.count;
    }
}

/// `[axis][bin]`.
type Bins = [[Bin; BINS_MAX]; 3];

/// Drops the centers into bins, chunks of them in parallel. The sums do not depend on the order.
fn fill(grid: &Grid, refs: &[PrimRef], stage: &Stage<'_>) -> Result<Bins, Cancelled> {
    let drop_in = |refs: &[PrimRef]| {
        let mut bins = [[Bin::EMPTY; BINS_MAX]; 3];
        for item in refs {
            let center = item.bounds.center();
            for (axis, bins) in bins.iter_mut().enumerate() {
                let bin = &mut bins[grid.bin(center, axis)];
                bin.bounds = bin.bounds.union(&item.bounds);
                bin.count += 1;
            }
        }
        bins
    };
    if refs.len() <= CHUNK {
        return Ok(drop_in(refs));
    }
    let parts = parallel::map_chunks(refs, CHUNK, |_, refs| {
        stage.check()?;
        Ok(drop_in(refs))
    });
    let mut sum = [[Bin::EMPTY; BINS_MAX]; 3];
    for part in parts {
        for (sum, part) in sum.iter_mut().flatten().zip(part?.iter().flatten()) {
            sum.add(part);
        }
    }
    Ok(sum)
}

/// Bins below `bin` of `axis` go left.
struct Plane {
    axis: usize,
    bin: usize,
    /// Primitive tests, weighted by half area.
    cost: f64,
}

/// The cheapest plane that leaves something on both sides; the first one wins a tie.
fn cheapest(grid: &Grid, bins: &Bins) -> Option<Plane> {
    let mut best: Option<Plane> = None;
    for (axis, bins) in bins.iter().enumerate() {
        let bins = &bins[..grid.bins];
        // From the right: the cost of everything from each bin on.
        let mut right_cost = [0.0; BINS_MAX];
        let mut right = Bin::EMPTY;
        for bin in (1..grid.bins).rev() {
            right.add(&bins[bin]);
            right_cost[bin] = right.bounds.half_area() * right.count as f64;
        }
        // From the left: add the cost of everything before it.
        let total: usize = bins.iter().map(|bin| bin.count).sum();
        let mut left = Bin::EMPTY;
        for bin in 1..grid.bins {
            left.add(&bins[bin - 1]);
            let cost = left.bounds.half_area() * left.count as f64 + right_cost[bin];
            let two_sided = 0 < left.count && left.count < total;
            if two_sided && best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Plane { axis, bin, cost });
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_out_of_range_are_named() {
        let build = |builder: BinnedSah| builder.build(&[], &Context::default());
        let bad = build(BinnedSah { bins: 33, ..BinnedSah::DEFAULT });
        assert_eq!(bad, Err(BuildError::Option { option: "bins", value: 33.0, allowed: "2..=32" }));
        assert!(build(BinnedSah { leaf_max: 0, ..BinnedSah::DEFAULT }).is_err());
        assert!(build(BinnedSah { visit_cost: f32::NAN, ..BinnedSah::DEFAULT }).is_err());
        assert!(build(BinnedSah::DEFAULT).is_ok());
    }
}

//! Where a range could be cut: the cheapest plane between its primitives, and the cheapest one through
//! them.

use super::{Build, CHUNK, Extent, Range, Ref, Sbvh};
use crate::bounds::Aabb;
use crate::context::{Cancelled, parallel};

/// The most bins that the stack has room for.
pub(super) const BINS_MAX: usize = 32;

/// How places along the axes of a box map to bins.
pub(super) struct Grid {
    origin: [f32; 3],
    scale: [f32; 3],
    bins: usize,
}

impl Grid {
    pub(super) fn new(around: &Aabb, bins: usize) -> Self {
        // An axis without extent gets scale 0: everything in bin 0, no plane there.
        let scale = around.extent().map(|e| if e > 0.0 { bins as f32 / e } else { 0.0 });
        Self { origin: around.lo, scale, bins }
    }

    /// The bin of a place; NaN (an extent whose reciprocal overflows) lands in bin 0.
    #[inline(always)]
    pub(super) fn bin(&self, place: f32, axis: usize) -> usize {
        let place = (place - self.origin[axis]) * self.scale[axis];
        (place as usize).min(self.bins - 1)
    }

    /// Where a bin begins.
    fn plane(&self, bin: usize, axis: usize) -> f32 {
        self.origin[axis] + bin as f32 / self.scale[axis]
    }
}

/// What lies, begins and ends in a bin.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    begins: usize,
    ends: usize,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, begins: 0, ends: 0 };

    fn add(&mut self, other: &Self) {
        self.bounds = self.bounds.union(&other.bounds);
        self.begins += other.begins;
        self.ends += other.ends;
    }
}

/// How many pieces of primitives are in the bins, whole ones included.
fn pieces(bins: &Bins) -> u64 {
    let of_axis = |bins: &[Bin; BINS_MAX]| {
        let (mut open, mut pieces) = (0, 0);
        for bin in bins {
            open += bin.begins;
            pieces += open as u64;
            open -= bin.ends;
        }
        pieces
    };
    bins.iter().map(of_axis).sum()
}

/// `[axis][bin]`.
type Bins = [[Bin; BINS_MAX]; 3];

/// Centers in bins below `bin` go left.
pub(super) struct ObjectPlane {
    pub(super) axis: usize,
    pub(super) bin: usize,
    /// Primitive tests, weighted by half area.
    pub(super) cost: f64,
    /// Half area of what both sides cover.
    pub(super) overlap: f64,
}

/// What lies below `at` goes left.
pub(super) struct SpatialPlane {
    pub(super) axis: usize,
    pub(super) at: f32,
    pub(super) cost: f64,
    pub(super) bounds: [Aabb; 2],
    pub(super) counts: [usize; 2],
}

/// Two sides of a plane at the beginning of a bin.
struct Candidate {
    axis: usize,
    bin: usize,
    cost: f64,
    bounds: [Aabb; 2],
    counts: [usize; 2],
}

impl Build<'_> {
    /// The cheapest plane between centers.
    pub(super) fn object_plane(
        &self,
        refs: &[Ref],
        extent: &Extent,
    ) -> Result<Option<ObjectPlane>, Cancelled> {
        let grid = Grid::new(&extent.centers, self.options.bins as usize);
        let drop_in = |refs: &[Ref], bins: &mut Bins| {
            for item in refs {
                let center = item.bounds.center();
                for (axis, bins) in bins.iter_mut().enumerate() {
                    let bin = &mut bins[grid.bin(center[axis], axis)];
                    bin.bounds = bin.bounds.union(&item.bounds);
                    bin.begins += 1;
                    bin.ends += 1;
                }
            }
        };
        let bins = self.fill(refs, drop_in)?;
        let best = cheapest(&self.options, &grid, &bins, refs.len());
        Ok(best.map(|Candidate { axis, bin, cost, bounds: [left, right], .. }| {
            let overlap = left.intersection(&right).half_area();
            ObjectPlane { axis, bin, cost, overlap }
        }))
    }

    /// The cheapest plane through primitives, and how many pieces were clipped to find it.
    pub(super) fn spatial_plane(
        &self,
        refs: &[Ref],
        range: &Range,
    ) -> Result<(Option<SpatialPlane>, u64), Cancelled> {
        let Some(clip) = self.clip else { return Ok((None, 0)) };
        if range.budget == 0 || range.clips == 0 {
            return Ok((None, 0));
        }
        let grid = Grid::new(&range.extent.bounds, self.options.bins as usize);
        let drop_in = |refs: &[Ref], bins: &mut Bins| {
            for item in refs {
                for (axis, bins) in bins.iter_mut().enumerate() {
                    let first = grid.bin(item.bounds.lo[axis], axis);
                    let last = grid.bin(item.bounds.hi[axis], axis);
                    bins[first].begins += 1;
                    bins[last].ends += 1;
                    if first == last {
                        bins[first].bounds = bins[first].bounds.union(&item.bounds);
                        continue;
                    }
                    for bin in first..=last {
                        let mut region = item.bounds;
                        if bin > first {
                            region.lo[axis] = region.lo[axis].max(grid.plane(bin, axis));
                        }
                        if bin < last {
                            region.hi[axis] = region.hi[axis].min(grid.plane(bin + 1, axis));
                        }
                        let piece = clip.clip(item.prim, &region);
                        bins[bin].bounds = bins[bin].bounds.union(&piece);
                    }
                }
            }
        };
        let bins = self.fill(refs, drop_in)?;
        let best = cheapest(&self.options, &grid, &bins, usize::MAX);
        let plane = best.map(|Candidate { axis, bin, cost, bounds, counts }| SpatialPlane {
            axis,
            at: grid.plane(bin, axis),
            cost,
            bounds,
            counts,
        });
        Ok((plane, pieces(&bins)))
    }

    /// Fills bins, chunks of references in parallel. The sums do not depend on the order.
    fn fill(
        &self,
        refs: &[Ref],
        drop_in: impl Fn(&[Ref], &mut Bins) + Sync + Send,
    ) -> Result<Bins, Cancelled> {
        let mut sum = [[Bin::EMPTY; BINS_MAX]; 3];
        if refs.len() <= CHUNK {
            drop_in(refs, &mut sum);
            return Ok(sum);
        }
        let parts = parallel::map_chunks(refs, CHUNK, |_, refs| {
            self.stage.check()?;
            let mut bins = [[Bin::EMPTY; BINS_MAX]; 3];
            drop_in(refs, &mut bins);
            Ok(bins)
        });
        for part in parts {
            for (sum, part) in sum.iter_mut().flatten().zip(part?.iter().flatten()) {
                sum.add(part);
            }
        }
        Ok(sum)
    }
}

/// The cheapest plane with fewer than `count` references on either side, and some; the first one
/// wins a tie.
fn cheapest(options: &Sbvh, grid: &Grid, bins: &Bins, count: usize) -> Option<Candidate> {
    let mut best: Option<Candidate> = None;
    for (axis, bins) in bins.iter().enumerate() {
        let bins = &bins[..grid.bins];
        // From the right: everything from each bin on.
        let mut rights = [Bin::EMPTY; BINS_MAX];
        let mut right = Bin::EMPTY;
        for bin in (1..grid.bins).rev() {
            right.add(&bins[bin]);
            rights[bin] = right;
        }
        // From the left: everything before it.
        let mut left = Bin::EMPTY;
        for bin in 1..grid.bins {
            left.add(&bins[bin - 1]);
            let right = &rights[bin];
            let counts = [left.begins, right.ends];
            if counts[0] == 0 || counts[1] == 0 || counts[0] >= count || counts[1] >= count {
                continue;
            }
            let cost = left.bounds.half_area() * options.tests(counts[0])
                + right.bounds.half_area() * options.tests(counts[1]);
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                let bounds = [left.bounds, right.bounds];
                best = Some(Candidate { axis, bin, cost, bounds, counts });
            }
        }
    }
    best
}

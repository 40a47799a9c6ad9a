//! Which neighbour in its window each cluster would join.

use crate::bounds::Aabb;
use crate::tree::Node;
use alloc::vec::Vec;

/// The widest window.
pub(super) const RADIUS_MAX: usize = 128;
/// Clusters are searched for this many at a time: what is looked at stays in a first-level cache.
const BLOCK: usize = 256;
/// Lanes of the loops over a block: two registers of the baseline.
const LANES: usize = 8;
/// A block with what its windows reach, and what vectors reach.
const WIDE: usize = BLOCK + 2 * RADIUS_MAX + LANES;

/// The least upper bound of areas: beyond it all are equal. NaN (an infinite edge times an empty
/// one) counts as that.
const AREA_MAX: f32 = f32::MAX;

/// Half the area of the box around both, as f32 rounds it: never less for larger boxes.
#[cfg(test)]
pub(super) fn area(a: &Aabb, b: &Aabb) -> f32 {
    let around = a.union(b);
    let [x, y, z] = [0, 1, 2].map(|axis| around.hi[axis] - around.lo[axis]);
    lesser(x * y + (x + y) * z, AREA_MAX)
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

/// The search, for one radius.
pub(super) struct Nearest {
    radius: usize,
    /// `[distance - 1][place]`: all ones where pairs that begin there are preferred, by place modulo
    /// twice the distance.
    tiles: Vec<Vec<u32>>,
}

/// Some clusters, one array a coordinate, and the areas of pairs at one distance by left end.
struct Block {
    /// Lower and upper faces alternate: `lo x, hi x, lo y, ...`.
    faces: [[f32; WIDE]; 6],
    areas: [f32; WIDE],
    best: [f32; BLOCK + LANES],
    partners: [i32; BLOCK + LANES],
}

impl Nearest {
    pub(super) fn new(radius: usize) -> Self {
        let tile = |distance: usize| {
            let row = 0..2 * distance + BLOCK + LANES;
            row.map(|place| if (place / distance).is_multiple_of(2) { u32::MAX } else { 0 })
                .collect()
        };
        Self { radius, tiles: (1..=radius).map(tile).collect() }
    }

    /// Writes how far away, and on which side, the partners of clusters from `begin` on are. There are
    /// at least two clusters.
    pub(super) fn find(&self, clusters: &[Node], begin: usize, partners: &mut [i16]) {
        let mut block = Block {
            faces: [[0.0; WIDE]; 6],
            areas: [0.0; WIDE],
            best: [0.0; BLOCK + LANES],
            partners: [0; BLOCK + LANES],
        };
        for (at, partners) in partners.chunks_mut(BLOCK).enumerate() {
            self.find_block(&mut block, clusters, begin + at * BLOCK, partners);
        }
    }

    #[inline(never)]
    fn find_block(&self, block: &mut Block, clusters: &[Node], begin: usize, partners: &mut [i16]) {
        let (radius, count) = (self.radius, partners.len());
        block.fill(clusters, begin, radius, count);
        block.best.fill(f32::INFINITY);
        // In the block's arrays, cluster `i` is at `i + radius - begin`.
        let first = radius.saturating_sub(begin);
        let end = clusters.len() + radius - begin;
        for distance in 1..=radius {
            block.measure(radius - distance..radius + count, distance);
            // Nobody is before the first cluster or after the last one.
            let before = radius - distance..first.max(radius - distance);
            block.areas[before].fill(f32::INFINITY);
            let after = end.saturating_sub(distance).min(radius + count)..radius + count;
            block.areas[after].fill(f32::INFINITY);
            let tiles = &self.tiles[distance - 1][begin % (2 * distance)..];
            block.compare(radius, count, distance, tiles);
        }
        for (partner, found) in partners.iter_mut().zip(&block.partners) {
            *partner = *found as i16;
        }
    }
}

impl Block {
    /// Loads the clusters from `begin` on, and `radius` more to each side where there are any.
    fn fill(&mut self, clusters: &[Node], begin: usize, radius: usize, count: usize) {
        let first = begin.saturating_sub(radius);
        let end = clusters.len().min(begin + count + radius);
        for (cluster, at) in clusters[first..end].iter().zip(first + radius - begin..) {
            let Aabb { lo, hi } = cluster.bounds;
            for axis in 0..3 {
                self.faces[2 * axis][at] = lo[axis];
                self.faces[2 * axis + 1][at] = hi[axis];
            }
        }
    }

    /// The areas of pairs whose left ends are in a range.
    #[inline(always)]
    fn measure(&mut self, lefts: core::ops::Range<usize>, distance: usize) {
        for at in lefts.step_by(LANES) {
            let (here, there) = (self.faces(at), self.faces(at + distance));
            let mut areas = [0.0; LANES];
            for lane in 0..LANES {
                let length = |axis: usize| {
                    let lo = lesser(here[2 * axis][lane], there[2 * axis][lane]);
                    let hi = greater(here[2 * axis + 1][lane], there[2 * axis + 1][lane]);
                    hi - lo
                };
                let (x, y, z) = (length(0), length(1), length(2));
                areas[lane] = lesser(x * y + (x + y) * z, AREA_MAX);
            }
            self.areas[at..at + LANES].copy_from_slice(&areas);
        }
    }

    #[inline(always)]
    fn faces(&self, at: usize) -> [[f32; LANES]; 6] {
        let face = |face: usize| window(&self.faces[face], at);
        [face(0), face(1), face(2), face(3), face(4), face(5)]
    }

    /// Takes pairs at this distance where they are better than nearer ones.
    #[inline(always)]
    fn compare(&mut self, radius: usize, count: usize, distance: usize, tiles: &[u32]) {
        for at in (0..count).step_by(LANES) {
            let as_left: [f32; LANES] = window(&self.areas, radius + at);
            let as_right: [f32; LANES] = window(&self.areas, radius + at - distance);
            let tile: [u32; LANES] = window(tiles, at);
            let mut best: [f32; LANES] = window(&self.best, at);
            let mut partner: [i32; LANES] = window(&self.partners, at);
            for lane in 0..LANES {
                let (left, right) = (as_left[lane], as_right[lane]);
                let goes_right = (left < right) | ((left == right) & (tile[lane] != 0));
                let area = if goes_right { left } else { right };
                let there = if goes_right { distance as i32 } else { -(distance as i32) };
                let better = area < best[lane];
                best[lane] = if better { area } else { best[lane] };
                partner[lane] = if better { there } else { partner[lane] };
            }
            self.best[at..at + LANES].copy_from_slice(&best);
            self.partners[at..at + LANES].copy_from_slice(&partner);
        }
    }
}

/// Neighbouring items.
#[inline(always)]
fn window<T: Copy + Default>(items: &[T], first: usize) -> [T; LANES] {
    let mut out = [T::default(); LANES];
    out.copy_from_slice(&items[first..first + LANES]);
    out
}

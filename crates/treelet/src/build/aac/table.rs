//! A list of clusters that is clustered greedily: the pair with the smallest box first.
//!
//! Each cluster knows the best pair that it makes with one before it in the list, so the least of
//! those is the least of all. A joined pair takes the place of its right member. No pair gets better
//! by that: a box around more is no smaller, so only those who lost their partner look again.

use super::super::bottom_up::{Below, Cluster};
use crate::bounds::Aabb;
use alloc::vec::Vec;

/// A pair's area above a code: how high the joined trees are together.
///
/// Of equal areas the lower pair wins: equal boxes become a balanced tree, not a chain.
type Price = f32;

/// Bits of an area that give way to the code.
const CODE_MASK: u32 = 31;
/// The height of a cluster counts up to this one.
const HEIGHT_MAX: u32 = CODE_MASK / 2;
/// A code that makes any price NaN, which is less than nothing: of places where no cluster is.
const NOBODY: u32 = 0x7FC0_0000;

/// Lanes of the loops over a list: two registers of the baseline.
const LANES: usize = 8;

/// Reused from list to list.
#[derive(Default)]
pub(super) struct Table {
    /// Lower and upper faces alternate: `lo x, hi x, lo y, ...`, in rows as long as `codes`.
    faces: Vec<f32>,
    codes: Vec<u32>,
    /// Of the best pair with a cluster before this one, NaN if there is none.
    prices: Vec<Price>,
    partners: Vec<u32>,
}

impl Table {
    /// Joins clusters until `most` are left, in front; returns how many.
    pub(super) fn reduce(
        &mut self,
        clusters: &mut [Cluster],
        most: usize,
        below: &mut Below<'_>,
    ) -> usize {
        self.fill(clusters);
        for at in 1..clusters.len() {
            self.search(at);
        }
        for _ in most..clusters.len() {
            let right = self.least();
            let left = self.partners[right] as usize;
            clusters[right] = below.join(&clusters[left], &clusters[right]);
            self.put(right, &clusters[right]);
            self.codes[left] = NOBODY;
            self.prices[left] = Price::NAN;
            self.search(right);
            for at in left + 1..clusters.len() {
                let partner = self.partners[at] as usize;
                if (partner == left || partner == right) && self.codes[at] != NOBODY {
                    self.search(at);
                }
            }
        }

        // Close the gaps.
        let mut count = 0;
        for at in 0..clusters.len() {
            clusters[count] = clusters[at];
            count += usize::from(self.codes[at] != NOBODY);
        }
        count
    }

    fn fill(&mut self, clusters: &[Cluster]) {
        let padded = clusters.len().next_multiple_of(LANES);
        self.faces.clear();
        self.faces.resize(6 * padded, 0.0);
        self.codes.clear();
        self.codes.resize(padded, NOBODY);
        self.prices.clear();
        self.prices.resize(padded, Price::NAN);
        self.partners.clear();
        self.partners.resize(padded, u32::MAX);
        for (at, cluster) in clusters.iter().enumerate() {
            self.put(at, cluster);
        }
    }

    fn put(&mut self, at: usize, cluster: &Cluster) {
        let row = self.codes.len();
        let Aabb { lo, hi } = cluster.root.bounds;
        for axis in 0..3 {
            self.faces[2 * axis * row + at] = lo[axis];
            self.faces[(2 * axis + 1) * row + at] = hi[axis];
        }
        self.codes[at] = cluster.height.min(HEIGHT_MAX);
    }

    /// Finds the best pair of a cluster with one before it; of equal ones the last.
    #[inline(never)]
    fn search(&mut self, at: usize) {
        let row = self.codes.len();
        let (mut faces, mut here) = ([&[][..]; 6], [0.0; 6]);
        for face in 0..6 {
            faces[face] = &self.faces[face * row..(face + 1) * row];
            here[face] = faces[face][at];
        }
        let code = self.codes[at];
        let (mut best, mut places) = ([Price::INFINITY; LANES], [0_u32; LANES]);
        for first in (0..at).step_by(LANES) {
            let there: [[f32; LANES]; 6] = [
                window(faces[0], first),
                window(faces[1], first),
                window(faces[2], first),
                window(faces[3], first),
                window(faces[4], first),
                window(faces[5], first),
            ];
            let codes: [u32; LANES] = window(&self.codes, first);
            for lane in 0..LANES {
                let length = |axis: usize| {
                    let lo = lesser(here[2 * axis], there[2 * axis][lane]);
                    let hi = greater(here[2 * axis + 1], there[2 * axis + 1][lane]);
                    hi - lo
                };
                let (x, y, z) = (length(0), length(1), length(2));
                // Beyond f32 all areas are equal.
                let area = lesser(x * y + (x + y) * z, f32::MAX);
                let place = first as u32 + lane as u32;
                let nobody = if place < at as u32 { 0 } else { NOBODY };
                let code = (code + (codes[lane] & CODE_MASK)) | (codes[lane] & NOBODY) | nobody;
                let price = Price::from_bits((area.to_bits() & !CODE_MASK) | code);
                let better = price <= best[lane];
                best[lane] = if better { price } else { best[lane] };
                places[lane] = if better { place } else { places[lane] };
            }
        }
        let (mut price, mut partner) = (Price::NAN, u32::MAX);
        for lane in 0..LANES {
            let (other, place) = (best[lane], places[lane]);
            let better = other < price || (other == price && place > partner) || price.is_nan();
            if better && other < Price::INFINITY {
                (price, partner) = (other, place);
            }
        }
        self.prices[at] = price;
        self.partners[at] = partner;
    }

    /// The cluster that makes the best pair; of equal ones the first.
    fn least(&self) -> usize {
        let (mut best, mut blocks) = ([Price::INFINITY; LANES], [0_u32; LANES]);
        for (block, prices) in self.prices.chunks_exact(LANES).enumerate() {
            for lane in 0..LANES {
                let better = prices[lane] < best[lane];
                best[lane] = if better { prices[lane] } else { best[lane] };
                blocks[lane] = if better { block as u32 } else { blocks[lane] };
            }
        }
        let mut least = (best[0], blocks[0] as usize * LANES);
        for lane in 1..LANES {
            let place = blocks[lane] as usize * LANES + lane;
            if best[lane] < least.0 || (best[lane] == least.0 && place < least.1) {
                least = (best[lane], place);
            }
        }
        least.1
    }
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

/// Neighbouring items.
#[inline(always)]
fn window<T: Copy + Default>(items: &[T], first: usize) -> [T; LANES] {
    let mut out = [T::default(); LANES];
    out.copy_from_slice(&items[first..first + LANES]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Node;

    /// The definition: of all pairs the best, again and again; of equal ones that with the first right
    /// member, then with the last left one.
    fn naive(clusters: &[Cluster], most: usize, below: &mut Below<'_>) -> Vec<Cluster> {
        let mut slots: Vec<Option<Cluster>> = clusters.iter().copied().map(Some).collect();
        let price = |a: &Cluster, b: &Cluster| {
            let around = a.root.bounds.union(&b.root.bounds);
            let [x, y, z] = [0, 1, 2].map(|axis| around.hi[axis] - around.lo[axis]);
            let area = x * y + (x + y) * z;
            let area = if area < f32::MAX { area } else { f32::MAX };
            (area.to_bits() / 32, a.height.min(15) + b.height.min(15))
        };
        for _ in most..clusters.len() {
            let mut best = None;
            for right in 1..slots.len() {
                for left in (0..right).rev() {
                    if let (Some(a), Some(b)) = (&slots[left], &slots[right])
                        && best.is_none_or(|(least, _, _)| price(a, b) < least)
                    {
                        best = Some((price(a, b), left, right));
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
                let (mut nodes, mut expected) = (empty.clone(), empty);
                let mut list = clusters.clone();
                let left = table.reduce(&mut list, most, &mut Below::new(&mut nodes, 1));
                let naive = naive(&clusters, most, &mut Below::new(&mut expected, 1));
                let who = alloc::format!("{count} to {most}, {steps} steps, scale {scale:e}");
                assert!(nodes == expected, "{who}");
                let roots = |list: &[Cluster]| -> Vec<(Node, u32)> {
                    list.iter().map(|cluster| (cluster.root, cluster.height)).collect()
                };
                assert_eq!(roots(&list[..left]), roots(&naive), "{who}");
            }
        }
    }
}

//! Object median: half of the primitives to each side, along the axis where they spread most.
//!
//! Source: as old as the hierarchy itself; see T. L. Kay and J. T. Kajiya, "Ray Tracing Complex
//! Scenes", SIGGRAPH 1986, which sorts along an axis and cuts the list in two. Always balanced: the
//! depth is `log2 n`, the quality is poor.
//!
//! O(n log n) time, in place.

use super::prim_ref::{self, Cutter, PrimRef};
use super::radix_sort::ordered_bits;
use super::top_down::{Cut, Range};
use super::{BuildError, Builder, Info};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage};
use crate::tree::Tree;

/// Cuts the list in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectMedian {
    /// Most primitives in a leaf, in `1..=64`. Ranges up to this size are not cut.
    pub leaf_max: u32,
}

impl ObjectMedian {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4 };
}

impl Builder for ObjectMedian {
    fn info(&self) -> Info {
        Info {
            name: "object-median",
            summary: "half of the primitives to each side, along the axis where they spread most",
            source: "Kay and Kajiya 1986",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        prim_ref::build(self, bounds, context)
    }
}

impl Cutter for ObjectMedian {
    fn leaf_max(&self) -> u32 {
        self.leaf_max
    }

    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        let count = range.slots.len();
        if count <= self.leaf_max as usize {
            return Ok(None);
        }
        let axis = prim_ref::widest_axis(&range.extent.centers);
        let key = |item: &PrimRef| ordered_bits(item.bounds.center()[axis]);
        if count <= prim_ref::CHUNK {
            let by_key = |item: &PrimRef| (key(item), item.prim);
            range.slots.select_nth_unstable_by_key(count / 2, by_key);
            return prim_ref::halve(range, stage).map(Some);
        }
        // Find the key in the middle by its digits, then move what is below it to the front, with
        // as many of its equals as fill the half.
        let (median, mut equals) = median_key(range.slots, count / 2, key, stage)?;
        let goes_left = |item: &PrimRef| match key(item).cmp(&median) {
            core::cmp::Ordering::Less => true,
            core::cmp::Ordering::Greater => false,
            core::cmp::Ordering::Equal => {
                let fits = equals > 0;
                equals -= usize::from(fits);
                fits
            }
        };
        prim_ref::partition(range.slots, goes_left, stage)
    }
}

/// The key of rank `rank`, and how many of its equals come before that rank. Three passes, one for
/// each digit of 11 bits from the top: unlike a selection, they can be interrupted.
fn median_key(
    refs: &[PrimRef],
    rank: usize,
    key: impl Fn(&PrimRef) -> u32,
    stage: &Stage<'_>,
) -> Result<(u32, usize), Cancelled> {
    const DIGIT_BITS: u32 = 11;
    let (mut prefix, mut rest) = (0_u32, rank);
    let mut known_bits = 0;
    for shift in [21_u32, 10, 0] {
        let bits = DIGIT_BITS.min(32 - known_bits);
        let mut histogram = [0_usize; 1 << DIGIT_BITS];
        for chunk in refs.chunks(prim_ref::CHUNK) {
            stage.check()?;
            for item in chunk {
                let key = key(item);
                // Keys that differ in the digits found so far are out of the race.
                let same = known_bits == 0 || (key ^ prefix) >> (32 - known_bits) == 0;
                histogram[(key >> shift) as usize & ((1 << bits) - 1)] += usize::from(same);
            }
        }
        let mut digit = 0;
        while rest >= histogram[digit] {
            rest -= histogram[digit];
            digit += 1;
        }
        prefix |= (digit as u32) << shift;
        known_bits += bits;
    }
    Ok((prefix, rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn the_median_is_that_of_a_sorted_list() {
        let context = Context::default();
        let stage = Stage::new(&context, "test", 0);
        let item = |prim: u32| PrimRef { bounds: Aabb::EMPTY, prim };
        // A multiplicative hash: values all over u32, some of them equal.
        let keys: Vec<u32> =
            (0..5000_u32).map(|i| (i % 1700).wrapping_mul(2_654_435_761)).collect();
        let refs: Vec<_> = (0..5000).map(item).collect();
        let mut sorted = keys.clone();
        sorted.sort_unstable();
        for rank in [0, 1, 2499, 2500, 4999] {
            let key = |item: &PrimRef| keys[item.prim as usize];
            let (median, equals) = median_key(&refs, rank, key, &stage).unwrap();
            assert_eq!(median, sorted[rank]);
            let below = sorted.iter().filter(|&&key| key < median).count();
            assert_eq!(equals, rank - below);
        }
    }
}

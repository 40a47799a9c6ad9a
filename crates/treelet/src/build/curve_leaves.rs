//! Where neighbours on the Morton curve part, and which ranges of it become leaves.
//!
//! The highest bit in which the codes of two neighbours differ is where the hierarchy of the curve
//! parts them (T. Karras, "Maximizing Parallelism in the Construction of BVHs, Octrees, and k-d
//! Trees", HPG 2012). The largest ranges of that hierarchy with up to `leaf_max` primitives become
//! leaves.
//!
//! Levels are `1..=63` by the bits of the code from the top, `64..=94` by places among equals: no
//! path of the hierarchy is longer than 95 nodes.

use super::curve_order::{Order, Piece, Split};
use super::{BuildError, radix_sort};
use crate::bounds::Aabb;
use crate::context::Stage;
use crate::math::morton::{CODE_BITS, Curve};
use crate::memory;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::AtomicU64;

/// Up to this many entries are sorted by comparison: less work than counting digits.
const SMALL_RUN: usize = 512;
/// Bits by which a bucket is sorted by digits: three that a first-level cache holds. What is equal in
/// them is sorted by comparison.
const SORT_BITS: u32 = 27;
/// The level of neighbours whose first words are equal, before [`refine`].
const EQUAL: u8 = u8::MAX;

/// A leaf and what comes after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// Place of its first primitive in the piece.
    pub(super) first: u32,
    /// Where it parts from the next leaf; 0 for the last of a piece.
    pub(super) level: u8,
}

impl Mark {
    #[inline(always)]
    fn pack(self) -> u64 {
        u64::from(self.level) << u32::BITS | u64::from(self.first)
    }

    /// Decodes what [`find`] wrote.
    #[inline(always)]
    pub(super) fn unpack(packed: u64) -> Self {
        Self { first: packed as u32, level: (packed >> u32::BITS) as u8 }
    }
}

/// What finding the leaves of a piece is given.
pub(super) struct Search<'a> {
    pub(super) bounds: &'a [Aabb],
    pub(super) curve: &'a Curve,
    pub(super) split: Split,
    pub(super) starts: &'a [usize],
    pub(super) leaf_max: usize,
    pub(super) stage: &'a Stage<'a>,
}

impl Search<'_> {
    /// Sorts the entries of a piece, writes its primitives in order, and overwrites the entries by
    /// its leaves' [`Mark`]s.
    pub(super) fn find(
        &self,
        piece: &mut Piece,
        entries: &mut [AtomicU64],
        prims: &mut [u32],
    ) -> Result<(), BuildError> {
        // Sort bucket by bucket.
        let mut sorted = memory::try_with_capacity(entries.len(), "sorting")?;
        sorted.extend(entries.iter_mut().map(|entry| *entry.get_mut()));
        let mut spare = Vec::new();
        let split = self.split;
        let below_bucket = split.prim_bits + split.coarse_bits - split.bucket_bits;
        let bits = split.prim_bits.max(below_bucket.saturating_sub(SORT_BITS))..below_bucket;
        for bucket in piece.buckets.clone() {
            let begin = piece.prims.start;
            let range = self.starts[bucket] - begin..self.starts[bucket + 1] - begin;
            let more = range.len().saturating_sub(spare.len());
            memory::try_reserve(&mut spare, more, "sorting")?;
            spare.resize(spare.len() + more, 0);
            let spare = &mut spare[..range.len()];
            radix_sort::sort(&mut sorted[range], spare, bits.clone(), self.stage)?;
        }
        if bits.start > split.prim_bits {
            self.sort_runs(&mut sorted, bits.start)?;
        }

        // Find where neighbours part, and which ranges are small enough.
        let mut levels = memory::try_filled(0, sorted.len() + 2 * PAD, "levels")?;
        part(&sorted, split, &mut levels[PAD..]);
        self.refine(&mut sorted, &mut levels[PAD..])?;
        for (entry, prim) in sorted.iter().zip(prims) {
            *prim = split.prim(*entry);
        }
        piece.leaves = mark_leaves(&levels, self.leaf_max, entries);
        Ok(())
    }

    /// Sorts runs of entries that are equal from bit `from` up. Fewer than fill a leaf are let be: they
    /// part below everything around them, so they stay together, and in a leaf no order matters.
    #[inline(never)]
    fn sort_runs(&self, entries: &mut [u64], from: u32) -> Result<(), BuildError> {
        let mut at = 0;
        while let Some(run) = next_run(entries, at, from, self.leaf_max) {
            at = run.end;
            self.sort_run(&mut entries[run], self.split.prim_bits..from)?;
        }
        Ok(())
    }

    /// Sorts entries by bits above which they are equal, below which they are primitives in order.
    fn sort_run(&self, entries: &mut [u64], bits: Range<u32>) -> Result<(), BuildError> {
        self.stage.check()?;
        if entries.len() <= SMALL_RUN {
            entries.sort_unstable();
            return Ok(());
        }
        let mut spare = memory::try_filled(0, entries.len(), "sorting")?;
        Ok(radix_sort::sort(entries, &mut spare, bits, self.stage)?)
    }

    /// Sorts entries with equal first words by their second ones. Fewer than fill a leaf are let be.
    fn refine(&self, entries: &mut [u64], levels: &mut [u8]) -> Result<(), BuildError> {
        let mut at = 0;
        while let Some(run) = next_run(entries, at, self.split.prim_bits, self.leaf_max) {
            at = run.end;
            let levels = &mut levels[run.start..run.end - 1];
            self.refine_run(&mut entries[run], levels)?;
        }
        Ok(())
    }

    /// Sorts entries with equal first words.
    fn refine_run(&self, entries: &mut [u64], levels: &mut [u8]) -> Result<(), BuildError> {
        let split = self.split;
        let code = entries[0] >> split.prim_bits;
        let unused = CODE_BITS - split.code_bits();
        for entry in &mut *entries {
            let prim = split.prim(*entry);
            *entry = u64::from(prim);
            if split.fine_bits > 0 {
                let center = self.bounds[prim as usize].center();
                let fine = self.curve.fine(self.curve.cell(center));
                *entry = split.entry(fine >> unused, prim);
            }
        }
        self.sort_run(entries, split.prim_bits..split.prim_bits + split.fine_bits)?;

        let mut begin = 0;
        for at in 0..levels.len() {
            let differ = (entries[at] ^ entries[at + 1]) >> split.prim_bits;
            levels[at] = if differ != 0 {
                begin = at + 1;
                (split.code_bits() - differ.ilog2()) as u8
            } else {
                // Equal to the last bit: parted by place, the left side a power of two.
                let place = (at - begin) as u32;
                (CODE_BITS + (place ^ (place + 1)).leading_zeros()) as u8
            };
        }
        for entry in entries {
            *entry = split.entry(code, split.prim(*entry));
        }
        Ok(())
    }
}

/// The first run, at or after `at`, of more than `leaf_max` entries that are equal from bit `from` up.
/// Entries are sorted by those bits.
#[inline(always)]
fn next_run(entries: &[u64], at: usize, from: u32, leaf_max: usize) -> Option<Range<usize>> {
    let rest = entries.get(at..)?;
    let ahead = rest.get(leaf_max..)?;
    let equal = |a: u64, b: u64| (a ^ b) >> from == 0;
    let begin = rest.iter().zip(ahead).position(|(&a, &b)| equal(a, b))?;
    let run = ahead[begin..].iter().take_while(|&&entry| equal(entry, rest[begin]));
    Some(at + begin..at + begin + leaf_max + run.count())
}

/// Where sorted neighbours part by the first words of their codes.
#[inline(never)]
fn part(entries: &[u64], split: Split, levels: &mut [u8]) {
    let unused = u64::BITS - split.prim_bits - split.coarse_bits;
    for (pair, level) in entries.windows(2).zip(levels) {
        // Primitives differ, so this is not 0.
        let level_of = |differ: u64| (differ | 1).leading_zeros() - unused;
        let bit = level_of(pair[0] ^ pair[1]);
        *level = if bit < split.coarse_bits { bit as u8 + 1 } else { EQUAL };
    }
}

/// Lanes of the pass that looks for leaves.
const LANES: usize = 16;
/// Zeros before and after levels: as many as that pass looks at past the ends.
const PAD: usize = super::LEAF_MAX as usize + LANES;

/// Writes down the leaves; returns how many.
#[inline(never)]
fn mark_leaves(levels: &[u8], leaf_max: usize, marks: &mut [AtomicU64]) -> usize {
    let count = marks.len();
    let (mut leaves, mut first) = (0, 0);
    for block in (0..count).step_by(LANES) {
        let sizes = range_sizes(&levels[block..block + 2 * PAD], leaf_max);
        let lanes = LANES.min(count - block);
        for (lane, &size) in sizes[..lanes].iter().enumerate() {
            // Written again and again until the leaf ends: cheaper than a branch that is often wrong.
            let at = block + lane;
            *marks[leaves].get_mut() = Mark { first, level: levels[PAD + at] }.pack();
            let ends = usize::from(size) > leaf_max || at + 1 == count;
            leaves += usize::from(ends);
            first = if ends { at as u32 + 1 } else { first };
        }
    }
    leaves
}

/// How many primitives are in the ranges that part after those from `PAD` on; counted only as far as
/// `leaf_max` on either side.
#[inline(always)]
fn range_sizes(levels: &[u8], leaf_max: usize) -> [u8; LANES] {
    let window = |from: usize| -> [u8; LANES] {
        let mut out = [0; LANES];
        out.copy_from_slice(&levels[from..from + LANES]);
        out
    };
    let here = window(PAD);
    // A range goes on as long as levels are deeper.
    let (mut size, mut left, mut right) = ([2; LANES], [1; LANES], [1; LANES]);
    for step in 1..leaf_max {
        let (before, after) = (window(PAD - step), window(PAD + step));
        for lane in 0..LANES {
            left[lane] &= u8::from(before[lane] > here[lane]);
            right[lane] &= u8::from(after[lane] > here[lane]);
            size[lane] += left[lane] + right[lane];
        }
    }
    size
}

impl Order {
    /// Sorts every piece and finds its leaves: their [`Mark`]s replace the entries.
    pub(super) fn find_leaves(
        &mut self,
        bounds: &[Aabb],
        leaf_max: u32,
        prims: &mut [u32],
        stage: &Stage<'_>,
    ) -> Result<(), BuildError> {
        let search = Search {
            bounds,
            curve: &self.curve,
            split: self.split,
            starts: &self.starts,
            leaf_max: leaf_max as usize,
            stage,
        };
        let (mut entries, mut prims) = (&mut *self.entries, prims);
        let mut tasks = Vec::with_capacity(self.pieces.len());
        for piece in &mut self.pieces {
            let count = piece.prims.len();
            tasks.push((take(&mut entries, count), take(&mut prims, count), piece));
        }
        let found = crate::context::parallel::map(tasks, |(entries, prims, piece)| {
            stage.check()?;
            search.find(piece, entries, prims)
        });
        found.into_iter().collect()
    }
}

/// Takes the first `count` items off a slice.
pub(super) fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (first, others) = core::mem::take(rest).split_at_mut(count);
    *rest = others;
    first
}

//! Primitives along the Morton curve, sorted as far as threads need it: into buckets, one pass over
//! memory, by the first bits of their codes; and the pieces of the curve that become tasks.
//!
//! O(n) time; 16 bytes a primitive, 8 of which are let go at the end.

use super::BuildError;
use crate::bounds::Aabb;
use crate::context::{Cancelled, Stage, parallel};
use crate::math::morton::{COARSE_BITS_MAX, Curve};
use crate::memory::{self, Pages};
use crate::tree::PRIMS_MAX;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::{AtomicU64, Ordering};

/// Passes over all primitives are cut into chunks of at least this size.
const CHUNK: usize = 16_384;
/// How many chunks and pieces to aim for.
const TASKS: usize = 64;
/// Smallest piece worth a task.
const PIECE_MIN: usize = 2048;
/// A bucket holds about this many primitives if they are spread evenly: sorting it stays in a
/// first-level cache.
const BUCKET: usize = 2048;
/// Most bits of a bucket's number: more streams than this miss the TLB.
pub(super) const BUCKET_BITS_MAX: u32 = 11;

/// How an entry is divided: the first word of a code above the number of its primitive. The word has
/// as many bits as there is room for: with 33 always, so many primitives of a kitchen shared theirs
/// that the build took 55 ns a triangle instead of 44.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    pub(super) bucket_bits: u32,
    pub(super) coarse_bits: u32,
    /// Of the second word.
    pub(super) fine_bits: u32,
    pub(super) prim_bits: u32,
}

const _: () = assert!(PRIMS_MAX <= 1 << 31, "room for 33 bits of a code");

impl Split {
    /// For codes of `code_bits` bits, at least [`BUCKET_BITS_MAX`].
    pub(super) fn new(count: usize, code_bits: u32) -> Self {
        let bucket_bits = (count / BUCKET).checked_ilog2().map_or(0, |bits| bits + 1);
        let bucket_bits = bucket_bits.min(BUCKET_BITS_MAX);
        let prim_bits = usize::BITS - count.saturating_sub(1).leading_zeros();
        let coarse_bits = (u64::BITS - prim_bits).min(COARSE_BITS_MAX).min(code_bits);
        Self { bucket_bits, coarse_bits, fine_bits: code_bits - coarse_bits, prim_bits }
    }

    pub(super) fn code_bits(self) -> u32 {
        self.coarse_bits + self.fine_bits
    }

    #[inline(always)]
    pub(super) fn entry(self, code: u64, prim: u32) -> u64 {
        code << self.prim_bits | u64::from(prim)
    }

    #[inline(always)]
    pub(super) fn prim(self, entry: u64) -> u32 {
        (entry & !(u64::MAX << self.prim_bits)) as u32
    }

    #[inline(always)]
    fn bucket(self, entry: u64) -> usize {
        (entry >> (self.prim_bits + self.coarse_bits - self.bucket_bits)) as usize
    }
}

/// A range of the curve that becomes a task.
#[derive(Debug)]
pub(super) struct Piece {
    /// Its primitives, by place on the curve.
    pub(super) prims: Range<usize>,
    /// Its buckets.
    pub(super) buckets: Range<usize>,
    /// Where it parts from the next piece; 0 for the last one.
    pub(super) level: u8,
    /// How many leaves it has, once they are found.
    pub(super) leaves: usize,
}

/// Primitives in buckets along the curve, not sorted inside.
pub(super) struct Order {
    pub(super) curve: Curve,
    pub(super) split: Split,
    /// Atomic because threads fill buckets together.
    pub(super) entries: Pages<AtomicU64>,
    /// Where buckets begin, and the end.
    pub(super) starts: Vec<usize>,
    /// In the order of the curve.
    pub(super) pieces: Vec<Piece>,
}

impl Order {
    pub(super) fn new(
        bounds: &[Aabb],
        code_bits: u32,
        stage: &Stage<'_>,
    ) -> Result<Self, BuildError> {
        let count = bounds.len();
        let split = Split::new(count, code_bits);
        let centers = centers(bounds, stage)?;
        let curve = Curve::new(centers.lo, centers.hi, split.coarse_bits);
        let chunk = CHUNK.max(count.div_ceil(TASKS));

        // Compute codes and count buckets, chunk by chunk.
        let encoded = parallel::map_chunks(bounds, chunk, |first, bounds| {
            encode(bounds, first, (&curve, split), stage)
        });
        let encoded = encoded.into_iter().collect::<Result<Vec<_>, BuildError>>()?;
        let (codes, mut places): (Vec<_>, Vec<_>) = encoded.into_iter().unzip();

        // Give each bucket, and in it each chunk, its place.
        let mut starts = Vec::with_capacity((1 << split.bucket_bits) + 1);
        let mut next = 0;
        for bucket in 0..1 << split.bucket_bits {
            starts.push(next as usize);
            for places in &mut places {
                next += core::mem::replace(&mut places[bucket], next);
            }
        }
        starts.push(count);

        // Move entries to their buckets.
        let entries = Pages::<AtomicU64>::zeroed(count, "buckets")?;
        let chunks: Vec<_> = codes.into_iter().zip(places).collect();
        let moved = parallel::map(chunks, |(codes, places)| {
            distribute(&codes, places, split, &entries, stage)
        });
        moved.into_iter().collect::<Result<(), Cancelled>>()?;

        let most = PIECE_MIN.max(count.div_ceil(TASKS));
        let pieces = pieces(&starts, split.bucket_bits, most);
        Ok(Self { curve, split, entries, starts, pieces })
    }
}

/// The box of the boxes' centers.
fn centers(bounds: &[Aabb], stage: &Stage<'_>) -> Result<Aabb, Cancelled> {
    let parts = parallel::map_chunks(bounds, CHUNK, |_, bounds| {
        stage.check()?;
        Ok(centers_of(bounds))
    });
    let mut centers = Aabb::EMPTY;
    for part in parts {
        let part: Result<_, Cancelled> = part;
        centers = centers.union(&part?);
    }
    Ok(centers)
}

/// Four lanes, the last of which is of no use, make this twice as fast as three.
fn centers_of(bounds: &[Aabb]) -> Aabb {
    let (mut lo, mut hi) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
    for Aabb { lo: [x, y, z], hi: [far_x, far_y, far_z] } in bounds {
        let (near, far) = ([*x, *y, *z, *far_x], [*far_x, *far_y, *far_z, *far_z]);
        for lane in 0..4 {
            let center = 0.5 * near[lane] + 0.5 * far[lane];
            lo[lane] = if center < lo[lane] { center } else { lo[lane] };
            hi[lane] = if center > hi[lane] { center } else { hi[lane] };
        }
    }
    Aabb { lo: [lo[0], lo[1], lo[2]], hi: [hi[0], hi[1], hi[2]] }
}

/// The entries of some primitives, numbered from `first`, and how many are in each bucket.
#[inline(never)]
fn encode(
    bounds: &[Aabb],
    first: usize,
    (curve, split): (&Curve, Split),
    stage: &Stage<'_>,
) -> Result<(Vec<u64>, Vec<u32>), BuildError> {
    let mut counts = alloc::vec![0; 1 << split.bucket_bits];
    let mut entries = memory::try_with_capacity(bounds.len(), "codes")?;
    let mut prims = first as u32..;
    for bounds in bounds.chunks(CHUNK) {
        stage.check()?;
        entries.extend(bounds.iter().zip(&mut prims).map(|(bounds, prim)| {
            let code = curve.coarse(curve.cell(bounds.center()));
            let entry = split.entry(code, prim);
            counts[split.bucket(entry)] += 1;
            entry
        }));
    }
    Ok((entries, counts))
}

/// Moves entries to their buckets. Every store has a place of its own, so relaxed ones do.
#[inline(never)]
fn distribute(
    codes: &[u64],
    mut places: Vec<u32>,
    split: Split,
    entries: &[AtomicU64],
    stage: &Stage<'_>,
) -> Result<(), Cancelled> {
    for codes in codes.chunks(CHUNK) {
        stage.check()?;
        for &entry in codes {
            let place = &mut places[split.bucket(entry)];
            entries[*place as usize].store(entry, Ordering::Relaxed);
            *place += 1;
        }
    }
    Ok(())
}

/// Cuts the curve into ranges of up to `most` primitives, or of one bucket.
fn pieces(starts: &[usize], bucket_bits: u32, most: usize) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    let mut open = alloc::vec![0..1_usize << bucket_bits];
    while let Some(buckets) = open.pop() {
        let prims = starts[buckets.start]..starts[buckets.end];
        if prims.len() > most && buckets.len() > 1 {
            let middle = buckets.start + buckets.len() / 2;
            open.push(middle..buckets.end);
            open.push(buckets.start..middle);
        } else if !prims.is_empty() {
            if let Some(last) = pieces.last_mut() {
                let differ = last.buckets.start ^ buckets.start;
                last.level = (bucket_bits - differ.ilog2()) as u8;
            }
            pieces.push(Piece { prims, buckets, level: 0, leaves: 0 });
        }
    }
    pieces
}

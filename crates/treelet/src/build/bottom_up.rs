//! What builders over Morton codes share: sort along the curve, cut into leaves, join from below.
//!
//! The curve orders the primitives; the digits in which the codes of neighbours differ make a
//! binary hierarchy of ranges (T. Karras, "Maximizing Parallelism in the Construction of BVHs,
//! Octrees, and k-d Trees", HPG 2012). Ranges of up to `leaf_max` become leaves. A builder is told
//! the leaves one after the other, each with the level at which it parts from the next, and joins
//! clusters as it likes.
//!
//! Pieces of the curve are ranges of that hierarchy whose sizes depend on the input alone; every
//! piece knows beforehand how many nodes it makes, so all write to their final places at once.
//!
//! O(n) time. 16 bytes a primitive of scratch while joining, besides the tree.

use super::BuildError;
use super::radix_sort;
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::math::morton::{COARSE_BITS, Curve, FINE_BITS};
use crate::memory;
use crate::tree::{Node, PRIMS_MAX, Tree};
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::{AtomicU64, Ordering};

/// Passes over all primitives are cut into chunks of at least this size.
const CHUNK: usize = 16_384;
/// How many chunks and pieces to aim for.
const TASKS: usize = 64;
/// Smallest piece worth a task.
const PIECE_MIN: usize = 2048;
/// A bucket of the first pass holds about this many primitives if they are spread evenly: it fits a
/// second-level cache twice.
const BUCKET: usize = 4096;
/// Most bits of the first pass.
const BUCKET_BITS_MAX: u32 = 11;

/// Up to this many entries are sorted by comparison: less work than counting digits.
const SMALL_RUN: usize = 512;

/// An entry holds the first word of a code above the number of its primitive.
const PRIM_BITS: u32 = u64::BITS - COARSE_BITS;
const _: () = assert!(PRIMS_MAX <= 1 << PRIM_BITS);

fn prim(entry: u64) -> u32 {
    (entry & ((1 << PRIM_BITS) - 1)) as u32
}

/// A subtree whose root has no place yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    pub(super) root: Node,
    /// Edges on the longest path below.
    pub(super) height: u32,
}

/// Where the nodes of a piece go, pairs of siblings from the end to the front: what is joined later
/// lies above, so children come after their parents.
pub(super) struct Below<'a> {
    nodes: &'a mut [Node],
    /// Index of the first of `nodes` in the tree.
    base: usize,
    free: usize,
}

impl<'a> Below<'a> {
    fn new(nodes: &'a mut [Node], base: usize) -> Self {
        Self { free: nodes.len(), nodes, base }
    }

    /// Gives two clusters their places and a parent.
    #[inline(always)]
    pub(super) fn join(&mut self, left: &Cluster, right: &Cluster) -> Cluster {
        self.free -= 2;
        self.nodes[self.free] = left.root;
        self.nodes[self.free + 1] = right.root;
        let bounds = left.root.bounds.union(&right.root.bounds);
        let height = left.height.max(right.height) + 1;
        Cluster { root: Node::inner(bounds, self.base + self.free), height }
    }
}

/// How a builder joins clusters.
pub(super) trait Join: Sync {
    /// What it keeps between one cluster and the next.
    type Open: Default;

    /// Takes neighbours on the curve that belong together; `level` is where the last of them parts
    /// from what comes next: the greater, the closer. 0 at the end.
    fn push(&self, open: &mut Self::Open, group: &[Cluster], level: u8, below: &mut Below<'_>);

    /// Joins what is open until `count` clusters are left.
    fn finish(&self, open: &mut Self::Open, count: usize, below: &mut Below<'_>) -> Vec<Cluster>;

    /// How many clusters a piece of many leaves hands to the top of the tree.
    fn keep(&self) -> usize;
}

/// Builds the tree that `join` joins, with leaves of up to `leaf_max`.
pub(super) fn build<J: Join>(
    join: &J,
    leaf_max: u32,
    bounds: &[Aabb],
    context: &Context<'_>,
) -> Result<(Tree, u32), BuildError> {
    let count = bounds.len();
    if count > PRIMS_MAX {
        return Err(BuildError::TooManyPrims { prims: count as u64 });
    }
    let stage = Stage::new(context, "build", count as u64);
    stage.check()?;
    if count == 0 {
        return Ok((Tree::default(), 0));
    }

    // Sort along the curve and find the leaves.
    let curve = Curve::new(&centers(bounds, &stage)?);
    let mut order = Order::new(bounds, &curve, &stage)?;
    order.find_leaves(bounds, &curve, leaf_max as usize, &stage)?;

    // Give every piece its place: below all that joins pieces.
    let keep = |piece: &Piece| piece.leaves.min(join.keep());
    let kept: usize = order.pieces.iter().map(keep).sum();
    let leaves: usize = order.pieces.iter().map(|piece| piece.leaves).sum();
    let unwritten = Node::leaf(Aabb::EMPTY, 0, 1);
    let mut nodes = memory::try_filled(unwritten, 2 * leaves - 1, "the tree's nodes")?;
    let mut prims = memory::try_filled(0, count, "the tree's primitives")?;
    let (top, mut rest) = nodes.split_at_mut(2 * kept - 1);
    let mut tasks = Vec::with_capacity(order.pieces.len());
    let mut base = top.len();
    let mut slices = Slices { entries: &mut order.entries, marks: &mut order.marks };
    let mut prims_rest = prims.as_mut_slice();
    for piece in &order.pieces {
        let size = 2 * (piece.leaves - keep(piece));
        let (entries, marks) = slices.split(piece.prims.len());
        let task = Task {
            piece,
            entries,
            marks: &mut marks[..piece.leaves],
            prims: split(&mut prims_rest, piece.prims.len()),
            below: Below::new(split(&mut rest, size), base),
        };
        tasks.push(task);
        base += size;
    }

    // Join inside pieces, all at once, then join the pieces.
    let groups = parallel::map(tasks, |task| {
        stage.check()?;
        let (piece, count) = (task.piece, keep(task.piece));
        let group = task.run(join, bounds, count);
        stage.advance(piece.prims.len() as u64);
        Ok((piece.level, group))
    });
    let (root, top) = top.split_at_mut(1);
    let mut below = Below::new(top, 1);
    let mut open = J::Open::default();
    for group in groups {
        let group: Result<_, Cancelled> = group;
        let (level, group) = group?;
        join.push(&mut open, &group, level, &mut below);
    }
    stage.check()?;
    let last = join.finish(&mut open, 1, &mut below);
    debug_assert!(last.len() == 1 && below.free == 0);
    root[0] = last[0].root;
    Ok((Tree { nodes, prims }, last[0].height + 1))
}

/// The box of the boxes' centers.
fn centers(bounds: &[Aabb], stage: &Stage<'_>) -> Result<Aabb, Cancelled> {
    let parts = parallel::map_chunks(bounds, CHUNK, |_, bounds| {
        stage.check()?;
        let mut centers = Aabb::EMPTY;
        for bounds in bounds {
            let center = bounds.center();
            centers = centers.union(&Aabb { lo: center, hi: center });
        }
        Ok(centers)
    });
    let mut centers = Aabb::EMPTY;
    for part in parts {
        let part: Result<_, Cancelled> = part;
        centers = centers.union(&part?);
    }
    Ok(centers)
}

/// A range of the curve that becomes a task.
struct Piece {
    /// Its primitives, by place on the curve.
    prims: Range<usize>,
    /// How many of them are in each bucket of the first pass.
    buckets: Range<usize>,
    /// Where it parts from the next piece; 0 for the last one.
    level: u8,
    leaves: usize,
}

/// Primitives along the curve.
struct Order {
    entries: Vec<u64>,
    /// First buckets, then leaves: the place of the first primitive below the level at which the
    /// leaf parts from the next one.
    marks: Vec<AtomicU64>,
    /// Where buckets begin, and the end.
    starts: Vec<usize>,
    pieces: Vec<Piece>,
    bucket_bits: u32,
}

impl Order {
    /// Primitives in buckets by the first bits of their codes, not sorted inside.
    fn new(bounds: &[Aabb], curve: &Curve, stage: &Stage<'_>) -> Result<Self, BuildError> {
        let count = bounds.len();
        let bucket_bits = (count / BUCKET).checked_ilog2().map_or(0, |bits| bits + 1);
        let bucket_bits = bucket_bits.min(BUCKET_BITS_MAX);
        let bucket = |entry: u64| (entry >> (u64::BITS - bucket_bits).min(63)) as usize;
        let bucket = |entry: u64| if bucket_bits == 0 { 0 } else { bucket(entry) };
        let chunk = CHUNK.max(count.div_ceil(TASKS));

        // Compute codes and count buckets, chunk by chunk.
        let mut entries = memory::try_filled(0_u64, count, "codes")?;
        let chunks: Vec<_> =
            bounds.chunks(chunk).zip(entries.chunks_mut(chunk)).enumerate().collect();
        let counted = parallel::map(chunks, |(index, (bounds, entries))| {
            let first = index * chunk;
            let mut counts = alloc::vec![0_u32; 1 << bucket_bits];
            let parts = bounds.chunks(CHUNK).zip(entries.chunks_mut(CHUNK));
            for (part, (bounds, entries)) in parts.enumerate() {
                stage.check()?;
                let first = first + part * CHUNK;
                for (at, (bounds, entry)) in bounds.iter().zip(entries).enumerate() {
                    let code = curve.coarse(curve.cell(bounds.center()));
                    *entry = code << PRIM_BITS | (first + at) as u64;
                    counts[bucket(*entry)] += 1;
                }
            }
            Ok(counts)
        });

        // Give each bucket, and in it each chunk, its place.
        let mut places: Vec<Vec<u32>> = Vec::with_capacity(counted.len());
        for counts in counted {
            let counts: Result<_, Cancelled> = counts;
            places.push(counts?);
        }
        let mut starts = Vec::with_capacity((1 << bucket_bits) + 1);
        let mut next = 0;
        for bucket in 0..1 << bucket_bits {
            starts.push(next as usize);
            for places in &mut places {
                next += core::mem::replace(&mut places[bucket], next);
            }
        }
        starts.push(count);

        // Move entries to their buckets. Every store has its own place, so relaxed atomics do.
        let mut marks = memory::try_with_capacity(count, "buckets")?;
        marks.resize_with(count, AtomicU64::default);
        let chunks: Vec<_> = entries.chunks(chunk).zip(places).collect();
        let moved = parallel::map(chunks, |(entries, mut places)| {
            for entries in entries.chunks(CHUNK) {
                stage.check()?;
                for &entry in entries {
                    let place = &mut places[bucket(entry)];
                    marks[*place as usize].store(entry, Ordering::Relaxed);
                    *place += 1;
                }
            }
            Ok(())
        });
        moved.into_iter().collect::<Result<(), Cancelled>>()?;
        let pieces = pieces(&starts, bucket_bits, PIECE_MIN.max(count.div_ceil(TASKS)));
        Ok(Self { entries, marks, starts, pieces, bucket_bits })
    }

    /// Sorts every piece and finds its leaves.
    fn find_leaves(
        &mut self,
        bounds: &[Aabb],
        curve: &Curve,
        leaf_max: usize,
        stage: &Stage<'_>,
    ) -> Result<(), BuildError> {
        let mut tasks = Vec::with_capacity(self.pieces.len());
        let mut slices = Slices { entries: &mut self.entries, marks: &mut self.marks };
        for piece in &mut self.pieces {
            tasks.push((slices.split(piece.prims.len()), piece));
        }
        let (starts, bits) = (&self.starts, PRIM_BITS..u64::BITS - self.bucket_bits);
        let done = parallel::map(tasks, |((entries, marks), piece)| {
            let begin = piece.prims.start;
            // Sort bucket by bucket.
            let (mut items, mut spare) = (Vec::new(), Vec::new());
            for bucket in piece.buckets.clone() {
                let range = starts[bucket] - begin..starts[bucket + 1] - begin;
                items.clear();
                memory::try_reserve(&mut items, range.len(), "sorting")?;
                items.extend(marks[range.clone()].iter_mut().map(|mark| *mark.get_mut()));
                spare.clear();
                memory::try_reserve(&mut spare, range.len(), "sorting")?;
                spare.resize(range.len(), 0);
                radix_sort::sort(&mut items, &mut spare, bits.clone(), stage)?;
                entries[range].copy_from_slice(&items);
            }
            // Find where neighbours part, and which ranges are small enough.
            let mut levels = Levels::new(entries, leaf_max)?;
            levels.refine(entries, bounds, curve, stage)?;
            piece.leaves = levels.mark_leaves(marks);
            Ok(())
        });
        done.into_iter().collect()
    }
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
                let differ = (last.buckets.start ^ buckets.start) as u64;
                let bit = 63 - differ.leading_zeros();
                last.level = (bucket_bits - bit) as u8;
            }
            pieces.push(Piece { prims, buckets, level: 0, leaves: 0 });
        }
    }
    pieces
}

/// The arrays of an [`Order`], to be handed out piece by piece.
struct Slices<'a> {
    entries: &'a mut [u64],
    marks: &'a mut [AtomicU64],
}

impl<'a> Slices<'a> {
    fn split(&mut self, count: usize) -> (&'a mut [u64], &'a mut [AtomicU64]) {
        (split(&mut self.entries, count), split(&mut self.marks, count))
    }
}

/// Takes the first `count` items off a slice.
fn split<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (first, others) = core::mem::take(rest).split_at_mut(count);
    *rest = others;
    first
}

/// At which level neighbours of a piece part: `1..=33` by the first word of their codes, `34..=63`
/// by the second, `64..=94` by their places among equals, so no path is longer than 95 nodes.
struct Levels {
    /// With `leaf_max` zeros before and after.
    levels: Vec<u8>,
    leaf_max: usize,
    count: usize,
}

/// The level of neighbours whose codes are equal, before [`Levels::refine`].
const EQUAL: u8 = u8::MAX;

impl Levels {
    fn new(entries: &[u64], leaf_max: usize) -> Result<Self, BuildError> {
        let count = entries.len();
        let mut levels = memory::try_filled(0_u8, count + 2 * leaf_max, "levels")?;
        for (pair, level) in entries.windows(2).zip(&mut levels[leaf_max..]) {
            let differ = (pair[0] ^ pair[1]) | 1;
            let zeros = differ.leading_zeros();
            *level = if zeros < COARSE_BITS { zeros as u8 + 1 } else { EQUAL };
        }
        Ok(Self { levels, leaf_max, count })
    }

    /// Sorts entries with equal first words by their second ones. Fewer than make a leaf are let be.
    fn refine(
        &mut self,
        entries: &mut [u64],
        bounds: &[Aabb],
        curve: &Curve,
        stage: &Stage<'_>,
    ) -> Result<(), BuildError> {
        let levels = &mut self.levels[self.leaf_max..];
        let mut at = 0;
        while at < self.count {
            let Some(skip) = levels[at..self.count].iter().position(|&level| level == EQUAL) else {
                break;
            };
            let begin = at + skip;
            let equals = levels[begin..self.count].iter().take_while(|&&level| level == EQUAL);
            // As many levels as primitives but one.
            let end = begin + equals.count() + 1;
            if end - begin > self.leaf_max {
                stage.check()?;
                refine_run(&mut entries[begin..end], &mut levels[begin..end - 1], bounds, curve, stage)?;
            }
            at = end;
        }
        Ok(())
    }

    /// Writes down the leaves, the largest ranges of up to `leaf_max`; returns how many.
    fn mark_leaves(&self, marks: &mut [AtomicU64]) -> usize {
        let pad = self.leaf_max;
        let (mut leaves, mut first) = (0, 0);
        for at in 0..self.count {
            let level = self.levels[pad + at];
            // The range that is cut after this primitive: as far as levels are deeper.
            let (mut size, mut left, mut right) = (2, true, true);
            for step in 1..pad {
                left &= self.levels[pad + at - step] > level;
                right &= self.levels[pad + at + step] > level;
                size += usize::from(left) + usize::from(right);
            }
            *marks[leaves].get_mut() = u64::from(level) << u32::BITS | first as u64;
            let ends = size > self.leaf_max || at + 1 == self.count;
            leaves += usize::from(ends);
            first = if ends { at + 1 } else { first };
        }
        leaves
    }
}

/// Sorts entries with equal first words.
fn refine_run(
    entries: &mut [u64],
    levels: &mut [u8],
    bounds: &[Aabb],
    curve: &Curve,
    stage: &Stage<'_>,
) -> Result<(), BuildError> {
    let code = entries[0] >> PRIM_BITS << PRIM_BITS;
    for entry in &mut *entries {
        let prim = u64::from(prim(*entry));
        *entry = curve.fine(curve.cell(bounds[prim as usize].center())) << PRIM_BITS | prim;
    }
    if entries.len() <= SMALL_RUN {
        entries.sort_unstable();
    } else {
        let mut spare = memory::try_filled(0, entries.len(), "sorting")?;
        radix_sort::sort(entries, &mut spare, PRIM_BITS..PRIM_BITS + FINE_BITS, stage)?;
    }

    let mut begin = 0;
    for at in 0..levels.len() {
        let differ = (entries[at] ^ entries[at + 1]) >> PRIM_BITS;
        if differ != 0 {
            let bit = 63 - differ.leading_zeros();
            levels[at] = (COARSE_BITS + FINE_BITS - bit) as u8;
            begin = at + 1;
        } else {
            // Equal to the last bit: halved by place, the left half a power of two.
            let place = (at - begin) as u32;
            levels[at] = (COARSE_BITS + FINE_BITS + (place ^ (place + 1)).leading_zeros()) as u8;
        }
    }
    for entry in entries {
        *entry = code | u64::from(prim(*entry));
    }
    Ok(())
}

/// A piece to be joined.
struct Task<'a> {
    piece: &'a Piece,
    entries: &'a [u64],
    marks: &'a mut [AtomicU64],
    prims: &'a mut [u32],
    below: Below<'a>,
}

impl Task<'_> {
    fn run<J: Join>(mut self, join: &J, bounds: &[Aabb], count: usize) -> Vec<Cluster> {
        for (entry, out) in self.entries.iter().zip(&mut *self.prims) {
            *out = prim(*entry);
        }
        let mut open = J::Open::default();
        let begin = self.piece.prims.start;
        for leaf in 0..self.marks.len() {
            let mark = *self.marks[leaf].get_mut();
            let first = mark as u32 as usize;
            let end = self.marks.get_mut(leaf + 1).map_or(self.prims.len(), |mark| *mark.get_mut() as u32 as usize);
            let mut around = Aabb::EMPTY;
            for &prim in &self.prims[first..end] {
                around = around.union(&bounds[prim as usize]);
            }
            let root = Node::leaf(around, begin + first, end - first);
            join.push(&mut open, &[Cluster { root, height: 0 }], (mark >> u32::BITS) as u8, &mut self.below);
        }
        join.finish(&mut open, count, &mut self.below)
    }
}

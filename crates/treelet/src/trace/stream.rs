//! Many rays through one level at once: a node is loaded once for all rays that reach it.
//!
//! Rays of one octant (the signs of the direction) are walked together, depth first, as lists of
//! ids. At a node every ray of the list is tested against all children; the ids are then dealt out
//! to one list a child. What that gains: no step of a ray waits for the one before it, nothing
//! branches on a single ray, nodes are fetched once for many rays.
//!
//! The test of a box is that of single rays, step by step; the test of a triangle is the same
//! function. Lists may hold rays whose hit has come nearer since: those only cost time. So the
//! answers are those of single rays.
//!
//! Source: W. Barringer, T. Akenine-Moller, "Dynamic Ray Stream Traversal", SIGGRAPH 2014; differs:
//! rays of different octants never share a list, short lists go on as single rays.

use super::prepared::Prepared;
use super::structure::{Get, Layout, Structure};
use super::walk::{Found, Visitor, walk_from};
use crate::bounds::{Interval, SlabRay};
use crate::geometry::{TriangleRay, block};
use crate::layout::wide::{Child, ChildKind, Node, Wide as WideTree};
use crate::math::{Ray, vec3};
use crate::memory::{OutOfMemory, try_reserve};
use crate::simd::{Floats, Kernel, Simd, Wide};
use alloc::vec::Vec;

/// What a stream tells about its rays' hits, and keeps of them between lists.
pub(crate) trait Answers<'a> {
    /// Sees the hits of one ray in one part of the tree.
    type Visitor: Visitor<'a>;

    /// For the ray in `slot`, which wants hits up to `t_max`.
    fn visitor(&self, slot: usize, t_max: f32) -> Self::Visitor;

    /// Keeps what the visitor saw; the greatest `t` that still matters to that ray.
    fn settle(&mut self, slot: usize, visitor: Self::Visitor) -> f32;
}

/// Rays of a batch, at most: their records fill half of a usual second-level cache.
pub(crate) const BATCH: usize = 4096;

/// Lists this short go on as single rays.
const FEW: usize = 2;

/// Ids of all lists that wait, at most. Lists that find no room go on as single rays.
const IDS_MAX: usize = 32 * BATCH;

/// Items that [`Simd::select`] handles at once.
const STEP: usize = 16;

/// A ray of a batch.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Record {
    slab: SlabRay,
    t_min: f32,
    /// The greatest `t` that matters by now.
    t_max: f32,
    /// Where the ray is in the slice.
    slot: u32,
    triangle: TriangleRay,
}

/// Rays that are to visit a child.
#[derive(Clone, Copy)]
struct List {
    child: Child,
    start: usize,
    len: usize,
}

/// What a stream works in.
#[derive(Default)]
pub(crate) struct Room {
    records: Vec<Record>,
    ids: Vec<u32>,
    masks: Vec<u32>,
    lists: Vec<List>,
}

impl Room {
    /// For batches of up to `len` rays.
    pub(crate) fn new(len: usize) -> Result<Self, OutOfMemory> {
        const WHAT: &str = "a stream of rays";
        let mut room = Self::default();
        try_reserve(&mut room.records, len.min(BATCH), WHAT)?;
        try_reserve(&mut room.masks, len.min(BATCH) + STEP, WHAT)?;
        room.masks.resize(len.min(BATCH) + STEP, 0);
        let ids = (32 * len).min(IDS_MAX) + STEP;
        try_reserve(&mut room.ids, ids, WHAT)?;
        room.ids.resize(ids, 0);
        try_reserve(&mut room.lists, 256, WHAT)?;
        Ok(room)
    }
}

/// Asks about the rays in `slots`, valid and of one octant, at most [`BATCH`].
#[inline(always)]
pub(crate) fn stream<'a, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    rays: &[Ray],
    slots: &[u32],
    answers: &mut A,
    room: &mut Room,
) where
    S: Wide<W>,
    Layout: Get<W>,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, A::Visitor, W>: Kernel<Output = ()>,
{
    let Some(wide) = structure.layout.get() else { return };
    let toward = prepare(structure, rays, slots, room);
    let Some(first) = room.records.first() else { return };
    let backward = first.slab.backward.map(|axis| usize::from(axis & 1));
    let len = room.records.len();
    for i in 0..len {
        room.ids[i] = i as u32;
    }
    room.lists.clear();
    room.lists.push(List { child: wide.root, start: 0, len });
    while let Some(list) = room.lists.pop() {
        let full = list.start + list.len + W * (list.len + STEP) > room.ids.len();
        match list.child.kind() {
            ChildKind::Inner { node } if list.len > FEW && !full => {
                let Some(node) = wide.nodes.get(node) else { return };
                let met = test(simd, node, backward, list, room);
                if A::Visitor::NEAREST_FIRST {
                    deal_nearest_first(simd, wide, node, met, toward, backward, list, room);
                } else {
                    deal_largest_first(simd, wide, node, met, list, room);
                }
            }
            ChildKind::Leaf { first, count } if first < wide.triangles => {
                leaf(simd, structure, wide.block(first), first, count, rays, list, answers, room);
            }
            _ if list.child == Child::END => {}
            _ => {
                for i in 0..list.len {
                    let Room { records, ids, .. } = &mut *room;
                    let record = &mut records[ids[list.start + i] as usize];
                    if record.t_max < record.t_min {
                        continue;
                    }
                    let slot = record.slot as usize;
                    let mut visitor = answers.visitor(slot, record.t_max);
                    structure.level.run(Tail {
                        structure,
                        record,
                        ray: &rays[slot],
                        child: list.child,
                        visitor: &mut visitor,
                    });
                    record.t_max = answers.settle(slot, visitor);
                }
            }
        }
    }
}

/// A single ray below a child.
pub(crate) struct Tail<'a, 'r, 'v, V, const W: usize> {
    structure: &'a Structure,
    record: &'r Record,
    ray: &'r Ray,
    child: Child,
    visitor: &'v mut V,
}

macro_rules! tails {
    ($($width:literal)*) => {
        $(impl<'a, V: Visitor<'a>> Kernel for Tail<'a, '_, '_, V, $width> {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, record, ray, child, visitor } = self;
                let prepared = Prepared {
                    origin: ray.origin,
                    direction: ray.direction,
                    slab: record.slab,
                    triangle: record.triangle,
                    clip: Interval::ALL,
                };
                walk_from::<S, V, (), $width>(
                    simd, structure, prepared, child, ray, visitor, &mut (),
                );
            }
        })*
    };
}

tails! { 8 16 }

/// Fills the records; returns about where the rays go.
#[inline(always)]
fn prepare(structure: &Structure, rays: &[Ray], slots: &[u32], room: &mut Room) -> [f32; 3] {
    let mut toward = [0.0; 3];
    room.records.clear();
    for &slot in slots.iter().take(BATCH) {
        let ray = &rays[slot as usize];
        let Prepared { slab, triangle, .. } = Prepared::new(ray, structure);
        let unit = vec3::scale(ray.direction, 1.0 / vec3::max_abs(ray.direction));
        toward = vec3::add(toward, unit);
        let Ray { t_min, t_max, .. } = *ray;
        room.records.push(Record { slab, t_min, t_max, slot, triangle });
    }
    toward
}

/// Tests the list against a node; returns the children that any of its rays meets.
#[inline(always)]
fn test<S: Wide<W>, const W: usize>(
    simd: S,
    node: &Node<W>,
    backward: [usize; 3],
    list: List,
    room: &mut Room,
) -> u32 {
    let splat = |x: f32| S::F::splat(simd, x);
    let first = |axis: usize| S::F::load(simd, &node.planes[axis][backward[axis] & 1]);
    let last = |axis: usize| S::F::load(simd, &node.planes[axis][backward[axis] & 1 ^ 1]);
    let first = [first(0), first(1), first(2)];
    let last = [last(0), last(1), last(2)];
    let mut met = 0;
    let ids = &room.ids[list.start..list.start + list.len];
    let masks = &mut room.masks[..list.len + STEP];
    for (mask, &id) in masks.iter_mut().zip(ids) {
        let Record { slab, t_min, t_max, .. } = &room.records[id as usize];
        let (mut entry, mut exit) = (splat(*t_min), splat(*t_max));
        for axis in 0..3 {
            let reciprocal = splat(slab.reciprocal[axis]);
            entry = first[axis].sub(splat(slab.near[axis])).mul(reciprocal).max(entry);
            exit = last[axis].sub(splat(slab.far[axis])).mul(reciprocal).min(exit);
        }
        *mask = entry.le(exit);
        met |= *mask;
    }
    masks[list.len..].fill(0);
    met
}

/// Puts the rays of `list` that meet the child in `slot` on a list of their own.
#[inline(always)]
fn deal<S: Wide<W>, const W: usize>(
    simd: S,
    wide: &WideTree<W>,
    node: &Node<W>,
    slot: usize,
    list: List,
    start: usize,
    room: &mut Room,
) -> usize {
    let child = node.children[slot % W];
    if let Some(node) = wide.nodes.get(child.0 as usize) {
        simd.prefetch(&node.planes[0][0]);
        simd.prefetch(&node.planes[1][0]);
        simd.prefetch(&node.planes[2][0]);
        simd.prefetch(&node.children);
    }
    let mut end = start;
    let mut at = 0;
    while at < list.len {
        let masks = room.masks[at..].first_chunk().unwrap_or(&[0; STEP]);
        let ids = room.ids[list.start + at..].first_chunk().unwrap_or(&[0; STEP]);
        let (selected, count) = simd.select(1 << slot, masks, ids);
        if let Some(out) = room.ids[end..].first_chunk_mut() {
            *out = selected;
        }
        end += count;
        at += STEP;
    }
    room.lists.push(List { child, start, len: end - start });
    end
}

/// Nearer children last.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one step of one loop, cut out to be read")]
fn deal_nearest_first<S: Wide<W>, const W: usize>(
    simd: S,
    wide: &WideTree<W>,
    node: &Node<W>,
    met: u32,
    toward: [f32; 3],
    backward: [usize; 3],
    list: List,
    room: &mut Room,
) {
    let along = |axis: usize| {
        let planes = &node.planes[axis][backward[axis] & 1];
        S::F::load(simd, planes).mul(S::F::splat(simd, toward[axis]))
    };
    let key = along(0).add(along(1)).add(along(2)).lanes();
    let mut sorted = [(0.0, 0); W];
    let mut count = 0;
    let mut rest = met;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % W;
        rest &= rest - 1;
        // Insertion, the farthest first.
        let mut at = count;
        while at > 0 && sorted[(at - 1) % W].0 < key[slot] {
            sorted[at % W] = sorted[(at - 1) % W];
            at -= 1;
        }
        sorted[at % W] = (key[slot], slot);
        count += 1;
    }
    let mut end = list.start + list.len;
    for &(_, slot) in &sorted[..count] {
        end = deal(simd, wide, node, slot, list, end, room);
    }
}

/// Larger children last.
#[inline(always)]
fn deal_largest_first<S: Wide<W>, const W: usize>(
    simd: S,
    wide: &WideTree<W>,
    node: &Node<W>,
    met: u32,
    list: List,
    room: &mut Room,
) {
    let mut rest = met;
    let mut end = list.start + list.len;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % W;
        rest &= rest - 1;
        end = deal(simd, wide, node, slot, list, end, room);
    }
}

/// Tests the list against the triangles of a leaf.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one step of one loop, cut out to be read")]
fn leaf<'a, S: Simd, A: Answers<'a>, const N: usize>(
    simd: S,
    structure: &'a Structure,
    rows: &[f32; N],
    _first: usize,
    count: usize,
    rays: &[Ray],
    list: List,
    answers: &mut A,
    room: &mut Room,
) {
    for &id in &room.ids[list.start..list.start + list.len] {
        let record = &mut room.records[id as usize];
        let range = Interval { entry: record.t_min, exit: record.t_max };
        let Record { slab, triangle, .. } = &record;
        let hits = block::hit(simd, rows, count, triangle, slab, &Interval::ALL, &range);
        let mut mask = hits.mask;
        if mask == 0 {
            continue;
        }
        let slot = record.slot as usize;
        let mut visitor = answers.visitor(slot, record.t_max);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % block::LANES;
            mask &= mask - 1;
            let id = rows[9 * count + lane].to_bits();
            let (t, u, v) = (hits.t[lane], hits.u[lane], hits.v[lane]);
            if t > visitor.t_max() || !structure.sees(id, rays[slot].mask) {
                continue;
            }
            if visitor.hit(Found { t, u, v, id, inst: 0, structure }).is_break() {
                break;
            }
        }
        record.t_max = answers.settle(slot, visitor);
    }
}

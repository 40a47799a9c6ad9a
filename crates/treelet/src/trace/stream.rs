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

use super::record::{
    Class, FAR, NEAR, ORIGIN, RAYS, RECIPROCAL, Record, Rest, SHEAR, T_MAX, T_MIN, prepared,
    records,
};
use super::structure::{Get, Layout, Structure};
use super::walk::{Found, Visitor, walk_from};
use crate::bounds::Interval;
use crate::geometry::block;
use crate::geometry::bundle::Bundle;
use crate::layout::wide::{BLOCK_WORDS, Child, ChildKind, Node, Wide as WideTree};
use crate::math::Ray;
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
pub(crate) const BATCH: usize = 2048;

/// Lists this short go on as single rays.
const FEW: usize = 2;

/// Fewer rays than this are tested one by one at a leaf.
const BUNDLE_MIN: usize = 3;

/// Ids of all lists that wait, at most. Lists that find no room go on as single rays.
const IDS_MAX: usize = 32 * BATCH;

/// Items that [`Simd::select`] handles at once.
const STEP: usize = 16;

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
    rest: Vec<Rest>,
    ids: Vec<u32>,
    masks: Vec<u32>,
    lists: Vec<List>,
}

impl Room {
    /// For batches of up to `len` rays.
    pub(crate) fn new(len: usize) -> Result<Self, OutOfMemory> {
        const WHAT: &str = "a stream of rays";
        let mut room = Self::default();
        try_reserve(&mut room.records, len.min(BATCH) + RAYS, WHAT)?;
        try_reserve(&mut room.rest, len.min(BATCH) + RAYS, WHAT)?;
        try_reserve(&mut room.masks, len.min(BATCH) + STEP, WHAT)?;
        room.masks.resize(len.min(BATCH) + STEP, 0);
        let ids = (32 * len).min(IDS_MAX) + STEP;
        try_reserve(&mut room.ids, ids, WHAT)?;
        room.ids.resize(ids, 0);
        try_reserve(&mut room.lists, 256, WHAT)?;
        Ok(room)
    }
}

/// Asks about the rays in `slots`, valid and of one class, at most [`BATCH`].
#[inline(always)]
pub(crate) fn stream<'a, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    class: Class,
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
    let toward = prepare(simd, structure, class, rays, slots, room);
    let backward = class.backward();
    let backward = [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
    let len = slots.len().min(BATCH);
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
                let block = Leaf { rows: wide.block(first), count };
                leaf(simd, structure, class, block, rays, list, answers, room);
            }
            _ if list.child == Child::END => {}
            _ => {
                for i in 0..list.len {
                    let id = room.ids[list.start + i] as usize;
                    one::<A, W>(structure, class, rays, list.child, id, answers, room);
                }
            }
        }
    }
}

/// Sends one ray on alone.
#[inline(always)]
fn one<'a, A, const W: usize>(
    structure: &'a Structure,
    class: Class,
    rays: &[Ray],
    child: Child,
    id: usize,
    answers: &mut A,
    room: &mut Room,
) where
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, A::Visitor, W>: Kernel<Output = ()>,
{
    let (record, rest) = (&mut room.records[id], &room.rest[id]);
    if record.0[T_MAX] < record.0[T_MIN] {
        return;
    }
    let slot = rest.slot as usize;
    let ray = &rays[slot];
    let mut visitor = answers.visitor(slot, record.0[T_MAX]);
    structure.level.run(Tail::<_, W> {
        structure,
        record,
        rest,
        class,
        ray,
        child,
        visitor: &mut visitor,
    });
    record.0[T_MAX] = answers.settle(slot, visitor);
}

/// A single ray below a child.
pub(crate) struct Tail<'a, 'r, 'v, V, const W: usize> {
    structure: &'a Structure,
    record: &'r Record,
    rest: &'r Rest,
    class: Class,
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
                let Self { structure, record, rest, class, ray, child, visitor } = self;
                let prepared = prepared(record, rest, class, ray);
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
fn prepare<S: Simd>(
    simd: S,
    structure: &Structure,
    class: Class,
    rays: &[Ray],
    slots: &[u32],
    room: &mut Room,
) -> [f32; 3] {
    room.records.clear();
    room.rest.clear();
    let [x, y, z] = class.axes();
    let (mut across, mut count) = ([0.0, 0.0], 0.0);
    for slots in slots[..slots.len().min(BATCH)].chunks(RAYS) {
        let made = records(simd, structure, class, rays, slots);
        room.records.extend_from_slice(&made);
        for &slot in slots {
            let along = rays[slot as usize].direction[usize::from(z)];
            room.rest.push(Rest { slot, along });
        }
        // A few rays tell enough.
        across[0] += made[0].0[SHEAR];
        across[1] += made[0].0[SHEAR + 1];
        count += 1.0;
    }
    let sign = if class.backward()[usize::from(z)] == 1 { -1.0 } else { 1.0 };
    let mut toward = [0.0; 3];
    toward[usize::from(x)] = sign * across[0];
    toward[usize::from(y)] = sign * across[1];
    toward[usize::from(z)] = sign * count;
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
        let ray = &room.records[id as usize].0;
        let (mut entry, mut exit) = (splat(ray[T_MIN]), splat(ray[T_MAX]));
        for axis in 0..3 {
            let reciprocal = splat(ray[RECIPROCAL + axis]);
            entry = first[axis].sub(splat(ray[NEAR + axis])).mul(reciprocal).max(entry);
            exit = last[axis].sub(splat(ray[FAR + axis])).mul(reciprocal).min(exit);
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
fn leaf<'a, S: Simd, A: Answers<'a>>(
    simd: S,
    structure: &'a Structure,
    class: Class,
    leaf: Leaf<'_>,
    rays: &[Ray],
    list: List,
    answers: &mut A,
    room: &mut Room,
) {
    let mut at = list.start;
    let end = list.start + list.len;
    while at < end {
        let len = RAYS.min(end - at);
        if len < BUNDLE_MIN {
            for at in at..at + len {
                let id = room.ids[at] as usize;
                leaf_of_one(simd, structure, class, leaf, rays, id, answers, room);
            }
        } else {
            leaf_of_many(simd, structure, class, leaf, rays, at, len, answers, room);
        }
        at += len;
    }
}

/// The triangles of a leaf, in rows.
#[derive(Clone, Copy)]
struct Leaf<'a> {
    rows: &'a [f32; BLOCK_WORDS],
    count: usize,
}

impl Leaf<'_> {
    fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        let word = |row: usize| self.rows[(row * self.count + triangle) % BLOCK_WORDS];
        [[word(0), word(1), word(2)], [word(3), word(4), word(5)], [word(6), word(7), word(8)]]
    }

    fn id(&self, triangle: usize) -> u32 {
        self.rows[(9 * self.count + triangle) % BLOCK_WORDS].to_bits()
    }
}

/// All triangles against one ray.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one step of one loop, cut out to be read")]
fn leaf_of_one<'a, S: Simd, A: Answers<'a>>(
    simd: S,
    structure: &'a Structure,
    class: Class,
    leaf: Leaf<'_>,
    rays: &[Ray],
    id: usize,
    answers: &mut A,
    room: &mut Room,
) {
    let (record, rest) = (&mut room.records[id], &room.rest[id]);
    let slot = rest.slot as usize;
    let ray = prepared(record, rest, class, &rays[slot]);
    let range = Interval { entry: record.0[T_MIN], exit: record.0[T_MAX] };
    let (triangle, slab, clip) = (&ray.triangle, &ray.slab, &Interval::ALL);
    let hits = block::hit(simd, leaf.rows, leaf.count, triangle, slab, clip, &range);
    let mut mask = hits.mask;
    if mask == 0 {
        return;
    }
    let mut visitor = answers.visitor(slot, record.0[T_MAX]);
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize % block::LANES;
        mask &= mask - 1;
        let id = leaf.id(lane);
        let (t, u, v) = (hits.t[lane], hits.u[lane], hits.v[lane]);
        if t > visitor.t_max() || !structure.sees(id, rays[slot].mask) {
            continue;
        }
        if visitor.hit(Found { t, u, v, id, inst: 0, structure }).is_break() {
            break;
        }
    }
    record.0[T_MAX] = answers.settle(slot, visitor);
}

/// One triangle after the other against up to 16 rays.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one step of one loop, cut out to be read")]
fn leaf_of_many<'a, S: Simd, A: Answers<'a>>(
    simd: S,
    structure: &'a Structure,
    class: Class,
    leaf: Leaf<'_>,
    rays: &[Ray],
    at: usize,
    len: usize,
    answers: &mut A,
    room: &mut Room,
) {
    // Lanes beyond the last ray repeat it.
    let mut ids = [0; RAYS];
    for lane in 0..RAYS {
        ids[lane] = room.ids[at + lane.min(len - 1)] as usize;
    }
    let (bundle, mut t_max) = gather(simd, class, &ids, room);
    let lanes = (1 << len) - 1;
    for triangle in 0..leaf.count {
        let Some(met) = bundle.hit(simd, &leaf.corners(triangle), lanes, &t_max) else { continue };
        let name = leaf.id(triangle);
        let mut mask = met.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % RAYS;
            mask &= mask - 1;
            let slot = room.rest[ids[lane]].slot as usize;
            if !structure.sees(name, rays[slot].mask) {
                continue;
            }
            let (t, u, v) = (met.t[lane], met.u[lane], met.v[lane]);
            let mut visitor = answers.visitor(slot, t_max[lane]);
            // Whether the ray goes on, its record knows.
            let _ = visitor.hit(Found { t, u, v, id: name, inst: 0, structure });
            t_max[lane] = answers.settle(slot, visitor);
            room.records[ids[lane]].0[T_MAX] = t_max[lane];
        }
    }
}

/// 16 rays side by side, and the greatest `t` that matter to them.
#[inline(always)]
fn gather<S: Simd>(
    simd: S,
    class: Class,
    ids: &[usize; RAYS],
    room: &Room,
) -> (Bundle<S>, [f32; RAYS]) {
    let mut rows = [&room.records[ids[0]].0; RAYS];
    let mut along = [0.0; RAYS];
    for lane in 0..RAYS {
        rows[lane] = &room.records[ids[lane]].0;
        along[lane] = room.rest[ids[lane]].along;
    }
    let c = simd.transpose(&rows);
    let bundle = Bundle {
        axes: class.axes(),
        backward: class.backward(),
        origin: [c[ORIGIN], c[ORIGIN + 1], c[ORIGIN + 2]],
        shear: [c[SHEAR], c[SHEAR + 1]],
        along,
        near: [c[NEAR], c[NEAR + 1], c[NEAR + 2]],
        far: [c[FAR], c[FAR + 1], c[FAR + 2]],
        reciprocal: [c[RECIPROCAL], c[RECIPROCAL + 1], c[RECIPROCAL + 2]],
        t_min: c[T_MIN],
    };
    (bundle, c[T_MAX].lanes())
}

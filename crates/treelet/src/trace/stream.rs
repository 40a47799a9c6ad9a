//! Many rays through one level at once: a node is loaded once for all rays that reach it.
//!
//! Rays of one class (the signs of the direction, and its longest axis) are walked together, depth
//! first, as lists of ids. At a node every ray of the list is tested against all children; the ids
//! are then dealt out to one list a child. What that gains: no step of a ray waits for the one before
//! it, nothing branches on a single ray, nodes are fetched once for many rays. At a leaf, 16 rays
//! meet a triangle at once ([`crate::geometry::bundle`]); short lists go on as single rays.
//!
//! # The same answers
//!
//! The test of a box makes the steps of single rays, and so does that of a triangle, in other lanes.
//! Lists may hold rays whose hit has come nearer since: those only cost time. So every triangle whose
//! hit could be the answer is tested with the same result, and ties are settled by id. Instances are
//! left to single rays from the leaf on that holds them.
//!
//! # What it costs
//!
//! Set-up is 4 ns a ray and sorting into classes 3. Of a primary ray's 60 ns in a kitchen of 1.4 M
//! triangles, leaves take 45 %, node tests 20 % (nine nodes a ray), single rays 8 %. Counted there per
//! ray: 3.5 rays in bundles, of which 1.8 are left after what hides the leaf is known, 1.7 nearer
//! hits; lists are 146 rays long at nodes. Diffuse: 7.4 nodes, lists of 65, 1.8 in bundles, 0.2 single.
//!
//! # What was tried
//!
//! - A ray against four triangles at leaves instead of 16 rays against one: primary 8.7 instead of
//!   13.8 M rays/s, shadow 16.9 instead of 22.3.
//! - Preparing rays one by one: 15 to 19 ns a ray instead of 4.
//! - Columns of 16 rays passed by value, not in memory: a kilobyte copied per step, 20 % of shadow rays.
//! - Children by the entry of the list's first ray to enter, for all rays: hits found per ray fall from
//!   2.6 to 1.9 for one origin, and rise from 1.2 to 1.4 for random rays: hence both orders.
//! - Looking at the hit so far before writing a nearer one: 8 % of diffuse rays (cache misses).
//! - Lists of up to 1, 2, 4 or 8 rays as single rays: alike within 5 %.
//!
//! Source: W. Barringer, T. Akenine-Moller, "Dynamic Ray Stream Traversal", SIGGRAPH 2014; differs:
//! rays of different classes never share a list, short lists go on as single rays.

use super::record::{
    Class, FAR, NEAR, ORIGIN, RAYS, RECIPROCAL, Record, Rest, SHEAR, T_MAX, T_MIN, prepared,
    records,
};
use super::structure::{Get, Layout, Structure};
use super::walk::{Found, Visitor, walk_from};
use crate::bounds::{Aabb, Interval};
use crate::geometry::block::{self, BlockTest};
use crate::geometry::bundle::Bundle;
use crate::layout::packing::{Block, Packing};
use crate::layout::wide::{BLOCK_WORDS, Child, ChildKind, Wide as WideTree};
use crate::math::Ray;
use crate::memory::{OutOfMemory, try_reserve};
use crate::simd::{Floats, Kernel, Simd, Wide};
use alloc::vec::Vec;
use core::marker::PhantomData;

/// What a stream tells about its rays' hits, and keeps of them between lists.
pub(crate) trait Answers<'a> {
    /// Sees the hits of one ray in one part of the tree.
    type Visitor: Visitor<'a>;

    /// Whether finding near hits early saves work. If not, large boxes come first.
    const NEAREST_FIRST: bool;

    /// For the ray in `slot`, which wants hits up to `t_max`.
    fn visitor(&self, slot: usize, t_max: f32) -> Self::Visitor;

    /// Keeps what the visitor, made for `t_max`, saw; the greatest `t` that still matters to that ray.
    fn settle(&mut self, slot: usize, t_max: f32, visitor: Self::Visitor) -> f32;
}

/// Rays of a batch, at most: their records fill half of a usual second-level cache.
pub(crate) const BATCH: usize = 2048;

/// Lists this short go on as single rays.
const FEW: usize = 4;

/// Fewer rays than this are tested one by one at a leaf.
const BUNDLE_MIN: usize = 5;

/// Ids of all lists that wait, at most. Lists that find no room go on as single rays.
const IDS_MAX: usize = 32 * BATCH;

/// Items that [`Simd::select`] handles at once.
const STEP: usize = 16;

/// Rays that are to visit a child.
#[derive(Clone, Copy)]
struct List {
    child: Child,
    /// Where the child's box is.
    node: u32,
    slot: u32,
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

/// Rays that are walked together.
#[derive(Clone, Copy)]
pub(crate) struct Batch<'r> {
    /// Of all of them.
    pub(crate) class: Class,
    /// A slice of rays, of which those in `slots` are walked: valid ones, at most [`BATCH`].
    pub(crate) rays: &'r [Ray],
    pub(crate) slots: &'r [u32],
    pub(crate) order: Order,
}

/// Which children come first where the nearest should.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Those that any ray enters first: good for rays from one point.
    Entry,
    /// Those whose nearest corner is first along the mean direction of the class.
    Corner,
}

/// Asks about the rays of a batch.
#[inline(always)]
pub(crate) fn stream<'a, K, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    batch: Batch<'_>,
    answers: &mut A,
    room: &mut Room,
) where
    K: Packing<W>,
    S: Wide<W>,
    Layout: Get<K, W>,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
{
    let Some(wide) = Get::<K, W>::get(&structure.layout) else { return };
    let mut block = [0.0; BLOCK_WORDS];
    let Batch { class, rays, slots, order } = batch;
    prepare(simd, structure, class, rays, slots, room);
    let backward = class.backward();
    let backward = [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
    let len = slots.len().min(BATCH);
    for i in 0..len {
        room.ids[i] = i as u32;
    }
    room.lists.clear();
    room.lists.push(List { child: wide.root, node: u32::MAX, slot: 0, start: 0, len });
    while let Some(list) = room.lists.pop() {
        let full = list.start + list.len + W * (list.len + STEP) > room.ids.len();
        match list.child.kind() {
            ChildKind::Inner { node } if list.len > FEW && !full => {
                let Some(node) = wide.nodes.get(node) else { return };
                let (met, entry) = test::<K, S, W>(simd, node, backward, list, room);
                if A::NEAREST_FIRST {
                    let key = match order {
                        Order::Entry => entry,
                        Order::Corner => corners::<K, S, W>(simd, node, class),
                    };
                    deal_nearest_first::<K, S, W>(simd, wide, node, met, key, list, room);
                } else {
                    deal_largest_first::<K, S, W>(simd, wide, node, met, list, room);
                }
            }
            ChildKind::Leaf { first, count } if first < wide.triangles => {
                let bounds = wide
                    .nodes
                    .get(list.node as usize)
                    .map_or(structure.bounds, |node| K::bounds(node, list.slot as usize));
                let (rows, stride) = K::block(simd, K::leaf(&wide.words, first), count, &mut block);
                let block = Leaf { rows, stride, count, bounds };
                leaf(simd, structure, class, block, rays, list, answers, room);
            }
            _ if list.child == Child::END => {}
            _ => {
                for i in 0..list.len {
                    let id = room.ids[list.start + i] as usize;
                    one::<K, S, A, W>(simd, structure, class, rays, list.child, id, answers, room);
                }
            }
        }
    }
}

/// Sends one ray on alone.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one step of one loop, cut out to be read")]
fn one<'a, K, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    class: Class,
    rays: &[Ray],
    child: Child,
    id: usize,
    answers: &mut A,
    room: &mut Room,
) where
    K: Packing<W>,
    S: Simd,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
{
    let (record, rest) = (&mut room.records[id], &room.rest[id]);
    if record.0[T_MAX] < record.0[T_MIN] {
        return;
    }
    let slot = rest.slot as usize;
    let ray = &rays[slot];
    let mut visitor = answers.visitor(slot, record.0[T_MAX]);
    let packing = PhantomData;
    let visitor_of_ray = &mut visitor;
    simd.call(Tail::<K, _, W> {
        packing,
        structure,
        record,
        rest,
        class,
        ray,
        child,
        visitor: visitor_of_ray,
    });
    record.0[T_MAX] = answers.settle(slot, record.0[T_MAX], visitor);
}

/// A single ray below a child.
pub(crate) struct Tail<'a, 'r, 'v, K, V, const W: usize> {
    packing: PhantomData<K>,
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
        $(impl<'a, K: Packing<$width>, V: Visitor<'a>> Kernel for Tail<'a, '_, '_, K, V, $width>
        where
            Layout: Get<K, $width>,
        {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, record, rest, class, ray, child, visitor, .. } = self;
                let prepared = prepared(record, rest, class, ray);
                walk_from::<K, S, V, (), $width>(
                    simd, structure, prepared, child, ray, visitor, &mut (),
                );
            }
        })*
    };
}

tails! { 8 16 }

/// Fills the records.
#[inline(always)]
fn prepare<S: Simd>(
    simd: S,
    structure: &Structure,
    class: Class,
    rays: &[Ray],
    slots: &[u32],
    room: &mut Room,
) {
    room.records.clear();
    room.rest.clear();
    let [.., longest] = class.axes();
    for slots in slots[..slots.len().min(BATCH)].chunks(RAYS) {
        let first = room.records.len();
        room.records.extend_from_slice(&[Record([0.0; 16]); RAYS]);
        let Some(made) = room.records[first..].first_chunk_mut() else { break };
        records(simd, structure, class, rays, slots, made);
        for &slot in slots {
            let along = rays[slot as usize].direction[usize::from(longest)];
            room.rest.push(Rest { slot, along });
        }
    }
}

/// Tests the list against a node; returns the children that any of its rays meets, and where the
/// first of them does.
#[inline(always)]
fn test<K: Packing<W>, S: Wide<W>, const W: usize>(
    simd: S,
    node: &K::Node,
    backward: [usize; 3],
    list: List,
    room: &mut Room,
) -> (u32, S::F) {
    let splat = |x: f32| S::F::splat(simd, x);
    let first = |axis: usize| K::planes(simd, node, axis, backward[axis] & 1);
    let last = |axis: usize| K::planes(simd, node, axis, backward[axis] & 1 ^ 1);
    let first = [first(0), first(1), first(2)];
    let last = [last(0), last(1), last(2)];
    let slots = K::slots(node);
    let (mut met, mut nearest) = (0, splat(f32::INFINITY));
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
        *mask = entry.le(exit) & slots;
        nearest = entry.min_where(*mask, nearest);
        met |= *mask;
    }
    masks[list.len..].fill(0);
    (met, nearest)
}

/// Puts the rays of `list` that meet the child in `slot` on a list of their own.
#[inline(always)]
fn deal<K: Packing<W>, S: Wide<W>, const W: usize>(
    simd: S,
    wide: &WideTree<W, K>,
    node: &K::Node,
    slot: usize,
    list: List,
    start: usize,
    room: &mut Room,
) -> usize {
    let child = K::children(node)[slot % W];
    if let Some(node) = wide.nodes.get(child.0 as usize) {
        K::prefetch(simd, node);
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
    let node = list.child.0;
    room.lists.push(List { child, node, slot: slot as u32, start, len: end - start });
    end
}

/// How far along the mean direction of the class the nearest corner of each child lies.
#[inline(always)]
fn corners<K: Packing<W>, S: Wide<W>, const W: usize>(
    simd: S,
    node: &K::Node,
    class: Class,
) -> S::F {
    let [.., longest] = class.axes();
    let mut sum = S::F::splat(simd, 0.0);
    for axis in 0..3 {
        let backward = usize::from(class.backward()[axis] & 1);
        let size = if axis == usize::from(longest) { 1.0 } else { 0.5 };
        let share = S::F::splat(simd, if backward == 1 { -size } else { size });
        sum = sum.add(share.mul(K::planes(simd, node, axis, backward)));
    }
    sum
}

/// Smaller keys last.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "one step of one loop, cut out to be read")]
fn deal_nearest_first<K: Packing<W>, S: Wide<W>, const W: usize>(
    simd: S,
    wide: &WideTree<W, K>,
    node: &K::Node,
    met: u32,
    key: S::F,
    list: List,
    room: &mut Room,
) {
    let key = key.lanes();
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
        end = deal::<K, S, W>(simd, wide, node, slot, list, end, room);
    }
}

/// Larger children last.
#[inline(always)]
fn deal_largest_first<K: Packing<W>, S: Wide<W>, const W: usize>(
    simd: S,
    wide: &WideTree<W, K>,
    node: &K::Node,
    met: u32,
    list: List,
    room: &mut Room,
) {
    let mut rest = met;
    let mut end = list.start + list.len;
    while rest != 0 {
        let slot = rest.trailing_zeros() as usize % W;
        rest &= rest - 1;
        end = deal::<K, S, W>(simd, wide, node, slot, list, end, room);
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
    rows: &'a Block,
    /// How far the rows are apart.
    stride: usize,
    count: usize,
    /// Around them.
    bounds: Aabb,
}

impl Leaf<'_> {
    #[inline(always)]
    fn corners(&self, triangle: usize) -> [[f32; 3]; 3] {
        let word = |row: usize| self.word(row, triangle);
        [[word(0), word(1), word(2)], [word(3), word(4), word(5)], [word(6), word(7), word(8)]]
    }

    #[inline(always)]
    fn id(&self, triangle: usize) -> u32 {
        self.word(9, triangle).to_bits()
    }

    #[inline(always)]
    fn word(&self, row: usize, triangle: usize) -> f32 {
        self.rows.get(row * self.stride + triangle).copied().unwrap_or(0.0)
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
    let (slab, clip) = (&ray.slab, &Interval::ALL);
    let Leaf { rows, stride, count, .. } = leaf;
    let ray = (&ray.triangle, slab);
    let hits = simd.apply::<BlockTest<'_, _>>((rows, stride), ray, clip, (range.entry, range.exit));
    let mut mask = hits.mask & ((1 << count) - 1);
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
    record.0[T_MAX] = answers.settle(slot, record.0[T_MAX], visitor);
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
    let mut rows = [&room.records[ids[0]].0; RAYS];
    let mut along = [0.0; RAYS];
    for lane in 0..RAYS {
        rows[lane] = &room.records[ids[lane]].0;
        along[lane] = room.rest[ids[lane]].along;
    }
    let mut columns = [[0.0; RAYS]; 16];
    simd.transpose(&rows, &mut columns);
    let mut t_max = columns[T_MAX];
    let c = &columns;
    let bundle = Bundle {
        axes: class.axes(),
        backward: class.backward(),
        origin: [&c[ORIGIN], &c[ORIGIN + 1], &c[ORIGIN + 2]],
        shear: [&c[SHEAR], &c[SHEAR + 1]],
        along: &along,
        near: [&c[NEAR], &c[NEAR + 1], &c[NEAR + 2]],
        far: [&c[FAR], &c[FAR + 1], &c[FAR + 2]],
        reciprocal: [&c[RECIPROCAL], &c[RECIPROCAL + 1], &c[RECIPROCAL + 2]],
        t_min: &c[T_MIN],
    };
    // Hits that were found since the list was made may hide the whole leaf.
    let lanes = ((1 << len) - 1) & bundle.meets(simd, &leaf.bounds, &t_max);
    if lanes == 0 {
        return;
    }
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
            t_max[lane] = answers.settle(slot, t_max[lane], visitor);
            room.records[ids[lane]].0[T_MAX] = t_max[lane];
        }
    }
}

//! A list at a node: which of its rays meet which children, dealt out to a list a child.

use super::room::{List, Room, STEP};
use crate::layout::packing::{Packing, fetch};
use crate::layout::wide::Wide as WideTree;
use crate::simd::{Floats, Simd, Wide};
use crate::trace::record::{Class, FAR, NEAR, RECIPROCAL, T_MAX, T_MIN};

/// A list at a node, after the test.
pub(super) struct Met<'n, K: Packing<W>, F, const W: usize> {
    pub(super) wide: &'n WideTree<W, K>,
    pub(super) node: &'n K::Node,
    pub(super) list: List,
    /// The children that any of its rays meets.
    pub(super) children: u32,
    /// Where the first of them does.
    pub(super) entry: F,
}

/// Tests the list against a node; returns the children that any of its rays meets, and where the
/// first of them does.
#[inline(always)]
pub(super) fn test<'n, K: Packing<W>, S: Wide<W>, const W: usize>(
    simd: S,
    wide: &'n WideTree<W, K>,
    node: &'n K::Node,
    class: Class,
    list: List,
    room: &mut Room,
) -> Met<'n, K, S::F, W> {
    let backward = class.backward();
    let backward = [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
    let splat = |x: f32| S::F::splat(simd, x);
    let first = |axis: usize| K::planes(simd, node, axis, backward[axis] & 1);
    let last = |axis: usize| K::planes(simd, node, axis, backward[axis] & 1 ^ 1);
    let first = [first(0), first(1), first(2)];
    let last = [last(0), last(1), last(2)];
    let slots = K::slots(node);
    let (mut children, mut first_in) = (0, splat(f32::INFINITY));
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
        first_in = entry.min_where(*mask, first_in);
        children |= *mask;
    }
    masks[list.len..].fill(0);
    Met { wide, node, list, children, entry: first_in }
}

/// How far along the mean direction of the class the nearest corner of each child lies.
#[inline(always)]
pub(super) fn corners<K: Packing<W>, S: Wide<W>, const W: usize>(
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

impl<K: Packing<W>, F: Copy, const W: usize> Met<'_, K, F, W> {
    /// Smaller keys last.
    #[inline(always)]
    pub(super) fn deal_nearest_first<S: Wide<W, F = F>>(self, simd: S, key: F, room: &mut Room)
    where
        F: Floats<W, Token = S>,
    {
        let key = key.lanes();
        let mut sorted = [(0.0, 0); W];
        let mut count = 0;
        let mut rest = self.children;
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
        let mut end = self.list.start + self.list.len;
        for &(_, slot) in &sorted[..count] {
            end = self.deal(simd, slot, end, room);
        }
    }

    /// In the node's order: the last child, the likeliest to stop rays for what it costs, ends up uppermost.
    #[inline(always)]
    pub(super) fn deal_likeliest_first<S: Simd>(self, simd: S, room: &mut Room) {
        let mut rest = self.children;
        let mut end = self.list.start + self.list.len;
        while rest != 0 {
            let slot = rest.trailing_zeros() as usize % W;
            rest &= rest - 1;
            end = self.deal(simd, slot, end, room);
        }
    }

    /// Puts the rays that meet the child in `slot` on a list of their own, which begins at `start`;
    /// returns where it ends.
    #[inline(always)]
    fn deal<S: Simd>(&self, simd: S, slot: usize, start: usize, room: &mut Room) -> usize {
        let child = K::children(self.node)[slot % W];
        if let Some(node) = self.wide.nodes.get(child.0 as usize) {
            fetch(simd, node);
        }
        let list = self.list;
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
}

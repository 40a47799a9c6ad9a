//! A group of packets through a tree: 16 children against the whole group at a time, then 16 packets
//! against each child that is left; the last few packets go on one by one.

use super::super::leaf::{Leaf, ROOM};
use super::super::stream::{Answers, Tail};
use super::super::structure::{Get, Layout};
use super::Walk;
use super::alone::Alone;
use super::group::{PACKETS, WAITING, Waiting};
use super::leaf::AtLeaf;
use crate::layout::packing::{Packing, fetch};
use crate::layout::wide::{Child, ChildKind, Wide as WideTree};
use crate::simd::{Floats, Kernel, Simd, Wide};
use core::marker::PhantomData;

/// So few packets go on one by one.
const FEW: u32 = 4;

/// Nodes that more packets than that visit together, at most: rays that only seem to go together
/// must not drag each other through the whole tree.
const NODES_MAX: usize = 48;

/// Walks the group.
#[inline(always)]
pub(super) fn beam<'a, K, S, A, const W: usize>(simd: S, walk: &mut Walk<'a, '_, A>)
where
    K: Packing<W>,
    S: Wide<W>,
    Layout: Get<K, W>,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
    for<'x, 'y> Alone<'a, 'x, 'y, K, A, W>: Kernel<Output = ()>,
{
    let structure = walk.structure;
    let Some(wide) = Get::<K, W>::get(&structure.layout) else { return };
    let mut block = ROOM;
    let count = walk.group.count;
    walk.group.stacks[0][0] = Waiting::new(wide.root, ((1_u32 << count) - 1) as u16);
    let (mut len, mut nodes) = (1, 0);
    while len > 0 {
        len -= 1;
        let waiting = walk.group.stacks[0][len % WAITING];
        let Waiting { child, some, entry, .. } = waiting;
        let ends = S::F16::load(simd, &walk.group.spreads.t_max);
        let packets = u32::from(some) & S::F16::splat(simd, entry).le(ends);
        if packets == 0 {
            continue;
        }
        let together = packets.count_ones() > FEW && len + W <= WAITING && nodes < NODES_MAX;
        match child.kind() {
            ChildKind::Inner { node: at } if together => {
                let Some(node) = wide.nodes.get(at) else { return };
                nodes += 1;
                len = visit(simd, wide, walk, node, at, packets, len);
            }
            ChildKind::Leaf { first, count } if first < wide.triangles => {
                let bounds = waiting.bounds(wide).unwrap_or(structure.bounds);
                let leaf = Leaf::new(simd, wide, (first, count), bounds, &mut block);
                simd.call(AtLeaf { walk, leaf, packets, lanes: u32::MAX });
            }
            _ if child == Child::END => {}
            _ => {
                let mut rest = packets;
                while rest != 0 {
                    let packet = rest.trailing_zeros() as usize % PACKETS;
                    rest &= rest - 1;
                    simd.call(Alone::<'a, '_, '_, K, A, W> {
                        packing: PhantomData,
                        walk,
                        packet,
                        child,
                    });
                }
            }
        }
    }
}

/// Stacks the children of a node that some packets may meet: the nearest uppermost, or, if nearness
/// saves no work, in the node's order, its last child uppermost. Returns the stack's new length.
#[inline(always)]
fn visit<'a, K: Packing<W>, S: Wide<W>, A: Answers<'a>, const W: usize>(
    simd: S,
    wide: &WideTree<W, K>,
    walk: &mut Walk<'a, '_, A>,
    node: &K::Node,
    at: usize,
    packets: u32,
    mut len: usize,
) -> usize {
    let group = &mut *walk.group;
    let backward = walk.class.backward();
    let backward = [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
    let (mut met, entries) = group.all.meets::<K, S, W>(simd, backward, node);
    let entries = entries.lanes();
    let base = len;
    while met != 0 {
        let slot = met.trailing_zeros() as usize % W;
        met &= met - 1;
        let packets = packets & group.spreads.meets(simd, backward, &K::bounds(node, slot));
        if packets == 0 {
            continue;
        }
        let child = K::children(node)[slot];
        prefetch(simd, wide, child);
        let (node, slot, entry) = (at as u32, slot as u16, entries[usize::from(slot as u16) % W]);
        let waiting = Waiting { child, node, slot, some: packets as u16, entry };
        Waiting::push(&mut group.stacks[0], base, &mut len, waiting, A::NEAREST_FIRST);
    }
    len
}

/// Asks for what a child will be read for.
#[inline(always)]
pub(super) fn prefetch<K: Packing<W>, S: Simd, const W: usize>(
    simd: S,
    wide: &WideTree<W, K>,
    child: Child,
) {
    match child.kind() {
        ChildKind::Inner { node } => {
            if let Some(node) = wide.nodes.get(node) {
                fetch(simd, node);
            }
        }
        ChildKind::Leaf { first, .. } => {
            if first < wide.triangles {
                fetch(simd, K::leaf(&wide.words, first));
            }
        }
    }
}

//! Rays that go together, walked together.

mod alone;
mod group;
mod leaf;

pub(crate) use group::{GROUP, Group};

use super::leaf::Leaf;
use super::stream::{Answers, Batch, Tail};
use super::structure::{Get, Layout, Structure};
use super::walk::Found;
use crate::layout::wide::{BLOCK_WORDS, Child, ChildKind, Wide as WideTree};
use crate::simd::{Floats, Kernel, Simd, Wide};
use alone::Alone;
use group::{NONE, PACKETS};
use leaf::AtLeaf;

pub static C: [core::sync::atomic::AtomicU64; 16] = [const { core::sync::atomic::AtomicU64::new(0) }; 16];
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn tick() -> u64 { unsafe { core::arch::x86_64::_rdtsc() } }
#[inline(always)]
pub(crate) fn add(i: usize, n: u64) { let c=&C[i]; let o=core::sync::atomic::Ordering::Relaxed; c.store(c.load(o)+n, o); }
/// So few packets go on one by one.
const FEW: u32 = 4;

/// Nodes that a group visits, at most, with more packets than that.
const NODES: usize = 48;

/// Children that wait, at most.
const WAITING: usize = 128;

#[derive(Clone, Copy)]
struct Waiting {
    child: Child,
    node: u32,
    slot: u16,
    packets: u16,
    entry: f32,
}

/// Asks about the rays of a batch, [`GROUP`] at most.
#[inline(always)]
pub(crate) fn packets<'a, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    batch: Batch<'_>,
    answers: &mut A,
    group: &mut Group,
) where
    S: Wide<W>,
    Layout: Get<W>,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, A::Visitor, W>: Kernel<Output = ()>,
    for<'x> Alone<'a, 'x, A, W>: Kernel<Output = ()>,
{
    let Some(wide) = structure.layout.get() else { return };
    let Batch { class, rays, slots, .. } = batch;
    let t0=tick(); group.fill(simd, structure, class, rays, slots);
    add(0,tick()-t0); add(1,1); let t1=tick();
    let backward = class.backward();
    let backward = [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
    let count = group.packets.len();
    let packets = ((1_u32 << count) - 1) as u16;
    let start = Waiting {
        child: wide.root,
        node: u32::MAX,
        slot: 0,
        packets,
        entry: f32::NEG_INFINITY,
    };
    let mut stack = [start; WAITING];
    let mut len = 1;
    let mut nodes = 0;
    while len > 0 {
        len -= 1;
        let Waiting { child, node, slot, packets, entry } = stack[len % WAITING];
        let ends = S::F16::load(simd, &group.spreads.t_max);
        let packets = packets & S::F16::splat(simd, entry).le(ends) as u16;
        if packets == 0 {
            continue;
        }
        match child.kind() {
            ChildKind::Inner { node: at } if packets.count_ones() > FEW && len + W <= WAITING && nodes < NODES => {
                nodes += 1;
                let Some(node) = wide.nodes.get(at) else { return };
                add(2,1); let (mut met, entries) = group.all.meets(simd, backward, node);
                let entries = entries.lanes();
                let base = len;
                while met != 0 {
                    let slot = met.trailing_zeros() as usize % W;
                    met &= met - 1;
                    let child = node.children[slot];
                    let packets =
                        packets & group.spreads.meets(simd, backward, &node.bounds(slot)) as u16;
                    if packets == 0 {
                        continue;
                    }
                    prefetch(simd, wide, child);
                    let entry = entries[slot];
                    let waiting =
                        Waiting { child, node: at as u32, slot: slot as u16, packets, entry };
                    let mut place = len;
                    if A::NEAREST_FIRST {
                        while place > base && stack[(place - 1) % WAITING].entry < entry {
                            stack[place % WAITING] = stack[(place - 1) % WAITING];
                            place -= 1;
                        }
                    }
                    stack[place % WAITING] = waiting;
                    len += 1;
                }
            }
            ChildKind::Leaf { first, count } if first < wide.triangles => {
                let bounds = wide
                    .nodes
                    .get(node as usize)
                    .map_or(structure.bounds, |node| node.bounds(usize::from(slot)));
                let mut rest = packets;
                while rest != 0 {
                    let packet = rest.trailing_zeros() as usize % PACKETS;
                    rest &= rest - 1;
                    let leaf = Leaf { rows: wide.block(first), count, bounds };
                    let lanes = group.packets[packet].alive;
                    let (answers, group) = (&mut *answers, &mut *group);
                    let t3=tick(); simd.call(AtLeaf {
                        structure,
                        class,
                        rays,
                        answers,
                        group,
                        leaf,
                        packet,
                        lanes,
                    }); add(5,1); add(6,tick()-t3);
                }
            }
            _ if child == Child::END => {}
            _ => {
                let mut rest = packets;
                while rest != 0 {
                    let packet = rest.trailing_zeros() as usize % PACKETS;
                    rest &= rest - 1;
                    let (answers, group) = (&mut *answers, &mut *group);
                    let t3=tick(); simd.call(Alone::<'a, '_, A, W> {
                        structure,
                        class,
                        rays,
                        answers,
                        group,
                        packet,
                        child,
                    }); add(7,1); add(8,tick()-t3);
                }
            }
        }
    }
    add(3,tick()-t1); let t2=tick(); if A::NEAREST_FIRST {
        finish(structure, answers, group);
    } add(4,tick()-t2);
}

/// Writes the hits that packets found.
#[inline(always)]
fn finish<'a, A: Answers<'a>>(structure: &'a Structure, answers: &mut A, group: &Group) {
    for packet in &group.packets {
        for lane in 0..16 {
            let id = packet.id[lane];
            if id != NONE {
                let t = packet.columns[super::record::T_MAX][lane];
                let (u, v) = (packet.u[lane], packet.v[lane]);
                let found = Found { t, u, v, id, inst: 0, structure };
                answers.keep(packet.slots[lane] as usize, found);
            }
        }
    }
}

/// Asks for what a child will be read for.
#[inline(always)]
fn prefetch<S: Simd, const W: usize>(simd: S, wide: &WideTree<W>, child: Child) {
    match child.kind() {
        ChildKind::Inner { node } => {
            if let Some(node) = wide.nodes.get(node) {
                for axis in 0..3 {
                    simd.prefetch(&node.planes[axis][0]);
                    simd.prefetch(&node.planes[axis][1]);
                }
                simd.prefetch(&node.children);
            }
        }
        ChildKind::Leaf { first, count } => {
            if first < wide.triangles {
                let words = wide.block(first);
                simd.prefetch(&words[0]);
                simd.prefetch(&words[(10 * count - 1).min(BLOCK_WORDS - 1)]);
            }
        }
    }
}

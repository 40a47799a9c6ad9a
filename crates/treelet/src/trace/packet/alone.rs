//! One packet below a child: boxes that no ray of it can meet are dropped 16 children at a time, the
//! others are tested against 16 rays at a time; the last few rays go on one by one.

use super::super::leaf::Leaf;
use super::super::record::{Class, RAYS, RECIPROCAL, T_MAX, bundle};
use super::super::stream::{Answers, Tail};
use super::super::structure::{Get, Layout, Structure};
use super::group::{Group, NONE, Spread};
use super::prefetch;
use super::leaf::AtLeaf;
use crate::layout::wide::{Child, ChildKind};
use crate::math::Ray;
use crate::simd::{Floats, Kernel, Simd, Wide};

/// So few rays go on one by one.
const FEW: u32 = 2;

/// Children that wait, at most: the rays of what finds no room go on one by one.
const WAITING: usize = 128;

#[derive(Clone, Copy)]
struct Waiting {
    child: Child,
    node: u32,
    slot: u16,
    lanes: u16,
    entry: f32,
}

/// Walks one packet through what is below a child.
pub(super) struct Alone<'a, 'w, A, const W: usize> {
    pub(super) structure: &'a Structure,
    pub(super) class: Class,
    pub(super) rays: &'w [Ray],
    pub(super) answers: &'w mut A,
    pub(super) group: &'w mut Group,
    pub(super) packet: usize,
    pub(super) child: Child,
}

macro_rules! widths {
    ($($width:literal)*) => {
        $(impl<'a, A: Answers<'a>> Kernel for Alone<'a, '_, A, $width> {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                self.walk::<S>(simd);
            }
        })*
    };
}

widths! { 8 16 }

impl<'a, A: Answers<'a>, const W: usize> Alone<'a, '_, A, W> {
    #[inline(always)]
    fn walk<S: Wide<W>>(self, simd: S)
    where
        Layout: Get<W>,
        for<'x, 'y> Tail<'a, 'x, 'y, A::Visitor, W>: Kernel<Output = ()>,
    {
        let Self { structure, class, rays, answers, group, packet: number, child } = self;
        let Some(wide) = structure.layout.get() else { return };
        let backward = class.backward();
        let backward =
            [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
        let mut spread = Spread::of(&group.spreads, number);
        let alive = group.packets[number].alive as u16;
        let start =
            Waiting { child, node: u32::MAX, slot: 0, lanes: alive, entry: f32::NEG_INFINITY };
        let mut stack = [start; WAITING];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let Waiting { child, node, slot, lanes, entry } = stack[len % WAITING];
            spread.t_max = group.spreads.t_max[number];
            if entry > spread.t_max {
                continue;
            }
            match child.kind() {
                ChildKind::Inner { node: at }
                    if lanes.count_ones() > FEW && len + W <= WAITING =>
                {
                    let Some(node) = wide.nodes.get(at) else { return };
                    super::add(9,1); let (mut met, entries) = spread.meets(simd, backward, node);
                    if met == 0 {
                        continue;
                    }
                    let entries = entries.lanes();
                    let packet = &group.packets[number];
                    let bundle = bundle(class, &packet.columns, &packet.along);
                    let base = len;
                    while met != 0 {
                        let slot = met.trailing_zeros() as usize % W;
                        met &= met - 1;
                        let child = node.children[slot];
                        let inside =
                            bundle.meets(simd, &node.bounds(slot), &packet.columns[T_MAX]);
                        let lanes = lanes & inside as u16;
                        if lanes == 0 {
                            continue;
                        }
                        prefetch(simd, wide, child);
                        let entry = entries[slot];
                        let waiting =
                            Waiting { child, node: at as u32, slot: slot as u16, lanes, entry };
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
                    let leaf = Leaf { rows: wide.block(first), count, bounds };
                    let (answers, group) = (&mut *answers, &mut *group);
                    let lanes = u32::from(lanes);
                    let packet = number;
                    simd.call(AtLeaf {
                        structure,
                        class,
                        rays,
                        answers,
                        group,
                        leaf,
                        packet,
                        lanes,
                    });
                }
                _ if child == Child::END => {}
                _ => {
                    let mut rest = u32::from(lanes);
                    while rest != 0 {
                        let lane = rest.trailing_zeros() as usize % RAYS;
                        rest &= rest - 1;
                        super::add(10,1); single::<S, A, W>(
                            simd, structure, class, rays, answers, group, number, lane, child,
                        );
                    }
                    group.spreads.t_max[number] = group.packets[number].t_max();
                }
            }
        }
    }
}

/// Sends one ray on alone.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "xx")]
fn single<'a, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    class: Class,
    rays: &[Ray],
    answers: &mut A,
    group: &mut Group,
    number: usize,
    lane: usize,
    child: Child,
) where
    S: Simd,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, A::Visitor, W>: Kernel<Output = ()>,
{
    let packet = &mut group.packets[number];
    let (record, rest) = packet.ray(lane);
    let t_max = packet.columns[T_MAX][lane];
    if t_max == f32::NEG_INFINITY {
        return;
    }
    let _ = RECIPROCAL;
    let slot = rest.slot as usize;
    let ray = &rays[slot];
    let mut visitor = answers.visitor(slot, t_max);
    simd.call(Tail::<_, W> {
        structure,
        record: &record,
        rest: &rest,
        class,
        ray,
        child,
        visitor: &mut visitor,
    });
    let left = answers.settle(slot, t_max, visitor);
    if left < t_max {
        packet.columns[T_MAX][lane] = left;
        packet.id[lane] = NONE;
    }
}

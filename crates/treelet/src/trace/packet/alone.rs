//! One packet below a child: boxes that no ray of it can meet are dropped 16 children at a time, the
//! others are tested against 16 rays at a time; the last few rays go on one by one.

use super::super::leaf::{Leaf, ROOM};
use super::super::record::{RAYS, T_MAX, bundle};
use super::super::stream::{Answers, Tail};
use super::super::structure::{Get, Layout};
use super::super::walk::Found;
use super::Walk;
use super::beam::prefetch;
use super::group::{Group, NONE, Spread, WAITING, Waiting};
use super::leaf::AtLeaf;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, Wide as WideTree};
use crate::simd::{Floats, Kernel, Simd, Wide};
use core::marker::PhantomData;

/// So few rays go on one by one.
const FEW: u32 = 2;

/// Walks one packet through what is below a child.
pub(crate) struct Alone<'a, 'w, 'x, K, A, const W: usize> {
    pub(super) packing: PhantomData<K>,
    pub(super) walk: &'x mut Walk<'a, 'w, A>,
    pub(super) packet: usize,
    pub(super) child: Child,
}

macro_rules! widths {
    ($($width:literal)*) => {
        $(impl<'a, K: Packing<$width>, A: Answers<'a>> Kernel for Alone<'a, '_, '_, K, A, $width>
        where
            Layout: Get<K, $width>,
        {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                self.run_through::<S>(simd);
            }
        })*
    };
}

widths! { 8 16 }

impl<'a, K: Packing<W>, A: Answers<'a>, const W: usize> Alone<'a, '_, '_, K, A, W> {
    #[inline(always)]
    fn run_through<S: Wide<W>>(mut self, simd: S)
    where
        Layout: Get<K, W>,
        for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
    {
        let number = self.packet;
        let structure = self.walk.structure;
        let Some(wide) = Get::<K, W>::get(&structure.layout) else { return };
        let mut block = ROOM;
        let Group { packets, spreads, stacks, .. } = &mut *self.walk.group;
        let mut spread = Spread::of(spreads, number);
        stacks[1][0] = Waiting::new(self.child, packets[number].alive as u16);
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let waiting = self.walk.group.stacks[1][len % WAITING];
            let Waiting { child, some, entry, .. } = waiting;
            spread.t_max = self.walk.group.spreads.t_max[number];
            if entry > spread.t_max {
                continue;
            }
            let lanes = u32::from(some);
            let together = lanes.count_ones() > FEW && len + W <= WAITING;
            match child.kind() {
                ChildKind::Inner { node: at } if together => {
                    len = self.visit(simd, wide, &spread, at, lanes, len);
                }
                ChildKind::Leaf { first, count } if first < wide.triangles => {
                    let bounds = waiting.bounds(wide).unwrap_or(structure.bounds);
                    let leaf = Leaf::new(simd, wide, (first, count), bounds, &mut block);
                    let walk = &mut *self.walk;
                    simd.call(AtLeaf { walk, leaf, packets: 1 << number, lanes });
                }
                _ if child == Child::END => {}
                _ => {
                    let mut rest = lanes;
                    while rest != 0 {
                        let lane = rest.trailing_zeros() as usize % RAYS;
                        rest &= rest - 1;
                        self.single(simd, lane, child);
                    }
                    let group = &mut *self.walk.group;
                    group.spreads.t_max[number] = group.packets[number].t_max(simd);
                }
            }
        }
    }

    /// Stacks the children of a node that some of the rays meet, as [`super::beam`] does; returns the
    /// stack's new length.
    #[inline(always)]
    fn visit<S: Wide<W>>(
        &mut self,
        simd: S,
        wide: &WideTree<W, K>,
        spread: &Spread<f32>,
        at: usize,
        lanes: u32,
        mut len: usize,
    ) -> usize {
        let Some(node) = wide.nodes.get(at) else { return len };
        let class = self.walk.class;
        let backward = class.backward();
        let backward =
            [usize::from(backward[0]), usize::from(backward[1]), usize::from(backward[2])];
        let (mut met, entries) = spread.meets::<K, S, W>(simd, backward, node);
        if met == 0 {
            return len;
        }
        let entries = entries.lanes();
        let Group { packets, stacks, .. } = &mut *self.walk.group;
        let packet = &packets[self.packet];
        let bundle = bundle(class, &packet.columns, &packet.along);
        let base = len;
        while met != 0 {
            let slot = met.trailing_zeros() as usize % W;
            met &= met - 1;
            let lanes = lanes & bundle.meets(simd, &K::bounds(node, slot), &packet.columns[T_MAX]);
            if lanes == 0 {
                continue;
            }
            let child = K::children(node)[slot];
            prefetch(simd, wide, child);
            let entry = entries[slot];
            let (node, slot, some) = (at as u32, slot as u16, lanes as u16);
            let waiting = Waiting { child, node, slot, some, entry };
            Waiting::push(&mut stacks[1], base, &mut len, waiting, A::NEAREST_FIRST);
        }
        len
    }

    /// Sends one ray on alone.
    #[inline(always)]
    fn single<S: Simd>(&mut self, simd: S, lane: usize, child: Child)
    where
        for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
    {
        let Walk { structure, class, rays, answers, group } = &mut *self.walk;
        let packet = &mut group.packets[self.packet];
        let t_max = packet.columns[T_MAX][lane];
        if t_max == f32::NEG_INFINITY {
            return;
        }
        let (record, rest) = packet.ray(lane);
        let (record, rest) = (&record, &rest);
        let slot = rest.slot as usize;
        let ray = &rays[slot];
        let mut visitor = answers.visitor(slot, t_max);
        let (structure, class) = (*structure, *class);
        let seen = &mut visitor;
        let packing = PhantomData::<K>;
        simd.call(Tail::<K, _, W> {
            packing,
            structure,
            record,
            rest,
            class,
            ray,
            child,
            visitor: seen,
        });
        match A::best(&visitor) {
            // As leaves keep it.
            Some(Found { t, u, v, id, inst: 0, .. }) => {
                if t < t_max || id < packet.id[lane] {
                    packet.columns[T_MAX][lane] = t;
                    (packet.u[lane], packet.v[lane], packet.id[lane]) = (u, v, id);
                }
            }
            _ => {
                let left = answers.settle(slot, t_max, visitor);
                if left < t_max {
                    packet.columns[T_MAX][lane] = left;
                    packet.id[lane] = NONE;
                }
            }
        }
    }
}

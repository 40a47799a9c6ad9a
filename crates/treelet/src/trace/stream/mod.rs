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

mod answers;
mod deal;
mod leaf;
mod room;
mod tail;

pub(crate) use answers::Answers;
pub(crate) use room::{BATCH, Room};
pub(crate) use tail::Tail;

use super::leaf::{Leaf, ROOM};
use super::record::{Class, T_MAX, T_MIN};
use super::structure::{Get, Layout, Structure};
use crate::bounds::Aabb;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, Wide as WideTree};
use crate::math::Ray;
use crate::simd::{Kernel, Simd, Wide};
use core::marker::PhantomData;
use room::{List, STEP};

/// Lists this short go on as single rays.
const FEW: usize = 4;

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

/// The walk of a batch.
struct Stream<'a, 'w, A> {
    structure: &'a Structure,
    class: Class,
    rays: &'w [Ray],
    answers: &'w mut A,
    room: &'w mut Room,
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
    let mut block = ROOM;
    let Batch { class, rays, order, .. } = batch;
    room.fill(simd, structure, batch, wide.root);
    let mut stream = Stream { structure, class, rays, answers, room };
    while let Some(list) = stream.room.lists.pop() {
        let full = list.start + list.len + W * (list.len + STEP) > stream.room.ids.len();
        match list.child.kind() {
            ChildKind::Inner { node } if list.len > FEW && !full => {
                let Some(node) = wide.nodes.get(node) else { return };
                let met = deal::test::<K, S, W>(simd, wide, node, class, list, stream.room);
                if A::NEAREST_FIRST {
                    let key = match order {
                        Order::Entry => met.entry,
                        Order::Corner => deal::corners::<K, S, W>(simd, node, class),
                    };
                    met.deal_nearest_first(simd, key, stream.room);
                } else {
                    met.deal_likeliest_first(simd, stream.room);
                }
            }
            ChildKind::Leaf { first, count } if first < wide.triangles => {
                let bounds = bounds(wide, list).unwrap_or(structure.bounds);
                let leaf = Leaf::new(simd, wide, (first, count), bounds, &mut block);
                stream.leaf(simd, leaf, list);
            }
            _ if list.child == Child::END => {}
            _ => {
                for i in 0..list.len {
                    let id = stream.room.ids[list.start + i] as usize;
                    stream.one::<K, S, W>(simd, list.child, id);
                }
            }
        }
    }
}

/// The box of the child that a list is to visit; `None` for the root.
#[inline(always)]
fn bounds<K: Packing<W>, const W: usize>(wide: &WideTree<W, K>, list: List) -> Option<Aabb> {
    wide.nodes.get(list.node as usize).map(|node| K::bounds(node, list.slot as usize))
}

impl<'a, A: Answers<'a>> Stream<'a, '_, A> {
    /// Sends one ray on alone.
    #[inline(always)]
    fn one<K, S: Simd, const W: usize>(&mut self, simd: S, child: Child, id: usize)
    where
        for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
    {
        let (record, rest) = (&mut self.room.records[id], &self.room.rest[id]);
        if record.0[T_MAX] < record.0[T_MIN] {
            return;
        }
        let (structure, class) = (self.structure, self.class);
        let slot = rest.slot as usize;
        let ray = &self.rays[slot];
        let mut visitor = self.answers.visitor(slot, record.0[T_MAX]);
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
        record.0[T_MAX] = self.answers.settle(slot, record.0[T_MAX], visitor);
    }
}

//! One ray through a scene: nearer children first, pruned by what the visitor still wants, instances
//! entered in the same loop and on the same stack.
//!
//! The order of visits decides nothing but time: every triangle whose hit the visitor could want is
//! tested (`geometry::triangle`, the culling lemma), and visitors settle ties by id. So the walk of
//! each instruction set may order children as is cheapest there.
//!
//! What was tried here: the block test inside the loop where there are 32 vector registers, and planes
//! addressed without arithmetic, each 1 to 2 %; not worth the code. Visits wait for each other, not for
//! instructions.
//!
//! Sources: I. Wald, C. Benthin, S. Boulos, "Getting Rid of Packets: Efficient SIMD Single-Ray
//! Traversal using Multi-branching BVHs", RT 2008 (one ray against all children of a node); V.
//! Fuetterling et al., "Accelerated Single Ray Tracing for Wide Vector Units", HPG 2017 (hits moved
//! together by a compress instruction).

use super::counters::Count;
use super::descent::{Descent, pop};
use super::instance::InstanceLeaf;
use super::moving::MovingLeaf;
use super::pending::{Order, Pending, STACK_NEAR};
use super::prepared::Prepared;
use super::structure::{Get, Layout, Structure};
use crate::geometry::{Meeting, block};
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, Wide as WideTree};
use crate::math::Ray;
use crate::memory::{Levels, Room, Stack};
use crate::simd::{Kernel, Simd, Wide};
use core::ops::ControlFlow;

/// What a query makes of the hits that a walk finds.
pub(crate) trait Visitor<'a> {
    /// What the walk's stack holds: [`ByEntry`] where finding near hits early saves work. With
    /// [`Child`], the order of `layout/order.rs`: what is likely to stop a ray, and cheap, comes first.
    type Pending: Pending + Order;

    /// The greatest `t` that still matters; hits at this very `t` do.
    fn t_max(&self) -> f32;

    /// Moves the visitor into a call out of the loop, which gives it back. (One whose address is known outside is in memory all
    /// the time: 1 % more instructions for closest hits.)
    fn lend(&mut self) -> Self
    where
        Self: Sized;

    /// Takes a hit within `t_min ..= t_max()`; says whether to go on.
    fn hit(&mut self, found: Found<'a>) -> ControlFlow<()>;
}

/// A hit, as leaves name it.
#[derive(Clone, Copy)]
pub(crate) struct Found<'a> {
    pub(crate) t: f32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    /// Of the primitive, among all of its level: ordered as `(geom, prim)` is.
    pub(crate) id: u32,
    /// Rank of the path to the level.
    pub(crate) inst: u64,
    pub(crate) structure: &'a Structure,
}

/// A level of the walk.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a, K: Packing<W>, const W: usize> {
    pub(super) structure: &'a Structure,
    pub(super) wide: &'a WideTree<W, K>,
    pub(super) ray: Prepared,
    /// Rank of the path to this level.
    pub(super) inst: u64,
    /// The instance whose inside stands at the next depth; [`NOBODY`] if none does.
    pub(super) entered: usize,
}

/// See [`Frame::entered`].
pub(super) const NOBODY: usize = usize::MAX;

/// Levels that need no allocation.
pub(super) const FRAMES_NEAR: usize = 3;

/// Shows the visitor every hit of a ray that it could want, in no particular order.
#[inline(always)]
pub(crate) fn walk<'a, K, S, V, C, const W: usize>(
    simd: S,
    structure: &'a Structure,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) where
    K: Packing<W>,
    S: Wide<W>,
    Layout: Get<K, W>,
    for<'d, 's> Descent<'d, 's, K, V::Pending, C, W>: Kernel<Output = Child>,
    V: Visitor<'a>,
    C: Count,
{
    let Some(wide) = Get::<K, W>::get(structure.layout_at(ray.time)) else { return };
    let Some(prepared) = Prepared::new(simd, ray, structure) else { return };
    let frame = Frame { structure, wide, ray: prepared, inst: 0, entered: NOBODY };
    walk_in::<K, S, V, C, W>(simd, frame, wide.root, ray, visitor, counters);
}

/// [`walk`] through what is below a child of the outermost level.
#[inline(always)]
pub(crate) fn walk_from<'a, K, S, V, C, const W: usize>(
    simd: S,
    structure: &'a Structure,
    prepared: Prepared,
    start: Child,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) where
    K: Packing<W>,
    S: Wide<W>,
    Layout: Get<K, W>,
    for<'d, 's> Descent<'d, 's, K, V::Pending, C, W>: Kernel<Output = Child>,
    V: Visitor<'a>,
    C: Count,
{
    // Slices go through one tree: where there are several, rays go one by one.
    let Some(wide) = Get::<K, W>::get(&structure.layout) else { return };
    let frame = Frame { structure, wide, ray: prepared, inst: 0, entered: NOBODY };
    walk_in::<K, S, V, C, W>(simd, frame, start, ray, visitor, counters);
}

#[inline(always)]
fn walk_in<'a, K, S, V, C, const W: usize>(
    simd: S,
    frame: Frame<'a, K, W>,
    start: Child,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) where
    K: Packing<W>,
    S: Wide<W>,
    Layout: Get<K, W>,
    for<'d, 's> Descent<'d, 's, K, V::Pending, C, W>: Kernel<Output = Child>,
    V: Visitor<'a>,
    C: Count,
{
    let mut levels = Levels::<Frame<'_, K, W>, FRAMES_NEAR>::new(frame);
    let mut depth = 0;
    let mut stack = Room::<V::Pending, STACK_NEAR>::new();
    let mut stack = Stack::new(&mut stack);
    let mut next = start;
    loop {
        // One level, until the ray leaves it or comes to an instance.
        let Some(frame) = levels.get(depth) else { return };
        loop {
            if next.is_inner() {
                let (nodes, slab) = (&*frame.wide.nodes, &frame.ray.slab);
                let (stack, counters) = (&mut stack, &mut *counters);
                let range = (ray.t_min, visitor.t_max());
                let way = Descent::<K, _, _, W> { nodes, slab, range, stack, counters, next };
                next = simd.call(way);
            }
            let (first, count) = match next.kind() {
                ChildKind::Leaf { first, count } => (first, count),
                ChildKind::Inner { .. } => {
                    stack.make_room::<W>();
                    continue;
                }
            };
            if first < frame.wide.triangles {
                counters.leaf(count);
                if triangles::<K, S, V, W>(simd, frame, (first, count), ray, visitor).is_break() {
                    return;
                }
            } else if next == Child::NONE {
                let Some(pending) = stack.pop() else { return };
                next = pending.child();
                continue;
            } else if next == Child::END {
                let Some(outer) = depth.checked_sub(1) else { return };
                depth = outer;
                next = pop(visitor.t_max(), &mut stack, counters);
                break;
            } else if let at = first - frame.wide.triangles
                && let Some(id) = at.checked_sub(frame.structure.instances.entries())
            {
                let lent = visitor.lend();
                let (lent, flow) =
                    rare::<K, S, V, C, W>(simd, frame, id as u32, ray, lent, counters);
                *visitor = lent;
                if flow.is_break() {
                    return;
                }
            } else {
                let number = first - frame.wide.triangles;
                let (place, wanted) = ((&mut levels, depth), (ray, visitor.t_max()));
                let start =
                    simd.apply::<InstanceLeaf<'_, '_, K, C, W>>(place, wanted, number, counters);
                next = start;
                if start == Child::NONE {
                    next = pop(visitor.t_max(), &mut stack, counters);
                    break;
                }
                let Some(inner) = levels.get(depth + 1) else { return };
                if let ChildKind::Leaf { first, count } = start.kind()
                    && first < inner.wide.triangles
                {
                    // Nothing to come back from.
                    counters.leaf(count);
                    if triangles::<K, S, V, W>(simd, inner, (first, count), ray, visitor).is_break()
                    {
                        return;
                    }
                    next = pop(visitor.t_max(), &mut stack, counters);
                } else {
                    stack.push(Pending::new(Child::END, f32::NEG_INFINITY.to_bits()));
                    depth += 1;
                }
                break;
            }
            next = pop(visitor.t_max(), &mut stack, counters);
        }
    }
}

/// Shows the visitor the hits with what is neither a triangle that stands nor an instance; gives it back, and says whether
/// to go on. Out of line.
#[inline(never)]
fn rare<'a, K: Packing<W>, S: Wide<W>, V: Visitor<'a>, C: Count, const W: usize>(
    simd: S,
    frame: &Frame<'a, K, W>,
    id: u32,
    ray: &Ray,
    mut visitor: V,
    counters: &mut C,
) -> (V, ControlFlow<()>)
where
    for<'b> MovingLeaf<'a, 'b, V, C>: Kernel<Output = (V, ControlFlow<()>)>,
{
    let Frame { structure, ray: ref prepared, inst, .. } = *frame;
    if let Some(mesh) = structure.moving(id) {
        let leaf = MovingLeaf { structure, mesh, prepared, inst, ray, visitor, counters };
        return simd.call(leaf);
    }
    counters.leaf(1);
    let met = structure.sees(id, ray.mask).then(|| structure.meet(id, &prepared.local(ray)));
    let flow = match met.flatten() {
        Some(Meeting { t, u, v }) if t <= visitor.t_max() => {
            visitor.hit(Found { t, u, v, id, inst, structure })
        }
        _ => ControlFlow::Continue(()),
    };
    (visitor, flow)
}

/// Shows the visitor the hits with the triangles of a leaf.
#[inline(always)]
fn triangles<'a, K: Packing<W>, S: Simd, V: Visitor<'a>, const W: usize>(
    simd: S,
    frame: &Frame<'a, K, W>,
    (first, count): (usize, usize),
    ray: &Ray,
    visitor: &mut V,
) -> ControlFlow<()> {
    let leaf = K::leaf(&frame.wide.words, first);
    let Prepared { triangle, slab, clip, .. } = &frame.ray;
    let range = (ray.t_min, visitor.t_max());
    let hits = K::hits(simd, leaf, count, (triangle, slab), clip, range);
    let mut mask = hits.mask;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize % block::LANES;
        mask &= mask - 1;
        let id = K::id(leaf, count, lane);
        let (t, u, v) = (hits.t[lane], hits.u[lane], hits.v[lane]);
        // A hit nearer than this one may have been found in another lane.
        if t > visitor.t_max() || !frame.structure.sees(id, ray.mask) {
            continue;
        }
        let Frame { structure, inst, .. } = *frame;
        visitor.hit(Found { t, u, v, id, inst, structure })?;
    }
    ControlFlow::Continue(())
}

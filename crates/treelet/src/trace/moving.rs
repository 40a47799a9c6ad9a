//! What happens where a leaf holds a mesh that moves: its own trees, one a segment of time, are walked to their end,
//! on a stack of their own, out of the loop that everything else goes through. So levels where nothing moves pay
//! nothing, and a leaf of such a mesh costs a call.
//!
//! Boxes are those of the ray's moment (`layout::moving` derives why they cull nothing that is hit), triangles
//! are the corners of that moment in the block test of all others.

use super::counters::Count;
use super::descent::{Lanes, pop};
use super::pending::{Order, Pending, STACK_NEAR};
use super::prepared::Prepared;
use super::structure::Structure;
use super::walk::{Found, Visitor};
use crate::bounds::{Aabb, SlabRay};
use crate::geometry::block::{self, MovingTest};
use crate::layout::moving::Segment;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, Plain};
use crate::math::Ray;
use crate::math::pose::Moment;
use crate::memory::{Room, Stack};
use crate::simd::{Floats, Kernel, Simd, Wide};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::ControlFlow;

/// A mesh that moves.
#[derive(Clone, Debug)]
pub(crate) struct MovingMesh {
    /// Its number in the level.
    pub(crate) geom: usize,
    /// The id of its first triangle, which is how leaves name it.
    pub(crate) first_id: u32,
    pub(crate) mask: u32,
    /// Time steps of its vertices.
    pub(crate) steps: usize,
    /// A segment is so many parts of a step long, or so many steps; one of the two is 1.
    pub(crate) parts: u32,
    pub(crate) strides: u32,
    /// Around its triangles at all times.
    pub(crate) bounds: Aabb,
    /// Whether a triangle lies in several leaves.
    pub(crate) repeats: bool,
    /// What the trees cost when they were built: boxes that a long random line meets for each triangle whose box it meets.
    pub(crate) built: f64,
    /// Leaves name triangles by their numbers in the mesh: snapshots share the trees, whatever the mesh is numbered.
    pub(crate) trees: Arc<Trees>,
}

/// One tree a segment, as wide as those of the level.
#[derive(Debug)]
pub(crate) enum Trees {
    Wide8(Vec<Segment<8>>),
    Wide16(Vec<Segment<16>>),
}

impl MovingMesh {
    /// The segment of a moment, were there enough of them.
    fn segment(&self, moment: Moment) -> usize {
        (moment.place * self.parts as f32) as usize / self.strides as usize
    }

    /// Whether its nodes have 8 children.
    pub(crate) fn is_wide8(&self) -> bool {
        matches!(*self.trees, Trees::Wide8(_))
    }

    /// Segments of time.
    pub(crate) fn segments(&self) -> usize {
        match &*self.trees {
            Trees::Wide8(segments) => segments.len(),
            Trees::Wide16(segments) => segments.len(),
        }
    }

    /// Bytes that walks read.
    pub(crate) fn bytes(&self) -> usize {
        match &*self.trees {
            Trees::Wide8(segments) => segments.iter().map(Segment::bytes).sum(),
            Trees::Wide16(segments) => segments.iter().map(Segment::bytes).sum(),
        }
    }
}

/// The way from a node to the next leaf, as [`super::descent`] has it where nothing moves.
struct Way<'w, 's, P, C, const W: usize> {
    segment: &'w Segment<W>,
    /// Steps since the segment began.
    passed: f32,
    slab: &'w SlabRay,
    range: (f32, f32),
    stack: &'w mut Stack<'s, P, STACK_NEAR>,
    counters: &'w mut C,
    next: Child,
}

macro_rules! ways {
    ($($width:literal)*) => {
        $(impl<P: Order, C: Count> Kernel for Way<'_, '_, P, C, $width> {
            type Output = Child;

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) -> Child {
                let Self { segment, passed, slab, range, stack, counters, mut next } = self;
                let lanes = Lanes::<<S as Wide<$width>>::F>::new(simd, slab);
                let splat = |x: f32| <S as Wide<$width>>::F::splat(simd, x);
                let (passed, t_min, limit) = (splat(passed), splat(range.0), splat(range.1));
                while next.is_inner() && !stack.is_tight::<$width>() {
                    let at = next.0 as usize;
                    let (node, deltas) = (segment.nodes.get(at), segment.deltas.get(at));
                    let (Some(node), Some(deltas)) = (node, deltas) else { return Child::NONE };
                    counters.node();
                    let (mask, entry) =
                        lanes.test_moving(simd, node, deltas, passed, t_min, limit);
                    next = if mask == 0 {
                        pop(range.1, stack, counters)
                    } else {
                        P::spread::<S, $width>(simd, &node.children, mask, entry, stack)
                    };
                }
                next
            }
        })*
    };
}

ways! { 8 16 }

/// The walk through a mesh that moves; gives the visitor back and says whether to go on.
pub(super) struct MovingLeaf<'a, 'd, V, C> {
    /// The level that the mesh is on.
    pub(super) structure: &'a Structure,
    pub(super) mesh: &'a MovingMesh,
    /// The ray on that level, and the rank of the path to it.
    pub(super) prepared: &'d Prepared,
    pub(super) inst: u64,
    pub(super) ray: &'d Ray,
    /// Given back.
    pub(super) visitor: V,
    pub(super) counters: &'d mut C,
}

impl<'a, V: Visitor<'a>, C: Count> Kernel for MovingLeaf<'a, '_, V, C> {
    type Output = (V, ControlFlow<()>);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        if self.mesh.mask & self.ray.mask == 0 {
            return (self.visitor, ControlFlow::Continue(()));
        }
        let moment = Moment::new(self.ray.time, self.mesh.steps);
        let at = self.mesh.segment(moment);
        match &*self.mesh.trees {
            Trees::Wide8(segments) => match segments.get(at).or(segments.last()) {
                Some(segment) => self.through::<S, 8>(simd, segment, moment),
                None => (self.visitor, ControlFlow::Continue(())),
            },
            Trees::Wide16(segments) => match segments.get(at).or(segments.last()) {
                Some(segment) => self.through::<S, 16>(simd, segment, moment),
                None => (self.visitor, ControlFlow::Continue(())),
            },
        }
    }
}

impl<'a, V: Visitor<'a>, C: Count> MovingLeaf<'a, '_, V, C> {
    #[inline(always)]
    fn through<S: Wide<W>, const W: usize>(
        self,
        simd: S,
        segment: &Segment<W>,
        moment: Moment,
    ) -> (V, ControlFlow<()>)
    where
        for<'w, 's> Way<'w, 's, V::Pending, C, W>: Kernel<Output = Child>,
    {
        let Self { structure, mesh, prepared, inst, ray, mut visitor, counters } = self;
        let passed = moment.place - segment.start;
        let after = moment.step - segment.step.min(moment.step);

        let mut stack = Room::<V::Pending, STACK_NEAR>::new();
        let mut stack = Stack::new(&mut stack);
        let mut next = segment.root;
        loop {
            if next.is_inner() {
                let (stack, counters) = (&mut stack, &mut *counters);
                let (slab, range) = (&prepared.slab, (ray.t_min, visitor.t_max()));
                next = simd.call(Way { segment, passed, slab, range, stack, counters, next });
            }
            let (first, count) = match next.kind() {
                ChildKind::Leaf { first, count } => (first, count),
                ChildKind::Inner { .. } => {
                    stack.make_room::<W>();
                    continue;
                }
            };
            if next == Child::NONE || next == Child::END {
                let Some(pending) = stack.pop() else {
                    return (visitor, ControlFlow::Continue(()));
                };
                next = pending.child();
                continue;
            }

            // Its triangles, where they are now.
            counters.leaf(count);
            let leaf = segment.leaf(first, after);
            let (range, rays) =
                ((ray.t_min, visitor.t_max(), moment.along), (&prepared.triangle, &prepared.slab));
            let hits = simd.apply::<MovingTest<'_, _>>((&leaf, count), rays, &prepared.clip, range);
            let mut mask = hits.mask;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % block::LANES;
                mask &= mask - 1;
                let (t, u, v) = (hits.t[lane], hits.u[lane], hits.v[lane]);
                // A hit nearer than this one may have been found in another lane.
                if t > visitor.t_max() {
                    continue;
                }
                let id = mesh.first_id + <Plain as Packing<W>>::id(leaf[0], count, lane);
                if visitor.hit(Found { t, u, v, id, inst, structure }).is_break() {
                    return (visitor, ControlFlow::Break(()));
                }
            }
            next = pop(visitor.t_max(), &mut stack, counters);
        }
    }
}

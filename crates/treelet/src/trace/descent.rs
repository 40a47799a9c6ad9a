//! The way from a node to the next leaf: all children of a node at once, no calls, so that the ray
//! stays in registers.

use super::counters::Count;
use super::pending::{Order, Pending, STACK_NEAR};
use crate::bounds::SlabRay;
use crate::layout::moving::Planes;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, Node};
use crate::memory::Stack;
use crate::simd::{Floats, Kernel, Simd, Wide};

/// The ray in every lane.
pub(super) struct Lanes<F> {
    near: [F; 3],
    far: [F; 3],
    reciprocal: [F; 3],
    backward: [usize; 3],
}

impl<F> Lanes<F> {
    #[inline(always)]
    pub(super) fn new<S: Wide<W, F = F>, const W: usize>(simd: S, ray: &SlabRay) -> Self
    where
        F: Floats<W, Token = S>,
    {
        let backward = [ray.backward(0), ray.backward(1), ray.backward(2)];
        let side = |of: usize, axis: usize| ray.side(backward[axis] ^ of, axis);
        Self {
            near: splat(simd, [side(0, 0), side(0, 1), side(0, 2)]),
            far: splat(simd, [side(1, 0), side(1, 1), side(1, 2)]),
            reciprocal: splat(simd, [ray.reciprocal(0), ray.reciprocal(1), ray.reciprocal(2)]),
            backward,
        }
    }

    /// The children whose boxes the ray meets within `t_min ..= t_max`, a bit each, and where it
    /// enters them.
    #[inline(always)]
    fn test<K, S, const W: usize>(&self, simd: S, node: &K::Node, t_min: F, t_max: F) -> (u32, F)
    where
        K: Packing<W>,
        S: Wide<W, F = F>,
        F: Floats<W, Token = S>,
    {
        let entry = |axis: usize| self.entry::<K, S, W>(simd, node, axis);
        let [entry_x, entry_y, entry_z] = [entry(0), entry(1), entry(2)];
        let exit = |axis: usize| self.exit::<K, S, W>(simd, node, axis);
        let [exit_x, exit_y, exit_z] = [exit(0), exit(1), exit(2)];
        let entry = entry_x.max(entry_y).max(entry_z.max(t_min));
        let exit = exit_x.min(exit_y).min(exit_z.min(t_max));
        (entry.le(exit) & K::slots(node), entry)
    }

    /// The same of boxes that move, where so many steps have `passed`.
    #[inline(always)]
    pub(super) fn test_moving<S, const W: usize>(
        &self,
        simd: S,
        node: &Node<W>,
        deltas: &Planes<W>,
        passed: F,
        t_min: F,
        t_max: F,
    ) -> (u32, F)
    where
        S: Wide<W, F = F>,
        F: Floats<W, Token = S>,
    {
        let plane = |axis: usize, side: usize| {
            let base = F::load(simd, &node.planes[axis][side]);
            base.add(passed.mul(F::load(simd, &deltas[axis][side])))
        };
        let entry = |axis: usize| {
            let planes = plane(axis, self.backward[axis] & 1);
            planes.sub(self.near[axis]).mul(self.reciprocal[axis])
        };
        let [entry_x, entry_y, entry_z] = [entry(0), entry(1), entry(2)];
        let exit = |axis: usize| {
            let planes = plane(axis, self.backward[axis] & 1 ^ 1);
            planes.sub(self.far[axis]).mul(self.reciprocal[axis])
        };
        let [exit_x, exit_y, exit_z] = [exit(0), exit(1), exit(2)];
        let entry = entry_x.max(entry_y).max(entry_z.max(t_min));
        let exit = exit_x.min(exit_y).min(exit_z.min(t_max));
        (entry.le(exit), entry)
    }

    #[inline(always)]
    fn entry<K: Packing<W>, S, const W: usize>(&self, simd: S, node: &K::Node, axis: usize) -> F
    where
        S: Wide<W, F = F>,
        F: Floats<W, Token = S>,
    {
        let planes = K::planes(simd, node, axis, self.backward[axis] & 1);
        planes.sub(self.near[axis]).mul(self.reciprocal[axis])
    }

    #[inline(always)]
    fn exit<K: Packing<W>, S, const W: usize>(&self, simd: S, node: &K::Node, axis: usize) -> F
    where
        S: Wide<W, F = F>,
        F: Floats<W, Token = S>,
    {
        let planes = K::planes(simd, node, axis, self.backward[axis] & 1 ^ 1);
        planes.sub(self.far[axis]).mul(self.reciprocal[axis])
    }
}

/// Each in all lanes. (A function, since closures in kernels may end up outside of them.)
#[inline(always)]
fn splat<F: Floats<W>, const W: usize>(token: F::Token, [x, y, z]: [f32; 3]) -> [F; 3] {
    [F::splat(token, x), F::splat(token, y), F::splat(token, z)]
}
/// The way from a node to the next leaf.
pub(crate) struct Descent<'d, 's, K: Packing<W>, P, C, const W: usize> {
    pub(super) nodes: &'d [K::Node],
    pub(super) slab: &'d SlabRay,
    /// The least `t` that is wanted, and the greatest: neither changes before the next leaf.
    pub(super) range: (f32, f32),
    pub(super) stack: &'d mut Stack<'s, P, STACK_NEAR>,
    pub(super) counters: &'d mut C,
    pub(super) next: Child,
}

macro_rules! descents {
    ($($width:literal)*) => {
        $(impl<K: Packing<$width>, P: Order, C: Count> Kernel for Descent<'_, '_, K, P, C, $width> {
            type Output = Child;

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) -> Child {
                let Self { nodes, slab, range: (t_min, t_max), stack, counters, mut next } = self;
                let lanes = Lanes::<<S as Wide<$width>>::F>::new(simd, slab);
                let t_min = <S as Wide<$width>>::F::splat(simd, t_min);
                let limit = <S as Wide<$width>>::F::splat(simd, t_max);
                while next.is_inner() && !stack.is_tight::<$width>() {
                    let Some(node) = nodes.get(next.0 as usize) else { return Child::NONE };
                    counters.node();
                    let (mask, entry) = lanes.test::<K, S, $width>(simd, node, t_min, limit);
                    if C::LISTENS {
                        report::<K, C, $width>(slab, node, mask, counters);
                    }
                    next = if mask == 0 {
                        pop(t_max, stack, counters)
                    } else {
                        P::spread::<S, $width>(simd, K::children(node), mask, entry, stack)
                    };
                }
                next
            }
        })*
    };
}

descents! { 8 16 }
/// The next child that may still matter; [`Child::NONE`] if none is near.
#[inline(always)]
pub(super) fn pop<P: Pending, C: Count>(
    t_max: f32,
    stack: &mut Stack<'_, P, STACK_NEAR>,
    counters: &mut C,
) -> Child {
    loop {
        let Some(pending) = stack.pop_near() else { return Child::NONE };
        if !pending.is_beyond(t_max) {
            return pending.child();
        }
        counters.t_culls(1);
    }
}
/// Counts the children that a visit did not lead to.
#[cold]
fn report<K: Packing<W>, C: Count, const W: usize>(
    ray: &SlabRay,
    node: &K::Node,
    mask: u32,
    counters: &mut C,
) {
    let children = K::children(node);
    for slot in (0..W).filter(|slot| mask >> slot & 1 == 0 && children[*slot] != Child::END) {
        if ray.interval(&K::bounds(node, slot)).is_empty() {
            counters.box_culls(1);
        } else {
            counters.t_culls(1);
        }
    }
}

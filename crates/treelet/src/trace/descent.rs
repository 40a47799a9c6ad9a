//! The way from a node to the next leaf: all children of a node at once, no calls, so that the ray
//! stays in registers.

use super::counters::Count;
use super::pending::{Order, Pending, STACK_NEAR};
use crate::bounds::{Aabb, SlabRay};
use crate::layout::wide::{Child, Node};
use crate::memory::Stack;
use crate::simd::{Floats, Kernel, Simd, Wide};

/// The ray in every lane.
struct Lanes<F> {
    near: [F; 3],
    far: [F; 3],
    reciprocal: [F; 3],
    backward: [usize; 3],
}

impl<F> Lanes<F> {
    #[inline(always)]
    fn new<S: Wide<W, F = F>, const W: usize>(simd: S, ray: &SlabRay) -> Self
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
    fn test<S, const W: usize>(&self, simd: S, node: &Node<W>, t_min: F, t_max: F) -> (u32, F)
    where
        S: Wide<W, F = F>,
        F: Floats<W, Token = S>,
    {
        let [entry_x, entry_y, entry_z] =
            [self.entry(simd, node, 0), self.entry(simd, node, 1), self.entry(simd, node, 2)];
        let [exit_x, exit_y, exit_z] =
            [self.exit(simd, node, 0), self.exit(simd, node, 1), self.exit(simd, node, 2)];
        let entry = entry_x.max(entry_y).max(entry_z.max(t_min));
        let exit = exit_x.min(exit_y).min(exit_z.min(t_max));
        (entry.le(exit), entry)
    }

    #[inline(always)]
    fn entry<S: Wide<W, F = F>, const W: usize>(&self, simd: S, node: &Node<W>, axis: usize) -> F
    where
        F: Floats<W, Token = S>,
    {
        let planes = F::load(simd, &node.planes[axis][self.backward[axis] & 1]);
        planes.sub(self.near[axis]).mul(self.reciprocal[axis])
    }

    #[inline(always)]
    fn exit<S: Wide<W, F = F>, const W: usize>(&self, simd: S, node: &Node<W>, axis: usize) -> F
    where
        F: Floats<W, Token = S>,
    {
        let planes = F::load(simd, &node.planes[axis][self.backward[axis] & 1 ^ 1]);
        planes.sub(self.far[axis]).mul(self.reciprocal[axis])
    }
}

/// Each in all lanes. (A function, since closures in kernels may end up outside of them.)
#[inline(always)]
fn splat<F: Floats<W>, const W: usize>(token: F::Token, [x, y, z]: [f32; 3]) -> [F; 3] {
    [F::splat(token, x), F::splat(token, y), F::splat(token, z)]
}
/// The way from a node to the next leaf.
pub(crate) struct Descent<'d, 's, P, C, const W: usize> {
    pub(super) nodes: &'d [Node<W>],
    pub(super) slab: &'d SlabRay,
    /// The least `t` that is wanted, and the greatest: neither changes before the next leaf.
    pub(super) range: (f32, f32),
    pub(super) stack: &'d mut Stack<'s, P, STACK_NEAR>,
    pub(super) counters: &'d mut C,
    pub(super) next: Child,
}

macro_rules! descents {
    ($($width:literal)*) => {
        $(impl<P: Order, C: Count> Kernel for Descent<'_, '_, P, C, $width> {
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
                    let (mask, entry) = lanes.test(simd, node, t_min, limit);
                    if C::LISTENS {
                        report(slab, node, mask, counters);
                    }
                    next = if mask == 0 {
                        pop(t_max, stack, counters)
                    } else {
                        P::spread::<S, $width>(simd, node, mask, entry, stack)
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
fn report<C: Count, const W: usize>(ray: &SlabRay, node: &Node<W>, mask: u32, counters: &mut C) {
    for slot in (0..W).filter(|slot| mask >> slot & 1 == 0 && node.children[*slot] != Child::END) {
        let bounds = Aabb {
            lo: core::array::from_fn(|axis| node.planes[axis][0][slot]),
            hi: core::array::from_fn(|axis| node.planes[axis][1][slot]),
        };
        if ray.interval(&bounds).is_empty() {
            counters.box_culls(1);
        } else {
            counters.t_culls(1);
        }
    }
}

//! One ray through a scene: nearer children first, pruned by what the visitor still wants, instances
//! entered in the same loop and on the same stack.
//!
//! The order of visits decides nothing but time: every triangle whose hit the visitor could want is
//! tested (`geometry::triangle`, the culling lemma), and visitors settle ties by id. So the walk of
//! each instruction set may order children as is cheapest there.
//!
//! Sources: I. Wald, C. Benthin, S. Boulos, "Getting Rid of Packets: Efficient SIMD Single-Ray
//! Traversal using Multi-branching BVHs", RT 2008 (one ray against all children of a node); V.
//! Fuetterling et al., "Accelerated Single Ray Tracing for Wide Vector Units", HPG 2017 (hits moved
//! together by a compress instruction).

use super::counters::Count;
use super::prepared::Prepared;
use super::structure::{Get, Layout, Structure};
use crate::bounds::{Interval, SlabRay};
use crate::geometry::block;
use crate::layout::wide::{Child, ChildKind, Node, Wide as WideTree};
use crate::math::Ray;
use crate::memory::{Room, Stack};
use crate::simd::{Floats, Wide};
use core::ops::ControlFlow;

/// What a query makes of the hits that a walk finds.
pub(crate) trait Visitor<'a> {
    /// Whether finding near hits early saves work. If not, large boxes come first: they are the
    /// likeliest to hold any hit.
    const NEAREST_FIRST: bool;

    /// The greatest `t` that still matters; hits at this very `t` do.
    fn t_max(&self) -> f32;

    /// Takes a hit within `t_min ..= t_max()`; says whether to go on.
    fn hit(&mut self, found: Found<'a>) -> ControlFlow<()>;
}

/// A hit, as leaves name it.
#[derive(Clone, Copy)]
pub(crate) struct Found<'a> {
    pub(crate) t: f32,
    pub(crate) u: f32,
    pub(crate) v: f32,
    /// Of the triangle, among all of its level: ordered as `(geom, prim)` is.
    pub(crate) id: u32,
    /// Rank of the path to the level.
    pub(crate) inst: u64,
    pub(crate) structure: &'a Structure,
}

/// A level of the walk.
#[derive(Clone, Copy)]
struct Frame<'a, const W: usize> {
    structure: &'a Structure,
    wide: &'a WideTree<W>,
    ray: Prepared,
    /// Rank of the path to this level.
    inst: u64,
}

/// Entries of the stack that need no allocation: several a level of a well-shaped tree.
const STACK_NEAR: usize = 128;
/// Saved levels that need no allocation.
const FRAMES_NEAR: usize = 2;

/// A child to be visited later, below the distance at which the ray enters it: sorted by distance as
/// integers are. (Negative distances, which need a negative `t_min`, sort wrongly among each other:
/// that costs time, never answers.)
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Pending(u64);

impl Pending {
    #[inline(always)]
    fn new(child: u32, entry: u32) -> Self {
        Self(u64::from(entry) << 32 | u64::from(child))
    }

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }

    #[inline(always)]
    fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }
}

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
        let splat = |[x, y, z]: [f32; 3]| [F::splat(simd, x), F::splat(simd, y), F::splat(simd, z)];
        let [x, y, z] = ray.backward;
        Self {
            near: splat(ray.near),
            far: splat(ray.far),
            reciprocal: splat(ray.reciprocal),
            backward: [usize::from(x), usize::from(y), usize::from(z)],
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
        let (mut entry, mut exit) = (t_min, t_max);
        for axis in 0..3 {
            let planes = &node.planes[axis];
            let first = F::load(simd, &planes[self.backward[axis] & 1]);
            let last = F::load(simd, &planes[self.backward[axis] & 1 ^ 1]);
            entry = first.sub(self.near[axis]).mul(self.reciprocal[axis]).max(entry);
            exit = last.sub(self.far[axis]).mul(self.reciprocal[axis]).min(exit);
        }
        (entry.le(exit), entry)
    }
}

/// Shows the visitor every hit of a valid ray that it could want, in no particular order.
#[inline(always)]
pub(crate) fn walk<'a, S, V, C, const W: usize>(
    simd: S,
    structure: &'a Structure,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) where
    S: Wide<W>,
    Layout: Get<W>,
    V: Visitor<'a>,
    C: Count,
{
    let Some(wide) = structure.layout.get() else { return };
    let prepared = Prepared::new(ray, structure);
    walk_from(simd, structure, prepared, wide.root, ray, visitor, counters);
}

/// [`walk`] through what is below a child of the outermost level.
#[inline(always)]
pub(crate) fn walk_from<'a, S, V, C, const W: usize>(
    simd: S,
    structure: &'a Structure,
    prepared: Prepared,
    start: Child,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) where
    S: Wide<W>,
    Layout: Get<W>,
    V: Visitor<'a>,
    C: Count,
{
    let Some(wide) = structure.layout.get() else { return };
    let mut frame = Frame { structure, wide, ray: prepared, inst: 0 };
    let mut lanes = Lanes::new(simd, &frame.ray.slab);
    let t_min = S::F::splat(simd, ray.t_min);
    let mut frames = Room::<Frame<'_, W>, FRAMES_NEAR>::new();
    let mut frames = Stack::new(&mut frames);
    let mut stack = Room::<Pending, STACK_NEAR>::new();
    let mut stack = Stack::new(&mut stack);
    let mut next = start;
    loop {
        // Go down to a leaf.
        while next.is_inner() {
            let Some(node) = frame.wide.nodes.get(next.0 as usize) else { return };
            counters.node();
            let t_max = S::F::splat(simd, visitor.t_max());
            let (mask, entry) = lanes.test(simd, node, t_min, t_max);
            if C::LISTENS {
                report(&frame.ray.slab, node, mask, counters);
            }
            let nearest = if V::NEAREST_FIRST {
                nearest_first(simd, node, mask, entry, &mut stack)
            } else {
                largest_first(simd, node, mask, &mut stack)
            };
            match nearest.or_else(|| pop(visitor, &mut stack, counters)) {
                Some(child) => next = child,
                None => return,
            }
        }

        match next.kind() {
            _ if next == Child::END => {
                // The end of a level, or of the tree of nothing.
                let Some(outer) = frames.pop() else { return };
                frame = outer;
                lanes = Lanes::new(simd, &frame.ray.slab);
            }
            ChildKind::Leaf { first, count } if first < frame.wide.triangles => {
                counters.leaf(count);
                let rows = frame.wide.block(first);
                let range = Interval { entry: ray.t_min, exit: visitor.t_max() };
                let Prepared { triangle, slab, clip, .. } = &frame.ray;
                let hits = block::hit(simd, rows, count, triangle, slab, clip, &range);
                let mut mask = hits.mask;
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize % block::LANES;
                    mask &= mask - 1;
                    let id = rows[9 * count + lane].to_bits();
                    let (t, u, v) = (hits.t[lane], hits.u[lane], hits.v[lane]);
                    // A hit nearer than this one may have been found in another lane.
                    if t > visitor.t_max() || !frame.structure.sees(id, ray.mask) {
                        continue;
                    }
                    let Frame { structure, inst, .. } = frame;
                    if visitor.hit(Found { t, u, v, id, inst, structure }).is_break() {
                        return;
                    }
                }
            }
            ChildKind::Leaf { first, count } => {
                let at = first - frame.wide.triangles;
                if count > 1 {
                    counters.leaf(0);
                    push_instances(&frame, at, count, ray, visitor, &mut stack, counters);
                } else if let Some(inner) = enter(&frame, at, ray, visitor) {
                    counters.instance();
                    stack.push(Pending::new(Child::END.0, f32::NEG_INFINITY.to_bits()));
                    let root = inner.wide.root;
                    stack.push(Pending::new(root.0, f32::NEG_INFINITY.to_bits()));
                    frames.push(frame);
                    frame = inner;
                    lanes = Lanes::new(simd, &frame.ray.slab);
                }
            }
            ChildKind::Inner { .. } => {}
        }
        match pop(visitor, &mut stack, counters) {
            Some(child) => next = child,
            None => return,
        }
    }
}

/// Stacks the children of the mask so that nearer ones come first; returns the nearest.
#[inline(always)]
fn nearest_first<S: Wide<W>, const W: usize>(
    simd: S,
    node: &Node<W>,
    mask: u32,
    entry: S::F,
    stack: &mut Stack<'_, Pending, STACK_NEAR>,
) -> Option<Child> {
    if mask == 0 {
        return None;
    }
    // Most nodes have one child that is met: no sorting, no distances.
    if mask & (mask - 1) == 0 {
        return Some(node.children[mask.trailing_zeros() as usize % W]);
    }
    let children = simd.compress(mask, &words(&node.children));
    let entries = simd.compress(mask, &bits(entry.lanes()));
    let key = |i: usize| Pending::new(children[i % W], entries[i % W]);
    let (mut nearest, farther) = ordered(key(0), key(1));
    let count = mask.count_ones() as usize;
    if count == 2 {
        stack.push(farther);
        return Some(nearest.child());
    }
    if count == 3 {
        let (near, far) = ordered(nearest, key(2));
        let (far, farthest) = ordered(farther, far);
        stack.push(farthest);
        stack.push(far);
        return Some(near.child());
    }
    // Rarely more: insertion, the farthest first.
    let mut sorted = [farther; W];
    for i in 2..count {
        let (near, far) = ordered(nearest, key(i));
        nearest = near;
        let mut at = i - 1;
        while at > 0 && sorted[(at - 1) % W] < far {
            sorted[at % W] = sorted[(at - 1) % W];
            at -= 1;
        }
        sorted[at % W] = far;
    }
    stack.push_first(sorted, count - 1);
    Some(nearest.child())
}

/// The children as plain words.
#[inline(always)]
fn words<const W: usize>(children: &[Child; W]) -> [u32; W] {
    let mut out = [0; W];
    for lane in 0..W {
        out[lane] = children[lane].0;
    }
    out
}

/// Floats as they are stored.
#[inline(always)]
fn bits<const W: usize>(lanes: [f32; W]) -> [u32; W] {
    let mut out = [0; W];
    for lane in 0..W {
        out[lane] = lanes[lane].to_bits();
    }
    out
}

/// The nearer first.
#[inline(always)]
fn ordered(a: Pending, b: Pending) -> (Pending, Pending) {
    if b < a { (b, a) } else { (a, b) }
}

/// Stacks the children of the mask in their order, smallest box first; returns the largest.
#[inline(always)]
fn largest_first<S: Wide<W>, const W: usize>(
    simd: S,
    node: &Node<W>,
    mask: u32,
    stack: &mut Stack<'_, Pending, STACK_NEAR>,
) -> Option<Child> {
    if mask == 0 {
        return None;
    }
    let largest = (u32::BITS - 1 - mask.leading_zeros()) as usize;
    let mut rest = mask & !(1 << largest);
    let _ = simd;
    while rest != 0 {
        let at = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        stack.push(Pending::new(node.children[at % W].0, f32::NEG_INFINITY.to_bits()));
    }
    Some(node.children[largest % W])
}

/// The next child that may still matter; `None` ends the walk.
#[inline(always)]
fn pop<'a, V: Visitor<'a>, C: Count>(
    visitor: &V,
    stack: &mut Stack<'_, Pending, STACK_NEAR>,
    counters: &mut C,
) -> Option<Child> {
    loop {
        let pending = stack.pop()?;
        if !V::NEAREST_FIRST || pending.entry() <= visitor.t_max() {
            return Some(pending.child());
        }
        counters.t_culls(1);
    }
}

/// Counts the children that a visit did not lead to.
#[cold]
fn report<C: Count, const W: usize>(ray: &SlabRay, node: &Node<W>, mask: u32, counters: &mut C) {
    for slot in (0..W).filter(|slot| mask >> slot & 1 == 0 && node.children[*slot] != Child::END) {
        let bounds = crate::Aabb {
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

/// Puts the instances of a leaf on the stack: each is entered when it is popped.
#[cold]
#[inline(never)]
fn push_instances<'a, V: Visitor<'a>, C: Count, const W: usize>(
    frame: &Frame<'a, W>,
    first: usize,
    count: usize,
    ray: &Ray,
    visitor: &V,
    stack: &mut Stack<'_, Pending, STACK_NEAR>,
    counters: &mut C,
) {
    let structure = frame.structure;
    for at in first..first + count {
        let instance = &structure.instances[structure.leaf_instances[at] as usize];
        if instance.mask & ray.mask == 0 {
            continue;
        }
        let inside = frame.ray.slab.interval(&instance.bounds);
        if inside.is_empty() {
            counters.box_culls(1);
        } else if inside.entry > visitor.t_max() || inside.exit < ray.t_min {
            counters.t_culls(1);
        } else {
            let child = Child::leaf(frame.wide.triangles + at, 1);
            stack.push(Pending::new(child.0, inside.entry.to_bits()));
        }
    }
}

/// The level inside an instance, if the ray has business there.
#[cold]
#[inline(never)]
fn enter<'a, V: Visitor<'a>, const W: usize>(
    frame: &Frame<'a, W>,
    at: usize,
    ray: &Ray,
    visitor: &V,
) -> Option<Frame<'a, W>>
where
    Layout: Get<W>,
{
    let structure = frame.structure;
    let instance = &structure.instances[structure.leaf_instances[at] as usize];
    if instance.mask & ray.mask == 0 {
        return None;
    }
    let clip = frame.ray.slab.interval(&instance.bounds).intersection(&frame.ray.clip);
    if clip.is_empty() || clip.entry > visitor.t_max() || clip.exit < ray.t_min {
        return None;
    }
    let inner = &*instance.structure;
    let ray = frame.ray.enter(&instance.object_from_world, clip, inner)?;
    // Building refuses instances of another layout.
    let wide = inner.layout.get()?;
    Some(Frame { structure: inner, wide, ray, inst: frame.inst + instance.rank })
}

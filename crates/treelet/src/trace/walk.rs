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
use crate::bounds::SlabRay;
use crate::geometry::block::{self, BlockTest};
use crate::layout::wide::{Child, ChildKind, LEAF_MAX, Node, Wide as WideTree};
use crate::math::Ray;
use crate::memory::{Room, Stack};
use crate::simd::{Floats, Kernel, Simd, Wide};
use core::ops::ControlFlow;

/// What a query makes of the hits that a walk finds.
pub(crate) trait Visitor<'a> {
    /// What the walk's stack holds: [`ByEntry`] where finding near hits early saves work. With
    /// [`Child`], large boxes come first: they are the likeliest to hold any hit.
    type Pending: Pending + Order;

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

/// A child to be visited later.
pub(crate) trait Pending: Copy {
    /// The child, and the bits of the distance at which the ray enters its box.
    fn new(child: Child, entry: u32) -> Self;
    /// What to visit.
    fn child(self) -> Child;
    /// Whether nothing in it can be at `t_max` or nearer.
    fn is_beyond(self, t_max: f32) -> bool;
}

/// For walks that stop at any hit: the child alone.
impl Pending for Child {
    #[inline(always)]
    fn new(child: Child, _: u32) -> Self {
        child
    }

    #[inline(always)]
    fn child(self) -> Child {
        self
    }

    #[inline(always)]
    fn is_beyond(self, _: f32) -> bool {
        false
    }
}

/// The child below the distance: sorted by distance as integers are. (Negative distances, which need
/// a negative `t_min`, sort wrongly among each other: that costs time, never answers.)
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ByEntry(u64);

impl Pending for ByEntry {
    #[inline(always)]
    fn new(child: Child, entry: u32) -> Self {
        Self(u64::from(entry) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }

    #[inline(always)]
    fn is_beyond(self, t_max: f32) -> bool {
        f32::from_bits((self.0 >> 32) as u32) > t_max
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

/// Shows the visitor every hit of a ray that it could want, in no particular order.
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
    for<'d, 's> Descent<'d, 's, V::Pending, V, C, W>: Kernel<Output = Child>,
    V: Visitor<'a>,
    C: Count,
{
    let Some(wide) = structure.layout.get() else { return };
    let Some(prepared) = Prepared::new(simd, ray, structure) else { return };
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
    for<'d, 's> Descent<'d, 's, V::Pending, V, C, W>: Kernel<Output = Child>,
    V: Visitor<'a>,
    C: Count,
{
    let Some(wide) = structure.layout.get() else { return };
    let mut frame = Frame { structure, wide, ray: prepared, inst: 0 };
    let mut frames = Room::<Frame<'_, W>, FRAMES_NEAR>::new();
    let mut frames = Stack::new(&mut frames);
    let mut stack = Room::<V::Pending, STACK_NEAR>::new();
    let mut stack = Stack::new(&mut stack);
    let mut next = start;
    loop {
        // One level, until the ray leaves it or enters another.
        loop {
            if next.is_inner() {
                let (nodes, slab) = (&*frame.wide.nodes, &frame.ray.slab);
                let (visitor, stack, t_min) = (&*visitor, &mut stack, ray.t_min);
                let counters = &mut *counters;
                let way = Descent { nodes, slab, t_min, visitor, stack, counters, next };
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
                let rows = frame.wide.block(first);
                let Prepared { triangle, slab, clip, .. } = &frame.ray;
                let range = (ray.t_min, visitor.t_max());
                let hits =
                    simd.apply::<BlockTest<'_, _>>((rows, count), (triangle, slab), clip, range);
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
                next = pop(visitor, &mut stack, counters);
                continue;
            }

            if next == Child::NONE {
                let Some(pending) = stack.pop() else { return };
                next = pending.child();
                continue;
            }
            if next == Child::END {
                let Some(outer) = frames.pop() else { return };
                frame = outer;
                next = pop(visitor, &mut stack, counters);
                break;
            }
            let (frame_now, visitor_now) = (&frame, &*visitor);
            let counters = &mut *counters;
            let leaf = InstanceLeaf {
                frame: frame_now,
                first,
                count,
                ray,
                visitor: visitor_now,
                counters,
            };
            match simd.call(leaf) {
                Opened::Several(instances, count) => {
                    instances.iter().take(count).for_each(|pending| stack.push(*pending));
                    next = pop(visitor, &mut stack, counters);
                }
                Opened::One(inner) => {
                    stack.push(Pending::new(Child::END, f32::NEG_INFINITY.to_bits()));
                    frames.push(frame);
                    next = inner.wide.root;
                    frame = inner;
                    break;
                }
            }
        }
    }
}

/// The way from a node to the next leaf.
pub(crate) struct Descent<'d, 's, P, V, C, const W: usize> {
    nodes: &'d [Node<W>],
    slab: &'d SlabRay,
    t_min: f32,
    visitor: &'d V,
    stack: &'d mut Stack<'s, P, STACK_NEAR>,
    counters: &'d mut C,
    next: Child,
}

macro_rules! descents {
    ($($width:literal)*) => {
        $(impl<'a, V: Visitor<'a>, C: Count> Kernel for Descent<'_, '_, V::Pending, V, C, $width> {
            type Output = Child;

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) -> Child {
                let Self { nodes, slab, t_min, visitor, stack, counters, mut next } = self;
                let lanes = Lanes::<<S as Wide<$width>>::F>::new(simd, slab);
                let t_min = <S as Wide<$width>>::F::splat(simd, t_min);
                while next.is_inner() && !stack.is_tight::<$width>() {
                    let Some(node) = nodes.get(next.0 as usize) else { return Child::NONE };
                    counters.node();
                    let t_max = <S as Wide<$width>>::F::splat(simd, visitor.t_max());
                    let (mask, entry) = lanes.test(simd, node, t_min, t_max);
                    if C::LISTENS {
                        report(slab, node, mask, counters);
                    }
                    next = if mask == 0 {
                        pop(visitor, stack, counters)
                    } else {
                        V::Pending::spread::<S, $width>(simd, node, mask, entry, stack)
                    };
                }
                next
            }
        })*
    };
}

descents! { 8 16 }

/// What a leaf of instances makes of the walk.
enum Opened<'a, P, const W: usize> {
    /// Leaves of one each, to be stacked.
    Several([P; LEAF_MAX], usize),
    /// The level inside.
    One(Frame<'a, W>),
}

/// A leaf of instances: one is entered, several become leaves of one each.
struct InstanceLeaf<'a, 'd, V, C, const W: usize> {
    frame: &'d Frame<'a, W>,
    first: usize,
    count: usize,
    ray: &'d Ray,
    visitor: &'d V,
    counters: &'d mut C,
}

impl<'a, V: Visitor<'a>, C: Count, const W: usize> Kernel for InstanceLeaf<'a, '_, V, C, W>
where
    Layout: Get<W>,
{
    type Output = Opened<'a, V::Pending, W>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Opened<'a, V::Pending, W> {
        let Self { frame, first, count, ray, visitor, counters } = self;
        let at = first - frame.wide.triangles;
        let mut several = [Pending::new(Child::END, 0); LEAF_MAX];
        let mut len = 0;
        if count == 1 {
            if let Some(inner) = enter(simd, frame, at, ray, visitor) {
                counters.instance();
                return Opened::One(inner);
            }
            return Opened::Several(several, 0);
        }
        counters.leaf(0);
        for at in at..at + count {
            let instance = frame.structure.leaf_instance(at);
            if instance.mask & ray.mask == 0 {
                continue;
            }
            let inside = frame.ray.slab.interval(&instance.bounds);
            if inside.is_empty() {
                counters.box_culls(1);
            } else if inside.entry > visitor.t_max() || inside.exit < ray.t_min {
                counters.t_culls(1);
            } else if let Some(place) = several.get_mut(len) {
                let child = Child::leaf(frame.wide.triangles + at, 1);
                *place = Pending::new(child, inside.entry.to_bits());
                len += 1;
            }
        }
        Opened::Several(several, len)
    }
}

/// How a node's children that are met go on the stack.
pub(crate) trait Order: Pending {
    /// Stacks all but one of the children of the mask, which has some; returns that one, to go on
    /// with.
    fn spread<S: Wide<W>, const W: usize>(
        simd: S,
        node: &Node<W>,
        mask: u32,
        entry: S::F,
        stack: &mut Stack<'_, Self, STACK_NEAR>,
    ) -> Child;
}

impl Order for ByEntry {
    /// The nearest is visited first, the farthest last.
    #[inline(always)]
    fn spread<S: Wide<W>, const W: usize>(
        simd: S,
        node: &Node<W>,
        mask: u32,
        entry: S::F,
        stack: &mut Stack<'_, Self, STACK_NEAR>,
    ) -> Child {
        // Most nodes have one child that is met: no sorting, no distances.
        if mask & (mask - 1) == 0 {
            return node.children[mask.trailing_zeros() as usize % W];
        }
        let mut met = Met::<W>::new(simd, node, mask, entry.lanes());
        let (mut nearest, farther) = ordered(met.next(), met.next());
        let count = mask.count_ones() as usize;
        if count == 2 {
            stack.push_near(farther);
            return nearest.child();
        }
        if count == 3 {
            let (near, far) = ordered(nearest, met.next());
            let (far, farthest) = ordered(farther, far);
            stack.push_near(farthest);
            stack.push_near(far);
            return near.child();
        }
        // Rarely more: insertion, the farthest first.
        let mut sorted = [farther; W];
        for i in 2..count {
            let (near, far) = ordered(nearest, met.next());
            nearest = near;
            let mut at = i - 1;
            while at > 0 && sorted[(at - 1) % W] < far {
                sorted[at % W] = sorted[(at - 1) % W];
                at -= 1;
            }
            sorted[at % W] = far;
        }
        stack.push_first(sorted, count - 1);
        nearest.child()
    }
}

impl Order for Child {
    /// In the node's order, the largest box uppermost.
    #[inline(always)]
    fn spread<S: Wide<W>, const W: usize>(
        simd: S,
        node: &Node<W>,
        mask: u32,
        _: S::F,
        stack: &mut Stack<'_, Self, STACK_NEAR>,
    ) -> Child {
        let largest = (u32::BITS - 1 - mask.leading_zeros()) as usize;
        let mut rest = mask & !(1 << largest);
        if S::COMPRESSES {
            let children = simd.compress(rest, &words(&node.children));
            stack.push_first(children.map(Child), rest.count_ones() as usize);
        } else {
            while rest != 0 {
                stack.push_near(node.children[rest.trailing_zeros() as usize % W]);
                rest &= rest - 1;
            }
        }
        node.children[largest % W]
    }
}

/// The children of a mask, one after the other, with where the ray enters them.
struct Met<const W: usize> {
    children: [u32; W],
    entries: [u32; W],
    /// Where the instruction set moves them together, a counter; else the bits that are left.
    left: u32,
    packed: bool,
}

impl<const W: usize> Met<W> {
    #[inline(always)]
    fn new<S: Simd>(simd: S, node: &Node<W>, mask: u32, entries: [f32; W]) -> Self {
        let (children, entries) = (words(&node.children), bits(entries));
        if S::COMPRESSES {
            let (children, entries) =
                (simd.compress(mask, &children), simd.compress(mask, &entries));
            return Self { children, entries, left: 0, packed: true };
        }
        Self { children, entries, left: mask, packed: false }
    }

    /// The next of them, of which there is one.
    #[inline(always)]
    fn next(&mut self) -> ByEntry {
        let at = if self.packed { self.left } else { self.left.trailing_zeros() } as usize % W;
        self.left = if self.packed { self.left + 1 } else { self.left & self.left.wrapping_sub(1) };
        ByEntry::new(Child(self.children[at]), self.entries[at])
    }
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
fn ordered(a: ByEntry, b: ByEntry) -> (ByEntry, ByEntry) {
    if b < a { (b, a) } else { (a, b) }
}

/// The next child that may still matter; [`Child::NONE`] if none is near.
#[inline(always)]
fn pop<'a, V: Visitor<'a>, C: Count>(
    visitor: &V,
    stack: &mut Stack<'_, V::Pending, STACK_NEAR>,
    counters: &mut C,
) -> Child {
    loop {
        let Some(pending) = stack.pop_near() else { return Child::NONE };
        if !pending.is_beyond(visitor.t_max()) {
            return pending.child();
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

/// The level inside an instance, if the ray has business there.
#[inline(always)]
fn enter<'a, S: Simd, V: Visitor<'a>, const W: usize>(
    simd: S,
    frame: &Frame<'a, W>,
    at: usize,
    ray: &Ray,
    visitor: &V,
) -> Option<Frame<'a, W>>
where
    Layout: Get<W>,
{
    let instance = frame.structure.leaf_instance(at);
    if instance.mask & ray.mask == 0 {
        return None;
    }
    let clip = frame.ray.slab.interval(&instance.bounds).intersection(&frame.ray.clip);
    if clip.is_empty() || clip.entry > visitor.t_max() || clip.exit < ray.t_min {
        return None;
    }
    let inner = &*instance.structure;
    let ray = frame.ray.enter(simd, &instance.object_from_world, clip, inner)?;
    // Building refuses instances of another layout.
    let wide = inner.layout.get()?;
    Some(Frame { structure: inner, wide, ray, inst: frame.inst + instance.rank })
}

//! One ray through a scene: nearer child first, pruned by what the visitor still wants, instances
//! entered in the same loop and on the same stack.
//!
//! The order of visits decides nothing but time: every triangle whose hit the visitor could want is
//! tested (`geometry::triangle`, the culling lemma), and visitors settle ties by id.

use super::counters::Count;
use super::prepared::Prepared;
use super::stack::Stack;
use super::structure::Structure;
use crate::bounds::Interval;
use crate::geometry::Hit;
use crate::layout::binary::{Child, ChildKind, Node2};
use crate::math::Ray;
use core::ops::ControlFlow;

/// What a query makes of the hits that a walk finds.
pub(crate) trait Visitor {
    /// The greatest `t` that still matters; hits at this very `t` do.
    fn t_max(&self) -> f32;

    /// Takes a hit within `t_min ..= t_max()`; says whether to go on.
    fn hit(&mut self, hit: Hit) -> ControlFlow<()>;
}

/// A child to be visited later, and where the ray enters its box.
#[derive(Clone, Copy)]
struct Pending {
    child: Child,
    entry: f32,
}

/// A level of the walk.
#[derive(Clone, Copy)]
struct Frame<'a> {
    structure: &'a Structure,
    ray: Prepared,
    /// Rank of the path to this level.
    inst: u64,
}

/// Entries of the stack that need no allocation: one a level of a well-shaped tree.
const STACK_NEAR: usize = 64;
/// Saved levels that need no allocation.
const FRAMES_NEAR: usize = 1;

struct Walk<'a, 'v, V, C> {
    ray: &'v Ray,
    visitor: &'v mut V,
    counters: &'v mut C,
    frame: Frame<'a>,
    frames: Stack<Frame<'a>, FRAMES_NEAR>,
    stack: Stack<Pending, STACK_NEAR>,
}

/// Shows the visitor every hit of a valid ray that it could want, in no particular order.
pub(crate) fn walk<V: Visitor, C: Count>(
    structure: &Structure,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) {
    let frame = Frame { structure, ray: Prepared::new(ray, structure), inst: 0 };
    let stack = Stack::new(Pending { child: Child::EMPTY, entry: 0.0 });
    let mut walk = Walk { ray, visitor, counters, frame, frames: Stack::new(frame), stack };
    walk.run(structure.layout.root);
}

impl<V: Visitor, C: Count> Walk<'_, '_, V, C> {
    fn run(&mut self, root: Child) {
        let mut next = Some(root);
        while let Some(child) = next {
            let nearer = match child.kind() {
                ChildKind::Inner { node } => {
                    self.counters.node();
                    let node = &self.frame.structure.layout.nodes[node];
                    self.visit(node)
                }
                ChildKind::Triangles { first, count } => {
                    if self.test_triangles(first, count).is_break() {
                        return;
                    }
                    None
                }
                ChildKind::Instances { first, count } => {
                    self.counters.leaf(0);
                    self.push_instances(first, count);
                    None
                }
                ChildKind::Leave => None,
            };
            next = nearer.or_else(|| self.pop());
        }
    }

    /// Tests both children; the nearer one is next, the farther one waits.
    #[inline(always)]
    fn visit(&mut self, node: &Node2) -> Option<Child> {
        // No `array::map` on this path: it is not inlined, and cost a third of all instructions.
        let [left, right] = self.frame.ray.slab.intervals(&node.boxes);
        let left = self.entry(&left);
        let right = self.entry(&right);
        match (left, right) {
            (None, None) => None,
            (Some(_), None) => Some(node.children[0]),
            (None, Some(_)) => Some(node.children[1]),
            (Some(left), Some(right)) => {
                let near = usize::from(right < left);
                let entry = if near == 0 { right } else { left };
                self.stack.push(Pending { child: node.children[1 - near], entry });
                Some(node.children[near])
            }
        }
    }

    /// Where the ray enters a box that may hold a hit that matters, given where it is inside.
    #[inline(always)]
    fn entry(&mut self, inside: &Interval) -> Option<f32> {
        if inside.is_empty() {
            self.counters.box_cull();
            return None;
        }
        // Strictly beyond: a hit at this very `t` still counts.
        if inside.entry > self.visitor.t_max() || inside.exit < self.ray.t_min {
            self.counters.t_cull();
            return None;
        }
        Some(inside.entry)
    }

    #[inline(always)]
    fn test_triangles(&mut self, first: usize, count: usize) -> ControlFlow<()> {
        self.counters.leaf(count);
        let structure = self.frame.structure;
        let ray = &self.frame.ray;
        for triangle in &structure.triangles[first..first + count] {
            let range = Interval { entry: self.ray.t_min, exit: self.visitor.t_max() };
            let meeting = ray.triangle.hit(&triangle.corners, &ray.slab, &ray.clip, &range);
            let Some(meeting) = meeting else { continue };
            if structure.geometries[triangle.geom as usize].mask & self.ray.mask == 0 {
                continue;
            }
            self.visitor.hit(Hit {
                t: meeting.t,
                u: meeting.u,
                v: meeting.v,
                prim: triangle.prim,
                geom: triangle.geom,
                inst: self.frame.inst,
            })?;
        }
        ControlFlow::Continue(())
    }

    /// Puts the instances of a leaf on the stack: each is entered when it is popped.
    fn push_instances(&mut self, first: usize, count: usize) {
        let structure = self.frame.structure;
        // Only one instance can be walked at a time, so all but the last wait as leaves of one.
        for at in first..first + count {
            let instance = &structure.instances[structure.leaf_instances[at] as usize];
            if instance.mask & self.ray.mask == 0 {
                continue;
            }
            if count > 1 {
                let inside = self.frame.ray.slab.interval(&instance.bounds);
                if let Some(entry) = self.entry(&inside) {
                    self.stack.push(Pending { child: Child::instances(at as u32, 1), entry });
                }
            } else {
                self.enter(first);
            }
        }
    }

    /// Goes down into an instance: saves this level and marks the way back.
    fn enter(&mut self, at: usize) {
        let structure = self.frame.structure;
        let instance = &structure.instances[structure.leaf_instances[at] as usize];
        // A hit in here must lie where the instance's own box is: that makes boxes above it safe.
        let clip = self.frame.ray.slab.interval(&instance.bounds);
        let clip = clip.intersection(&self.frame.ray.clip);
        if clip.is_empty() || clip.entry > self.visitor.t_max() || clip.exit < self.ray.t_min {
            return;
        }
        let inner = &*instance.structure;
        let Some(ray) = self.frame.ray.enter(&instance.object_from_world, clip, inner) else {
            return;
        };
        self.counters.instance();
        let inst = self.frame.inst + instance.rank;
        let outer = core::mem::replace(&mut self.frame, Frame { structure: inner, ray, inst });
        self.frames.push(outer);
        self.stack.push(Pending { child: Child::LEAVE, entry: f32::NEG_INFINITY });
        let inside = self.frame.ray.slab.interval(&inner.layout.bounds);
        if self.entry(&inside).is_some() {
            self.stack.push(Pending { child: inner.layout.root, entry: f32::NEG_INFINITY });
        }
    }

    /// The next child that may still matter; `None` ends the walk.
    #[inline(always)]
    fn pop(&mut self) -> Option<Child> {
        loop {
            let Pending { child, entry } = self.stack.pop()?;
            if child == Child::LEAVE {
                if let Some(outer) = self.frames.pop() {
                    self.frame = outer;
                }
            } else if entry > self.visitor.t_max() {
                self.counters.t_cull();
            } else {
                return Some(child);
            }
        }
    }
}

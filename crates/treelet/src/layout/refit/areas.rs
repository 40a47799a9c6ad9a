//! What a wide tree is worth: the half areas of its boxes.
//!
//! A long random line meets a box as often as the box has surface (the argument behind the surface area heuristic: J. D. MacDonald,
//! K. S. Booth, "Heuristics for Ray Tracing Using Space Subdivision", The Visual Computer 6, 1990). What is
//! counted is how many boxes it meets for each primitive whose own box it meets. C. Lauterbach et al.
//! ("RT-DEFORM", 2006) compare boxes with those of their children instead, and whoever compares with the box of the
//! root finds trees better when the scene flies apart, and worse when it shrinks.

use super::Content;
use crate::bounds::Aabb;
use crate::context::parallel;
use crate::layout::lower::Packed;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, LEAF_MAX, SLOTS_MAX, Wide};
use alloc::vec::Vec;

/// Nodes that one task looks at.
const CHUNK: usize = 1024;

/// Sums of half areas.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Areas {
    /// Of the boxes of all children, leaves included.
    pub(crate) boxes: f64,
    /// Of the primitives' own boxes.
    pub(crate) prims: f64,
}

impl Areas {
    /// Boxes that a long random line meets, over the primitives whose boxes it meets.
    pub(crate) fn price(&self) -> f64 {
        let price = self.boxes / self.prims;
        if price.is_finite() && price > 0.0 { price } else { 1.0 }
    }

    pub(super) fn add(&mut self, other: Self) {
        self.boxes += other.boxes;
        self.prims += other.prims;
    }
}

/// In f64, where no area of a scene is too large.
#[inline(always)]
pub(crate) fn half_area(bounds: &Aabb) -> f64 {
    let edge = |axis: usize| f64::from(bounds.hi[axis]) - f64::from(bounds.lo[axis]);
    let (x, y, z) = (edge(0), edge(1), edge(2));
    if x >= 0.0 { x * y + y * z + z * x } else { 0.0 }
}

/// Slots that hold a child: those before the first that does not.
#[inline(always)]
pub(crate) fn used<const W: usize>(children: &[Child; W]) -> usize {
    children.iter().position(|&child| child == Child::END).unwrap_or(W)
}

/// Whether a leaf's first entry is a triangle's, and how many it has.
pub(crate) fn triangles_of<K: Packing<W>, const W: usize>(
    wide: &Wide<W, K>,
    child: Child,
) -> Option<usize> {
    match child.kind() {
        ChildKind::Leaf { first, count } if child != Child::END && first < wide.triangles => {
            Some(count)
        }
        _ => None,
    }
}

/// The ids of a leaf's triangles; returns how many, none of an instance.
pub(super) fn ids_of<K: Packing<W>, const W: usize>(
    wide: &Wide<W, K>,
    child: Child,
    ids: &mut [u32],
) -> usize {
    let (Some(count), ChildKind::Leaf { first, .. }) = (triangles_of(wide, child), child.kind())
    else {
        return 0;
    };
    let leaf = K::leaf(&wide.words, first);
    for (triangle, id) in ids.iter_mut().enumerate().take(count) {
        *id = K::id(leaf, count, triangle);
    }
    count
}

/// The half areas of triangles' own boxes, together.
#[inline(always)]
pub(crate) fn prim_areas(triangles: &[Packed]) -> f64 {
    let area = |packed: &Packed| half_area(&Aabb::of_points(&packed.corners));
    triangles.iter().map(area).sum()
}

/// The areas of a tree as it is, and of the triangles in the leaves of each node; `content` is what it was made of.
pub(crate) fn areas<K: Packing<W>, const W: usize>(
    wide: &Wide<W, K>,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
) -> (Areas, Vec<f32>) {
    let of_children = |children: &[Child], boxes: &dyn Fn(usize) -> Aabb, sum: &mut Areas| {
        let (mut ids, mut count) = ([0; SLOTS_MAX * LEAF_MAX], 0);
        for (slot, &child) in children.iter().enumerate() {
            let area = half_area(&boxes(slot));
            sum.boxes += area;
            let triangles = ids_of(wide, child, &mut ids[count..]);
            count += triangles;
            if triangles == 0 && !child.is_inner() {
                sum.prims += area;
            }
        }
        let mut packed = [Packed::default(); SLOTS_MAX * LEAF_MAX];
        (content.triangles)(&ids[..count], &mut packed[..count]);
        let triangles = prim_areas(&packed[..count]);
        sum.prims += triangles;
        triangles as f32
    };
    let sums = parallel::map_chunks(&wide.nodes, CHUNK, |_, nodes| {
        let mut sum = Areas::default();
        let mut triangles = Vec::with_capacity(nodes.len());
        for node in nodes {
            let children = K::children(node);
            let boxes = |slot: usize| K::bounds(node, slot);
            triangles.push(of_children(&children[..used(children)], &boxes, &mut sum));
        }
        (sum, triangles)
    });
    let mut sum = Areas::default();
    let mut triangles = Vec::with_capacity(wide.nodes.len());
    for (of_chunk, of_nodes) in sums {
        sum.add(of_chunk);
        triangles.extend(of_nodes);
    }
    (sum, triangles)
}

/// What is below a node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Part {
    /// Half areas of the children of all nodes below, this one's included.
    pub(crate) boxes: f64,
    /// The half area of its own box.
    pub(crate) own: f64,
    /// Half areas of the primitives' own boxes.
    pub(crate) prims: f64,
    pub(crate) triangles: u32,
    /// Nodes, itself included.
    pub(crate) nodes: u32,
}

impl Part {
    /// As [`Areas::price`], of this node and what is below it.
    pub(crate) fn price(&self) -> f32 {
        let price = (self.own + self.boxes) / self.prims;
        if price.is_finite() { price as f32 } else { 1.0 }
    }
}

/// What is below each node: one reverse sweep. `triangles` are the areas of those in the leaves of each node.
pub(crate) fn survey<K: Packing<W>, const W: usize>(
    wide: &Wide<W, K>,
    triangles: &[f32],
) -> Vec<Part> {
    let mut parts = alloc::vec![Part::default(); wide.nodes.len()];
    for (at, node) in wide.nodes.iter().enumerate().rev() {
        let children = K::children(node);
        let mut part = Part { nodes: 1, prims: f64::from(triangles[at]), ..Part::default() };
        let mut all = Aabb::EMPTY;
        for (slot, &child) in children[..used(children)].iter().enumerate() {
            let bounds = K::bounds(node, slot);
            let area = half_area(&bounds);
            part.boxes += area;
            all = all.union(&bounds);
            match child.kind() {
                ChildKind::Inner { node } => {
                    let below = parts.get(node).copied().unwrap_or_default();
                    part.boxes += below.boxes;
                    part.prims += below.prims;
                    part.triangles += below.triangles;
                    part.nodes += below.nodes;
                }
                ChildKind::Leaf { .. } => match triangles_of(wide, child) {
                    Some(count) => part.triangles += count as u32,
                    None => part.prims += area,
                },
            }
        }
        part.own = half_area(&all);
        parts[at] = part;
    }
    parts
}

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
use crate::simd::f4::F4;
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

/// Of a box with coordinates of a scene ([`COORDINATE_MAX`]) it fits into f32. Where it is too small for that, prices say nothing and
/// nothing is found to decay.
///
/// [`COORDINATE_MAX`]: crate::geometry::mesh::COORDINATE_MAX
#[inline(always)]
pub(crate) fn half_area(bounds: &Aabb) -> f64 {
    let edge = |axis: usize| bounds.hi[axis] - bounds.lo[axis];
    let (x, y, z) = (edge(0), edge(1), edge(2));
    if x >= 0.0 { f64::from(x * y + y * z + z * x) } else { 0.0 }
}

/// Of the boxes in all slots of a node, as [`half_area`] says; of slots without a child, anything.
#[inline(always)]
fn half_areas<K: Packing<W>, const W: usize>(node: &K::Node) -> [f32; W] {
    let mut areas = [0.0; W];
    for (slot, area) in areas.iter_mut().enumerate() {
        let Aabb { lo, hi } = K::bounds(node, slot);
        let edge = |axis: usize| hi[axis] - lo[axis];
        let (x, y, z) = (edge(0), edge(1), edge(2));
        *area = if x >= 0.0 { x * y + y * z + z * x } else { 0.0 };
    }
    areas
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
pub(crate) fn ids_of<K: Packing<W>, const W: usize>(
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

/// The box around triangles, and the half areas of their own boxes together.
#[inline(always)]
pub(crate) fn around(triangles: &[Packed]) -> (Aabb, f64) {
    let (mut low, mut high) = (F4::splat(f32::INFINITY), F4::splat(f32::NEG_INFINITY));
    let mut areas = 0.0;
    for Packed { corners, .. } in triangles {
        let corner = |[x, y, z]: [f32; 3]| F4::new(x, y, z, z);
        let (a, b, c) = (corner(corners[0]), corner(corners[1]), corner(corners[2]));
        let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
        (low, high) = (low.min(lo), high.max(hi));
        let edges = hi.sub(lo);
        let [x, y, z, _] = edges.mul(edges.yzxw()).to_array();
        areas += x + y + z;
    }
    let ([x, y, z, _], [far_x, far_y, far_z, _]) = (low.to_array(), high.to_array());
    (Aabb { lo: [x, y, z], hi: [far_x, far_y, far_z] }, f64::from(areas))
}

/// Half areas of the boxes of the first `count` triangles, which are a leaf's.
pub(super) fn of_leaf(words: &[f32], count: usize) -> f32 {
    let mut areas = 0.0;
    for triangle in 0..count {
        let corner = |corner: usize| {
            [0, 1, 2].map(|axis: usize| words[(3 * corner + axis) * count + triangle])
        };
        areas += half_area(&Aabb::of_points(&[corner(0), corner(1), corner(2)]));
    }
    areas as f32
}

/// The box around a node's children, and the sum of their half areas: four children at a time. The box in a slot without a
/// child is empty.
#[inline(always)]
pub(crate) fn of_node<const W: usize>(planes: &[[[f32; W]; 2]; 3]) -> (Aabb, f64) {
    const LANES: usize = 4;
    let mut all = Aabb::EMPTY;
    let mut edges = [[F4::splat(0.0); SLOTS_MAX / LANES]; 3];
    for (axis, edges) in edges.iter_mut().enumerate() {
        let (mut low, mut high) = (F4::splat(f32::INFINITY), F4::splat(f32::NEG_INFINITY));
        let [lo, hi] = &planes[axis];
        let lanes = lo.as_chunks::<LANES>().0.iter().zip(hi.as_chunks::<LANES>().0);
        for (edge, (&[a, b, c, d], &[e, f, g, h])) in edges.iter_mut().zip(lanes) {
            let (lo, hi) = (F4::new(a, b, c, d), F4::new(e, f, g, h));
            (low, high) = (low.min(lo), high.max(hi));
            *edge = hi.sub(lo).max(F4::splat(0.0));
        }
        let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
        all.lo[axis] = a.min(b).min(c.min(d));
        all.hi[axis] = e.max(f).max(g.max(h));
    }
    let mut areas = F4::splat(0.0);
    let [xs, ys, zs] = &edges;
    for ((&x, &y), &z) in xs.iter().zip(ys).zip(zs).take(W / LANES) {
        areas = areas.add(x.mul(y).add(y.mul(z)).add(z.mul(x)));
    }
    let areas = areas.to_array().map(f64::from);
    (all, areas.iter().sum())
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
    let of_children = |children: &[Child], of_boxes: &[f32; W], sum: &mut Areas| {
        let (mut ids, mut count) = ([0; SLOTS_MAX * LEAF_MAX], 0);
        for (&child, &area) in children.iter().zip(of_boxes) {
            let area = f64::from(area);
            sum.boxes += area;
            let triangles = ids_of(wide, child, &mut ids[count..]);
            count += triangles;
            if triangles == 0 && !child.is_inner() {
                sum.prims += area;
            }
        }
        if count == 0 {
            return 0.0;
        }
        let mut packed = [Packed::default(); SLOTS_MAX * LEAF_MAX];
        (content.triangles)(&ids[..count], &mut packed[..count]);
        let (_, triangles) = around(&packed[..count]);
        sum.prims += triangles;
        triangles as f32
    };
    let sums = parallel::map_chunks(&wide.nodes, CHUNK, |_, nodes| {
        let mut sum = Areas::default();
        let mut triangles = Vec::with_capacity(nodes.len());
        for node in nodes {
            let children = K::children(node);
            let areas = half_areas::<K, W>(node);
            triangles.push(of_children(&children[..used(children)], &areas, &mut sum));
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
        for (&child, area) in children[..used(children)].iter().zip(half_areas::<K, W>(node)) {
            let area = f64::from(area);
            part.boxes += area;
            match child.kind() {
                ChildKind::Inner { node } => {
                    // Its own box is the one in this slot.
                    let Some(below) = parts.get_mut(node) else { continue };
                    below.own = area;
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
        if at == 0 {
            let boxes = (0..used(children)).map(|slot| K::bounds(node, slot));
            part.own = half_area(&boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds)));
        }
        parts[at] = part;
    }
    parts
}

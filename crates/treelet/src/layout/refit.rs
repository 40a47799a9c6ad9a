//! Refitting: the tree stays, its boxes follow the triangles that moved.
//!
//! Source: I. Wald, S. Boulos, P. Shirley, "Ray Tracing Deformable Scenes Using Dynamic Bounding
//! Volume Hierarchies", ACM Transactions on Graphics 26(1), 2007. Children stand after their parents,
//! so one reverse sweep meets every node after its children. Differs from the source in how it is
//! shared out: chunks of nodes are swept side by side, and a node that needs a box of another chunk
//! waits; few do, since subtrees lie together, and one thread does them at the end.
//!
//! Leaves are written anew, in the order of the nodes, from the ids that they hold. A triangle that
//! lay in a leaf by a part of it has its whole box there afterwards. The order of children, which is
//! for the boxes that were, stays.
//!
//! Cost: O(n); reads and writes every byte of the layout once.

use super::lower::Packed;
use super::packing::Packing;
use super::wide::{
    BLOCK_WORDS, Child, ChildKind, LEAF_MAX, Node, Plain, SLOTS_MAX, TRIANGLE_WORDS, Wide,
};
use super::write::write_block;
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::{self, Pages};
use alloc::collections::BTreeSet;
use alloc::vec::Vec;

/// Nodes that one task sweeps.
const CHUNK: usize = 1024;

/// What the leaves of a layout hold now.
pub(crate) struct Content<'a, T, I> {
    /// Gives the triangles of some ids; `false` if one of them is not fit for a scene any more.
    pub(crate) triangles: &'a T,
    /// The box of the instance of that number.
    pub(crate) instance: &'a I,
}

/// A layout with new boxes.
pub(crate) struct Refitted<const W: usize> {
    pub(crate) wide: Wide<W>,
    pub(crate) bounds: Aabb,
    /// See [`areas`].
    pub(crate) areas: f64,
}

/// The sum of the half areas of all children.
pub(crate) fn areas<K: Packing<W>, const W: usize>(wide: &Wide<W, K>) -> f64 {
    let sums = parallel::map_chunks(&wide.nodes, CHUNK, |_, nodes| {
        let of_node = |node: &K::Node| {
            let used = used(K::children(node));
            (0..used).map(|slot| half_area(&K::bounds(node, slot))).sum::<f64>()
        };
        nodes.iter().map(of_node).sum::<f64>()
    });
    sums.into_iter().sum()
}

/// What a long random line that meets the root pays: visits of nodes and leaves, each at the same
/// price, as when nodes were chosen ([`super::collapse`]).
pub(crate) fn price(areas: f64, root: &Aabb) -> f64 {
    let root = half_area(root);
    if root > 0.0 { 1.0 + areas / root } else { 1.0 }
}

/// In f64, where no area of a scene is too large.
fn half_area(bounds: &Aabb) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|axis| f64::from(bounds.hi[axis]) - f64::from(bounds.lo[axis]));
    if x >= 0.0 { x * y + y * z + z * x } else { 0.0 }
}

/// Slots that hold a child: those before the first that does not.
#[inline(always)]
fn used<const W: usize>(children: &[Child; W]) -> usize {
    children.iter().position(|&child| child == Child::END).unwrap_or(W)
}

/// Whether a leaf's first entry is a triangle's, and how many it has.
fn triangles_of<K: Packing<W>, const W: usize>(wide: &Wide<W, K>, child: Child) -> Option<usize> {
    match child.kind() {
        ChildKind::Leaf { first, count } if child != Child::END && first < wide.triangles => {
            Some(count)
        }
        _ => None,
    }
}

/// The same tree around what its leaves hold now; `None` if a triangle is not fit for it.
pub(crate) fn refit<K: Packing<W>, const W: usize>(
    old: &Wide<W, K>,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    cancel: &Cancel,
) -> Result<Option<Refitted<W>>, BuildError> {
    // Number the triangles anew, in the order of the nodes; the root may be a leaf.
    let of_root = triangles_of(old, old.root).unwrap_or(0);
    let counts = parallel::map_chunks(&old.nodes, CHUNK, |_, nodes| {
        let children = nodes.iter().flat_map(|node| K::children(node));
        children.filter_map(|&child| triangles_of(old, child)).sum::<usize>()
    });
    let triangles = of_root + counts.iter().sum::<usize>();
    let mut nodes = Pages::zeroed(old.nodes.len(), "wide nodes")?;
    let mut words = Pages::zeroed(triangles * TRIANGLE_WORDS + BLOCK_WORDS, "leaf blocks")?;
    let mut boxes = memory::try_filled(Aabb::EMPTY, old.nodes.len(), "boxes of nodes")?;

    // Sweep the chunks, each from its end.
    let sweep = Sweep { old, content, triangles };
    let mut rest = &mut *words;
    let mut jobs = Vec::with_capacity(counts.len());
    let mut first = 0;
    let places = nodes.chunks_mut(CHUNK).zip(boxes.chunks_mut(CHUNK)).zip(counts).enumerate();
    for (chunk, ((nodes, boxes), count)) in places {
        let (words, after) = rest.split_at_mut(count * TRIANGLE_WORDS);
        rest = after;
        jobs.push(Chunk { base: chunk * CHUNK, nodes, boxes, words, first });
        first += count;
    }
    let swept = parallel::map(jobs, |chunk| {
        cancel.check()?;
        Ok(sweep.chunk(chunk))
    });
    let swept = swept.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;

    // Finish those that waited.
    let mut sum = 0.0;
    for chunk in swept.into_iter().rev() {
        let Some(Swept { waiting, areas }) = chunk else { return Ok(None) };
        sum += areas;
        for at in waiting {
            sum += sweep.close(at, &mut nodes, &mut boxes);
        }
    }
    let mut root = old.root;
    let mut bounds = boxes.first().copied().unwrap_or(Aabb::EMPTY);
    if !old.root.is_inner() && old.root != Child::END {
        let mut leaves = Leaves::new(first);
        let Some(around) = sweep.leaf(old.root, &mut root, rest, &mut leaves) else {
            return Ok(None);
        };
        bounds = around;
    }
    Ok(Some(Refitted { wide: Wide { nodes, root, words, triangles }, bounds, areas: sum }))
}

/// The same tree, where only the boxes of some instances changed: those that are `moved`, by their
/// numbers. `bounds` and `areas` are those of the tree as it is.
///
/// Cost: copies the layout and reads the children of every node; then a few steps for each.
pub(crate) fn touch<const W: usize>(
    old: &Wide<W>,
    (bounds, areas): (Aabb, f64),
    moved: impl Fn(usize) -> bool,
    instance: impl Fn(usize) -> Aabb,
) -> Result<Refitted<W>, BuildError> {
    let mut nodes = Pages::zeroed(old.nodes.len(), "wide nodes")?;
    nodes.copy_from_slice(&old.nodes);
    let mut words = Pages::zeroed(old.words.len(), "leaf blocks")?;
    words.copy_from_slice(&old.words);
    let around = |first: usize, count: usize| {
        let entries = first - old.triangles..first - old.triangles + count;
        entries.map(&instance).fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
    };

    // Mend the leaves, and find the way up from each node.
    let mut areas = areas;
    let mut parents = memory::try_filled((u32::MAX, 0_u8), nodes.len(), "parents of nodes")?;
    let mut grown = BTreeSet::new();
    for (at, node) in nodes.iter_mut().enumerate() {
        for slot in 0..used(&node.children) {
            match node.children[slot].kind() {
                ChildKind::Inner { node: child } => parents[child] = (at as u32, slot as u8),
                ChildKind::Leaf { first, count } if first >= old.triangles => {
                    let mut entries = first - old.triangles..first - old.triangles + count;
                    if entries.any(&moved) {
                        areas += replace(node, slot, &around(first, count));
                        grown.insert(at);
                    }
                }
                ChildKind::Leaf { .. } => {}
            }
        }
    }

    // Mend the boxes above, children before parents.
    while let Some(at) = grown.pop_last() {
        let bounds = own_box(&nodes[at]);
        let (parent, slot) = parents[at];
        if let Some(node) = nodes.get_mut(parent as usize) {
            areas += replace(node, usize::from(slot), &bounds);
            grown.insert(parent as usize);
        }
    }
    let bounds = match old.root.kind() {
        ChildKind::Inner { node } => own_box(&nodes[node]),
        ChildKind::Leaf { first, count } if old.root != Child::END && first >= old.triangles => {
            around(first, count)
        }
        // Triangles, or nothing at all.
        ChildKind::Leaf { .. } => bounds,
    };
    let wide = Wide { nodes, root: old.root, words, triangles: old.triangles };
    Ok(Refitted { wide, bounds, areas })
}

/// Gives a child another box; returns by how much its half area grew.
fn replace<const W: usize>(node: &mut Node<W>, slot: usize, bounds: &Aabb) -> f64 {
    let before = half_area(&<Plain as Packing<W>>::bounds(node, slot));
    let child = node.children[slot];
    node.set(slot, bounds, child);
    half_area(bounds) - before
}

/// The box around a node's children.
fn own_box<const W: usize>(node: &Node<W>) -> Aabb {
    let boxes = (0..used(&node.children)).map(|slot| <Plain as Packing<W>>::bounds(node, slot));
    boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
}

/// What a chunk is written to.
struct Chunk<'a, const W: usize> {
    /// The number of its first node.
    base: usize,
    nodes: &'a mut [Node<W>],
    boxes: &'a mut [Aabb],
    words: &'a mut [f32],
    /// The number of its first triangle.
    first: usize,
}

/// A chunk that is written, but for the nodes that wait.
struct Swept {
    /// Children before parents.
    waiting: Vec<usize>,
    /// Half areas of the children of nodes that do not wait.
    areas: f64,
}

/// What the leaves of a node hold.
struct Leaves {
    ids: [u32; SLOTS_MAX * LEAF_MAX],
    packed: [Packed; SLOTS_MAX * LEAF_MAX],
    /// The number of the next triangle.
    next: usize,
}

impl Leaves {
    fn new(next: usize) -> Self {
        let packed = [Packed::default(); SLOTS_MAX * LEAF_MAX];
        Self { ids: [0; SLOTS_MAX * LEAF_MAX], packed, next }
    }
}

struct Sweep<'a, K: Packing<W>, T, I, const W: usize> {
    old: &'a Wide<W, K>,
    content: &'a Content<'a, T, I>,
    /// Of all leaves, as they are numbered now.
    triangles: usize,
}

impl<K, T, I, const W: usize> Sweep<'_, K, T, I, W>
where
    K: Packing<W>,
    T: Fn(&[u32], &mut [Packed]) -> bool + Sync,
    I: Fn(usize) -> Aabb + Sync,
{
    /// Writes what can be written without other chunks; `None` if a triangle is unfit.
    fn chunk(&self, chunk: Chunk<'_, W>) -> Option<Swept> {
        let Chunk { base, nodes, boxes, words, first } = chunk;
        let old = self.old.nodes.get(base..base + nodes.len())?;

        // Leaves go forward, as their words do.
        let mut leaves = Leaves::new(first);
        let mut words = words;
        for (old, node) in old.iter().zip(&mut *nodes) {
            *node = Node::EMPTY;
            words = self.leaves(old, node, words, &mut leaves)?;
        }

        // Boxes go backward.
        let mut waiting = Vec::new();
        let mut waits = alloc::vec![false; nodes.len()];
        let mut areas = 0.0;
        for at in (0..nodes.len()).rev() {
            let node = &mut nodes[at];
            let slots = used(&node.children);
            for slot in 0..slots {
                let ChildKind::Inner { node: child } = node.children[slot].kind() else { continue };
                match child.checked_sub(base).filter(|&inside| inside < boxes.len()) {
                    Some(inside) if !waits[inside] => {
                        let child = node.children[slot];
                        node.set(slot, &boxes[inside], child);
                    }
                    _ => waits[at] = true,
                }
            }
            if waits[at] {
                waiting.push(base + at);
            } else {
                areas += self.finish(node, slots, &mut boxes[at]);
            }
        }
        Some(Swept { waiting, areas })
    }

    /// Writes a node whose children are known by now; returns their half areas.
    fn close(&self, at: usize, nodes: &mut [Node<W>], boxes: &mut [Aabb]) -> f64 {
        let node = &mut nodes[at];
        let slots = used(&node.children);
        for slot in 0..slots {
            let child = node.children[slot];
            if let ChildKind::Inner { node: below } = child.kind() {
                node.set(slot, &boxes[below], child);
            }
        }
        self.finish(node, slots, &mut boxes[at])
    }

    /// The box around a node's children, and the sum of their half areas.
    fn finish(&self, node: &Node<W>, slots: usize, around: &mut Aabb) -> f64 {
        let mut all = Aabb::EMPTY;
        let mut areas = 0.0;
        for slot in 0..slots {
            let bounds = <Plain as Packing<W>>::bounds(node, slot);
            areas += half_area(&bounds);
            all = all.union(&bounds);
        }
        *around = all;
        areas
    }

    /// Fills the slots of a node that hold leaves, and notes its other children; returns the words
    /// that are left.
    fn leaves<'w>(
        &self,
        old: &K::Node,
        node: &mut Node<W>,
        words: &'w mut [f32],
        leaves: &mut Leaves,
    ) -> Option<&'w mut [f32]> {
        let children = *K::children(old);
        let slots = used(&children);

        // Fetch the triangles of all leaves at once.
        let mut count = 0;
        for &child in &children[..slots] {
            count += self.ids(child, &mut leaves.ids[count..]);
        }
        if !(self.content.triangles)(&leaves.ids[..count], &mut leaves.packed[..count]) {
            return None;
        }

        // Write them leaf by leaf.
        let (mut words, rest) = words.split_at_mut(count * TRIANGLE_WORDS);
        let mut packed = &leaves.packed[..count];
        for (slot, &child) in children[..slots].iter().enumerate() {
            if let Some(count) = triangles_of(self.old, child) {
                let (triangles, others) = packed.split_at(count);
                let (block, after) = words.split_at_mut(count * TRIANGLE_WORDS);
                write_block(triangles, block);
                (packed, words) = (others, after);
                node.set(slot, &around(triangles), Child::leaf(leaves.next, count));
                leaves.next += count;
            } else if child.is_inner() {
                node.children[slot] = child;
            } else {
                let (child, bounds) = self.instances(child);
                node.set(slot, &bounds, child);
            }
        }
        Some(rest)
    }

    /// The ids of a leaf's triangles; returns how many.
    fn ids(&self, child: Child, ids: &mut [u32]) -> usize {
        let (Some(count), ChildKind::Leaf { first, .. }) =
            (triangles_of(self.old, child), child.kind())
        else {
            return 0;
        };
        let leaf = K::leaf(&self.old.words, first);
        for (triangle, id) in ids.iter_mut().enumerate().take(count) {
            *id = K::id(leaf, count, triangle);
        }
        count
    }

    /// A leaf of instances, numbered anew, and its box.
    fn instances(&self, child: Child) -> (Child, Aabb) {
        let ChildKind::Leaf { first, count } = child.kind() else { return (child, Aabb::EMPTY) };
        let first = first - self.old.triangles;
        let bounds = (first..first + count).map(self.content.instance);
        let bounds = bounds.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds));
        (Child::leaf(self.triangles + first, count), bounds)
    }

    /// The root, where it is a leaf.
    fn leaf(
        &self,
        old: Child,
        new: &mut Child,
        words: &mut [f32],
        leaves: &mut Leaves,
    ) -> Option<Aabb> {
        let Some(count) = triangles_of(self.old, old) else {
            let bounds;
            (*new, bounds) = self.instances(old);
            return Some(bounds);
        };
        self.ids(old, &mut leaves.ids);
        let packed = &mut leaves.packed[..count];
        if !(self.content.triangles)(&leaves.ids[..count], packed) {
            return None;
        }
        write_block(packed, words.get_mut(..count * TRIANGLE_WORDS)?);
        *new = Child::leaf(leaves.next, count);
        Some(around(packed))
    }
}

/// The box around triangles.
#[inline(always)]
fn around(triangles: &[Packed]) -> Aabb {
    let boxes = triangles.iter().map(|packed| Aabb::of_points(&packed.corners));
    boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
}

impl<const W: usize> Refitted<W> {
    /// Up to `most` boxes that together contain everything: the largest is opened, again and again
    /// while there is room.
    pub(crate) fn cover(&self, most: usize) -> Vec<Aabb> {
        if self.bounds.is_empty() {
            return Vec::new();
        }
        let mut cut = alloc::vec![(self.bounds, self.wide.root)];
        loop {
            let inner = cut.iter().enumerate().filter(|(_, (_, child))| child.is_inner());
            let largest =
                inner.max_by(|(_, a), (_, b)| half_area(&a.0).total_cmp(&half_area(&b.0)));
            let Some((at, &(_, child))) = largest else { break };
            let ChildKind::Inner { node } = child.kind() else { break };
            let Some(node) = self.wide.nodes.get(node) else { break };
            let slots = used(&node.children);
            if cut.len() - 1 + slots > most {
                break;
            }
            cut.swap_remove(at);
            let part = |slot| (<Plain as Packing<W>>::bounds(node, slot), node.children[slot]);
            cut.extend((0..slots).map(part));
        }
        cut.into_iter().map(|(bounds, _)| bounds).collect()
    }
}

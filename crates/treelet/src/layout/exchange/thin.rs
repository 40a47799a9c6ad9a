//! Thinning: a tree without what went, and with the names that the others have now.
//!
//! Leaves are written as refitting does it ([`crate::layout::refit`]), in chunks of nodes side by side; what went leaves its leaf, and a
//! leaf of nothing its node. Then one sweep from the last node to the first takes out the nodes that hold nothing, and puts
//! what is alone in a node in the place of it. Nodes stay where they are; whoever is not reached from the root is not there.

use super::Stay;
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::layout::lower::Packed;
use crate::layout::packing::Packing;
use crate::layout::refit::{Content, Soon, around, half_area, ids_of, of_node, triangles_of, used};
use crate::layout::wide::{
    BLOCK_WORDS, Child, ChildKind, LEAF_MAX, Node, Plain, SLOTS_MAX, TRIANGLE_WORDS, Wide,
};
use crate::layout::write::write_block;
use crate::memory::{self, Pages};
use alloc::vec::Vec;

/// Nodes that one task writes.
const CHUNK: usize = 1024;
/// Triangles are asked for this many nodes ahead.
const AHEAD: usize = 2;

/// A tree that was thinned, with room for more.
pub(super) struct Thinned<const W: usize> {
    pub(super) nodes: Pages<Node<W>>,
    /// How many of them are written.
    pub(super) len: usize,
    pub(super) words: Pages<f32>,
    /// Triangles are numbered up to here; some numbers stand for none.
    pub(super) triangles: usize,
    /// Half areas of the boxes of the triangles in the leaves of each node.
    pub(super) areas: Vec<f32>,
    /// Half areas of the boxes of all primitives.
    pub(super) prims: f64,
}

impl<const W: usize> Thinned<W> {
    /// Whether nothing is left.
    pub(super) fn is_empty(&self) -> bool {
        self.len == 0 || used(&self.nodes[0].children) == 0
    }
}

/// Thins a tree; leaves room for so many more nodes and triangles. `None` if a triangle is not fit for a scene.
pub(super) fn thin<K: Packing<W>, const W: usize>(
    old: &Wide<W, K>,
    stay: &Stay<'_>,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    [more_nodes, more_triangles]: [usize; 2],
    cancel: &Cancel,
) -> Result<Option<Thinned<W>>, BuildError> {
    // Chunks get room for all triangles that they had.
    let counts = parallel::map_chunks(&old.nodes, CHUNK, |_, nodes| {
        let children = nodes.iter().flat_map(|node| K::children(node));
        children.filter_map(|&child| triangles_of(old, child)).sum::<usize>()
    });
    let triangles = counts.iter().sum::<usize>();
    let all = triangles + more_triangles;
    let len = old.nodes.len();
    let mut nodes = Pages::zeroed(len + more_nodes, "wide nodes")?;
    let mut words = Pages::zeroed(all * TRIANGLE_WORDS + BLOCK_WORDS, "leaf blocks")?;
    let mut areas = memory::try_filled(0.0, len, "areas of nodes")?;

    // Write the leaves.
    let mut jobs = Vec::with_capacity(counts.len());
    let (mut rest, mut first) = (&mut *words, 0);
    let places = nodes[..len].chunks_mut(CHUNK).zip(areas.chunks_mut(CHUNK));
    for (((nodes, areas), from), count) in places.zip(old.nodes.chunks(CHUNK)).zip(counts) {
        let (words, after) = rest.split_at_mut(count * TRIANGLE_WORDS);
        rest = after;
        jobs.push(Chunk { old, from, stay, content, nodes, areas, words, first, all });
        first += count;
    }
    let written = parallel::map(jobs, |chunk| {
        cancel.check()?;
        Ok(chunk.write())
    });
    let mut prims = 0.0;
    for written in written.into_iter().collect::<Result<Vec<_>, Cancelled>>()? {
        let Some(of_chunk) = written else { return Ok(None) };
        prims += of_chunk;
    }

    close(&mut nodes[..len], &mut areas)?;
    Ok(Some(Thinned { nodes, len, words, triangles, areas, prims }))
}

/// Some nodes of the old tree, and where they are written.
struct Chunk<'a, K: Packing<W>, T, I, const W: usize> {
    old: &'a Wide<W, K>,
    from: &'a [K::Node],
    stay: &'a Stay<'a>,
    content: &'a Content<'a, T, I>,
    nodes: &'a mut [Node<W>],
    areas: &'a mut [f32],
    words: &'a mut [f32],
    /// The number of its first triangle.
    first: usize,
    /// Of all triangles, those that come included.
    all: usize,
}

impl<K, T, I, const W: usize> Chunk<'_, K, T, I, W>
where
    K: Packing<W>,
    T: Fn(&[u32], &mut [Packed]) -> bool + Sync,
    I: Fn(usize) -> Aabb + Sync,
{
    /// Writes the leaves, and notes the other children; returns the half areas of all primitives, `None` if one is unfit.
    fn write(self) -> Option<f64> {
        let Self { old, from, stay, content, nodes, areas, mut words, mut first, all } = self;
        let mut ids = [0; SLOTS_MAX * LEAF_MAX];
        let mut packed = [Packed::default(); SLOTS_MAX * LEAF_MAX];
        let mut prims = 0.0;
        for (at, (node, own)) in nodes.iter_mut().zip(areas).enumerate() {
            if let Some(soon) = from.get(at + AHEAD) {
                expect(old, soon, stay, content.ahead);
            }
            let children = K::children(&from[at]);
            let children = &children[..used(children)];

            // Fetch the triangles that stay, of all leaves at once.
            let (mut count, mut lengths) = (0, [0; SLOTS_MAX]);
            for (length, &child) in lengths.iter_mut().zip(children) {
                let begin = count;
                for at in begin..begin + ids_of(old, child, &mut ids[begin..]) {
                    if let Some(id) = (stay.triangle)(ids[at]) {
                        ids[count] = id;
                        count += 1;
                    }
                }
                *length = count - begin;
            }
            if !(content.triangles)(&ids[..count], &mut packed[..count]) {
                return None;
            }

            // Write them leaf by leaf.
            *node = Node::EMPTY;
            let (mut packed, mut slot, mut area) = (&packed[..count], 0, 0.0);
            for (&length, &child) in lengths.iter().zip(children) {
                if child.is_inner() {
                    node.children[slot] = child;
                } else if triangles_of(old, child).is_none() {
                    let Some((child, bounds)) = single(old, child, stay, &content.instance, all)
                    else {
                        continue;
                    };
                    prims += half_area(&bounds);
                    node.set(slot, &bounds, child);
                } else if length == 0 {
                    continue;
                } else {
                    let (triangles, others) = packed.split_at(length);
                    let (block, after) = words.split_at_mut(length * TRIANGLE_WORDS);
                    write_block(triangles, block);
                    (packed, words) = (others, after);
                    let (bounds, of_leaf) = around(triangles);
                    area += of_leaf;
                    node.set(slot, &bounds, Child::leaf(first, length));
                    first += length;
                }
                slot += 1;
            }
            prims += area;
            *own = area as f32;
        }
        Some(prims)
    }
}

/// What is alone in a leaf, under the number that it has now, and its box; `None` if it went.
fn single<K: Packing<W>, const W: usize>(
    old: &Wide<W, K>,
    child: Child,
    stay: &Stay<'_>,
    instance: &impl Fn(usize) -> Aabb,
    all: usize,
) -> Option<(Child, Aabb)> {
    let ChildKind::Leaf { first, .. } = child.kind() else { return None };
    let number = (stay.single)(first - old.triangles)?;
    let bounds = instance(number);
    (!bounds.is_empty()).then(|| (Child::leaf(all + number, 1), bounds))
}

/// Asks for the triangles of a node that is written soon.
#[inline(always)]
fn expect<K: Packing<W>, const W: usize>(
    old: &Wide<W, K>,
    node: &K::Node,
    stay: &Stay<'_>,
    ahead: &dyn Soon,
) {
    let children = K::children(node);
    let mut ids = [0; LEAF_MAX];
    for &child in &children[..used(children)] {
        let mut count = 0;
        for at in 0..ids_of(old, child, &mut ids) {
            if let Some(id) = (stay.triangle)(ids[at]) {
                ids[count] = id;
                count += 1;
            }
        }
        ahead.expect(&ids[..count]);
    }
}

/// Boxes all nodes, and takes out those that hold nothing, or one child only; but not the root.
fn close<const W: usize>(nodes: &mut [Node<W>], areas: &mut [f32]) -> Result<(), BuildError> {
    let mut boxes = memory::try_filled(Aabb::EMPTY, nodes.len(), "boxes of nodes")?;
    for at in (0..nodes.len()).rev() {
        let before = used(&nodes[at].children);
        let mut kept = 0;
        for slot in 0..before {
            let mut child = nodes[at].children[slot];
            let mut bounds = <Plain as Packing<W>>::bounds(&nodes[at], slot);
            if let ChildKind::Inner { node: below } = child.kind() {
                bounds = boxes[below];
                if nodes[below].children[1] == Child::END {
                    // What is alone moves up; of nothing, the box is empty.
                    child = nodes[below].children[0];
                    areas[at] += areas[below];
                }
            } else if kept == slot {
                kept += 1;
                continue;
            }
            if !bounds.is_empty() {
                nodes[at].set(kept, &bounds, child);
                kept += 1;
            }
        }
        for slot in kept..before {
            nodes[at].set(slot, &Aabb::EMPTY, Child::END);
        }
        boxes[at] = of_node(&nodes[at].planes).0;
    }
    Ok(())
}

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
//! for the boxes that were, stays; what comes to a node by a rotation (`rotate.rs`) stands last.
//!
//! Cost: O(n); reads and writes every byte of the layout once, 21 ms for 1.4 million triangles on one core where everything is asked for
//! ahead (`ahead.rs`), 30 where only the numbers of corners are.

mod ahead;
mod areas;
mod rotate;
mod touch;

pub(crate) use areas::{
    Areas, Part, areas, around, half_area, ids_of, of_node, survey, triangles_of, used,
};
pub(crate) use touch::{Moved, own_box, touch};

use super::lower::Packed;
use super::packing::Packing;
use super::wide::{
    BLOCK_WORDS, Child, ChildKind, LEAF_MAX, Node, Plain, SLOTS_MAX, TRIANGLE_WORDS, Wide,
};
use super::write::write_block;
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::{self, Pages, Zeroed};
use ahead::{AHEAD, Ahead};
use alloc::vec::Vec;
use areas::of_leaf;
use rotate::{Rotations, TURNS, halve};

/// Nodes that one task sweeps.
const CHUNK: usize = 1024;

/// What the leaves of a layout hold now.
pub(crate) struct Content<'a, T, I> {
    /// Gives the triangles of some ids; `false` if one of them is not fit for a scene any more.
    pub(crate) triangles: T,
    /// Hears of triangles that will be asked for soon.
    pub(crate) ahead: &'a dyn Soon,
    /// The box of the instance of that number.
    pub(crate) instance: I,
}

/// Who hears of triangles before they are asked for.
pub(crate) trait Soon: Sync {
    /// The numbers of their corners are needed next.
    fn expect(&self, ids: &[u32]);
    /// Their corners are.
    fn expect_corners(&self, ids: &[u32]);
}

/// Where there are none.
impl Soon for () {
    fn expect(&self, _: &[u32]) {}
    fn expect_corners(&self, _: &[u32]) {}
}

/// A layout with new boxes.
pub(crate) struct Refitted<const W: usize> {
    pub(crate) wide: Wide<W>,
    pub(crate) bounds: Aabb,
    pub(crate) areas: Areas,
    /// Half areas of the boxes of the triangles in the leaves of each node.
    pub(crate) triangles: Vec<f32>,
}

/// Room for so many, all of which will be written: what is there if it fits.
fn sized<T: Zeroed>(
    spare: Pages<T>,
    len: usize,
    what: &'static str,
) -> Result<Pages<T>, BuildError> {
    if spare.len() == len { Ok(spare) } else { Ok(Pages::zeroed(len, what)?) }
}

/// The same tree around what its leaves hold now, written over a layout that nobody needs any more if there is one; `None` if a triangle is not fit for it. A
/// tree that is `worn` is mended a little on the way, other nodes of it each time: which ones, that number says.
pub(crate) fn refit<K: Packing<W>, const W: usize>(
    old: &Wide<W, K>,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    worn: Option<u32>,
    spare: Option<Wide<W>>,
    cancel: &Cancel,
) -> Result<Option<Refitted<W>>, BuildError> {
    // Number the triangles anew, in the order of the nodes; the root may be a leaf.
    let of_root = triangles_of(old, old.root).unwrap_or(0);
    let counts = parallel::map_chunks(&old.nodes, CHUNK, |_, nodes| {
        let children = nodes.iter().flat_map(|node| K::children(node));
        children.filter_map(|&child| triangles_of(old, child)).sum::<usize>()
    });
    let triangles = of_root + counts.iter().sum::<usize>();
    let count_of_words = triangles * TRIANGLE_WORDS + BLOCK_WORDS;
    let spare = spare.unwrap_or_else(Wide::nothing);
    let mut nodes = sized(spare.nodes, old.nodes.len(), "wide nodes")?;
    let mut words = sized(spare.words, count_of_words, "leaf blocks")?;
    let mut boxes = memory::try_filled(Aabb::EMPTY, old.nodes.len(), "boxes of nodes")?;
    let mut own = memory::try_filled(0.0, old.nodes.len(), "areas of nodes")?;

    // Sweep the chunks, each from its end.
    let sweep = Sweep { old, content, triangles, worn };
    let mut rest = &mut *words;
    let mut jobs = Vec::with_capacity(counts.len());
    let mut first = 0;
    let places = nodes.chunks_mut(CHUNK).zip(boxes.chunks_mut(CHUNK)).zip(own.chunks_mut(CHUNK));
    for (chunk, (((nodes, boxes), areas), count)) in places.zip(counts).enumerate() {
        let (words, after) = rest.split_at_mut(count * TRIANGLE_WORDS);
        rest = after;
        jobs.push(Chunk { base: chunk * CHUNK, nodes, boxes, areas, words, first });
        first += count;
    }
    let swept = parallel::map(jobs, |chunk| {
        cancel.check()?;
        Ok(sweep.chunk(chunk))
    });
    let swept = swept.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;

    // Finish those that waited.
    let mut sum = Areas::default();
    for chunk in swept.into_iter().rev() {
        let Some(Swept { waiting, areas }) = chunk else { return Ok(None) };
        sum.add(areas);
        for at in waiting {
            sum.boxes += sweep.close(at, &mut nodes, &mut boxes, (&mut own, &words));
        }
    }
    let mut root = old.root;
    let mut bounds = boxes.first().copied().unwrap_or(Aabb::EMPTY);
    if !old.root.is_inner() && old.root != Child::END {
        let mut leaves = Leaves::new(first);
        let Some(around) = sweep.leaf(old.root, &mut root, &mut words, &mut leaves) else {
            return Ok(None);
        };
        bounds = around;
    }
    let wide = Wide { nodes, root, words, triangles };
    Ok(Some(Refitted { wide, bounds, areas: sum, triangles: own }))
}

/// What a chunk is written to.
struct Chunk<'a, const W: usize> {
    /// The number of its first node.
    base: usize,
    nodes: &'a mut [Node<W>],
    boxes: &'a mut [Aabb],
    areas: &'a mut [f32],
    words: &'a mut [f32],
    /// The number of its first triangle.
    first: usize,
}

/// A chunk that is written, but for the nodes that wait.
struct Swept {
    /// Children before parents.
    waiting: Vec<usize>,
    /// Of the nodes that do not wait; of primitives all.
    areas: Areas,
}

/// What the leaves of a node hold.
struct Leaves {
    packed: [Packed; SLOTS_MAX * LEAF_MAX],
    /// The number of the next triangle.
    next: usize,
    /// Whether they may be taken apart.
    apart: bool,
    /// Half areas of the primitives so far.
    areas: f64,
}

impl Leaves {
    fn new(next: usize) -> Self {
        let packed = [Packed::default(); SLOTS_MAX * LEAF_MAX];
        Self { packed, next, apart: false, areas: 0.0 }
    }
}

struct Sweep<'a, K: Packing<W>, T, I, const W: usize> {
    old: &'a Wide<W, K>,
    content: &'a Content<'a, T, I>,
    /// Of all leaves, as they are numbered now.
    triangles: usize,
    worn: Option<u32>,
}

impl<K, T, I, const W: usize> Sweep<'_, K, T, I, W>
where
    K: Packing<W>,
    T: Fn(&[u32], &mut [Packed]) -> bool + Sync,
    I: Fn(usize) -> Aabb + Sync,
{
    /// Writes what can be written without other chunks; `None` if a triangle is unfit.
    fn chunk(&self, chunk: Chunk<'_, W>) -> Option<Swept> {
        let Chunk { base, nodes, boxes, areas: own, words, first } = chunk;
        let old = self.old.nodes.get(base..base + nodes.len())?;

        // Leaves go forward, as their words do; their ids are read ahead of them.
        let mut leaves = Leaves::new(first);
        let mut rest = &mut *words;
        let mut ahead = Ahead::new();
        (0..AHEAD).for_each(|at| ahead.look((self.old, old), self.content, at));
        for (at, (node, own)) in nodes.iter_mut().zip(&mut *own).enumerate() {
            ahead.look((self.old, old), self.content, at + AHEAD);
            *node = Node::EMPTY;
            leaves.apart = self.is_turn(base + at);
            rest = self.leaves(&old[at], node, ahead.of(at), rest, &mut leaves, own)?;
        }

        // Boxes go backward.
        let mut waiting = Vec::new();
        let mut waits = alloc::vec![false; nodes.len()];
        let mut areas = Areas { boxes: 0.0, prims: leaves.areas };
        let of_leaf = |leaf: Child| self.area_of(leaf, words, first);
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
                let of_children;
                (boxes[at], of_children) = of_node(&node.planes);
                areas.boxes += of_children;
                if self.is_turn(base + at) {
                    let triangles = &mut *own;
                    let mut tree = Rotations { nodes, base, triangles, of_leaf };
                    areas.boxes -= tree.rotate(at, half_area(&boxes[at]));
                }
            }
        }
        Some(Swept { waiting, areas })
    }

    /// Writes a node whose children are known by now; returns their half areas. `own` are those of the triangles in the leaves of each node.
    fn close(
        &self,
        at: usize,
        nodes: &mut [Node<W>],
        boxes: &mut [Aabb],
        (own, words): (&mut [f32], &[f32]),
    ) -> f64 {
        let node = &mut nodes[at];
        let slots = used(&node.children);
        for slot in 0..slots {
            let child = node.children[slot];
            if let ChildKind::Inner { node: below } = child.kind() {
                node.set(slot, &boxes[below], child);
            }
        }
        let of_children;
        (boxes[at], of_children) = of_node(&node.planes);
        if self.worn.is_none() {
            return of_children;
        }
        let of_leaf = |leaf: Child| self.area_of(leaf, words, 0);
        let mut tree = Rotations { nodes, base: 0, triangles: own, of_leaf };
        of_children - tree.rotate(at, half_area(&boxes[at]))
    }

    /// Whether a node is looked at more closely in this sweep.
    fn is_turn(&self, at: usize) -> bool {
        self.worn.is_some_and(|turn| at as u32 % TURNS == turn % TURNS)
    }

    /// Half areas of the triangles in a leaf whose words are among those from triangle `from` on.
    fn area_of(&self, leaf: Child, words: &[f32], from: usize) -> f32 {
        match leaf.kind() {
            ChildKind::Leaf { first, count } if first < self.triangles => {
                of_leaf(&words[(first - from) * TRIANGLE_WORDS..], count)
            }
            _ => 0.0,
        }
    }

    /// Fills the slots of a node that hold leaves, and notes its other children; returns the words
    /// that are left.
    fn leaves<'w>(
        &self,
        old: &K::Node,
        node: &mut Node<W>,
        ids: &[u32],
        words: &'w mut [f32],
        leaves: &mut Leaves,
        own: &mut f32,
    ) -> Option<&'w mut [f32]> {
        let children = *K::children(old);
        let slots = used(&children);

        // Fetch the triangles of all leaves at once.
        let count = ids.len();
        if !(self.content.triangles)(ids, &mut leaves.packed[..count]) {
            return None;
        }

        // Write them leaf by leaf; what was taken apart goes on in the next free slot.
        let mut areas = 0.0;
        let mut free = slots;
        let (mut words, rest) = words.split_at_mut(count * TRIANGLE_WORDS);
        let mut packed = &mut leaves.packed[..count];
        for (slot, &child) in children[..slots].iter().enumerate() {
            if let Some(count) = triangles_of(self.old, child) {
                let (triangles, others) = packed.split_at_mut(count);
                let (block, after) = words.split_at_mut(count * TRIANGLE_WORDS);
                (packed, words) = (others, after);
                let (bounds, prims) = around(triangles);
                areas += prims;
                let apart = leaves.apart && free < W;
                let half = if apart { halve(triangles, &bounds, prims) } else { None };
                if let Some(half) = half {
                    let (one, other) = triangles.split_at(half);
                    let (block, of_other) = block.split_at_mut(half * TRIANGLE_WORDS);
                    write_block(one, block);
                    write_block(other, of_other);
                    node.set(slot, &around(one).0, Child::leaf(leaves.next, half));
                    let rest = Child::leaf(leaves.next + half, count - half);
                    node.set(free, &around(other).0, rest);
                    free += 1;
                } else {
                    write_block(triangles, block);
                    node.set(slot, &bounds, Child::leaf(leaves.next, count));
                }
                leaves.next += count;
            } else if child.is_inner() {
                node.children[slot] = child;
            } else {
                let (child, bounds) = self.instances(child);
                leaves.areas += half_area(&bounds);
                node.set(slot, &bounds, child);
            }
        }
        leaves.areas += areas;
        *own = areas as f32;
        Some(rest)
    }

    /// A leaf of instances, numbered anew, and its box.
    fn instances(&self, child: Child) -> (Child, Aabb) {
        let ChildKind::Leaf { first, count } = child.kind() else { return (child, Aabb::EMPTY) };
        let first = first - self.old.triangles;
        let bounds = (first..first + count).map(&self.content.instance);
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
        let mut ids = [0; LEAF_MAX];
        ids_of(self.old, old, &mut ids);
        let packed = &mut leaves.packed[..count];
        if !(self.content.triangles)(&ids[..count], packed) {
            return None;
        }
        write_block(packed, words.get_mut(..count * TRIANGLE_WORDS)?);
        *new = Child::leaf(leaves.next, count);
        Some(around(packed).0)
    }
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

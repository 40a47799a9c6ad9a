//! Writing wide nodes and leaf blocks where they stay.
//!
//! All triangles of a node's leaves are fetched together: their numbers, then their corners. Reads
//! that do not wait for each other overlap, which is what counts where every one misses the cache.

use super::lower::{Numbered, Packed};
use super::order::{self, Outlook};
use super::select::{Chosen, NO_PARENT, Part, Selected};
use super::wide::{Child, LEAF_MAX, Node, SLOTS_MAX, TRIANGLE_WORDS};
use crate::context::{Cancel, Cancelled};
use crate::memory::prefetch;
use crate::tree::{Kind, Tree};
use alloc::vec::Vec;

/// Nodes of the tree are asked for this many wide nodes ahead.
const AHEAD: usize = 2;

/// What is written.
pub(super) struct Writer<'a, F> {
    pub(super) tree: &'a Tree,
    /// Gives the triangles of some numbers.
    pub(super) source: &'a F,
    pub(super) instances: Numbered<'a>,
    /// Leaves' entries from here on are instances.
    pub(super) triangles: usize,
    /// The scale of [`order::unit`].
    pub(super) unit: f32,
    pub(super) cancel: &'a Cancel,
}

/// Where a piece is written.
pub(super) struct Output<'a, const W: usize> {
    /// Room for its nodes, and the number of the first one.
    pub(super) nodes: &'a mut [Node<W>],
    pub(super) base: u32,
    /// Of its nodes.
    pub(super) outlooks: &'a mut [Outlook],
    /// Room for its triangles, in words, and the number of the first one.
    pub(super) words: &'a mut [f32],
    pub(super) triangle: usize,
}

/// What the leaves of one node hold.
struct Batch {
    prims: [u32; SLOTS_MAX * LEAF_MAX],
    count: usize,
    packed: [Packed; SLOTS_MAX * LEAF_MAX],
    /// Triangles of each leaf.
    lengths: [u8; SLOTS_MAX],
    blocks: usize,
}

impl<F: Fn(&[u32], &mut [Packed]) + Sync> Writer<'_, F> {
    /// Writes a piece; returns what fills its places in the top.
    pub(super) fn piece<const W: usize>(
        &self,
        piece: &Selected<W>,
        mut output: Output<'_, W>,
    ) -> Result<Vec<Child>, Cancelled> {
        let none = Packed::default();
        let mut batch = Batch {
            prims: [0; SLOTS_MAX * LEAF_MAX],
            count: 0,
            packed: [none; SLOTS_MAX * LEAF_MAX],
            lengths: [0; SLOTS_MAX],
            blocks: 0,
        };

        // Triangles are stored root after root, as nodes are.
        let mut children = Vec::with_capacity(piece.roots.len());
        let mut at = 0;
        for root in &piece.roots {
            if root.is_leaf() {
                let mut child = [Child::END];
                self.leaves(&[*root], &mut child, &mut output, &mut batch);
                children.push(child[0]);
                continue;
            }
            children.push(Child::inner(output.base + at as u32));
            loop {
                self.cancel.check()?;
                if let Some(soon) = piece.nodes.get(at + AHEAD) {
                    self.expect(soon);
                }
                self.node(at, &piece.nodes[at], &mut output, &mut batch);
                at += 1;
                if piece.nodes.get(at).is_none_or(|node| node.parent == NO_PARENT) {
                    break;
                }
            }
        }
        let Writer { unit, triangles, .. } = *self;
        order::arrange(output.nodes, output.base, triangles, unit, output.outlooks);
        Ok(children)
    }

    /// Asks for the boxes and leaves of a node that is written soon.
    #[inline(always)]
    fn expect<const W: usize>(&self, chosen: &Chosen<W>) {
        for part in &chosen.parts[..chosen.count as usize] {
            prefetch(&self.tree.nodes, part.node());
        }
    }

    /// Writes the node `at` with its leaves, and puts it into its parent.
    fn node<const W: usize>(
        &self,
        at: usize,
        chosen: &Chosen<W>,
        output: &mut Output<'_, W>,
        batch: &mut Batch,
    ) {
        let parts = &chosen.parts[..chosen.count as usize];
        let mut children = [Child::END; W];
        self.leaves(parts, &mut children, output, batch);
        // Written where it stays: a copy would wait for all these stores.
        let node = &mut output.nodes[at];
        *node = Node::EMPTY;
        for (slot, (part, child)) in parts.iter().zip(children).enumerate() {
            node.set(slot, &self.tree.nodes[part.node()].bounds, child);
        }
        if chosen.parent != NO_PARENT {
            let parent = &mut output.nodes[chosen.parent as usize];
            parent.children[chosen.slot as usize] = Child::inner(output.base + at as u32);
        }
    }

    /// Writes those of the parts that are leaves, each at most `LEAF_MAX` triangles, or an instance.
    fn leaves<const W: usize>(
        &self,
        parts: &[Part],
        children: &mut [Child],
        output: &mut Output<'_, W>,
        batch: &mut Batch,
    ) {
        // Number the entries.
        (batch.count, batch.blocks) = (0, 0);
        for (part, child) in parts.iter().zip(children) {
            if !part.is_leaf() {
                continue;
            }
            let first = batch.count;
            self.gather(part.node(), batch);
            let prims = &batch.prims[first..batch.count];
            let count = prims.len();
            if let &[prim] = prims
                && let Some(instance) = self.instances.of(prim)
            {
                *child = Child::leaf(self.triangles + instance, 1);
                batch.count = first;
                continue;
            }
            *child = Child::leaf(output.triangle + first, count);
            batch.lengths[batch.blocks] = count as u8;
            batch.blocks += 1;
        }

        // Fetch the triangles, then write them block by block.
        let count = batch.count;
        (self.source)(&batch.prims[..count], &mut batch.packed[..count]);
        let words = core::mem::take(&mut output.words);
        let (mut words, rest) = words.split_at_mut(count * TRIANGLE_WORDS);
        (output.words, output.triangle) = (rest, output.triangle + count);
        let mut packed = &batch.packed[..count];
        for &length in &batch.lengths[..batch.blocks] {
            let length = usize::from(length);
            let (block, after) = words.split_at_mut(length * TRIANGLE_WORDS);
            let (triangles, others) = packed.split_at(length);
            (words, packed) = (after, others);
            write_block(triangles, block);
        }
    }

    /// Adds everything below a node of the tree.
    #[inline(always)]
    fn gather(&self, node: usize, batch: &mut Batch) {
        if let Kind::Leaf { first, count } = self.tree.nodes[node].kind() {
            let prims = &self.tree.prims[first..first + count];
            batch.prims[batch.count..batch.count + count].copy_from_slice(prims);
            batch.count += count;
        } else {
            self.gather_below(node, batch);
        }
    }

    /// The same for an inner node. A primitive that was split may be there more than once.
    fn gather_below(&self, node: usize, batch: &mut Batch) {
        let begin = batch.count;
        let mut open = [node; 2 * LEAF_MAX];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            match self.tree.nodes[open[len]].kind() {
                Kind::Inner { left } => {
                    open[len..len + 2].copy_from_slice(&[left + 1, left]);
                    len += 2;
                }
                Kind::Leaf { first, count } => {
                    for &prim in &self.tree.prims[first..first + count] {
                        if !batch.prims[begin..batch.count].contains(&prim) {
                            batch.prims[batch.count] = prim;
                            batch.count += 1;
                        }
                    }
                }
            }
        }
    }
}

/// Rows as long as the leaf has triangles: coordinate by coordinate, then the ids.
#[inline(always)]
pub(super) fn write_block(triangles: &[Packed], block: &mut [f32]) {
    match triangles.len() {
        1 => write_rows::<1>(triangles, block),
        2 => write_rows::<2>(triangles, block),
        3 => write_rows::<3>(triangles, block),
        _ => write_rows::<LEAF_MAX>(triangles, block),
    }
}

/// The same for a number of triangles that the compiler knows: fewer instructions.
#[inline(always)]
fn write_rows<const N: usize>(triangles: &[Packed], block: &mut [f32]) {
    let (triangles, block) = (&triangles[..N], &mut block[..N * TRIANGLE_WORDS]);
    for (lane, Packed { corners, id }) in triangles.iter().enumerate() {
        for corner in 0..3 {
            for axis in 0..3 {
                block[(3 * corner + axis) * N + lane] = corners[corner][axis];
            }
        }
        block[9 * N + lane] = f32::from_bits(*id);
    }
}

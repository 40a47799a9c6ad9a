//! Bottom-up sweeps that rearrange a tree: every inner node is looked at once, after everything below
//! it, subtrees side by side.
//!
//! Nodes lie depth first, so that all that is below a node is one slice: subtrees of up to
//! [`TASK_LEAVES`] leaves are swept in parallel, each by itself, and then what is above them. Whoever
//! rearranges what is below a node moves nodes among the pairs that are there, so the slice stays its
//! own. Afterwards the nodes are laid depth first again.
//!
//! Inside a sweep nodes are taken by their height when it began, so those of one height come
//! together and none of them is below another: what looks at several at once can.
//!
//! Cost: 40 bytes a node, twice while nodes are laid anew; a sweep reads and writes each once, and so
//! does laying them.

use super::{DEPTH_MAX, Kind, Node, Tree};
use crate::bounds::Aabb;
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::{self, OutOfMemory};
use alloc::vec::Vec;

/// Subtrees of up to this many leaves are swept by one thread each: some milliseconds.
const TASK_LEAVES: u32 = 4096;

/// Long loops are interrupted at most this many steps apart.
const CHUNK: usize = 4096;

/// A node with what sweeps ask for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    /// Links are indices into the whole tree.
    pub(crate) node: Node,
    /// Leaves below; 1 for a leaf.
    pub(crate) leaves: u32,
    /// Edges on the longest way down; 0 for a leaf.
    height: u16,
    /// Edges up to the root, as the nodes were last laid.
    depth: u16,
}

impl Slot {
    fn leaf(node: Node) -> Self {
        Self { node, leaves: 1, height: 0, depth: 0 }
    }

    /// An inner node over two others that stand at `left` and after it.
    pub(crate) fn around(left: usize, below: [&Self; 2]) -> Self {
        let bounds = below[0].node.bounds.union(&below[1].node.bounds);
        Self {
            node: Node::inner(bounds, left),
            leaves: below[0].leaves + below[1].leaves,
            height: below[0].height.max(below[1].height) + 1,
            depth: 0,
        }
    }

    /// The left child of an inner node; the right one is next.
    #[inline(always)]
    pub(crate) fn left(&self) -> Option<usize> {
        (self.node.count == 0).then_some(self.node.first as usize)
    }

    /// Where what is below it lies after it was laid depth first: all pairs, one after the other.
    fn below(&self) -> core::ops::Range<usize> {
        let first = self.node.first as usize;
        first..first + 2 * (self.leaves as usize - 1)
    }
}

/// What is below a node, or the whole tree.
pub(crate) struct Below<'a> {
    slots: &'a mut [Slot],
    /// Index of the first of them in the tree.
    base: usize,
}

impl Below<'_> {
    #[inline(always)]
    pub(crate) fn at(&self, index: usize) -> &Slot {
        &self.slots[index - self.base]
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, index: usize, slot: Slot) {
        self.slots[index - self.base] = slot;
    }
}

/// An inner node below which something may be rearranged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Root {
    at: usize,
    /// Its left child, which stays where it is, whatever it becomes.
    pub(crate) left: usize,
    pub(crate) bounds: Aabb,
    pub(crate) leaves: u32,
    height: u16,
    depth: u16,
}

impl Root {
    /// Whether the tree may have `slot` that many levels below this node.
    pub(crate) fn has_room(&self, levels: u32, slot: &Slot) -> bool {
        u32::from(self.depth) + levels + u32::from(slot.height) < DEPTH_MAX
    }
}

/// What a sweep does.
pub(crate) trait Rearrange: Sync {
    /// Rearranges what is below some nodes, none of them below another, inside their pairs; returns
    /// by how much the cost falls. What it writes fits where [`Root::has_room`].
    fn rearrange(&self, below: &mut Below<'_>, roots: &[Root]) -> f64;
}

/// A tree that is swept.
pub(crate) struct Sweep {
    slots: Vec<Slot>,
    prims: Vec<u32>,
}

/// Why a sweep ends early.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stopped {
    Cancelled,
    OutOfMemory(OutOfMemory),
}

impl From<Cancelled> for Stopped {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl From<OutOfMemory> for Stopped {
    fn from(error: OutOfMemory) -> Self {
        Self::OutOfMemory(error)
    }
}

impl Sweep {
    /// Takes a tree of at least one node apart, and makes its inner boxes tight.
    pub(crate) fn new(tree: Tree, cancel: &Cancel) -> Result<Self, Stopped> {
        let Tree { nodes, prims } = tree;
        let mut slots = memory::try_with_capacity(nodes.len(), "the tree that is swept")?;
        for chunk in nodes.chunks(CHUNK) {
            cancel.check()?;
            slots.extend(chunk.iter().copied().map(Slot::leaf));
        }
        for at in (0..slots.len()).rev() {
            if at % CHUNK == 0 {
                cancel.check()?;
            }
            if let Some(left) = slots[at].left() {
                slots[at] = Slot::around(left, [&slots[left], &slots[left + 1]]);
            }
        }
        let mut sweep = Self { slots, prims };
        sweep.lay(cancel)?;
        Ok(sweep)
    }

    /// How many leaves there are.
    pub(crate) fn leaves(&self) -> u32 {
        self.slots[0].leaves
    }

    /// Rearranges below every inner node of at least `leaves_min` leaves; returns by how much the
    /// cost falls.
    pub(crate) fn run(
        &mut self,
        rearrange: &impl Rearrange,
        leaves_min: u32,
        cancel: &Cancel,
    ) -> Result<f64, Stopped> {
        // What is above the tasks, and the tasks, in the order in which they lie.
        let mut top = Vec::new();
        let mut tasks = Vec::new();
        let mut open = alloc::vec![0];
        while let Some(at) = open.pop() {
            cancel.check()?;
            let slot = self.slots[at];
            let Some(left) = slot.left() else { continue };
            if slot.leaves < leaves_min {
                continue;
            }
            if slot.leaves <= TASK_LEAVES {
                tasks.push((at, slot));
            } else {
                top.push((at, slot));
                open.extend([left + 1, left]);
            }
        }

        // Sweep the tasks, each in its own slice.
        let mut rest = self.slots.as_mut_slice();
        let mut done = 0;
        let mut slices = Vec::with_capacity(tasks.len());
        for &(at, slot) in &tasks {
            let below = slot.below();
            let (_, tail) = rest.split_at_mut(below.start - done);
            let (head, tail) = tail.split_at_mut(below.len());
            (rest, done) = (tail, below.end);
            slices.push((at, slot, Below { slots: head, base: below.start }));
        }
        let swept = parallel::map(slices, |(at, slot, mut below)| {
            let inner = below.slots.iter().enumerate().map(|(i, slot)| (i + below.base, *slot));
            let roots = roots(inner.chain([(at, slot)]), leaves_min);
            sweep_roots(rearrange, &mut below, roots, cancel)
        });
        let mut gain = 0.0;
        for (task, (at, _)) in swept.into_iter().zip(tasks) {
            gain += task?;
            self.refresh(at);
        }

        // Then what is above them.
        let mut below = Below { slots: &mut self.slots, base: 0 };
        gain += sweep_roots(rearrange, &mut below, roots(top.into_iter(), leaves_min), cancel)?;
        self.lay(cancel)?;
        Ok(gain)
    }

    /// Makes a node's height right after those below it changed.
    fn refresh(&mut self, at: usize) {
        let Some(left) = self.slots[at].left() else { return };
        self.slots[at] = Slot::around(left, [&self.slots[left], &self.slots[left + 1]]);
    }

    /// Lays the nodes depth first: below a node come its children, what is below the left one, what
    /// is below the right one.
    fn lay(&mut self, cancel: &Cancel) -> Result<(), Stopped> {
        let old = &self.slots;
        let mut new = memory::try_filled(old[0], old.len(), "the tree that is swept")?;
        let (root, rest) = new.split_at_mut(1);
        let mut rest = rest;
        let mut next = 1;
        let place = |slot: &Slot, depth, next: &mut usize| {
            let mut slot = *slot;
            slot.depth = depth;
            if slot.node.count == 0 {
                slot.node = Node::inner(slot.node.bounds, *next);
                *next += 2 * (slot.leaves as usize - 1);
            }
            slot
        };
        root[0] = place(&old[0], 0, &mut { 1 });

        // Pairs above the tasks are laid here; what comes below in one piece is a task.
        let mut tasks = Vec::new();
        let mut open = alloc::vec![(&old[0], 0_u16)];
        while let Some((slot, depth)) = open.pop() {
            cancel.check()?;
            let Some(left) = slot.left() else { continue };
            let pairs = if slot.leaves <= TASK_LEAVES { slot.leaves as usize - 1 } else { 1 };
            let (head, tail) = rest.split_at_mut(2 * pairs);
            rest = tail;
            if slot.leaves <= TASK_LEAVES {
                tasks.push((slot, depth, head, next));
            } else {
                let mut below = next + 2;
                for (side, to) in head.iter_mut().enumerate() {
                    *to = place(&old[left + side], depth + 1, &mut below);
                }
                open.extend([(&old[left + 1], depth + 1), (&old[left], depth + 1)]);
            }
            next += 2 * pairs;
        }
        let laid = parallel::map(tasks, |(slot, depth, to, base)| {
            cancel.check()?;
            let mut open = alloc::vec![(slot, depth)];
            let mut next = 0;
            while let Some((slot, depth)) = open.pop() {
                let Some(left) = slot.left() else { continue };
                let mut below = base + next + 2;
                for side in 0..2 {
                    to[next + side] = place(&old[left + side], depth + 1, &mut below);
                }
                open.extend([(&old[left + 1], depth + 1), (&old[left], depth + 1)]);
                next += 2;
            }
            Ok(())
        });
        laid.into_iter().collect::<Result<(), Cancelled>>()?;
        self.slots = new;
        Ok(())
    }

    /// The tree, with a leaf for each subtree of up to `leaf_max >= 1` leaves; leaves come in the order of its
    /// primitives. 1 keeps the leaves that there are.
    pub(crate) fn into_tree(self, leaf_max: u32, cancel: &Cancel) -> Result<Tree, Stopped> {
        let inner = self.slots.iter().filter(|slot| slot.leaves > leaf_max).count();
        let mut nodes = memory::try_with_capacity(2 * inner + 1, "the tree's nodes")?;
        let mut prims = memory::try_with_capacity(self.prims.len(), "the tree's primitives")?;
        nodes.push(self.slots[0].node);
        let mut open = alloc::vec![(0, 0)];
        while let Some((from, to)) = open.pop() {
            cancel.check()?;
            let slot = self.slots[from];
            if let Some(left) = slot.left().filter(|_| slot.leaves > leaf_max) {
                let children = nodes.len();
                nodes[to] = Node::inner(slot.node.bounds, children);
                nodes.extend([slot.node; 2]);
                open.extend([(left + 1, children + 1), (left, children)]);
            } else {
                let first = prims.len();
                self.gather(from, &mut prims);
                nodes[to] = Node::leaf(slot.node.bounds, first, prims.len() - first);
            }
        }
        Ok(Tree { nodes, prims })
    }

    /// Adds the primitives below a node.
    fn gather(&self, node: usize, prims: &mut Vec<u32>) {
        let slot = &self.slots[node];
        match slot.node.kind() {
            Kind::Leaf { first, count } => {
                prims.extend_from_slice(&self.prims[first..first + count])
            }
            Kind::Inner { .. } => {
                let leaves = self.slots[slot.below()].iter().filter(|slot| slot.left().is_none());
                for Slot { node, .. } in leaves {
                    let (first, count) = (node.first as usize, node.count as usize);
                    prims.extend_from_slice(&self.prims[first..first + count]);
                }
            }
        }
    }
}

/// The inner nodes of at least `leaves_min` leaves among some, by height; equal ones as they come.
fn roots(slots: impl Iterator<Item = (usize, Slot)>, leaves_min: u32) -> Vec<Root> {
    let wanted = slots.filter(|(_, slot)| slot.left().is_some() && slot.leaves >= leaves_min);
    let root = |(at, slot): (usize, Slot)| Root {
        at,
        left: slot.node.first as usize,
        bounds: slot.node.bounds,
        leaves: slot.leaves,
        height: slot.height,
        depth: slot.depth,
    };
    let mut roots: Vec<Root> = wanted.map(root).collect();
    roots.sort_by_key(|root| root.height);
    roots
}

/// Rearranges below each node, those of one height at a time.
fn sweep_roots(
    rearrange: &impl Rearrange,
    below: &mut Below<'_>,
    roots: Vec<Root>,
    cancel: &Cancel,
) -> Result<f64, Cancelled> {
    let mut gain = 0.0;
    for roots in roots.chunk_by(|a, b| a.height == b.height) {
        cancel.check()?;
        gain += rearrange.rearrange(below, roots);
        for root in roots {
            // A task's own root is nobody else's business here, and lies outside.
            if let Some(at) = root.at.checked_sub(below.base).filter(|&at| at < below.slots.len()) {
                let pair = [root.left, root.left + 1].map(|child| *below.at(child));
                below.slots[at] = Slot::around(root.left, [&pair[0], &pair[1]]);
            }
        }
    }
    Ok(gain)
}

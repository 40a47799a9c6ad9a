//! Which nodes of a binary tree become nodes of a wide one: quickly, not in the cheapest way.
//!
//! Source: I. Wald, C. Benthin, S. Boulos, "Getting Rid of Packets: Efficient SIMD Single-Ray Traversal
//! using Multi-branching BVHs", IEEE Symposium on Interactive Ray Tracing, 2008: of what fills the slots
//! of a wide node, the inner node of largest area gives way to its two children until no slot is free.
//! Differs from it: a node over few enough leaves to fill a wide node of its own gives way only if all
//! its leaves find a slot. Without that, wide nodes held 4.6 leaves of 16 (a kitchen, `hploc`) and took
//! twice the memory. Leaves stay as the builder made them.
//!
//! What a wide node becomes depends on its root alone. So the upper nodes are opened breadth first until
//! there is work for many threads, and what hangs below them is opened piece by piece: the same nodes as
//! in one go.
//!
//! The inner child of largest area stands last, so that its subtree is stored next; other children in any
//! order, since `order` arranges them: nobody asks the area of what is opened to the leaves.
//!
//! O(n) time; one byte a node of the tree, and `4 W + 12` bytes a wide node. Choosing by masks instead of
//! branches where leaves are counted: no gain. Against the cheapest choice
//! (`collapse`): see [`super::Collapse`].

use super::collapse::{Below, Priced};
use super::select::{Chosen, Entry, NO_PARENT, Part, Selected, Selection, Top};
use super::wide::{Child, Node, SLOTS_MAX};
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::prefetch;
use crate::simd::f4::F4;
use crate::tree::{Kind, Tree};
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// The top is opened until so many nodes wait.
const PIECES: usize = 256;
/// Trees with fewer nodes are one piece.
const PIECES_MIN: usize = 8192;

/// What fills the slots of every wide node.
pub(super) fn select<const W: usize>(
    priced: &Priced<'_>,
    cancel: &Cancel,
) -> Result<Selection<W>, Cancelled> {
    let leaves_below = &*count_leaves(priced.tree, cancel)?;

    // Open the top. Leaves that hang there become one piece.
    let mut nodes: Vec<Node<W>> = Vec::new();
    let mut leaves = Vec::new();
    let mut waiting = VecDeque::from([(priced.part(0), None)]);
    let pieces = if priced.tree.nodes.len() < PIECES_MIN { 1 } else { PIECES };
    while waiting.len() < pieces
        && let Some((part, place)) = waiting.pop_front()
    {
        if part.is_leaf() {
            leaves.push((part, place));
            continue;
        }
        let here = nodes.len();
        nodes.push(Node::EMPTY);
        if let Some((node, slot)) = place {
            let parent: &mut Node<W> = &mut nodes[node];
            parent.children[slot] = Child::inner(here as u32);
        }
        let (parts, count) = open::<W>(priced, leaves_below, part);
        for (slot, part) in parts[..count].iter().enumerate() {
            nodes[here].set(slot, &priced.tree.nodes[part.node()].bounds, Child::END);
            waiting.push_back((*part, Some((here, slot))));
        }
    }

    // Open what waits.
    let mut groups: Vec<_> = waiting.into_iter().map(|waits| alloc::vec![waits]).collect();
    if !leaves.is_empty() {
        groups.push(leaves);
    }
    let roots = groups.iter().map(|group| group.iter().map(|&(part, _)| part).collect()).collect();
    let pieces =
        parallel::map(roots, |roots: Vec<Part>| piece(priced, leaves_below, roots, cancel));
    let pieces = pieces.into_iter().collect::<Result<_, Cancelled>>()?;
    let entry = |(part, place): (Part, _)| Entry { below: Below::Tree(part.node() as u32), place };
    let entries = groups.into_iter().map(|group| group.into_iter().map(entry).collect()).collect();
    Ok(Selection { top: Top { nodes, entries }, pieces })
}

/// How many leaves are below each node, or 255 if there are more.
fn count_leaves(tree: &Tree, cancel: &Cancel) -> Result<Vec<u8>, Cancelled> {
    let mut leaves = alloc::vec![1_u8; tree.nodes.len()];
    for (at, node) in tree.nodes.iter().enumerate().rev() {
        cancel.check()?;
        if let Kind::Inner { left } = node.kind() {
            leaves[at] = leaves[left].saturating_add(leaves[left + 1]);
        }
    }
    Ok(leaves)
}

/// Opens everything below some roots.
fn piece<const W: usize>(
    priced: &Priced<'_>,
    leaves: &[u8],
    roots: Vec<Part>,
    cancel: &Cancel,
) -> Result<Selected<W>, Cancelled> {
    let (mut nodes, mut entries): (Vec<Chosen<W>>, _) = (Vec::new(), [0; 2]);
    let mut waiting = Vec::new();
    for &root in &roots {
        if root.is_leaf() {
            priced.count(root, &mut entries);
            continue;
        }
        waiting.push((root, NO_PARENT, 0));
        while let Some((part, parent, slot)) = waiting.pop() {
            cancel.check()?;
            let (parts, count) = open(priced, leaves, part);
            for (slot, &part) in parts[..count].iter().enumerate() {
                if part.is_leaf() {
                    priced.count(part, &mut entries);
                } else {
                    expect(priced.tree, leaves, part);
                    waiting.push((part, nodes.len() as u32, slot as u32));
                }
            }
            nodes.push(Chosen { parts, count: count as u32, parent, slot });
        }
    }
    Ok(Selected { roots, nodes, entries })
}

/// Asks for what is below an inner node that is opened soon: builders that join from below put small
/// subtrees in one place.
#[inline(always)]
fn expect(tree: &Tree, leaves: &[u8], part: Part) {
    let first = tree.nodes[part.node()].first as usize;
    for pair in 0..usize::from(leaves[part.node()]).min(SLOTS_MAX) {
        prefetch(&tree.nodes, first + 2 * pair);
    }
}

/// What fills the slots of the wide node of an inner node, and how much that is.
#[inline(always)]
fn open<const W: usize>(priced: &Priced<'_>, leaves: &[u8], root: Part) -> ([Part; W], usize) {
    const { assert!(W.is_multiple_of(4) && W <= SLOTS_MAX) }
    let mut slots = Slots::<W> {
        parts: [Part::new(0, true); W],
        areas: [0.0; W],
        keys: [-1.0; W],
        leaves: [1; W],
        count: 1,
    };
    // Open the largest of those that are too large for one wide node.
    slots.parts[0] = root;
    let mut slot = 0;
    if usize::from(leaves[root.node()]) > W {
        loop {
            slots.open(priced, leaves, slot);
            let largest = largest(&slots.keys);
            if slots.count == W || largest < 0.0 {
                break;
            }
            slot = largest.to_bits() as usize % SLOTS_MAX;
        }
    } else {
        slots.absorb(priced, 0);
    }
    // Then the largest of those whose leaves find room.
    while slots.count < W
        && let Some(slot) = slots.fitting()
    {
        slots.absorb(priced, slot);
    }

    slots.largest_last();
    (slots.parts, slots.count)
}

/// A wide node being filled.
struct Slots<const W: usize> {
    parts: [Part; W],
    areas: [f32; W],
    /// Of those over more than `W` leaves the area above the number of the slot, so that the largest one
    /// says where it is; less than nothing for the others.
    keys: [f32; W],
    /// Below each; areas and keys are of those with more than one.
    leaves: [u8; W],
    count: usize,
}

impl<const W: usize> Slots<W> {
    #[inline(always)]
    fn put(&mut self, priced: &Priced<'_>, leaves: &[u8], slot: usize, node: u32) {
        let (slot, part, leaves) = (slot % W, priced.part(node), leaves[node as usize]);
        let area = priced.area(&priced.tree.nodes[node as usize]);
        let key = area.to_bits() & !(SLOTS_MAX as u32 - 1) | slot as u32;
        self.keys[slot] = if usize::from(leaves) > W { f32::from_bits(key) } else { -1.0 };
        (self.parts[slot], self.areas[slot], self.leaves[slot]) = (part, area, leaves);
    }

    /// Puts the children of what is in a slot there and into the next free one.
    #[inline(always)]
    fn open(&mut self, priced: &Priced<'_>, leaves: &[u8], slot: usize) {
        let left = priced.tree.nodes[self.parts[slot % W].node()].first;
        self.put(priced, leaves, slot, left);
        self.put(priced, leaves, self.count, left + 1);
        self.count += 1;
    }

    /// Opens what is in a slot down to its leaves, for which there is room. Of these nobody asks the area.
    #[inline(always)]
    fn absorb(&mut self, priced: &Priced<'_>, slot: usize) {
        let mut next = self.count;
        let mut slot = slot;
        self.leaves[slot % W] = 1;
        loop {
            while !self.parts[slot % W].is_leaf() {
                let left = priced.tree.nodes[self.parts[slot % W].node()].first;
                self.parts[slot % W] = priced.part(left);
                self.parts[self.count % W] = priced.part(left + 1);
                self.count += 1;
            }
            if next >= self.count {
                return;
            }
            slot = next;
            next += 1;
        }
    }

    /// Moves the inner node of largest area to the end, so that its subtree is stored next.
    #[inline(always)]
    fn largest_last(&mut self) {
        let (mut largest, mut area) = (self.count - 1, -1.0);
        for slot in 0..self.count {
            if self.leaves[slot] > 1 && self.areas[slot] > area {
                (largest, area) = (slot, self.areas[slot]);
            }
        }
        self.parts.swap(largest, self.count - 1);
    }

    /// Of the inner nodes whose leaves find room, the one of largest area.
    #[inline(always)]
    fn fitting(&self) -> Option<usize> {
        let most = W - self.count + 1;
        let mut best = None;
        let mut best_area = -1.0;
        for slot in 0..self.count {
            let leaves = usize::from(self.leaves[slot]);
            if 1 < leaves && leaves <= most && self.areas[slot] > best_area {
                (best, best_area) = (Some(slot), self.areas[slot]);
            }
        }
        best
    }
}

/// The largest of some numbers.
#[inline(always)]
fn largest<const W: usize>(numbers: &[f32; W]) -> f32 {
    let four = |at: usize| F4::new(numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3]);
    let mut all = four(0);
    for at in (4..W).step_by(4) {
        all = all.max(four(at));
    }
    let [a, b, c, d] = all.to_array();
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    larger(larger(a, b), larger(c, d))
}

impl Priced<'_> {
    /// A node of the tree, and whether it is a leaf.
    #[inline(always)]
    fn part(&self, node: u32) -> Part {
        Part::new(node, self.tree.nodes[node as usize].count > 0)
    }

    /// Counts the triangles and instances of a leaf.
    #[inline(always)]
    fn count(&self, leaf: Part, entries: &mut [usize; 2]) {
        let Kind::Leaf { first, count } = self.tree.nodes[leaf.node()].kind() else { return };
        let is_instance = self.first_instance < u32::MAX
            && self.tree.prims.get(first).is_some_and(|&prim| prim >= self.first_instance);
        entries[usize::from(is_instance)] += count;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Collapse;
    use super::super::lower::{Numbered, Packed, lower};
    use super::super::wide::{ChildKind, Wide};
    use super::*;
    use crate::bounds::Aabb;
    use crate::build::{Builder, Hploc};
    use crate::context::Context;
    use crate::layout::packing::Packing;
    use crate::layout::wide::Plain;

    /// What is to fill the slots of one wide node, by the definition; in any order.
    fn naive(tree: &Tree, leaves: &[usize], root: usize, width: usize) -> Vec<usize> {
        let mut slots = alloc::vec![root];
        let opened = |node: usize| match tree.nodes[node].kind() {
            Kind::Inner { left } => alloc::vec![left, left + 1],
            Kind::Leaf { .. } => alloc::vec![node],
        };
        let area = |node: usize| tree.nodes[node].bounds.half_area();
        let largest = |slots: &[usize], fits: &dyn Fn(usize) -> bool| {
            let fitting = slots.iter().filter(|&&node| fits(leaves[node]));
            fitting.copied().max_by(|&a, &b| area(a).total_cmp(&area(b)))
        };
        while slots.len() < width
            && let Some(node) = largest(&slots, &|leaves| leaves > width)
        {
            slots.retain(|&other| other != node);
            slots.extend(opened(node));
        }
        while let room = width - slots.len() + 1
            && let Some(node) = largest(&slots, &|leaves| 1 < leaves && leaves <= room)
        {
            slots.retain(|&other| other != node);
            let mut inside = alloc::vec![node];
            while inside.len() < leaves[node] {
                inside = inside.into_iter().flat_map(opened).collect();
            }
            slots.extend(inside);
        }
        slots
    }

    /// Holds a wide node and all below it against the definition.
    fn compare<const W: usize>(
        tree: &Tree,
        leaves: &[usize],
        wide: &Wide<W>,
        (root, child): (usize, Child),
    ) -> usize {
        let node = match child.kind() {
            ChildKind::Inner { node } => &wide.nodes[node],
            ChildKind::Leaf { first, count } => {
                // Ids are the last row of a block.
                let ids = &<Plain as Packing<W>>::leaf(&wide.words, first)[9 * count..10 * count];
                let Kind::Leaf { first, count } = tree.nodes[root].kind() else { panic!() };
                let prims = &tree.prims[first..first + count];
                assert!(ids.iter().zip(prims).all(|(id, prim)| id.to_bits() == *prim));
                return count;
            }
        };
        let bits = |a: &Aabb| [a.lo.map(f32::to_bits), a.hi.map(f32::to_bits)];
        let mut expected: Vec<_> = naive(tree, leaves, root, W)
            .into_iter()
            .map(|node| (bits(&tree.nodes[node].bounds), node))
            .collect();
        let used = node.children.iter().filter(|&&child| child != Child::END).count();
        assert_eq!(used, expected.len());
        let mut entries = 0;
        for slot in 0..used {
            let bounds = <Plain as Packing<W>>::bounds(node, slot);
            let found = expected.iter().position(|(other, _)| *other == bits(&bounds));
            let (_, part) = expected.swap_remove(found.expect("a box of the definition"));
            entries += compare(tree, leaves, wide, (part, node.children[slot]));
        }
        entries
    }

    fn check<const W: usize>(count: usize) {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let bounds: Vec<_> = (0..count)
            .map(|_| {
                let lo = [random(), random(), random()];
                let size = 0.01 / (0.02 + random());
                Aabb { lo, hi: [lo[0] + size, lo[1] + size * random(), lo[2] + size * random()] }
            })
            .collect();
        let tree = Hploc::DEFAULT.build(&bounds, &Context::default()).unwrap();
        let mut leaves = alloc::vec![1; tree.nodes.len()];
        for at in (0..tree.nodes.len()).rev() {
            if let Kind::Inner { left } = tree.nodes[at].kind() {
                leaves[at] = leaves[left] + leaves[left + 1];
            }
        }
        let source = |prims: &[u32], packed: &mut [Packed]| {
            for (packed, &id) in packed.iter_mut().zip(prims) {
                *packed = Packed { id, ..Packed::default() };
            }
        };
        let cancel = Cancel::new();
        let lowered =
            lower::<W>(&tree, Numbered::NONE, &source, Collapse::Greedy, &cancel).unwrap();
        let entries = compare(&tree, &leaves, &lowered, (0, lowered.root));
        assert_eq!(entries, count);
    }

    #[test]
    fn in_pieces_it_chooses_what_the_definition_chooses() {
        for count in [1, 5, 40, 3000, 30_000] {
            check::<8>(count);
            check::<16>(count);
        }
    }
}

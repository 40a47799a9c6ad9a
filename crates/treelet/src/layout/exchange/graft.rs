//! Grafting: a subtree is put into a wide tree where boxes grow least.
//!
//! What it costs to put a box somewhere is by how much the boxes above grow, and where the node has no slot left, the box of a new
//! node around it and the one that makes room: what rays meet more often, or in vain, than before. The search looks at the place that promises
//! most first, and ends when no node is left whose growth alone is less than the best that was found (Bittner, Hapala,
//! Havran 2015, section 3; the bound there is for binary trees).
//!
//! Cost: as many nodes as have boxes that grow less than the best place costs, which are few; each tests its children.
//!
//! What was tried: subtrees in parts, the children of the root and theirs, where those together cost less than the whole, up to 256 of them.
//! In a kitchen of 1.4 million triangles a tenth of them, chosen at random, comes: 0.71 of a new tree's speed instead of 0.63; 100 balls of
//! 1,024 triangles: 0.90 instead of 0.95, since parts take each other's places. Neither is worth more than a repair.

use super::thin::Thinned;
use super::{Branch, Twig};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::layout::lower::Packed;
use crate::layout::packing::Packing;
use crate::layout::refit::{around, half_area, used};
use crate::layout::wide::{Child, ChildKind, LEAF_MAX, Node, Plain, TRIANGLE_WORDS};
use crate::memory::{self, Pages};
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Ordering;

/// A tree that subtrees are put into.
pub(super) struct Stock<const W: usize> {
    /// In any order; some are no part of the tree.
    pub(super) nodes: Pages<Node<W>>,
    /// How many are written.
    pub(super) len: usize,
    pub(super) words: Pages<f32>,
    /// Of all, those that are still to come included.
    pub(super) triangles: usize,
    /// What each node cost when it was built; no number for those that stand between.
    pub(super) prices: Vec<f32>,
    /// Half areas of the boxes of the triangles in the leaves of each node.
    pub(super) areas: Vec<f32>,
    /// Half areas of the boxes of all primitives.
    pub(super) prims: f64,
    /// The number of the next triangle.
    next: usize,
}

/// A node that may be looked into.
struct Open {
    /// By how much the boxes above grow, and its own.
    growth: f64,
    /// Among those that were looked into.
    step: usize,
}

/// How a node was come to.
struct Step {
    node: usize,
    /// The step before, and the slot there.
    from: Option<(usize, usize)>,
}

/// Where a box goes.
struct Spot {
    cost: f64,
    step: usize,
    /// The slot that makes room; none if there is one.
    beside: Option<usize>,
}

impl<const W: usize> Stock<W> {
    /// That of a tree, with room for `more` triangles.
    pub(super) fn new(
        thinned: Thinned<W>,
        more: usize,
        prices: &[f32],
    ) -> Result<Self, BuildError> {
        let Thinned { nodes, len, words, triangles, areas, prims } = thinned;
        let mut all = memory::try_with_capacity(nodes.len(), "prices of nodes")?;
        all.extend(prices);
        // Nobody may ask.
        all.resize(len, 0.0);
        let (prices, next, triangles) = (all, triangles, triangles + more);
        Ok(Self { nodes, len, words, triangles, prices, areas, prims, next })
    }

    /// Puts one in.
    pub(super) fn graft(&mut self, twig: &Twig<'_, W>) {
        match twig {
            Twig::Single(number, bounds) => {
                self.prims += half_area(bounds);
                self.insert(Child::leaf(self.triangles + number, 1), bounds);
            }
            Twig::Tree(branch) if !branch.bounds.is_empty() => {
                let child = self.copy(branch);
                // Areas are those of nodes.
                self.prims += match branch.wide.root.kind() {
                    ChildKind::Inner { .. } => branch.areas.prims,
                    ChildKind::Leaf { .. } if branch.wide.triangles > 0 => {
                        f64::from(self.prims_of(child))
                    }
                    ChildKind::Leaf { .. } => half_area(&branch.bounds),
                };
                self.insert(child, &branch.bounds);
            }
            Twig::Tree(_) => {}
        }
    }

    /// Copies a tree behind all nodes and triangles; returns its root.
    fn copy(&mut self, branch: &Branch<'_, W>) -> Child {
        let Branch { wide, first_id, first_number, .. } = *branch;
        let (base, first) = (self.len, self.next);
        let words = &wide.words[..wide.triangles * TRIANGLE_WORDS];
        self.words[first * TRIANGLE_WORDS..][..words.len()].copy_from_slice(words);
        self.nodes[base..base + wide.nodes.len()].copy_from_slice(&wide.nodes);
        self.prices.extend(branch.prices);
        self.areas.extend(branch.triangles);
        self.len += wide.nodes.len();
        self.next += wide.triangles;

        // Name all as they are named here.
        let Self { nodes, words, triangles: all, .. } = self;
        let mut named = |child: Child| match child.kind() {
            _ if child == Child::END => child,
            ChildKind::Inner { node } => Child::inner((base + node) as u32),
            ChildKind::Leaf { first: at, count } => match at.checked_sub(wide.triangles) {
                Some(number) => Child::leaf(*all + first_number + number, count),
                None => {
                    let ids = (first + at) * TRIANGLE_WORDS + 9 * count;
                    for id in &mut words[ids..ids + count] {
                        *id = f32::from_bits(id.to_bits() + first_id);
                    }
                    Child::leaf(first + at, count)
                }
            },
        };
        for node in &mut nodes[base..base + wide.nodes.len()] {
            for child in &mut node.children {
                *child = named(*child);
            }
        }
        named(wide.root)
    }

    /// Puts a child where that costs least.
    fn insert(&mut self, child: Child, bounds: &Aabb) {
        let (steps, spot) = self.search(bounds);
        let at = steps[spot.step].node;
        let own = self.prims_of(child);
        match spot.beside {
            None => {
                let slot = used(&self.nodes[at].children);
                self.nodes[at].set(slot, bounds, child);
                self.areas[at] += own;
            }
            Some(slot) => {
                let node = &self.nodes[at];
                let other = node.children[slot];
                let sibling = <Plain as Packing<W>>::bounds(node, slot);
                let of_other = self.prims_of(other);
                let between = self.len;
                let new = &mut self.nodes[between];
                *new = Node::EMPTY;
                new.set(0, &sibling, other);
                new.set(1, bounds, child);
                self.prices.push(f32::NAN);
                self.areas.push(own + of_other);
                self.areas[at] -= of_other;
                self.len += 1;
                self.nodes[at].set(slot, &sibling.union(bounds), Child::inner(between as u32));
            }
        }
        // The boxes above hold it, too.
        let mut from = steps[spot.step].from;
        while let Some((step, slot)) = from {
            let node = &mut self.nodes[steps[step].node];
            let (grown, child) = (<Plain as Packing<W>>::bounds(node, slot), node.children[slot]);
            node.set(slot, &grown.union(bounds), child);
            from = steps[step].from;
        }
    }

    /// Half areas of the boxes of a leaf's triangles; 0 for anything else.
    fn prims_of(&self, child: Child) -> f32 {
        match child.kind() {
            ChildKind::Leaf { first, count } if first < self.triangles => {
                let leaf = <Plain as Packing<W>>::leaf(&self.words, first);
                let mut packed = [Packed::default(); LEAF_MAX];
                for (at, packed) in packed.iter_mut().enumerate().take(count) {
                    for (corner, point) in packed.corners.iter_mut().enumerate() {
                        *point =
                            [0, 1, 2].map(|axis: usize| leaf[(3 * corner + axis) * count + at]);
                    }
                }
                around(&packed[..count]).1 as f32
            }
            _ => 0.0,
        }
    }

    /// Looks for the best place, and tells the way there.
    fn search(&self, bounds: &Aabb) -> (Vec<Step>, Spot) {
        let mut steps = alloc::vec![Step { node: 0, from: None }];
        let mut best = Spot { cost: f64::INFINITY, step: 0, beside: Some(0) };
        let mut open = BinaryHeap::from([Open { growth: 0.0, step: 0 }]);
        while let Some(Open { growth, step }) = open.pop() {
            if growth >= best.cost {
                break;
            }
            let node = &self.nodes[steps[step].node];
            let used = used(&node.children);
            if used < W {
                best = Spot { cost: growth, step, beside: None };
                // Whatever is below grows as much and more.
                continue;
            }
            for slot in 0..used {
                let now = <Plain as Packing<W>>::bounds(node, slot);
                let both = half_area(&now.union(bounds));
                if growth + both < best.cost {
                    best = Spot { cost: growth + both, step, beside: Some(slot) };
                }
                let below = growth + both - half_area(&now);
                if let ChildKind::Inner { node } = node.children[slot].kind()
                    && below < best.cost
                {
                    open.push(Open { growth: below, step: steps.len() });
                    steps.push(Step { node, from: Some((step, slot)) });
                }
            }
        }
        (steps, best)
    }
}

/// The least growth first; of the same, what was found first.
impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.growth.total_cmp(&self.growth).then(other.step.cmp(&self.step))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

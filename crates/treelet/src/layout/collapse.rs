//! Which nodes of a binary tree become nodes of a wide one: the cheapest choice there is.
//!
//! Source: H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs", HPG 2017, section 3.1. `cost(n, j)` is the least expected cost of the
//! subtree of `n` if up to `j` slots of a wide node are spent on it:
//!
//! - one slot: a leaf, if few enough entries are below, at the price of one block; or a node of its
//!   own, at the price of a visit and of spending `W` slots on its two children;
//! - more slots: shared out to the two children in the best way, or one slot.
//!
//! Costs are areas times prices. A block of up to four entries costs what one costs, since they are
//! tested at once; measured here, prices of 0.5 to 2 for a block against 1 for a visit changed
//! traced rays by less than the noise. Differs from the source in that: there a leaf costs by its
//! triangles.
//!
//! Tried: chances that were counted instead of areas (how many of 100,000 rays meet a node before they end; where
//! few came near, by areas below a node above). Where these were rays of the very kinds and the camera that were
//! traced then, the best trees of a kitchen, a car and a turbine blade were traced at 1.19, 1.09 and
//! 1.05 times `sweep-sah`'s speed instead of 1.13, 1.04 and 1.00: worth the effort only for who knows the rays. With rays
//! between random points of the surfaces, single tests: 1.15, 0.95, 1.01 instead of 1.13, 0.99, 1.00.
//!
//! Cost: for each inner node, the slots of the child with fewer leaves are tried one after the
//! other, each for all `j` at once as vectors. That is O(W) a node on average (a knapsack on a tree),
//! and two or three steps in practice. Costs live on a stack while a subtree is planned; what stays
//! of an inner node is 24 bytes, and two for each step but the first.

use super::wide::{LEAF_MAX, SLOTS_MAX};
use crate::simd::f4::F4;
use crate::tree::{self, Kind, Tree};
use alloc::vec::Vec;

/// Price of visiting a wide node.
pub(super) const VISIT: f32 = 1.0;
/// Price of testing a leaf's block.
pub(super) const BLOCK: f32 = 1.0;

/// A node below a plan: one that the plan covers, or one where it ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Below {
    /// Index of an inner node in the plan.
    Planned(u32),
    /// Index of a node in the tree: a leaf, or the root of another plan.
    Tree(u32),
}

/// [`Below`] in a word: bit 31 is set for a planned node. Trees that are lowered have fewer than
/// 2^31 nodes.
#[derive(Clone, Copy, Debug)]
struct BelowWord(u32);

const PLANNED: u32 = 1 << 31;

impl From<Below> for BelowWord {
    fn from(below: Below) -> Self {
        match below {
            Below::Planned(index) => Self(PLANNED | index),
            Below::Tree(node) => Self(node),
        }
    }
}

impl BelowWord {
    #[inline(always)]
    fn decode(self) -> Below {
        if self.0 & PLANNED == 0 { Below::Tree(self.0) } else { Below::Planned(self.0 ^ PLANNED) }
    }
}

/// An inner node of the tree, and what is best for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned {
    /// Index in the tree.
    pub(super) node: u32,
    below: [BelowWord; 2],
    /// Where the plan's `ways` say which numbers of slots it is better to give 2 of to the child
    /// with fewer leaves than 1; 3 than 2 is next.
    ways: u32,
    /// Bit `j - 1`: with `j` slots, one is best.
    single: u16,
    /// How many slots for the child with fewer leaves were tried.
    tried: u8,
    /// Whether that child is the right one.
    right_is_small: bool,
    /// Whether it is a leaf if it gets one slot.
    pub(super) leaf: bool,
}

/// What it costs to spend up to `j` slots on a subtree, and what is in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    /// With `j` slots at `SLOTS_MAX + j - 1`; infinite before that, so that shifted vectors can be
    /// read.
    by_slots: [f32; 2 * SLOTS_MAX],
    /// Leaves of the tree below, at most `W`: more slots are of no use.
    leaves: usize,
    /// Entries below, at most `LEAF_MAX + 1`.
    entries: usize,
    /// Bit 0: there are triangles; bit 1: there are instances.
    kinds: u8,
}

/// Decisions for the upper part of a subtree.
#[derive(Clone, Debug)]
pub(super) struct Plan<const W: usize> {
    /// Parents before children; the root first.
    pub(super) nodes: Vec<Planned>,
    /// Bit `j - 1`, see [`Planned::ways`].
    ways: Vec<u16>,
    /// Of the root.
    pub(super) cost: Cost,
    /// Triangles and instances in the leaves where the plan ends.
    pub(super) entries: [usize; 2],
}

/// A tree, and how its leaves are priced.
#[derive(Clone, Copy)]
pub(super) struct Priced<'a> {
    pub(super) tree: &'a Tree,
    /// Primitives from here on are instances.
    pub(super) first_instance: u32,
    /// Multiplied to areas, so that they neither overflow nor vanish in f32.
    pub(super) scale: f64,
}

impl Priced<'_> {
    #[inline(always)]
    pub(super) fn area(&self, node: &tree::Node) -> f32 {
        (node.bounds.half_area() * self.scale) as f32
    }
}

impl<const W: usize> Plan<W> {
    /// Plans the subtree of `root` down to its leaves, or to nodes for which `ends` knows a cost.
    #[inline(always)]
    pub(super) fn new<'a>(
        priced: &Priced<'_>,
        root: u32,
        ends: impl Fn(u32) -> Option<&'a Cost>,
    ) -> Self {
        const { assert!(W.is_multiple_of(4) && W <= SLOTS_MAX) }
        let mut plan =
            Self { nodes: Vec::new(), ways: Vec::new(), cost: Cost::NOTHING, entries: [0; 2] };
        plan.list(priced.tree, root, &ends);

        // Decide, children first: in this order the costs of children are on top of the stack, the
        // nearer one's uppermost. Costs stay where they are; leaves have places of their own.
        let mut stack = Stack::default();
        let mut leaves = [Cost::NOTHING; 2];
        for at in (0..plan.nodes.len()).rev() {
            let node = &priced.tree.nodes[plan.nodes[at].node as usize];
            let mut below = [BelowWord(0); 2];
            let mut popped = [None; 2];
            for child in near_first(priced.tree, node.first) {
                let side = (child - node.first) as usize;
                below[side] = Below::Tree(child).into();
                if let Some(cost) = ends(child) {
                    leaves[side] = *cost;
                } else if priced.tree.nodes[child as usize].count > 0 {
                    plan.leaf(priced, child, &mut leaves[side]);
                } else {
                    popped[side] = stack.pop();
                    below[side] = stack.root(popped[side]).into();
                }
            }
            let planned = &mut plan.nodes[at];
            planned.below = below;
            let cost =
                |side: usize| popped[side].map_or(&leaves[side], |at: usize| &stack.costs[at]);
            let decided = planned.decide::<W>(priced.area(node), cost(0), cost(1), &mut plan.ways);
            stack.push::<W>(at as u32, &decided);
        }
        match stack.pop() {
            Some(at) => plan.cost = stack.costs[at],
            None => {
                plan.leaf(priced, root, &mut leaves[0]);
                plan.cost = leaves[0];
            }
        }
        plan
    }

    /// Lists the inner nodes, parents first, siblings in the order in which what is below them lies in
    /// memory: to wait for every node would take longer than all the rest.
    #[inline(always)]
    fn list<'a>(&mut self, tree: &Tree, root: u32, ends: &impl Fn(u32) -> Option<&'a Cost>) {
        let is_inner = |node: u32| ends(node).is_none() && tree.nodes[node as usize].count == 0;
        let mut open = Vec::new();
        if is_inner(root) {
            open.push(root);
        }
        while let Some(node) = open.pop() {
            self.nodes.push(Planned::new(node));
            let [near, far] = near_first(tree, tree.nodes[node as usize].first);
            if is_inner(far) {
                open.push(far);
            }
            if is_inner(near) {
                open.push(near);
            }
        }
    }

    /// Counts and prices a leaf of the tree.
    #[inline(always)]
    fn leaf(&mut self, priced: &Priced<'_>, node: u32, cost: &mut Cost) {
        let node = &priced.tree.nodes[node as usize];
        let Kind::Leaf { first, count } = node.kind() else { return };
        let is_instance = priced.first_instance < u32::MAX
            && priced.tree.prims.get(first).is_some_and(|&prim| prim >= priced.first_instance);
        self.entries[usize::from(is_instance)] += count;
        cost.by_slots[SLOTS_MAX..].fill(priced.area(node) * BLOCK);
        cost.leaves = 1;
        cost.entries = count.min(LEAF_MAX + 1);
        cost.kinds = 1 << u8::from(is_instance);
    }

    /// What stands in the slots of a wide node that are spent on the planned node `at`: its parts, if
    /// `opened` or if that is best, with the slots that each was given; or the node itself.
    #[inline]
    pub(super) fn spend(&self, at: u32, slots: usize, opened: bool, out: &mut Vec<(Below, usize)>) {
        let mut pending = [(Below::Tree(0), 0); SLOTS_MAX];
        let mut len = 0;
        let mut next = (Below::Planned(at), slots);
        let mut opened = opened;
        loop {
            let (below, slots) = next;
            if let Below::Planned(index) = below
                && let planned = &self.nodes[index as usize]
                && (opened || planned.single >> (slots - 1) & 1 == 0)
            {
                // Every node that waits has a slot at least, so no more than `W` wait.
                let left = self.left_share(planned, slots);
                pending[len] = (planned.below[1].decode(), slots - left);
                len += 1;
                next = (planned.below[0].decode(), left);
                opened = false;
                continue;
            }
            out.push(next);
            if len == 0 {
                return;
            }
            len -= 1;
            next = pending[len];
        }
    }

    /// How many of `slots` the left child gets.
    #[inline(always)]
    fn left_share(&self, planned: &Planned, slots: usize) -> usize {
        let mut small = usize::from(planned.tried);
        while small > 1 && self.ways[planned.ways as usize + small - 2] >> (slots - 1) & 1 == 0 {
            small -= 1;
        }
        if planned.right_is_small { slots - small } else { small }
    }
}

/// Two siblings, first the one whose children come first in memory, if both are inner nodes.
#[inline(always)]
fn near_first(tree: &Tree, left: u32) -> [u32; 2] {
    let at = left as usize;
    let right_is_near = tree.nodes[at + 1].first < tree.nodes[at].first;
    if right_is_near { [left + 1, left] } else { [left, left + 1] }
}

impl Cost {
    const NOTHING: Self =
        Self { by_slots: [f32::INFINITY; 2 * SLOTS_MAX], leaves: 1, entries: 0, kinds: 0 };

    /// The same for whoever must not make a leaf of it.
    pub(super) fn opaque(self) -> Self {
        Self { entries: LEAF_MAX + 1, ..self }
    }

    /// With one slot.
    #[cfg(test)]
    pub(super) fn single(&self) -> f32 {
        self.by_slots[SLOTS_MAX]
    }

    /// With `slots + j` slots for `j` of `4 at ..`; infinite where that is none.
    #[inline(always)]
    fn shifted(&self, at: usize, slots: usize) -> F4 {
        let start = SLOTS_MAX + 4 * at - slots;
        let four = self.by_slots.get(start..start + 4).and_then(<[f32]>::first_chunk);
        let [a, b, c, d] = *four.unwrap_or(&[f32::INFINITY; 4]);
        F4::new(a, b, c, d)
    }
}

impl Planned {
    fn new(node: u32) -> Self {
        let below = [BelowWord(0); 2];
        Self { node, below, ways: 0, single: 0, tried: 1, right_is_small: false, leaf: false }
    }

    /// Decides for every number of slots, given the costs of the two children.
    #[inline(always)]
    fn decide<const W: usize>(
        &mut self,
        area: f32,
        left: &Cost,
        right: &Cost,
        ways: &mut Vec<u16>,
    ) -> Decided {
        self.right_is_small = right.leaves < left.leaves;
        let (small, large) = if self.right_is_small { (right, left) } else { (left, right) };
        let tried = small.leaves.min(W - 1);
        self.tried = tried as u8;
        self.ways = ways.len() as u32;

        // The best way to share `j` slots, all `j` at once: one for the child with fewer leaves,
        // two, and so on. A child does not cost more with slots that it does not use.
        let mut shared = [F4::splat(f32::INFINITY); SLOTS_MAX / 4];
        let one = F4::splat(small.by_slots[SLOTS_MAX]);
        for at in 0..W / 4 {
            shared[at] = one.add(large.shifted(at, 1));
        }
        for slots in 2..=tried {
            let of_small = F4::splat(small.by_slots[SLOTS_MAX + slots - 1]);
            let mut better = 0;
            for at in 0..W / 4 {
                let cost = of_small.add(large.shifted(at, slots));
                better |= cost.less_bits(shared[at]) << (4 * at);
                shared[at] = cost.min(shared[at]);
            }
            ways.push(better as u16);
        }

        // One slot: a leaf or a node.
        let entries = (left.entries + right.entries).min(LEAF_MAX + 1);
        let kinds = left.kinds | right.kinds;
        let fits = entries <= LEAF_MAX && kinds != 3;
        let as_leaf = if fits { area * BLOCK } else { f32::INFINITY };
        let as_node = area * VISIT + shared[W / 4 - 1].to_array()[3];
        self.leaf = as_leaf <= as_node;
        let single = F4::splat(if self.leaf { as_leaf } else { as_node });
        let mut opened = 0;
        for at in 0..W / 4 {
            opened |= shared[at].less_bits(single) << (4 * at);
            shared[at] = shared[at].min(single);
        }
        self.single = !(opened as u16);
        let leaves = (left.leaves + right.leaves).min(W);
        Decided { by_slots: shared, leaves, entries, kinds }
    }
}

/// What [`Planned::decide`] finds out about a subtree: a [`Cost`] in registers.
struct Decided {
    by_slots: [F4; SLOTS_MAX / 4],
    leaves: usize,
    entries: usize,
    kinds: u8,
}

/// Costs of the planned nodes whose parents are not decided yet.
#[derive(Default)]
struct Stack {
    /// Beyond `len`, what was there before.
    costs: Vec<Cost>,
    /// Which planned node each belongs to.
    roots: Vec<u32>,
    len: usize,
}

impl Stack {
    #[inline(always)]
    fn push<const W: usize>(&mut self, root: u32, decided: &Decided) {
        if self.len == self.costs.len() {
            self.costs.push(Cost::NOTHING);
            self.roots.push(0);
        }
        let cost = &mut self.costs[self.len];
        for at in 0..W / 4 {
            let start = SLOTS_MAX + 4 * at;
            cost.by_slots[start..start + 4].copy_from_slice(&decided.by_slots[at].to_array());
        }
        (cost.leaves, cost.entries, cost.kinds) = (decided.leaves, decided.entries, decided.kinds);
        self.roots[self.len] = root;
        self.len += 1;
    }

    /// Where the uppermost cost is, until the next is pushed.
    #[inline(always)]
    fn pop(&mut self) -> Option<usize> {
        self.len = self.len.checked_sub(1)?;
        Some(self.len)
    }

    #[inline(always)]
    fn root(&self, popped: Option<usize>) -> Below {
        popped.map_or(Below::Tree(0), |at| Below::Planned(self.roots[at]))
    }
}

#[cfg(test)]
mod tests;

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
//! Slots beyond the leaves of a subtree are not looked at, so the cost of all is O(W) a node of the
//! tree (a knapsack on a tree), not O(W^2).

use super::wide::LEAF_MAX;
use crate::tree::{Kind, Tree};
use alloc::vec::Vec;

/// Price of visiting a wide node.
const VISIT: f32 = 1.0;
/// Price of testing a leaf's block.
const BLOCK: f32 = 1.0;

/// A node below a plan: one that the plan covers, or one where it ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Below {
    /// Index of an inner node in the plan.
    Planned(u32),
    /// Index of a node in the tree: a leaf, or the root of another plan.
    Tree(u32),
}

/// An inner node of the tree, and what is best for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned<const W: usize> {
    /// Index in the tree.
    pub(super) node: u32,
    pub(super) below: [Below; 2],
    /// Whether it is a leaf if it gets one slot.
    pub(super) leaf: bool,
    /// Bit `j - 1`: with `j` slots, one is best.
    single: u16,
    /// With up to `j` slots: how many to use, and how many of them the left child gets. At `j - 1`,
    /// both less one, four bits each.
    shares: [u8; W],
}

/// What it costs to spend up to `j` slots on a subtree, at `j - 1`, and what is in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost<const W: usize> {
    by_slots: [f32; W],
    /// Leaves of the tree below, at most `W`: more slots are of no use.
    leaves: usize,
    /// Entries below, at most `LEAF_MAX + 1`.
    entries: usize,
    /// Whether all entries are triangles, whether all are instances.
    kinds: [bool; 2],
}

/// Decisions for the upper part of a subtree.
#[derive(Clone, Debug)]
pub(super) struct Plan<const W: usize> {
    /// Parents before children; the root first.
    pub(super) nodes: Vec<Planned<W>>,
    /// Of the root.
    pub(super) cost: Cost<W>,
}

impl<const W: usize> Plan<W> {
    /// Plans the subtree of the inner node `root` down to the nodes for which `ends` knows a cost.
    ///
    /// `scale` is multiplied to areas, so that they neither overflow nor vanish in f32.
    pub(super) fn new(
        tree: &Tree,
        root: u32,
        scale: f64,
        ends: impl Fn(u32) -> Option<Cost<W>>,
    ) -> Self {
        // List the inner nodes, parents first.
        let mut nodes: Vec<Planned<W>> = Vec::new();
        let mut open = alloc::vec![(root, None)];
        while let Some((node, parent)) = open.pop() {
            let end = match tree.nodes[node as usize].kind() {
                Kind::Inner { left } if ends(node).is_none() => left as u32,
                _ => continue,
            };
            if let Some((parent, side)) = parent {
                let here = Below::Planned(nodes.len() as u32);
                let parent: &mut Planned<W> = &mut nodes[parent as usize];
                parent.below[side as usize] = here;
            }
            let here = nodes.len() as u32;
            nodes.push(Planned {
                node,
                below: [Below::Tree(end), Below::Tree(end + 1)],
                leaf: false,
                single: 0,
                shares: [0; W],
            });
            open.push((end + 1, Some((here, 1_u8))));
            open.push((end, Some((here, 0))));
        }

        // Decide, children first.
        let mut costs: Vec<Cost<W>> = alloc::vec![Cost::NOTHING; nodes.len()];
        for at in (0..nodes.len()).rev() {
            let cost = |below: Below| match below {
                Below::Planned(below) => costs[below as usize],
                Below::Tree(node) => ends(node).unwrap_or(Cost::NOTHING),
            };
            let [left, right] = nodes[at].below.map(cost);
            let area = (tree.nodes[nodes[at].node as usize].bounds.half_area() * scale) as f32;
            costs[at] = nodes[at].decide(area, &left, &right);
        }
        let cost = costs.first().copied().unwrap_or(Cost::NOTHING);
        Self { nodes, cost }
    }

    /// What stands in the slots of a wide node that are spent on the planned node `at`: its parts, if
    /// `opened` or if that is best, with the slots that each was given; or the node itself.
    pub(super) fn spend(
        &self,
        at: u32,
        slots: usize,
        opened: bool,
        out: &mut Vec<(Below, usize)>,
        pending: &mut Vec<(Below, usize, bool)>,
    ) {
        pending.push((Below::Planned(at), slots, opened));
        while let Some((below, slots, opened)) = pending.pop() {
            match below {
                Below::Planned(index) => {
                    let planned = &self.nodes[index as usize];
                    if !opened && planned.single >> (slots - 1) & 1 == 1 {
                        out.push((below, slots));
                        continue;
                    }
                    let shares = usize::from(planned.shares[slots - 1]);
                    let (used, left) = ((shares >> 4) + 1, (shares & 15) + 1);
                    pending.push((planned.below[1], used - left, false));
                    pending.push((planned.below[0], left, false));
                }
                Below::Tree(_) => out.push((below, slots)),
            }
        }
    }
}

impl<const W: usize> Cost<W> {
    const NOTHING: Self = Self { by_slots: [0.0; W], leaves: 1, entries: 0, kinds: [true, true] };

    /// Of a leaf of the tree.
    pub(super) fn leaf(area: f32, entries: usize, kinds: [bool; 2]) -> Self {
        Self { by_slots: [area * BLOCK; W], leaves: 1, entries: entries.min(LEAF_MAX + 1), kinds }
    }
}

impl<const W: usize> Cost<W> {
    /// The same for whoever must not make a leaf of it.
    pub(super) fn opaque(self) -> Self {
        Self { entries: LEAF_MAX + 1, ..self }
    }
}

impl<const W: usize> Planned<W> {
    /// Decides for every number of slots, given the costs of the two children.
    fn decide(&mut self, area: f32, left: &Cost<W>, right: &Cost<W>) -> Cost<W> {
        const { assert!(2 <= W && W <= 16) }
        let leaves = (left.leaves + right.leaves).min(W);
        let entries = (left.entries + right.entries).min(LEAF_MAX + 1);
        let kinds = [left.kinds[0] && right.kinds[0], left.kinds[1] && right.kinds[1]];

        // The best way to share exactly `slots`, then at most `slots`; at index `slots - 1`.
        let mut shared = [f32::INFINITY; W];
        let most_left = left.leaves.min(W - 1);
        let most_right = right.leaves.min(W - 1);
        let mut ways = [0_u8; W];
        for to_left in 1..=most_left {
            let of_left = left.by_slots[to_left - 1];
            for to_right in 1..=most_right.min(W - to_left) {
                let slots = to_left + to_right;
                let cost = of_left + right.by_slots[to_right - 1];
                if cost < shared[slots - 1] {
                    shared[slots - 1] = cost;
                    ways[slots - 1] = ((slots - 1) << 4 | (to_left - 1)) as u8;
                }
            }
        }
        for slots in 3..=W {
            if shared[slots - 2] <= shared[slots - 1] {
                shared[slots - 1] = shared[slots - 2];
                ways[slots - 1] = ways[slots - 2];
            }
        }

        // One slot: a leaf or a node.
        let fits = entries <= LEAF_MAX && (kinds[0] || kinds[1]);
        let as_leaf = if fits { area * BLOCK } else { f32::INFINITY };
        let as_node = area * VISIT + shared[W - 1];
        self.leaf = as_leaf <= as_node;
        let single = if self.leaf { as_leaf } else { as_node };
        let mut by_slots = [single; W];
        self.single = 1;
        for slots in 2..=W {
            if single <= shared[slots - 1] {
                self.single |= 1 << (slots - 1);
            } else {
                by_slots[slots - 1] = shared[slots - 1];
            }
        }
        self.shares = ways;
        Cost { by_slots, leaves, entries, kinds }
    }
}

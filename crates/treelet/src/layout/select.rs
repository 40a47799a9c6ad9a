//! What fills the slots of each wide node, as a plan says, largest last; and the order of the nodes:
//! parents before children, each followed by its largest child's subtree.

use super::collapse::{Below, Plan, Priced};
use super::wide::{Child, Node, SLOTS_MAX};
use crate::context::{Cancel, Cancelled};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// A child of a wide node in a word: bits 0..31 are a node of the tree; bit 31 is set where all that
/// is below becomes one leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part(u32);

const LEAF: u32 = 1 << 31;

impl Part {
    /// Everything below a node of the tree, as a leaf or a wide node.
    pub(super) fn new(node: u32, is_leaf: bool) -> Self {
        Self(if is_leaf { node | LEAF } else { node })
    }

    pub(super) fn node(self) -> usize {
        (self.0 & !LEAF) as usize
    }

    pub(super) fn is_leaf(self) -> bool {
        self.0 & LEAF != 0
    }
}

/// A wide node before it is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen<const W: usize> {
    /// Of the inner ones, the largest last.
    pub(super) parts: [Part; W],
    pub(super) count: u32,
    /// Which wide node of the piece it is a child of, and in which slot; `NO_PARENT` if it is one
    /// that the top leads to.
    pub(super) parent: u32,
    pub(super) slot: u32,
}

/// A wide node that fills a place in the top.
pub(super) const NO_PARENT: u32 = u32::MAX;

/// The wide nodes of a piece.
#[derive(Debug)]
pub(super) struct Selected<const W: usize> {
    /// What fills the places in the top.
    pub(super) roots: Vec<Part>,
    /// Those that belong to the first root, to the second, and so on.
    pub(super) nodes: Vec<Chosen<W>>,
    /// Triangles and instances below, counted once for each leaf of the tree.
    pub(super) entries: [usize; 2],
}

/// What fills one slot of the top: a node of a piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) below: Below,
    /// Node and slot; none if it is the root of all.
    pub(super) place: Option<(usize, usize)>,
}

/// What fills the slots of every wide node.
pub(super) struct Selection<const W: usize> {
    pub(super) top: Top<W>,
    pub(super) pieces: Vec<Selected<W>>,
}

/// The wide nodes above the pieces.
pub(super) struct Top<const W: usize> {
    /// The first of them is the root, if there is any.
    pub(super) nodes: Vec<Node<W>>,
    /// For each piece, which of its nodes fill which slots.
    pub(super) entries: Vec<Vec<Entry>>,
}

impl<const W: usize> Plan<W> {
    /// The tree's node, and whether it becomes a leaf.
    #[inline(always)]
    fn part(&self, below: Below) -> Part {
        match below {
            Below::Planned(index) => {
                let planned = &self.nodes[index as usize];
                Part::new(planned.node, planned.leaf)
            }
            Below::Tree(node) => Part::new(node, true),
        }
    }
}

impl<const W: usize> Selected<W> {
    /// Selects what the entries lead to.
    pub(super) fn new(
        priced: &Priced<'_>,
        plan: &Plan<W>,
        entries: &[Entry],
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        let mut roots = Vec::with_capacity(entries.len());
        let mut nodes: Vec<Chosen<W>> = Vec::with_capacity(plan.nodes.len() / (W / 2) + 1);
        let mut slots: Vec<(Below, usize)> = Vec::with_capacity(W);
        let mut open = Vec::new();
        for entry in entries {
            let root = plan.part(entry.below);
            roots.push(root);
            if let Below::Planned(at) = entry.below
                && !root.is_leaf()
            {
                open.push((at, NO_PARENT, 0));
            }
            while let Some((at, parent, slot)) = open.pop() {
                cancel.check()?;
                slots.clear();
                plan.spend(at, W, true, &mut slots);
                let mut parts = [Part(0); W];
                let mut areas = [0.0; W];
                for (slot, (below, _)) in slots.iter().enumerate() {
                    parts[slot] = plan.part(*below);
                    areas[slot] = priced.area(&priced.tree.nodes[parts[slot].node()]);
                }
                let order = by_area(&areas, slots.len());
                let mut chosen =
                    Chosen { parts: [Part(0); W], count: slots.len() as u32, parent, slot };
                for (slot, &from) in order[..slots.len()].iter().enumerate() {
                    let from = usize::from(from) % W;
                    chosen.parts[slot] = parts[from];
                    if let Below::Planned(at) = slots[from].0
                        && !parts[from].is_leaf()
                    {
                        open.push((at, nodes.len() as u32, slot as u32));
                    }
                }
                nodes.push(chosen);
            }
        }
        Ok(Self { roots, nodes, entries: plan.entries })
    }
}

/// The first `count` places in the order of their areas, none of them negative.
///
/// Each is compared with each, without a branch. Of the areas, the last four bits are not looked at.
#[inline(always)]
pub(super) fn by_area<const W: usize>(areas: &[f32; W], count: usize) -> [u8; W] {
    const { assert!(W <= SLOTS_MAX) }
    let mut keys = [i32::MAX; W];
    for at in 0..count {
        // Bits of floats that are not negative are in the order of the floats.
        keys[at] = (areas[at].to_bits() & !(SLOTS_MAX as u32 - 1) | at as u32).cast_signed();
    }
    let mut ranks = [0_i32; W];
    for key in &keys[..count] {
        for at in 0..W {
            ranks[at] += i32::from(*key < keys[at]);
        }
    }
    let mut order = [0; W];
    for at in 0..count {
        order[ranks[at] as usize % W] = at as u8;
    }
    order
}

impl<const W: usize> Top<W> {
    /// Plans and writes what is above the pieces.
    pub(super) fn new(priced: &Priced<'_>, roots: &[u32], plans: &[Plan<W>]) -> Self {
        let by_root: BTreeMap<u32, usize> = roots.iter().copied().zip(0..).collect();
        let costs: Vec<_> = plans.iter().map(|plan| plan.cost.opaque()).collect();
        let plan = Plan::<W>::new(priced, 0, |node| by_root.get(&node).map(|&piece| &costs[piece]));
        let whole = |piece: usize| {
            let is_leaf = plans[piece].nodes.is_empty();
            if is_leaf { Below::Tree(roots[piece]) } else { Below::Planned(0) }
        };
        let mut entries = alloc::vec![Vec::new(); plans.len()];
        let mut nodes: Vec<Node<W>> = Vec::new();
        if plan.nodes.is_empty() {
            entries[0].push(Entry { below: whole(0), place: None });
            return Self { nodes, entries };
        }
        let (mut slots, mut inside) = (Vec::new(), Vec::new());
        let mut open = alloc::vec![(0_u32, None)];
        while let Some((at, place)) = open.pop() {
            let here = nodes.len();
            nodes.push(Node::EMPTY);
            if let Some((node, slot)) = place {
                let parent: &mut Node<W> = &mut nodes[node];
                parent.children[slot] = Child::inner(here as u32);
            }

            // Spend the slots on nodes of the top, and what reaches pieces on nodes of these.
            plan.spend(at, W, true, &mut slots);
            let mut children = Vec::with_capacity(W);
            for (below, share) in slots.drain(..) {
                let piece = match below {
                    Below::Planned(_) => {
                        children.push((plan.part(below), None, below));
                        continue;
                    }
                    Below::Tree(node) => by_root[&node],
                };
                match whole(piece) {
                    Below::Planned(at) => plans[piece].spend(at, share, false, &mut inside),
                    leaf @ Below::Tree(_) => inside.push((leaf, 1)),
                }
                let part = |below| (plans[piece].part(below), Some(piece), below);
                children.extend(inside.drain(..).map(|(below, _)| part(below)));
            }
            let bounds = |part: Part| priced.tree.nodes[part.node()].bounds;
            let area = |part| bounds(part).half_area();
            children.sort_by(|a, b| area(a.0).total_cmp(&area(b.0)));
            for (slot, (part, piece, below)) in children.into_iter().enumerate() {
                nodes[here].set(slot, &bounds(part), Child::END);
                match (piece, below) {
                    (Some(piece), below) => {
                        entries[piece].push(Entry { below, place: Some((here, slot)) });
                    }
                    (None, Below::Planned(index)) => open.push((index, Some((here, slot)))),
                    // Every end of the top is a piece.
                    (None, Below::Tree(_)) => {}
                }
            }
        }
        Self { nodes, entries }
    }
}

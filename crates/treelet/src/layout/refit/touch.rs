//! Where only a few instances moved, came or went: their leaves, and the way up from them.
//!
//! One that went leaves its slot with an empty box, which no ray enters. One that came goes down from the root to
//! the child that grows least, until a node has room for which that growth is more than the box of its own, or until
//! there are leaves only: then a node over the leaf that grows least and the new one takes its place. That is
//! the greedy form of J. Bittner, M. Hapala, V. Havran, "Incremental BVH Construction for Ray Tracing", Computers &
//! Graphics 47, 2015, whose search looks at every place that may be better.

use super::Refitted;
use super::{Areas, half_area, used};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, Node, Plain, Wide};
use crate::memory::{self, Pages};
use alloc::collections::BTreeSet;
use alloc::vec::Vec;

/// Instances that came: their numbers begin where those of instances ended, and what was numbered after
/// them moves up by as many.
pub(crate) struct Came<'a> {
    /// The number of the first.
    pub(crate) from: usize,
    /// How many numbers are new.
    pub(crate) numbers: usize,
    /// Those of them that have a box.
    pub(crate) placed: &'a [usize],
}

/// An entry of the tree whose box changed.
pub(crate) struct Moved {
    /// Its number as it is now.
    pub(crate) number: usize,
    /// The box that it had.
    pub(crate) was: Aabb,
}

/// To look for so many leaves takes as long as reading all nodes: one is found after some ten nodes, beside which
/// others' boxes hold its own.
const SHARE: usize = 64;

/// The same tree, where only the boxes of some entries changed: those that are `moved`, in rising order; and where some
/// `came`. `bounds`, `areas` and those of `triangles` are of the tree as it is.
///
/// Cost: copies the layout; then some ten nodes for each, looked for from the root, or the children of every node once.
pub(crate) fn touch<const W: usize>(
    old: &Wide<W>,
    (bounds, areas, triangles): (Aabb, Areas, &[f32]),
    moved: &[Moved],
    came: &Came<'_>,
    instance: impl Fn(usize) -> Aabb,
) -> Result<Refitted<W>, BuildError> {
    // Each that comes needs at most one node more.
    let room = old.nodes.len() + came.placed.len();
    let mut nodes = Pages::zeroed(room, "wide nodes")?;
    nodes[..old.nodes.len()].copy_from_slice(&old.nodes);
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
    let few = came.numbers == 0 && moved.len() * SHARE <= old.nodes.len();
    let found = few
        && moved.iter().all(|&Moved { number, was }| {
            let leaf = Child::leaf(old.triangles + number, 1);
            let Some((at, slot)) = find(&nodes, leaf, &was, &mut parents) else { return false };
            let grown_by = replace(&mut nodes[at], slot, &instance(number));
            areas.boxes += grown_by;
            areas.prims += grown_by;
            grown.insert(at);
            true
        });
    let is_moved = |number: usize| moved.binary_search_by_key(&number, |it| it.number).is_ok();
    let all = if found { 0 } else { old.nodes.len() };
    for (at, node) in nodes[..all].iter_mut().enumerate() {
        for slot in 0..used(&node.children) {
            match node.children[slot].kind() {
                ChildKind::Inner { node: child } => parents[child] = (at as u32, slot as u8),
                ChildKind::Leaf { first, count } if first >= old.triangles => {
                    let after = first - old.triangles >= came.from;
                    let first = if after { first + came.numbers } else { first };
                    node.children[slot] = Child::leaf(first, count);
                    let mut entries = first - old.triangles..first - old.triangles + count;
                    if entries.any(is_moved) {
                        let grown_by = replace(node, slot, &around(first, count));
                        areas.boxes += grown_by;
                        areas.prims += grown_by;
                        grown.insert(at);
                    }
                }
                ChildKind::Leaf { .. } => {}
            }
        }
    }

    // Put in what came.
    let mut tree = Growing { nodes: &mut nodes, len: old.nodes.len(), parents: &mut parents };
    for &number in came.placed {
        let bounds = instance(number);
        let half_area = half_area(&bounds);
        areas.boxes += half_area;
        areas.prims += half_area;
        let (at, sibling) = tree.insert(Child::leaf(old.triangles + number, 1), &bounds);
        areas.boxes += sibling;
        grown.insert(at);
    }
    let len = tree.len;
    if len < room {
        let mut exact = Pages::zeroed(len, "wide nodes")?;
        exact.copy_from_slice(&nodes[..len]);
        nodes = exact;
    }

    // Mend the boxes above, children before parents.
    while let Some(at) = grown.pop_last() {
        let bounds = own_box(&nodes[at]);
        let (parent, slot) = parents[at];
        if let Some(node) = nodes.get_mut(parent as usize) {
            areas.boxes += replace(node, usize::from(slot), &bounds);
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
    let mut triangles: Vec<f32> = triangles.to_vec();
    triangles.resize(len, 0.0);
    Ok(Refitted { wide, bounds, areas, triangles })
}

/// Where a leaf is whose box is known: from the root down through all boxes that hold it. Notes the parents of nodes on the way.
fn find<const W: usize>(
    nodes: &[Node<W>],
    leaf: Child,
    was: &Aabb,
    parents: &mut [(u32, u8)],
) -> Option<(usize, usize)> {
    let mut open = Vec::from_iter((!nodes.is_empty()).then_some(0));
    while let Some(at) = open.pop() {
        let node: &Node<W> = &nodes[at];
        for slot in 0..used(&node.children) {
            let child = node.children[slot];
            if child == leaf {
                return Some((at, slot));
            }
            if let ChildKind::Inner { node: below } = child.kind()
                && <Plain as Packing<W>>::bounds(node, slot).contains(was)
            {
                parents[below] = (at as u32, slot as u8);
                open.push(below);
            }
        }
    }
    None
}

/// A tree that gets new leaves.
struct Growing<'a, const W: usize> {
    nodes: &'a mut [Node<W>],
    /// How many there are; there is room for more.
    len: usize,
    parents: &'a mut [(u32, u8)],
}

impl<const W: usize> Growing<'_, W> {
    /// Puts a leaf into a node; says which, and the half area of what was put between it and the nodes above.
    fn insert(&mut self, leaf: Child, bounds: &Aabb) -> (usize, f64) {
        let mut at = 0;
        loop {
            let node = &mut self.nodes[at];
            let used = used(&node.children);
            let growth = |slot: &usize| {
                let now = <Plain as Packing<W>>::bounds(node, *slot);
                half_area(&now.union(bounds)) - half_area(&now)
            };
            let least = |slots: &mut dyn Iterator<Item = usize>| {
                slots.map(|slot| (growth(&slot), slot)).min_by(|a, b| a.0.total_cmp(&b.0))
            };
            let below = least(&mut (0..used).filter(|&slot| node.children[slot].is_inner()));
            // A slot of its own costs its area.
            if used < W && below.is_none_or(|(growth, _)| growth >= half_area(bounds)) {
                node.set(used, bounds, leaf);
                return (at, 0.0);
            }
            if let Some((_, slot)) = below {
                let ChildKind::Inner { node } = node.children[slot].kind() else {
                    return (at, 0.0);
                };
                at = node;
                continue;
            }
            // Full of leaves: one of them makes room.
            let slot = least(&mut (0..used)).map_or(0, |(_, slot)| slot);
            let (sibling, child) = (<Plain as Packing<W>>::bounds(node, slot), node.children[slot]);
            let both = sibling.union(bounds);
            node.set(slot, &both, Child::inner(self.len as u32));
            let new = &mut self.nodes[self.len];
            *new = Node::EMPTY;
            new.set(0, &sibling, child);
            new.set(1, bounds, leaf);
            self.parents[self.len] = (at as u32, slot as u8);
            self.len += 1;
            return (self.len - 1, half_area(&both));
        }
    }
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

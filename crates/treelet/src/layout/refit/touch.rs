//! Where only a few instances moved or went: their leaves, and the way up from them.
//!
//! One that went leaves its slot with an empty box, which no ray enters. What comes is put in by an exchange
//! ([`crate::layout::exchange`]), which takes such slots out.

use super::Refitted;
use super::{Areas, half_area, used};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, Node, Plain, Wide};
use crate::memory::{self, Pages};
use alloc::collections::BTreeSet;
use alloc::vec::Vec;

/// An entry of the tree whose box changed.
pub(crate) struct Moved {
    /// Its number.
    pub(crate) number: usize,
    /// The box that it had.
    pub(crate) was: Aabb,
}

/// To look for so many leaves takes as long as reading all nodes: one is found after some ten nodes, beside which
/// others' boxes hold its own.
const SHARE: usize = 64;

/// The same tree, where only the boxes of some entries changed: those that are `moved`, in rising order.
/// `bounds`, `areas` and those of `triangles` are of the tree as it is.
///
/// Cost: copies the layout; then some ten nodes for each, looked for from the root, or the children of every node once.
pub(crate) fn touch<const W: usize>(
    old: &Wide<W>,
    (bounds, areas, triangles): (Aabb, Areas, &[f32]),
    moved: &[Moved],
    instance: impl Fn(usize) -> Aabb,
) -> Result<Refitted<W>, BuildError> {
    let mut nodes = Pages::zeroed(old.nodes.len(), "wide nodes")?;
    nodes.copy_from_slice(&old.nodes);
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
    let few = moved.len() * SHARE <= old.nodes.len();
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
    Ok(Refitted { wide, bounds, areas, triangles: triangles.to_vec() })
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

/// Gives a child another box; returns by how much its half area grew.
fn replace<const W: usize>(node: &mut Node<W>, slot: usize, bounds: &Aabb) -> f64 {
    let before = half_area(&<Plain as Packing<W>>::bounds(node, slot));
    let child = node.children[slot];
    node.set(slot, bounds, child);
    half_area(bounds) - before
}

/// The box around a node's children.
pub(crate) fn own_box<const W: usize>(node: &Node<W>) -> Aabb {
    let boxes = (0..used(&node.children)).map(|slot| <Plain as Packing<W>>::bounds(node, slot));
    boxes.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
}

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

/// The same tree, where only the boxes of some instances changed: those that are `moved`, by their
/// numbers. `bounds`, `areas` and those of `triangles` are of the tree as it is.
///
/// Cost: copies the layout and reads the children of every node; then a few steps for each.
pub(crate) fn touch<const W: usize>(
    old: &Wide<W>,
    (bounds, areas, triangles): (Aabb, Areas, &[f32]),
    moved: impl Fn(usize) -> bool,
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
    for (at, node) in nodes.iter_mut().enumerate() {
        for slot in 0..used(&node.children) {
            match node.children[slot].kind() {
                ChildKind::Inner { node: child } => parents[child] = (at as u32, slot as u8),
                ChildKind::Leaf { first, count } if first >= old.triangles => {
                    let mut entries = first - old.triangles..first - old.triangles + count;
                    if entries.any(&moved) {
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

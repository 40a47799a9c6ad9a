//! What is written soon is asked for ahead: each of a triangle's words is behind another one that must have come first.
//!
//! The ids are in the old leaf, the numbers of the corners are found by the ids, and the corners by those numbers: three steps, each
//! of which misses the cache where the one before it has just come. So they are taken for different nodes at a time, the ids first.

use super::areas::{ids_of, used};
use super::{Content, triangles_of};
use crate::bounds::Aabb;
use crate::layout::lower::Packed;
use crate::layout::packing::Packing;
use crate::layout::wide::{ChildKind, LEAF_MAX, SLOTS_MAX, Wide};

/// The line of a leaf's ids is asked for so many nodes before they are read.
const IDS_AHEAD: usize = 4;
/// Nodes between the reading of ids and the writing of triangles.
pub(super) const AHEAD: usize = 2;
/// Nodes whose ids are held.
const RING: usize = 4;
const _: () = assert!(RING > AHEAD && RING.is_power_of_two());

/// The ids of a node's triangles, leaf by leaf.
#[derive(Clone, Copy)]
struct Ids {
    ids: [u32; SLOTS_MAX * LEAF_MAX],
    count: usize,
}

/// The ids of the nodes that are next.
pub(super) struct Ahead([Ids; RING]);

impl Ahead {
    pub(super) fn new() -> Self {
        Self([Ids { ids: [0; SLOTS_MAX * LEAF_MAX], count: 0 }; RING])
    }

    /// The ids of a node that was looked at [`AHEAD`] nodes ago.
    pub(super) fn of(&self, at: usize) -> &[u32] {
        let Ids { ids, count } = &self.0[at % RING];
        &ids[..*count]
    }

    /// Reads the ids of node `at`, and asks for what those before and after it need next.
    #[inline(always)]
    pub(super) fn look<K: Packing<W>, T, I, const W: usize>(
        &mut self,
        (old, nodes): (&Wide<W, K>, &[K::Node]),
        content: &Content<'_, T, I>,
        at: usize,
    ) where
        T: Fn(&[u32], &mut [Packed]) -> bool + Sync,
        I: Fn(usize) -> Aabb + Sync,
    {
        if let Some(far) = nodes.get(at + IDS_AHEAD) {
            let children = K::children(far);
            for &child in &children[..used(children)] {
                if let (Some(count), ChildKind::Leaf { first, .. }) =
                    (triangles_of(old, child), child.kind())
                {
                    K::expect_ids(&old.words, first, count);
                }
            }
        }
        if let Some(node) = nodes.get(at) {
            let children = K::children(node);
            let Ids { ids, count } = &mut self.0[at % RING];
            *count = 0;
            for &child in &children[..used(children)] {
                *count += ids_of(old, child, &mut ids[*count..]);
            }
            content.ahead.expect(&ids[..*count]);
        }
        if at > 0 && at <= nodes.len() {
            content.ahead.expect_corners(self.of(at - 1));
        }
    }
}

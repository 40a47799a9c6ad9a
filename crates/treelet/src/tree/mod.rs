//! The binary tree everyone can read: what builders make, optimisers improve and layouts lower.
//!
//! A node holds a box and either two children or a range of one permuted list of primitives.
//! Children are neighbours in the node array and come after their parent, so one index names both,
//! a reverse sweep sees children before parents, and nothing is a pointer.

pub mod cost;
mod draws;
pub mod epo;
mod kinship;
pub mod lines;
pub mod surface;
pub(crate) mod sweep;
pub mod validate;

pub use cost::{SahConstants, TreeStats};
pub use draws::Estimate;
pub use lines::LineStats;
pub use surface::Surface;
pub use validate::TreeError;

use crate::bounds::Aabb;
use alloc::vec::Vec;

/// No path from the root of a built tree is longer than this many nodes.
pub const DEPTH_MAX: u32 = 96;

/// A node of 32 bytes: inner if `count` is 0, else a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Node {
    /// Contains everything below.
    pub bounds: Aabb,
    /// Inner: index of the left child; the right one is next. Leaf: start in [`Tree::prims`].
    pub first: u32,
    /// Inner: 0. Leaf: how many primitives.
    pub count: u32,
}

const _: () = assert!(size_of::<Node>() == 32, "two siblings share a cache line");

/// What a node leads to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// The left child; the right one is the next node.
    Inner {
        /// Index of the left child.
        left: usize,
    },
    /// A range of the tree's `prims`.
    Leaf {
        /// Index of the first.
        first: usize,
        /// How many, at least 1.
        count: usize,
    },
}

impl Node {
    /// A node whose children are `left` and `left + 1`.
    pub fn inner(bounds: Aabb, left: usize) -> Self {
        Self { bounds, first: index(left), count: 0 }
    }

    /// A node over `count > 0` primitives from `first` on.
    pub fn leaf(bounds: Aabb, first: usize, count: usize) -> Self {
        debug_assert!(count > 0);
        Self { bounds, first: index(first), count: index(count) }
    }

    /// What the node leads to.
    #[inline]
    pub fn kind(&self) -> Kind {
        let first = self.first as usize;
        if self.count == 0 {
            Kind::Inner { left: first }
        } else {
            Kind::Leaf { first, count: self.count as usize }
        }
    }

    /// The same node with its child or primitives further along by `children` or `prims`.
    pub(crate) fn shifted(mut self, children: usize, prims: usize) -> Self {
        let by = if self.count == 0 { children } else { prims };
        self.first = index(self.first as usize + by);
        self
    }
}

/// Builders refuse more than `PRIMS_MAX` primitives, so every index of a tree fits.
fn index(i: usize) -> u32 {
    debug_assert!(u32::try_from(i).is_ok());
    i as u32
}

/// The most primitives that one tree holds, a little less than 2^29: leaves of the layouts have 29
/// bits for them, and the last few words mean something else.
pub const PRIMS_MAX: usize = (1 << 29) - 8;

/// A binary bounding volume hierarchy. The tree of nothing has no nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// The root is node 0; children come after their parents.
    pub nodes: Vec<Node>,
    /// The primitives, permuted so that every leaf is a range.
    pub prims: Vec<u32>,
}

impl Tree {
    /// The box around everything.
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| root.bounds)
    }

    /// The depth of each node, the root's being 0; in node order.
    pub fn depths(&self) -> Vec<u32> {
        let mut depths = alloc::vec![0; self.nodes.len()];
        for (at, node) in self.nodes.iter().enumerate() {
            if let Kind::Inner { left } = node.kind() {
                depths[left] = depths[at] + 1;
                depths[left + 1] = depths[at] + 1;
            }
        }
        depths
    }
}

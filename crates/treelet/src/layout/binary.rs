//! The two-wide layout: a node holds the boxes of both its children, so that one visit decides
//! about both, and one cache line is one visit.
//!
//! | bytes    | field      | meaning                                         |
//! |----------|------------|-------------------------------------------------|
//! | 0..48    | `boxes`    | by axis: `lo` of left and right, `hi` of both   |
//! | 48..64   | `children` | left, then right: one [`Child`] of two words    |
//!
//! | word of a child | meaning                                                              |
//! |-----------------|----------------------------------------------------------------------|
//! | 0               | index of a node, or of the first entry of a leaf                     |
//! | 1               | bits 0..24: entries of a leaf; bits 30..32: [`ChildKind`], 0 is inner |
//!
//! Lowering visits every node of the tree once; leaves that mix kinds are split by kind.

use crate::bounds::Aabb;
use crate::bounds::slab::{BoxPair, pair};
use crate::build::{BuildError, Info};
use crate::context::{Cancel, Cancelled};
use crate::memory;
use crate::tree::{Kind, Tree};
use alloc::vec::Vec;

/// The catalogue's entry.
pub const INFO: Info = Info {
    name: "binary",
    summary: "two child boxes a node, 64 bytes",
    source: "Wald, Boulos, Shirley 2007",
};

/// A visit: two boxes and what they lead to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Node2 {
    /// Around the left and the right child.
    pub boxes: BoxPair,
    /// Left and right.
    pub children: [Child; 2],
}

const _: () = assert!(size_of::<Node2>() == 64, "a node is one cache line");

/// What is behind a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Child {
    first: u32,
    word: u32,
}

/// The decoded form of a [`Child`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// Another node.
    Inner {
        /// Its index.
        node: usize,
    },
    /// Packed triangles.
    Triangles {
        /// Index of the first.
        first: usize,
        /// How many; 0 for the tree of nothing.
        count: usize,
    },
    /// Packed references to instances.
    Instances {
        /// Index of the first.
        first: usize,
        /// How many, at least 1.
        count: usize,
    },
    /// The mark at which a walk goes back to the level above; never stored.
    Leave,
}

const KIND_SHIFT: u32 = 30;
const COUNT_MASK: u32 = (1 << 24) - 1;

impl Child {
    /// Nothing at all.
    pub const EMPTY: Self = Self::triangles(0, 0);
    /// See [`ChildKind::Leave`].
    pub const LEAVE: Self = Self { first: 0, word: 3 << KIND_SHIFT };

    /// Another node.
    pub const fn inner(node: u32) -> Self {
        Self { first: node, word: 0 }
    }

    /// A leaf of triangles.
    pub const fn triangles(first: u32, count: u32) -> Self {
        debug_assert!(count <= COUNT_MASK);
        Self { first, word: 1 << KIND_SHIFT | count }
    }

    /// A leaf of instances.
    pub const fn instances(first: u32, count: u32) -> Self {
        debug_assert!(count <= COUNT_MASK);
        Self { first, word: 2 << KIND_SHIFT | count }
    }

    /// Decodes it.
    #[inline(always)]
    pub fn kind(self) -> ChildKind {
        let (first, count) = (self.first as usize, (self.word & COUNT_MASK) as usize);
        match self.word >> KIND_SHIFT {
            0 => ChildKind::Inner { node: first },
            1 => ChildKind::Triangles { first, count },
            2 => ChildKind::Instances { first, count },
            _ => ChildKind::Leave,
        }
    }
}

/// A tree in this layout. What leaves refer to is stored beside it by its owner, in the order of
/// `Lowered::triangles` and `Lowered::instances`.
#[derive(Clone, Debug)]
pub struct Binary {
    /// All visits; the root need not be one.
    pub nodes: Vec<Node2>,
    /// Where a walk begins.
    pub root: Child,
    /// Around everything.
    pub bounds: Aabb,
}

/// A lowered tree, and the order in which its leaves list primitives of each kind.
pub(crate) struct Lowered {
    pub(crate) layout: Binary,
    pub(crate) triangles: Vec<u32>,
    pub(crate) instances: Vec<u32>,
}

/// Packs a tree over `triangles` triangles, numbered first, and instances, numbered after them.
pub(crate) fn lower(
    tree: &Tree,
    bounds: &[Aabb],
    triangles: usize,
    cancel: &Cancel,
) -> Result<Lowered, BuildError> {
    let entries = tree.prims.len();
    let instances = bounds.len() - triangles;
    let mut lowering = Lowering {
        tree,
        bounds,
        first_instance: triangles as u32,
        nodes: memory::try_with_capacity(tree.nodes.len() / 2, "packed nodes")?,
        triangles: memory::try_with_capacity(entries - instances, "the order of triangles")?,
        instances: memory::try_with_capacity(instances, "the order of instances")?,
    };
    let root = lowering.run(cancel)?;
    Ok(Lowered {
        layout: Binary { nodes: lowering.nodes, root, bounds: tree.bounds() },
        triangles: lowering.triangles,
        instances: lowering.instances,
    })
}

struct Lowering<'a> {
    tree: &'a Tree,
    bounds: &'a [Aabb],
    first_instance: u32,
    nodes: Vec<Node2>,
    triangles: Vec<u32>,
    instances: Vec<u32>,
}

impl Lowering<'_> {
    /// Lowers depth first, so that a node's left subtree follows it in memory.
    fn run(&mut self, cancel: &Cancel) -> Result<Child, Cancelled> {
        let Some(root) = self.tree.nodes.first() else { return Ok(Child::EMPTY) };
        // Inner nodes whose children are still to be packed: the left one, and where they go.
        let mut open = Vec::new();
        let root = self.child(root.kind(), &mut open);
        while let Some((left, place)) = open.pop() {
            cancel.check()?;
            // The right one first, so that the left one is on top of the stack.
            let nodes = [&self.tree.nodes[left], &self.tree.nodes[left + 1]];
            let right = self.child(nodes[1].kind(), &mut open);
            let left = self.child(nodes[0].kind(), &mut open);
            let boxes = pair(&nodes[0].bounds, &nodes[1].bounds);
            self.nodes[place] = Node2 { boxes, children: [left, right] };
        }
        Ok(root)
    }

    /// The word for a node of the tree: a leaf is packed now, an inner node gets a place.
    fn child(&mut self, kind: Kind, open: &mut Vec<(usize, usize)>) -> Child {
        match kind {
            Kind::Inner { left } => {
                let place = self.nodes.len();
                self.nodes.push(UNWRITTEN);
                open.push((left, place));
                Child::inner(place as u32)
            }
            Kind::Leaf { first, count } => self.leaf(first, count),
        }
    }

    /// Packs a leaf; one with both kinds becomes a node of two leaves.
    fn leaf(&mut self, first: usize, count: usize) -> Child {
        let prims = &self.tree.prims[first..first + count];
        let (starts, first_instance) =
            ([self.triangles.len() as u32, self.instances.len() as u32], self.first_instance);
        let mut around = [Aabb::EMPTY; 2];
        for &prim in prims {
            let is_instance = prim >= first_instance;
            let bounds = &mut around[usize::from(is_instance)];
            *bounds = bounds.union(&self.bounds[prim as usize]);
            if is_instance {
                self.instances.push(prim - first_instance);
            } else {
                self.triangles.push(prim);
            }
        }
        let triangles = Child::triangles(starts[0], self.triangles.len() as u32 - starts[0]);
        let instances = Child::instances(starts[1], self.instances.len() as u32 - starts[1]);
        match around.map(|bounds| bounds.is_empty()) {
            [_, true] => triangles,
            [true, false] => instances,
            [false, false] => {
                let boxes = pair(&around[0], &around[1]);
                self.nodes.push(Node2 { boxes, children: [triangles, instances] });
                Child::inner(self.nodes.len() as u32 - 1)
            }
        }
    }
}

/// A place whose node is still to come.
const UNWRITTEN: Node2 = Node2 { boxes: [[0.0; 4]; 3], children: [Child::EMPTY; 2] };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn child_words_decode_to_what_they_were_made_of() {
        assert_eq!(Child::inner(7).kind(), ChildKind::Inner { node: 7 });
        assert_eq!(Child::triangles(9, 4).kind(), ChildKind::Triangles { first: 9, count: 4 });
        assert_eq!(Child::instances(1, 2).kind(), ChildKind::Instances { first: 1, count: 2 });
        assert_eq!(Child::LEAVE.kind(), ChildKind::Leave);
        assert_eq!(Child::EMPTY.kind(), ChildKind::Triangles { first: 0, count: 0 });
    }
}

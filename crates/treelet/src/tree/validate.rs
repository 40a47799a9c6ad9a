//! Every invariant of a tree, checked in one pass. O(n).

use super::{DEPTH_MAX, Kind, Tree};
use crate::bounds::Aabb;

/// The first invariant that a tree breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TreeError {
    /// A child is missing, or does not come after its parent.
    #[error(
        "inner node {node} names children {left} and {left} + 1 of {nodes} nodes; children come after their parent"
    )]
    Child {
        /// The parent.
        node: usize,
        /// Its left child.
        left: usize,
        /// Nodes in all.
        nodes: usize,
    },
    /// A node is the child of none, or of two.
    #[error("node {node} has {parents} parents; every node but the root has exactly one")]
    Parents {
        /// The node.
        node: usize,
        /// Its parents.
        parents: usize,
    },
    /// A leaf's range leaves the list of primitives.
    #[error("leaf {node} holds entries {first} .. {first} + {count} of a list of {prims}")]
    Range {
        /// The leaf.
        node: usize,
        /// Start of its range.
        first: usize,
        /// Length of its range.
        count: usize,
        /// Length of the list.
        prims: usize,
    },
    /// An entry of the list is in no leaf, or in two.
    #[error(
        "entry {entry} of the primitive list lies in {leaves} leaves; every entry lies in exactly one"
    )]
    Entry {
        /// The entry.
        entry: usize,
        /// Leaves that have it.
        leaves: usize,
    },
    /// A primitive does not exist, or does not occur exactly once.
    #[error(
        "primitive {prim} of {prims} occurs {times} times; every primitive occurs exactly once"
    )]
    Primitive {
        /// The primitive.
        prim: usize,
        /// Primitives in all.
        prims: usize,
        /// How often it occurs.
        times: usize,
    },
    /// A node's box does not contain a child's, or a leaf's not a primitive's.
    #[error("the box of node {node} does not contain that of {inside}")]
    Containment {
        /// The node.
        node: usize,
        /// The child or the primitive.
        inside: Inside,
    },
    /// A primitive that was cut reaches farther than the boxes of its leaves.
    #[error("the leaves of primitive {prim} do not reach as far as it does")]
    Part {
        /// The primitive.
        prim: usize,
    },
    /// A path is longer than any walk expects.
    #[error("node {node} lies at depth {depth}; the limit is {}", DEPTH_MAX)]
    Depth {
        /// The node.
        node: usize,
        /// Its depth, the root's being 0.
        depth: u32,
    },
}

/// What should have been inside a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inside {
    /// A child node.
    Node(usize),
    /// A primitive.
    Primitive(usize),
}

impl core::fmt::Display for Inside {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Node(node) => write!(f, "node {node}"),
            Self::Primitive(prim) => write!(f, "primitive {prim}"),
        }
    }
}

impl Tree {
    /// Checks that this is a tree over exactly the primitives with the given boxes: children after
    /// parents, one parent each, leaves that share nothing and leave nothing out, boxes inside
    /// boxes by exact comparison, depth within [`DEPTH_MAX`].
    pub fn validate(&self, bounds: &[Aabb]) -> Result<(), TreeError> {
        self.check_links()?;
        self.check_lists(bounds.len())?;
        self.check_boxes(bounds)?;
        self.check_depth()
    }

    /// [`Tree::validate`] for a tree whose builder cuts primitives: one may lie in several leaves,
    /// whose boxes then each lie inside its own, or contain it, and reach together as far as it does
    /// on every side. That they contain every point of it only the geometry can tell.
    pub fn validate_pieces(&self, bounds: &[Aabb]) -> Result<(), TreeError> {
        self.check_links()?;
        self.check_leaves()?;
        self.check_nesting()?;
        // What the leaves hold of each primitive, by their boxes.
        let prims = bounds.len();
        let mut held = alloc::vec![Aabb::EMPTY; prims];
        for content in &self.nodes {
            let Kind::Leaf { first, count } = content.kind() else { continue };
            for &prim in &self.prims[first..first + count] {
                let prim = prim as usize;
                let held =
                    held.get_mut(prim).ok_or(TreeError::Primitive { prim, prims, times: 1 })?;
                *held = held.union(&content.bounds.intersection(&bounds[prim]));
            }
        }
        match held.iter().zip(bounds).position(|(held, bounds)| held != bounds) {
            Some(prim) if held[prim].is_empty() => {
                Err(TreeError::Primitive { prim, prims, times: 0 })
            }
            Some(prim) => Err(TreeError::Part { prim }),
            None => self.check_depth(),
        }
    }

    fn check_depth(&self) -> Result<(), TreeError> {
        let depths = self.depths();
        match depths.iter().position(|&depth| depth >= DEPTH_MAX) {
            Some(node) => Err(TreeError::Depth { node, depth: depths[node] }),
            None => Ok(()),
        }
    }

    fn check_links(&self) -> Result<(), TreeError> {
        let nodes = self.nodes.len();
        let mut parents = alloc::vec![0_usize; nodes];
        for (node, content) in self.nodes.iter().enumerate() {
            if let Kind::Inner { left } = content.kind() {
                if left <= node || left + 1 >= nodes {
                    return Err(TreeError::Child { node, left, nodes });
                }
                parents[left] += 1;
                parents[left + 1] += 1;
            }
        }
        let wrong = |(node, &count): (usize, &usize)| count != usize::from(node > 0);
        match parents.iter().enumerate().find(|&entry| wrong(entry)) {
            Some((node, &parents)) => Err(TreeError::Parents { node, parents }),
            None => Ok(()),
        }
    }

    fn check_lists(&self, prims: usize) -> Result<(), TreeError> {
        self.check_leaves()?;
        let mut times = alloc::vec![0_usize; prims];
        for &prim in &self.prims {
            let prim = prim as usize;
            *times.get_mut(prim).ok_or(TreeError::Primitive { prim, prims, times: 1 })? += 1;
        }
        match times.iter().position(|&times| times != 1) {
            Some(prim) => Err(TreeError::Primitive { prim, prims, times: times[prim] }),
            None => Ok(()),
        }
    }

    fn check_leaves(&self) -> Result<(), TreeError> {
        let mut leaves = alloc::vec![0_usize; self.prims.len()];
        for (node, content) in self.nodes.iter().enumerate() {
            if let Kind::Leaf { first, count } = content.kind() {
                let prims = self.prims.len();
                let range = leaves.get_mut(first..first + count);
                let range = range.ok_or(TreeError::Range { node, first, count, prims })?;
                range.iter_mut().for_each(|leaves| *leaves += 1);
            }
        }
        match leaves.iter().position(|&leaves| leaves != 1) {
            Some(entry) => Err(TreeError::Entry { entry, leaves: leaves[entry] }),
            None => Ok(()),
        }
    }

    fn check_boxes(&self, bounds: &[Aabb]) -> Result<(), TreeError> {
        self.check_nesting()?;
        for (node, content) in self.nodes.iter().enumerate() {
            let Kind::Leaf { first, count } = content.kind() else { continue };
            let prims = self.prims[first..first + count].iter().map(|&prim| prim as usize);
            let mut outside = prims.filter(|&prim| !content.bounds.contains(&bounds[prim]));
            if let Some(prim) = outside.next() {
                return Err(TreeError::Containment { node, inside: Inside::Primitive(prim) });
            }
        }
        Ok(())
    }

    /// Inner boxes contain those of their children.
    fn check_nesting(&self) -> Result<(), TreeError> {
        for (node, content) in self.nodes.iter().enumerate() {
            let Kind::Inner { left } = content.kind() else { continue };
            let outside = |&child: &usize| !content.bounds.contains(&self.nodes[child].bounds);
            if let Some(child) = [left, left + 1].into_iter().find(outside) {
                return Err(TreeError::Containment { node, inside: Inside::Node(child) });
            }
        }
        Ok(())
    }
}

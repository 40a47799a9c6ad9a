//! The modelling hierarchy as the tree: what not to do, kept to show what it costs.
//!
//! Source: S. M. Rubin and T. Whitted, "A 3-Dimensional Representation for Fast Rendering of Complex
//! Scenes", SIGGRAPH 1980, who let the modeller nest the boxes. Whoever models a scene groups what
//! belongs together, not what lies together: all chairs, all screws, a wall with the ceiling.
//!
//! What a builder is told of the hierarchy is the order of all primitives and which mesh each is in
//! ([`Clip::group`]; the levels above, objects and instances, are scenes of their own). So the children
//! of the root are the meshes in the order given, and those of a mesh its primitives in the order of
//! its file. A list of more than two children becomes a binary tree that halves it by count, of at most
//! 61 levels together. No box is looked at to decide anything.
//!
//! A kitchen of 1.4 M triangles in one file has an SAH of 325 by it, of 119 by `object-median`, of 46 by
//! `spatial-median` and of 37 by `sweep-sah`.
//! Of the single rays a second that [`crate::Quality::Best`] traces in a house of 1.6 M triangles in one
//! file, it traces 0.10 (primary), 0.18 (occlusion) and 0.11 (diffuse), and builds no faster than `hploc`.
//!
//! Cost: O(n log n) time for the boxes of all levels, 28 bytes a primitive.

use super::clip::Clip;
use super::prim_ref::{self, Cutter, PrimRef, extent_of, halve};
use super::top_down::{Cut, Range};
use super::{BuildError, Builder, Info};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage};
use crate::tree::Tree;

/// Meshes in the order given, primitives in the order of their file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneGraph {
    /// Most primitives in a leaf, in `1..=64`.
    pub leaf_max: u32,
}

impl SceneGraph {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4 };
}

impl Builder for SceneGraph {
    fn info(&self) -> Info {
        Info {
            name: "scene-graph",
            summary: "the modelling hierarchy as it is: meshes and triangles in the order given",
            source: "Rubin and Whitted 1980",
        }
    }

    /// Without a geometry to ask, all primitives are one mesh.
    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        prim_ref::build(&InOrder { leaf_max: self.leaf_max, scene: None }, bounds, context)
    }

    fn build_clipped(
        &self,
        bounds: &[Aabb],
        clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        prim_ref::build(&InOrder { leaf_max: self.leaf_max, scene: Some(clip) }, bounds, context)
    }
}

struct InOrder<'a> {
    leaf_max: u32,
    scene: Option<&'a dyn Clip>,
}

impl InOrder<'_> {
    fn group(&self, item: &PrimRef) -> u32 {
        self.scene.map_or(0, |scene| scene.group(item.prim))
    }
}

impl Cutter for InOrder<'_> {
    fn leaf_max(&self) -> u32 {
        self.leaf_max
    }

    /// Between meshes while there are several, then in the middle; the order stays.
    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        let slots = &*range.slots;
        let groups = [slots.first(), slots.last()].map(|item| item.map_or(0, |i| self.group(i)));
        let [first, last] = groups;
        if first < last {
            let middle = first + (last - first) / 2;
            let left = slots.partition_point(|item| self.group(item) <= middle);
            let (a, b) = slots.split_at(left);
            return Ok(Some(Cut { left, extents: [extent_of(a, stage)?, extent_of(b, stage)?] }));
        }
        let full = slots.len() > self.leaf_max as usize;
        full.then(|| halve(range, stage)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Kind;
    use alloc::vec::Vec;

    /// Primitives by the number of their mesh.
    struct Meshes(Vec<u32>);

    impl Clip for Meshes {
        fn clip(&self, _: u32, region: &Aabb) -> Aabb {
            *region
        }

        fn group(&self, prim: u32) -> u32 {
            self.0[prim as usize]
        }
    }

    fn tree(groups: &[u32]) -> Tree {
        // Places have nothing to do with the order.
        let place = |i: usize| [(i * 7919 % 101) as f32, (i * 31 % 17) as f32, 0.0];
        let bounds: Vec<Aabb> = (0..groups.len())
            .map(|i| Aabb { lo: place(i), hi: place(i).map(|x| x + 1.0) })
            .collect();
        let meshes = Meshes(groups.to_vec());
        let tree = SceneGraph::DEFAULT.build_clipped(&bounds, &meshes, &Context::default());
        let tree = tree.unwrap();
        tree.validate(&bounds).unwrap();
        tree
    }

    #[test]
    fn meshes_are_subtrees_and_nothing_changes_places() {
        // Three meshes without triangles, and some of one.
        let sizes = [5, 0, 1, 300, 0, 0, 2, 1, 1, 40_000, 3];
        let groups: Vec<u32> =
            (0..).zip(sizes).flat_map(|(group, size)| core::iter::repeat_n(group, size)).collect();
        let tree = tree(&groups);
        assert!(tree.prims.iter().copied().eq(0..groups.len() as u32));

        // What is below each node: its first and last primitive.
        let mut below = alloc::vec![(0, 0); tree.nodes.len()];
        for (at, node) in tree.nodes.iter().enumerate().rev() {
            below[at] = match node.kind() {
                Kind::Inner { left } => (below[left].0, below[left + 1].1),
                Kind::Leaf { first, count } => (first, first + count - 1),
            };
            let mixed = groups[below[at].0] != groups[below[at].1];
            let leaf = matches!(node.kind(), Kind::Leaf { .. });
            assert!(!(mixed && leaf), "a leaf holds triangles of two meshes");
        }
        for (group, size) in sizes.into_iter().enumerate().filter(|(_, size)| *size > 0) {
            let first = groups.partition_point(|&other| other < group as u32);
            assert!(below.contains(&(first, first + size - 1)), "mesh {group} is no subtree");
        }
    }

    #[test]
    fn lists_are_halved() {
        for count in [1, 4, 5, 1000] {
            // As one mesh, and as that many meshes.
            let one = tree(&alloc::vec![3; count]).stats();
            let many = tree(&(0..count as u32).collect::<Vec<_>>()).stats();
            let levels = |leaves: usize| leaves.next_power_of_two().ilog2() + 1;
            assert_eq!((many.depth, many.leaves), (levels(count), count as u64));
            assert_eq!(one.depth, levels(count.div_ceil(4)));
        }
    }
}

//! LBVH: the hierarchy that Morton codes make by themselves. The fastest builder; poor trees.
//!
//! Sources: C. Lauterbach, M. Garland, S. Sengupta, D. Luebke and D. Manocha, "Fast BVH Construction
//! on GPUs", Computer Graphics Forum 28(2), 2009; T. Karras, "Maximizing Parallelism in the
//! Construction of BVHs, Octrees, and k-d Trees", HPG 2012, whose topology this is: every range is
//! cut at the highest bit in which its codes differ, equal codes by their places. Differs from it:
//! one sweep with a stack makes topology and boxes, and small ranges become leaves.
//!
//! O(n) time.

use super::bottom_up::{self, Below, Cluster, Join};
use super::{BuildError, Builder, Info, check_leaf_max};
use crate::bounds::Aabb;
use crate::context::Context;
use crate::tree::Tree;
use alloc::vec::Vec;

/// Cuts ranges of the Morton curve at the highest bit that differs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lbvh {
    /// Most primitives in a leaf, in `1..=64`. Ranges up to this size are not cut.
    pub leaf_max: u32,
}

impl Lbvh {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4 };
}

impl Builder for Lbvh {
    fn info(&self) -> Info {
        Info {
            name: "lbvh",
            summary: "cuts the Morton curve where the highest bit of its codes differs",
            source: "Lauterbach et al. 2009; Karras 2012",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        bottom_up::build(self, self.leaf_max, bounds, context).map(|(tree, _)| tree)
    }
}

impl Join for Lbvh {
    /// Clusters that wait for a right sibling, each with the level at which it parts from the next;
    /// levels rise.
    type Open = Vec<(Cluster, u8)>;

    #[inline(always)]
    fn push(&self, open: &mut Self::Open, group: &[Cluster], level: u8, below: &mut Below<'_>) {
        let mut last = group[0];
        while let Some((left, parts)) = open.last()
            && *parts > level
        {
            last = below.join(left, &last);
            open.pop();
        }
        open.push((last, level));
    }

    fn finish(&self, open: &mut Self::Open, _count: usize, _below: &mut Below<'_>) -> Vec<Cluster> {
        // Level 0 ended every range.
        open.drain(..).map(|(cluster, _)| cluster).collect()
    }

    fn keep(&self) -> usize {
        1
    }
}

//! Spatial median: cut the box of the centers in the middle of its longest edge.
//!
//! Source: the oldest way to split, as in J. T. Kajiya and T. L. Kay, "Ray Tracing Complex Scenes",
//! SIGGRAPH 1986. Differs from it: the box of the centers is cut, not that of the primitives, so
//! that neither side is empty unless all centers coincide; then the range is halved by count.
//!
//! O(n log(range)) time, in place.

use super::prim_ref::{self, Cutter, PrimRef};
use super::top_down::{Cut, Range};
use super::{BuildError, Builder, Info};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage};
use crate::tree::Tree;

/// Cuts space in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpatialMedian {
    /// Most primitives in a leaf, in `1..=64`. Ranges up to this size are not cut.
    pub leaf_max: u32,
}

impl SpatialMedian {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4 };
}

impl Builder for SpatialMedian {
    fn info(&self) -> Info {
        Info {
            name: "spatial-median",
            summary: "cuts the box of the centers in the middle of its longest edge",
            source: "Kay and Kajiya 1986",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        prim_ref::build(self, bounds, context)
    }
}

impl Cutter for SpatialMedian {
    fn leaf_max(&self) -> u32 {
        self.leaf_max
    }

    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        if range.slots.len() <= self.leaf_max as usize {
            return Ok(None);
        }
        let axis = prim_ref::widest_axis(&range.extent.centers);
        let middle = range.extent.centers.center()[axis];
        prim_ref::partition(range.slots, |item| item.bounds.center()[axis] < middle, stage)
    }
}

//! Spatial median: cut the box of the centers in the middle of its longest edge.
//!
//! Source: the oldest way to split, as in J. T. Kajiya and T. L. Kay, "Ray Tracing Complex Scenes",
//! SIGGRAPH 1986. Differs from it: the box of the centers is cut, not that of the primitives, so
//! that neither side is empty unless all centers coincide; then the range is halved by count.
//!
//! O(n log(range)) time, in place.

use super::prim_ref::{self, PrimRef};
use super::top_down::{self, Cut, Range, Splitter};
use super::{BuildError, Builder, Info, check_leaf_max};
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
        check_leaf_max(self.leaf_max)?;
        let (mut refs, extent) = prim_ref::gather(bounds, context)?;
        top_down::build(self, &mut refs, extent, context)
    }
}

impl Splitter for SpatialMedian {
    type Slot = PrimRef;
    type Scratch = ();

    fn prim(slot: &PrimRef) -> u32 {
        slot.prim
    }

    fn leaf_max(&self) -> u32 {
        self.leaf_max
    }

    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        (): &mut (),
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        if range.slots.len() <= self.leaf_max as usize {
            return Ok(None);
        }
        let axis = prim_ref::widest_axis(&range.extent.centers);
        let middle = range.extent.centers.center()[axis];
        prim_ref::partition(range.slots, |item| item.bounds.center()[axis] < middle, stage)
    }

    fn halve(
        &self,
        range: &mut Range<'_, PrimRef>,
        (): &mut (),
        stage: &Stage<'_>,
    ) -> Result<Cut, Cancelled> {
        prim_ref::halve(range, stage)
    }
}

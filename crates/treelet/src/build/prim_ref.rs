//! A primitive as most top-down builders see it, and the passes over many of them.

use super::top_down::{self, Cut, Extent, Range, Splitter};
use super::{BuildError, check_leaf_max};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::tree::Tree;
use alloc::vec::Vec;

/// Passes over a range are cut into chunks of this size, for threads and for cancellation: about a
/// tenth of a millisecond each.
pub(super) const CHUNK: usize = 16_384;

/// A box with the number of what it is around; moved, not pointed to: 28 bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrimRef {
    pub(super) bounds: Aabb,
    pub(super) prim: u32,
}

/// What a builder over references answers. The rest of a [`Splitter`] is the same for all of them.
pub(super) trait Cutter: Sync {
    /// The most primitives that may stay in a leaf.
    fn leaf_max(&self) -> u32;

    /// Permutes the range and says where it is cut; `None` makes a leaf, where one is allowed.
    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled>;
}

/// Builds the tree that `cutter` cuts.
pub(super) fn build<C: Cutter>(
    cutter: &C,
    bounds: &[Aabb],
    context: &Context<'_>,
) -> Result<Tree, BuildError> {
    check_leaf_max(cutter.leaf_max())?;
    let (mut refs, extent) = gather(bounds, context)?;
    top_down::build(&OverRefs(cutter), &mut refs, extent, context)
}

/// A cutter as the shared loop asks it.
struct OverRefs<'a, C>(&'a C);

impl<C: Cutter> Splitter for OverRefs<'_, C> {
    type Slot = PrimRef;
    type Scratch = ();

    fn prim(slot: &PrimRef) -> u32 {
        slot.prim
    }

    fn leaf_max(&self) -> u32 {
        self.0.leaf_max()
    }

    fn cut(
        &self,
        range: &mut Range<'_, PrimRef>,
        (): &mut (),
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        self.0.cut(range, stage)
    }

    fn halve(
        &self,
        range: &mut Range<'_, PrimRef>,
        (): &mut (),
        stage: &Stage<'_>,
    ) -> Result<Cut, Cancelled> {
        halve(range, stage)
    }
}

/// One reference for each box, and their extent.
fn gather(bounds: &[Aabb], context: &Context<'_>) -> Result<(Vec<PrimRef>, Extent), BuildError> {
    let empty = PrimRef { bounds: Aabb::EMPTY, prim: 0 };
    let mut refs = memory::try_with_capacity(bounds.len(), "primitive references")?;
    // First touched here: fresh pages take longer than what is written to them.
    while refs.len() < bounds.len() {
        context.cancel.check()?;
        refs.resize(bounds.len().min(refs.len() + CHUNK), empty);
    }
    let numbered: Vec<_> = bounds.chunks(CHUNK).zip(refs.chunks_mut(CHUNK)).enumerate().collect();
    let extents = parallel::map(numbered, |(chunk, (bounds, refs))| {
        context.cancel.check()?;
        let first = chunk * CHUNK;
        let mut extent = Extent::EMPTY;
        for (at, (bounds, out)) in bounds.iter().zip(refs).enumerate() {
            *out = PrimRef { bounds: *bounds, prim: (first + at) as u32 };
            extent.add(bounds);
        }
        Ok(extent)
    });
    let mut all = Extent::EMPTY;
    for extent in extents {
        let extent: Result<_, Cancelled> = extent;
        all = all.union(&extent?);
    }
    Ok((refs, all))
}

/// The extent of some references.
pub(super) fn extent_of(refs: &[PrimRef], stage: &Stage<'_>) -> Result<Extent, Cancelled> {
    let mut extent = Extent::EMPTY;
    for chunk in refs.chunks(CHUNK) {
        stage.check()?;
        chunk.iter().for_each(|item| extent.add(&item.bounds));
    }
    Ok(extent)
}

/// Moves what `goes_left` to the front, keeping no order but the same one every time; returns
/// where to cut with the extents of both sides, or `None` if one side is empty.
pub(super) fn partition(
    refs: &mut [PrimRef],
    mut goes_left: impl FnMut(&PrimRef) -> bool,
    stage: &Stage<'_>,
) -> Result<Option<Cut>, Cancelled> {
    let mut extents = [Extent::EMPTY; 2];
    let (mut left, mut right) = (0, refs.len());
    let mut steps = 0;
    while left < right {
        if steps % CHUNK == 0 {
            stage.check()?;
        }
        steps += 1;
        if goes_left(&refs[left]) {
            extents[0].add(&refs[left].bounds);
            left += 1;
        } else {
            right -= 1;
            extents[1].add(&refs[left].bounds);
            refs.swap(left, right);
        }
    }
    let one_sided = left == 0 || left == refs.len();
    Ok((!one_sided).then_some(Cut { left, extents }))
}

/// Cuts in the middle of the present order.
pub(super) fn halve(range: &Range<'_, PrimRef>, stage: &Stage<'_>) -> Result<Cut, Cancelled> {
    let left = range.slots.len() / 2;
    let (a, b) = range.slots.split_at(left);
    Ok(Cut { left, extents: [extent_of(a, stage)?, extent_of(b, stage)?] })
}

/// The axis along which the centers spread most; the lowest one wins a tie.
pub(super) fn widest_axis(centers: &Aabb) -> usize {
    crate::math::vec3::largest_axis(centers.extent())
}

//! Where instances are that move: checked at each step, boxed over all times, and widened as `trace::slack` derives;
//! and trees for parts of the time.

use super::builder::BuildOptions;
use super::moving::{GAIN_MIN, SEGMENTS_MAX, Whole};
use super::place::{Place, SCALE_MAX, is_near};
use super::{InstanceDefect, Plan, SceneError};
use crate::bounds::Aabb;
use crate::layout::compact::pack::pack;
use crate::layout::lower::{Numbered, Packed, lower, split_leaves};
use crate::math::Affine;
use crate::math::pose::{Path, PathDefect};
use crate::trace::motion::Motion;
use crate::trace::placements::{Block, Instance};
use crate::trace::slack::{Near, Slack, Stretch};
use crate::trace::structure::{Layout, Structure};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Finds the way of an instance; or what is wrong with a step of it.
pub(super) fn locate(inner: &Structure, steps: &[Affine]) -> Result<Place, InstanceDefect> {
    // Each map must lead back, as that of an instance that stands.
    let unusable = |step: usize| InstanceDefect::Step { step, rows: steps[step].0 };
    for (step, map) in steps.iter().enumerate() {
        let back = map.inverse().ok_or(unusable(step))?;
        let extreme = |map: &Affine| {
            map.0.iter().flat_map(|row| &row[..3]).any(|entry| f64::from(entry.abs()) > SCALE_MAX)
        };
        if extreme(map) || extreme(&back) {
            return Err(unusable(step));
        }
    }
    let path = Path::new(steps).map_err(|defect| match defect {
        PathDefect::Singular(step) => unusable(step),
        PathDefect::Mirrored(step) => InstanceDefect::Mirrored { step },
    })?;
    let object_from_world = steps[0].inverse().ok_or(unusable(0))?;
    // Who holds nothing now may be given something, and moves then.
    if inner.bounds.is_empty() {
        let motion = Some(Arc::new(Motion::new(path, &[])));
        return Ok(Place { object_from_world, motion, ..Place::NOWHERE });
    }

    let whole = Motion::new(path.clone(), &[inner.reach]).around();
    let motion = match inner.cover.boxes() {
        [] => Motion::new(path, &[inner.bounds]),
        cover => Motion::new(path, cover),
    };
    let bounds = motion.around();
    let reach = whole.union(&bounds);
    let Aabb { lo, hi } = reach;
    if !is_near(&reach) {
        return Err(InstanceDefect::TooFar { lo, hi });
    }
    let motion = Some(Arc::new(motion));
    Ok(Place { object_from_world, bounds, reach, motion, ..Place::NOWHERE })
}

/// What near means to a level inside that moves, seen from outside: see [`Near::limit`].
pub(super) fn limit(inner: &Slack, motion: &Motion) -> f64 {
    let [m, ..] = stretch(&motion.path).bounds();
    Near::limit_of(inner, m)
}

/// Widens the boxes of an instance that moves, for what is near; returns the box around all, and what rays from far
/// away need on top.
pub(super) fn widen(instance: &mut Instance, near: Near) -> (Aabb, f64) {
    let Some(motion) = &instance.motion else { return (instance.bounds(), 0.0) };
    let bounds = stretch(&motion.path).bounds();
    let (by, far_share) = near.widening_moving(&instance.structure.slack, bounds);
    let motion = motion.widened(by);
    let around = motion.around();
    instance.motion = Some(Arc::new(motion));
    (around, far_share)
}

fn stretch(path: &Path) -> Stretch {
    let (most, least) = path.stretches();
    let offsets = path.maps().iter().flat_map(|map| map.0.map(|row| row[3].abs()));
    Stretch { most, least, far: offsets.fold(0.0, |most, x| f64::from(x).max(most)) }
}

/// Makes a tree for each of some equal parts of the time, where a level is made of instances, some of which move, and it
/// makes boxes smaller: as for meshes ([`super::moving`]), there are more of them where that takes [`GAIN_MIN`] off
/// the boxes' areas, up to [`SEGMENTS_MAX`]. Boxes stand still in these trees; what is inside is boxed again where a
/// ray gets there, as it is then.
pub(super) fn split(
    structure: &mut Structure,
    plan: &Plan<'_>,
    options: &BuildOptions<'_>,
) -> Result<(), SceneError> {
    let moves = |block: &Arc<Block>| block.items.iter().any(|it| it.motion.is_some());
    let moves = structure.moves && structure.instances.blocks.iter().any(moves);
    if !options.temporal_splits || !moves || !structure.geometries.is_empty() {
        return Ok(());
    }
    let boxes = |parts: usize| -> Vec<Vec<Aabb>> {
        let time = |part: usize| part as f32 / parts as f32;
        let part = |part: usize| {
            let during = |instance: &Instance| match &instance.motion {
                Some(motion) if !instance.bounds().is_empty() => {
                    motion.during([time(part), time(part + 1)])
                }
                _ => instance.bounds(),
            };
            structure.instances.iter().map(during).collect()
        };
        (0..parts).map(part).collect()
    };
    let mean = |boxes: &[Vec<Aabb>]| {
        boxes.iter().flatten().map(Aabb::half_area).sum::<f64>() / boxes.len() as f64
    };
    let mut best = boxes(1);
    let mut parts = 2;
    while parts <= SEGMENTS_MAX {
        options.context.cancel.check()?;
        let halved = boxes(parts);
        // Not the end if not: who comes and goes is in the same box in both halves.
        if mean(&halved) <= (1.0 - GAIN_MIN) * mean(&best) {
            best = halved;
        }
        parts *= 2;
    }
    if best.len() == 1 {
        return Ok(());
    }
    for boxes in best {
        structure.spans.push(layout(&structure.layout, &boxes, plan, options)?);
    }
    Ok(())
}

/// The tree over instances with these boxes, in the same form as another.
fn layout(
    like: &Layout,
    boxes: &[Aabb],
    plan: &Plan<'_>,
    options: &BuildOptions<'_>,
) -> Result<Layout, SceneError> {
    let numbers: Vec<u32> =
        boxes.iter().zip(0..).filter(|(bounds, _)| !bounds.is_empty()).map(|(_, at)| at).collect();
    let bounds: Vec<Aabb> = numbers.iter().map(|&at| boxes[at as usize]).collect();
    let tree = plan.build(&bounds, &Whole(&bounds), &options.context)?;
    let tree = split_leaves(tree, &bounds, 0)?;
    let placed = Numbered { first: 0, numbers: &numbers };
    let nothing = |_: &[u32], _: &mut [Packed]| {};
    let cancel = &options.context.cancel;
    Ok(match like {
        Layout::Wide8(_) => Layout::Wide8(lower(&tree, placed, &nothing, plan.collapse, cancel)?),
        Layout::Wide16(_) => Layout::Wide16(lower(&tree, placed, &nothing, plan.collapse, cancel)?),
        Layout::Compact(_) => {
            let wide = lower(&tree, placed, &nothing, plan.collapse, cancel)?;
            Layout::Compact(pack(&wide, cancel)?)
        }
    })
}

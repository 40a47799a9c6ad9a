//! Where instances are that move: checked at each step, boxed over all times, and widened as `trace::slack` derives.

use super::InstanceDefect;
use super::place::{Place, SCALE_MAX, is_near};
use crate::bounds::Aabb;
use crate::math::Affine;
use crate::math::pose::{Path, PathDefect};
use crate::trace::motion::Motion;
use crate::trace::placements::Instance;
use crate::trace::slack::{Near, Slack, Stretch};
use crate::trace::structure::Structure;
use alloc::sync::Arc;

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
    if inner.bounds.is_empty() {
        return Ok(Place { object_from_world, ..Place::NOWHERE });
    }

    let whole = Motion::new(path.clone(), &[inner.reach]).around();
    let motion = match inner.cover.as_slice() {
        [] => Motion::new(path, &[inner.bounds]),
        cover => Motion::new(path, cover),
    };
    let bounds = motion.around();
    let reach = whole.union(&bounds);
    let Aabb { lo, hi } = reach;
    if !is_near(&reach) {
        return Err(InstanceDefect::TooFar { lo, hi });
    }
    Ok(Place { object_from_world, bounds, reach, motion: Some(Arc::new(motion)) })
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

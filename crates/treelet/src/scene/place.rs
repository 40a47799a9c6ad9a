//! Where instances are: checked, ranked, boxed, and widened as `trace::slack` derives.

use super::builder::{BuildOptions, Invalid, Placed};
use super::report::BuildReport;
use super::{InstanceDefect, SceneError};
use crate::bounds::Aabb;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::COORDINATE_MAX;
use crate::math::{Affine, affine};
use crate::memory;
use crate::trace::slack::{Near, Slack};
use crate::trace::structure::Instance;
use alloc::vec::Vec;

/// How far an entry of the map that rays go through, inverted again, may be from the caller's,
/// relative to the largest of its row: a matrix for which f32 cannot do that is as good as singular.
const FIDELITY: f64 = 1.0 / 1024.0;

/// Maps may lengthen and shorten by this much: a ray of any common length then stays, seen from
/// inside, within the lengths at which rays are answered (`Ray::is_valid`).
const SCALE_MAX: f64 = (1_u128 << 80) as f64;

/// The instances of a level, and what follows from where they are.
pub(super) struct Placements {
    /// In the caller's order; a skipped one keeps its number and has an empty box.
    pub(super) instances: Vec<Instance>,
    /// Contains the level's meshes and the images of the reaches of all instances.
    pub(super) reach: Aabb,
    pub(super) slack: Slack,
    /// Instance paths, the level's own empty one included.
    pub(super) paths: u64,
}

/// Places the instances of a level whose meshes lie in `meshes`.
pub(super) fn place_instances(
    placed: Vec<Placed>,
    meshes: Aabb,
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Placements, SceneError> {
    // Find where each one is; one that is nowhere is an error, or is skipped.
    let located = parallel::map(placed, |placed| {
        options.context.cancel.check()?;
        let place = locate(&placed);
        Ok((placed, place))
    });
    let mut places = memory::try_with_capacity(located.len(), "places of instances")?;
    let mut reach = meshes;
    for (index, located) in located.into_iter().enumerate() {
        let located: Result<_, Cancelled> = located;
        let (placed, place) = located?;
        let place = place.or_else(|defect| skip(index, defect, options, report))?;
        reach = reach.union(&place.reach);
        report.empty_instances += u64::from(placed.structure.bounds.is_empty());
        places.push((placed, place));
    }

    // Only now is it known how large the level is, and so what rays are near.
    let seen = places.iter().filter(|(_, place)| !place.bounds.is_empty());
    let near = seen.fold(Near::of(&reach), |near, (placed, place)| {
        near.within(&placed.structure.slack, &place.object_from_world)
    });
    let mut slack = Slack::new(near);
    let mut paths = 1_u64;
    let mut instances = memory::try_with_capacity(places.len(), "instances")?;
    for (index, (Placed { structure, world_from_object, mask }, place)) in
        places.into_iter().enumerate()
    {
        let mut bounds = place.bounds;
        if !bounds.is_empty() {
            let inner = &structure.slack;
            bounds = bounds.widened(slack.include(inner, &place.object_from_world, &place.exact));
            if !is_near(&bounds) {
                let Aabb { lo, hi } = bounds;
                skip(index, InstanceDefect::TooFar { lo, hi }, options, report)?;
                bounds = Aabb::EMPTY;
            }
        }
        let (rank, inside) = (paths, structure.paths);
        let object_from_world = place.object_from_world;
        let instance =
            Instance { structure, world_from_object, object_from_world, bounds, rank, mask };
        instances.push(instance);
        paths = paths.checked_add(inside).ok_or(SceneError::TooManyPaths)?;
    }
    Ok(Placements { instances, reach, slack, paths })
}

/// Counts an instance that cannot be used as nowhere, where the caller chose so.
fn skip(
    instance: usize,
    defect: InstanceDefect,
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Place, SceneError> {
    if options.invalid == Invalid::Error {
        return Err(SceneError::Instance { instance, defect });
    }
    report.skipped.instances += 1;
    let first = &mut report.skipped.first_instance;
    *first = first.or(Some((instance, defect)));
    Ok(Place::NOWHERE)
}

/// Where an instance is.
struct Place {
    object_from_world: Affine,
    /// The exact inverse of `object_from_world`, as far as f64 goes.
    exact: [[f64; 4]; 3],
    bounds: Aabb,
    reach: Aabb,
}

impl Place {
    const NOWHERE: Self = Self {
        object_from_world: Affine::IDENTITY,
        exact: [[0.0; 4]; 3],
        bounds: Aabb::EMPTY,
        reach: Aabb::EMPTY,
    };
}

fn locate(placed: &Placed) -> Result<Place, InstanceDefect> {
    let rows = placed.world_from_object.0;
    if !placed.world_from_object.is_finite() {
        return Err(InstanceDefect::NotFinite { rows });
    }
    let singular = InstanceDefect::Singular { rows };
    let object_from_world = placed.world_from_object.inverse().ok_or(singular)?;
    // Rays see the object through the rounded inverse, so its boxes are those of the inverse's
    // exact inverse.
    let exact = object_from_world.inverse_f64().ok_or(singular)?;
    if !is_faithful(&exact, &placed.world_from_object) {
        return Err(singular);
    }
    let there = object_from_world.0.map(|row| row.map(f64::from));
    if largest(&there) > SCALE_MAX || largest(&exact) > SCALE_MAX {
        return Err(InstanceDefect::Scale { rows });
    }
    if placed.structure.bounds.is_empty() {
        return Ok(Place { object_from_world, exact, ..Place::NOWHERE });
    }
    let image = |bounds: &Aabb| {
        let (lo, hi) = affine::box_image(&exact, bounds.lo, bounds.hi);
        Aabb { lo, hi }
    };
    let bounds = placed.structure.cover.iter().map(image).fold(Aabb::EMPTY, |a, b| a.union(&b));
    let reach = image(&placed.structure.reach).union(&bounds);
    let Aabb { lo, hi } = reach;
    let place = Place { object_from_world, exact, bounds, reach };
    if is_near(&reach) { Ok(place) } else { Err(InstanceDefect::TooFar { lo, hi }) }
}

/// Whether the linear part that rays see is the caller's, to three digits.
fn is_faithful(exact: &[[f64; 4]; 3], given: &Affine) -> bool {
    exact.iter().zip(&given.0).all(|(exact, given)| {
        let largest = given[..3].iter().fold(0.0_f32, |size, x| size.max(x.abs()));
        let near = |(exact, given): (&f64, &f32)| {
            (exact - f64::from(*given)).abs() <= FIDELITY * f64::from(largest)
        };
        exact[..3].iter().zip(&given[..3]).all(near)
    })
}

/// The largest entry of the linear part.
fn largest(map: &[[f64; 4]; 3]) -> f64 {
    map.iter().flat_map(|row| &row[..3]).fold(0.0, |largest, entry| largest.max(entry.abs()))
}

fn is_near(bounds: &Aabb) -> bool {
    bounds.lo.iter().chain(&bounds.hi).all(|x| x.abs() <= COORDINATE_MAX)
}

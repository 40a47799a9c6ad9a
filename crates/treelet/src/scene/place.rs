//! Where instances are: checked, ranked, boxed, and widened as `trace::slack` derives.

use super::builder::{BuildOptions, Crowd, Invalid, Placed};
use super::report::BuildReport;
use super::{InstanceDefect, SceneError, travel};
use crate::bounds::Aabb;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::COORDINATE_MAX;
use crate::math::{Affine, affine};
use crate::memory;
use crate::trace::motion::Motion;
use crate::trace::placements::{BLOCK, Block, Instance, Instances};
use crate::trace::slack::{self, Near, Norms, Slack};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// How far an entry of the map that rays go through, inverted again, may be from the caller's,
/// relative to the largest of its row: a matrix for which f32 cannot do that is as good as singular.
const FIDELITY: f64 = 1.0 / 1024.0;

/// Maps may lengthen and shorten by this much: a ray of any common length then stays, seen from
/// inside, within the lengths at which rays are answered (`Ray::is_valid`).
pub(super) const SCALE_MAX: f64 = (1_u128 << 80) as f64;

/// The instances of a level, and what follows from where they are.
pub(super) struct Placements {
    /// In the caller's order; a skipped one keeps its number and has an empty box.
    pub(super) instances: Instances,
    /// Contains the level's meshes and the images of the reaches of all instances.
    pub(super) reach: Aabb,
    pub(super) slack: Slack,
    /// Instance paths, the level's own empty one included.
    pub(super) paths: u64,
}

/// A block of instances, as they are wanted.
pub(super) enum Part {
    /// As they stand.
    Kept(Arc<Block>),
    /// To be placed.
    New(Vec<Placed>),
}

/// Blocks of what is to be placed, each full but for the last.
pub(super) fn parts(placed: Crowd) -> Vec<Part> {
    placed.blocks.into_iter().map(Part::New).collect()
}

impl Placed {
    /// An instance as the caller gave it.
    pub(super) fn again(instance: &Instance) -> Self {
        let Instance { structure, world_from_object, mask, motion, .. } = instance;
        let (world_from_object, mask) = (*world_from_object, *mask);
        let steps = motion.as_ref().map(|motion| motion.path.maps().into());
        Self { structure: Arc::clone(structure), world_from_object, mask, steps }
    }
}

/// Places the instances of a level whose meshes lie in `meshes`. Blocks that stand stay what they
/// are where their numbers and what is near stay the same.
pub(super) fn place_instances(
    parts: Vec<Part>,
    meshes: Aabb,
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Placements, SceneError> {
    // Find where each one is; one that is nowhere is an error, or is skipped.
    let cancel = &options.context.cancel;
    let located = parallel::map(parts, |part| {
        cancel.check()?;
        Ok(match part {
            Part::Kept(block) => Located::Kept(block),
            Part::New(placed) => Located::new(placed),
        })
    });
    let located = located.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
    for (block, located) in located.iter().enumerate() {
        if let Located::New { defects, .. } = located {
            report_defects(block, defects, options, report)?;
        }
        report.empty_instances += located.block().empty;
    }

    // Only now is it known how large the level is, and so what rays are near.
    let blocks = || located.iter().map(Located::block);
    let reach = blocks().fold(meshes, |all, block| all.union(&block.reach));
    let limit = blocks().map(|block| block.limit).fold(f64::INFINITY, f64::min);
    let near = Near::of(&reach).at_most(limit);
    let mut paths = 1_u64;
    let mut ranked = Vec::with_capacity(located.len());
    for located in located {
        let rank = paths;
        paths = paths.checked_add(located.block().paths).ok_or(SceneError::TooManyPaths)?;
        ranked.push((located, rank));
    }

    // Widen their boxes for those.
    let widened = parallel::map(ranked, |(located, rank)| {
        cancel.check()?;
        Ok(located.widened(near, rank))
    });
    let mut blocks = memory::try_with_capacity(widened.len(), "blocks of instances")?;
    let mut far_share = 0.0_f64;
    for (index, widened) in widened.into_iter().enumerate() {
        let widened: Result<_, Cancelled> = widened;
        let (block, defects): (Arc<Block>, _) = widened?;
        report_defects(index, &defects, options, report)?;
        far_share = far_share.max(block.far_share);
        blocks.push(block);
    }
    let instances = Instances::new(blocks);
    Ok(Placements { instances, reach, slack: Slack::new(near, far_share), paths })
}

/// What is wrong with some instances of a block.
type Defects = Vec<(usize, InstanceDefect)>;

/// A block of instances that are where they are, their boxes not widened if they are new.
enum Located {
    Kept(Arc<Block>),
    New { block: Block, all_norms: Vec<Norms>, defects: Defects },
}

impl Located {
    fn new(placed: Vec<Placed>) -> Self {
        let mut block = Block {
            items: Vec::with_capacity(placed.len()),
            reach: Aabb::EMPTY,
            limit: f64::INFINITY,
            far_share: 0.0,
            paths: 0,
            repeats: false,
            empty: 0,
            layouts: 0,
            moves: false,
            near: Near::of(&Aabb::EMPTY),
        };
        let mut defects = Vec::new();
        let mut all_norms = Vec::with_capacity(placed.len());
        for (at, placed) in placed.into_iter().enumerate() {
            let located = match &placed.steps {
                None => locate(&placed),
                Some(steps) => travel::locate(&placed.structure, steps),
            };
            let Placed { structure, mut world_from_object, mask, steps } = placed;
            let place = located.unwrap_or_else(|defect| {
                defects.push((at, defect));
                // Whoever places it again must not take its first step for all of its way.
                if steps.is_some() {
                    world_from_object = Affine([[f32::NAN; 4]; 3]);
                }
                Place::NOWHERE
            });
            let Place { object_from_world, bounds, reach, norms, motion } = place;
            all_norms.push(norms);
            if !bounds.is_empty() {
                let limit = match &motion {
                    None => Near::limit(&structure.slack, &object_from_world),
                    Some(motion) => travel::limit(&structure.slack, motion),
                };
                block.limit = block.limit.min(limit);
            }
            block.reach = block.reach.union(&reach);
            block.paths = block.paths.saturating_add(structure.paths);
            block.repeats |= structure.repeats;
            block.empty += u64::from(structure.bounds.is_empty());
            block.layouts |= structure.layout.bit();
            block.moves |= structure.moves | motion.is_some();
            let columns = Instance::columns(&object_from_world);
            let (corners, rank) = (Instance::corners(&bounds), 0);
            block.items.push(Instance {
                columns,
                corners,
                structure,
                rank,
                mask,
                motion,
                world_from_object,
            });
        }
        Self::New { block, all_norms, defects }
    }

    fn block(&self) -> &Block {
        match self {
            Self::Kept(block) => block,
            Self::New { block, .. } => block,
        }
    }

    /// With boxes for what is near, and ranks from `rank` on; and what is wrong with that.
    fn widened(self, near: Near, rank: u64) -> (Arc<Block>, Defects) {
        let (mut block, all_norms) = match self {
            Self::New { block, all_norms, .. } => (block, all_norms),
            Self::Kept(block) if block.near == near && block.first_rank() == Some(rank) => {
                return (block, Vec::new());
            }
            Self::Kept(block) => match Self::new(block.items.iter().map(Placed::again).collect()) {
                Self::New { block, all_norms, .. } => (block, all_norms),
                Self::Kept(block) => return (block, Vec::new()),
            },
        };
        let mut defects = Vec::new();
        let mut next = rank;
        for (at, (instance, norms)) in block.items.iter_mut().zip(&all_norms).enumerate() {
            instance.rank = next;
            next = next.saturating_add(instance.structure.paths);
            let bounds = instance.bounds();
            if bounds.is_empty() {
                continue;
            }
            let (bounds, far_share) = if instance.motion.is_some() {
                travel::widen(instance, near)
            } else {
                let (by, far_share) = near.widening_of(&instance.structure.slack, *norms);
                (bounds.widened(by), far_share)
            };
            block.far_share = block.far_share.max(far_share);
            instance.set_bounds(&bounds);
            if !is_near(&bounds) {
                let Aabb { lo, hi } = bounds;
                defects.push((at, InstanceDefect::TooFar { lo, hi }));
                instance.set_bounds(&Aabb::EMPTY);
            }
        }
        block.near = near;
        (Arc::new(block), defects)
    }
}

/// Counts instances that cannot be used as nowhere, where the caller chose so.
fn report_defects(
    block: usize,
    defects: &Defects,
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<(), SceneError> {
    for &(at, defect) in defects {
        let instance = block * BLOCK + at;
        if options.invalid == Invalid::Error {
            return Err(SceneError::Instance { instance, defect });
        }
        report.skipped.instances += 1;
        let first = &mut report.skipped.first_instance;
        *first = first.or(Some((instance, defect)));
    }
    Ok(())
}

/// Where an instance is.
pub(super) struct Place {
    pub(super) object_from_world: Affine,
    pub(super) bounds: Aabb,
    pub(super) reach: Aabb,
    /// What [`Near::widening_of`] asks for where nothing moves.
    pub(super) norms: Norms,
    /// How it moves; the bounds are not widened yet.
    pub(super) motion: Option<Arc<Motion>>,
}

impl Place {
    pub(super) const NOWHERE: Self = Self {
        object_from_world: Affine::IDENTITY,
        bounds: Aabb::EMPTY,
        reach: Aabb::EMPTY,
        norms: [0.0; 4],
        motion: None,
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
        return Ok(Place { object_from_world, ..Place::NOWHERE });
    }
    let image = |bounds: &Aabb| {
        let (lo, hi) = affine::box_image(&exact, bounds.lo, bounds.hi);
        Aabb { lo, hi }
    };
    let inner = &placed.structure;
    let whole = image(&inner.reach);
    let bounds = match inner.cover.as_slice() {
        [only] if *only == inner.reach => whole,
        cover => cover.iter().map(image).fold(Aabb::EMPTY, |a, b| a.union(&b)),
    };
    let reach = whole.union(&bounds);
    let Aabb { lo, hi } = reach;
    let norms = slack::norms(&object_from_world, &exact);
    let place = Place { object_from_world, bounds, reach, norms, motion: None };
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

pub(super) fn is_near(bounds: &Aabb) -> bool {
    bounds.lo.iter().chain(&bounds.hi).all(|x| x.abs() <= COORDINATE_MAX)
}

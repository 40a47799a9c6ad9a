//! Where instances are: checked, ranked, boxed, and widened as `trace::slack` derives.

use super::builder::{BuildOptions, Crowd, Draft, Invalid, Placed};
use super::report::BuildReport;
use super::{InstanceDefect, SceneError, travel};
use crate::bounds::Aabb;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::COORDINATE_MAX;
use crate::math::Affine;
use crate::math::affine::larger;
use crate::memory;
use crate::trace::motion::Motion;
use crate::trace::placements::{BLOCK, Block, Instance, Instances};
use crate::trace::slack::{self, Near, Norms, Slack};
use crate::trace::structure::Structure;
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
    New(Draft),
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
    let new = parts.iter().filter(|part| matches!(part, Part::New(_))).count();
    let located = each(parts, new, |part| {
        cancel.check()?;
        Ok(match part {
            Part::Kept(block) => Located::Kept(block),
            Part::New(draft) => Located::new(draft),
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
    let stays = |(located, rank): &(Located, u64)| match located {
        Located::Kept(block) => block.stays(near, *rank),
        Located::New { .. } => false,
    };
    let new = ranked.iter().filter(|ranked| !stays(ranked)).count();
    let widened = each(ranked, new, |(located, rank)| {
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

/// `f` of each, side by side if there is work to share: to wake threads for blocks that stay takes longer than the blocks.
fn each<T: Send, R: Send>(items: Vec<T>, new: usize, f: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    if new > 1 { parallel::map(items, f) } else { items.into_iter().map(f).collect() }
}

/// What is wrong with some instances of a block.
type Defects = Vec<(usize, InstanceDefect)>;

/// A block of instances that are where they are, their boxes not widened if they are new.
enum Located {
    Kept(Arc<Block>),
    New { block: Block, all_norms: Vec<[f32; 4]>, defects: Defects },
}

impl Located {
    fn new(draft: Draft) -> Self {
        let Draft { mut items, steps } = draft;
        let mut block = Block {
            items: Vec::new(),
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
        let mut all_norms = Vec::with_capacity(items.len());
        let mut steps = steps.into_iter().peekable();
        for (at, instance) in items.iter_mut().enumerate() {
            let inner = &*instance.structure;
            let steps = steps.next_if(|(of, _)| *of == at);
            let moves = steps.is_some();
            let located = match steps {
                None => locate(inner, &instance.world_from_object),
                Some((_, steps)) => travel::locate(inner, &steps),
            };
            // Written twice, so that a place need not be moved to where the two ways meet.
            match located {
                Ok(place) => all_norms.push(block.put(instance, place)),
                Err(defect) => {
                    defects.push((at, defect));
                    // Whoever places it again must not take its first step for all of its way.
                    if moves {
                        instance.world_from_object = Affine([[f32::NAN; 4]; 3]);
                    }
                    all_norms.push(block.put(instance, Place::NOWHERE));
                }
            }
        }
        block.items = items;
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
            Self::Kept(block) if block.stays(near, rank) => return (block, Vec::new()),
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
                let norms = norms.map(f64::from);
                let (by, far_share) = near.widening_of(&instance.structure.slack, norms);
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

impl Block {
    /// Writes down where an instance of the block is; returns what its box is to be widened by.
    #[inline(always)]
    fn put(&mut self, instance: &mut Instance, place: Place) -> [f32; 4] {
        let Place { object_from_world, bounds, reach, norms, motion } = place;
        let inner = &*instance.structure;
        if !bounds.is_empty() {
            let limit = match &motion {
                None => Near::limit(&inner.slack, &object_from_world),
                Some(motion) => travel::limit(&inner.slack, motion),
            };
            self.limit = self.limit.min(limit);
        }
        self.reach = self.reach.union(&reach);
        self.paths = self.paths.saturating_add(inner.paths);
        self.repeats |= inner.repeats;
        self.empty += u64::from(inner.bounds.is_empty());
        self.layouts |= inner.layout.bit();
        self.moves |= inner.moves | motion.is_some();
        instance.columns = Instance::columns(&object_from_world);
        instance.corners = Instance::corners(&bounds);
        instance.motion = motion;
        slack::rounded(norms)
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

#[inline(always)]
fn locate(inner: &Structure, world_from_object: &Affine) -> Result<Place, InstanceDefect> {
    let rows = world_from_object.0;
    if !world_from_object.is_finite() {
        return Err(InstanceDefect::NotFinite { rows });
    }
    let singular = InstanceDefect::Singular { rows };
    let object_from_world = world_from_object.inverse().ok_or(singular)?;
    // Rays see the object through the rounded inverse, so its boxes are those of the inverse's
    // exact inverse.
    let exact = object_from_world.inverse_f64().ok_or(singular)?;
    if !is_faithful(&exact, world_from_object) {
        return Err(singular);
    }
    if is_extreme(&object_from_world, &exact) {
        return Err(InstanceDefect::Scale { rows });
    }
    if inner.bounds.is_empty() {
        return Ok(Place { object_from_world, ..Place::NOWHERE });
    }
    let (bounds, reach) = match boxes(inner, &exact) {
        Some(boxes) if is_near(&boxes.1) => boxes,
        _ => boxes_f64(inner, &exact),
    };
    if !is_near(&reach) {
        let Aabb { lo, hi } = reach;
        return Err(InstanceDefect::TooFar { lo, hi });
    }
    let norms = slack::norms(&object_from_world, &exact);
    Ok(Place { object_from_world, bounds, reach, norms, motion: None })
}

/// The boxes around what is inside, and around its reach; `None` where f32 cannot say.
#[inline(always)]
fn boxes(inner: &Structure, map: &[[f64; 4]; 3]) -> Option<(Aabb, Aabb)> {
    let whole = inner.reach_cover.image(map)?;
    let bounds = match inner.cover.boxes() {
        [only] if *only == inner.reach => whole,
        _ => inner.cover.image(map)?,
    };
    Some((bounds, whole.union(&bounds)))
}

/// The same in f64.
#[cold]
#[inline(never)]
fn boxes_f64(inner: &Structure, map: &[[f64; 4]; 3]) -> (Aabb, Aabb) {
    let bounds = inner.cover.image_f64(map);
    (bounds, inner.reach_cover.image_f64(map).union(&bounds))
}

/// Whether the linear part that rays see is the caller's, to three digits.
fn is_faithful(exact: &[[f64; 4]; 3], given: &Affine) -> bool {
    let mut faithful = true;
    for (&[a, b, c, _], &[x, y, z, _]) in exact.iter().zip(&given.0) {
        let largest = larger(larger(f64::from(x.abs()), f64::from(y.abs())), f64::from(z.abs()));
        let near = |exact: f64, given: f32| (exact - f64::from(given)).abs() <= FIDELITY * largest;
        faithful &= near(a, x) & near(b, y) & near(c, z);
    }
    faithful
}

/// Whether one of the linear parts has an entry beyond [`SCALE_MAX`].
#[inline(always)]
fn is_extreme(there: &Affine, back: &[[f64; 4]; 3]) -> bool {
    let mut extreme = false;
    for (&[a, b, c, _], &[x, y, z, _]) in there.0.iter().zip(back) {
        let there = |entry: f32| f64::from(entry.abs()) > SCALE_MAX;
        let back = |entry: f64| entry.abs() > SCALE_MAX;
        extreme |= there(a) | there(b) | there(c) | back(x) | back(y) | back(z);
    }
    extreme
}

pub(super) fn is_near(bounds: &Aabb) -> bool {
    let near = |x: f32| x.abs() <= COORDINATE_MAX;
    let (lo, hi) = (bounds.lo, bounds.hi);
    near(lo[0]) & near(lo[1]) & near(lo[2]) & near(hi[0]) & near(hi[1]) & near(hi[2])
}

#[cfg(test)]
mod tests {
    use crate::math::Affine;
    use crate::scene::BuildOptions;
    use crate::trace::placements::BLOCK;
    use crate::{Mesh, Scene};
    use alloc::sync::Arc;

    /// An instance that goes a little beyond all others leaves the blocks that it is not in to be shared; one that goes
    /// far away does not.
    #[test]
    fn blocks_are_shared_where_one_moves_at_the_rim() {
        let mesh = Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
        let options = BuildOptions::default();
        let object = Scene::builder().mesh(mesh).build(&options).unwrap();
        let at = |x: usize| Affine::translation([x as f32, 0.0, 0.0]);
        let level =
            (0..2 * BLOCK).fold(Scene::builder(), |level, x| level.instance(&object, at(x)));
        let scene = level.build(&options).unwrap();
        for (x, shared) in [(2 * BLOCK + 3, true), (8 * BLOCK, false)] {
            let mut edit = scene.edit();
            edit.set_transform(2 * BLOCK - 1, at(x)).unwrap();
            let after = edit.commit(&options).unwrap().scene;
            let [before, after] = [&scene, &after].map(|it| &it.structure.instances.blocks);
            assert_eq!(Arc::ptr_eq(&before[0], &after[0]), shared, "{x}");
            assert!(!Arc::ptr_eq(&before[1], &after[1]));
        }
    }
}

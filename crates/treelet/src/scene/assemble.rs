//! From meshes and instances to a level that can be walked: check, box, build, lower, pack.

use super::builder::{BuildOptions, Invalid, Placed, SceneBuilder};
use super::report::{BuildReport, Skipped};
use super::{InstanceDefect, Scene, SceneError};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::clock::Stopwatch;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::{COORDINATE_MAX, Defect, Mesh};
use crate::geometry::triangle;
use crate::layout::binary::{self, Lowered, Node2};
use crate::math::affine;
use crate::memory;
use crate::trace::slack::Slack;
use crate::trace::structure::{Geometry, Instance, PackedTriangle, Structure};
use crate::tree::{Kind, PRIMS_MAX, Tree};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Triangles are checked, boxed and packed this many at a time.
const CHUNK: usize = 16_384;

/// The most boxes that stand for a level when it is transformed.
const COVER_MAX: usize = 32;

/// Builds the scene.
pub(super) fn assemble(
    description: SceneBuilder,
    options: &BuildOptions<'_>,
) -> Result<Scene, SceneError> {
    let total = Stopwatch::start();
    let mut report = BuildReport { builder: options.builder.info().name, ..Default::default() };

    // Check and box what the leaves will hold: triangles first, then instances.
    let mut prims = Prims::default();
    for (geom, (mesh, _)) in description.meshes.iter().enumerate() {
        add_triangles(geom, mesh, options, &mut prims, &mut report)?;
    }
    let triangles = prims.names.len();
    let instances = place_instances(description.instances, options, &mut report)?;
    let placed = instances.iter().zip(0..).filter(|(instance, _)| !instance.bounds.is_empty());
    for (instance, index) in placed {
        prims.bounds.push(instance.bounds);
        prims.instances.push(index);
    }

    // Build the tree and pack it.
    let tree_time = Stopwatch::start();
    let tree = options.builder.build(&prims.bounds, &options.context)?;
    report.tree_time = tree_time.elapsed();
    report.tree = tree.measure(&options.context.cancel)?;
    report.triangles = triangles as u64;
    report.instances = prims.instances.len() as u64;
    let lowered = binary::lower(&tree, &prims.bounds, triangles, &options.context.cancel)?;
    let structure = finish(description.meshes, instances, &prims, &tree, lowered, options)?;
    report.trace_bytes = level_bytes(&structure);
    report.total_time = total.elapsed();
    Ok(Scene { structure: Arc::new(structure), report: Arc::new(report) })
}

/// What the tree is built over.
#[derive(Default)]
struct Prims {
    bounds: Vec<Aabb>,
    /// `(geom, prim)` of the triangles.
    names: Vec<(u32, u32)>,
    /// Indices of the instances, whose boxes come after those of the triangles.
    instances: Vec<u32>,
}

/// What checking a chunk of triangles found.
#[derive(Default)]
struct Checked {
    bounds: Vec<Aabb>,
    prims: Vec<u32>,
    degenerate: u64,
    skipped: Skipped,
}

fn add_triangles(
    geom: usize,
    mesh: &Mesh,
    options: &BuildOptions<'_>,
    prims: &mut Prims,
    report: &mut BuildReport,
) -> Result<(), SceneError> {
    let count = mesh.triangles().len();
    let all = prims.names.len() + count;
    if all > PRIMS_MAX {
        return Err(BuildError::TooManyPrims { prims: all as u64 }.into());
    }
    reserve(&mut prims.bounds, count, "primitive boxes")?;
    reserve(&mut prims.names, count, "primitive names")?;
    let chunks = parallel::map_chunks(mesh.triangles(), CHUNK, |first, triangles| {
        options.context.cancel.check()?;
        Ok(check(geom, mesh, first..first + triangles.len()))
    });
    for chunk in chunks {
        let chunk: Result<Checked, Cancelled> = chunk;
        let chunk = chunk?;
        if let (Invalid::Error, Some((geom, prim, defect))) =
            (options.invalid, chunk.skipped.first_triangle)
        {
            return Err(SceneError::Triangle { geom, prim, defect });
        }
        prims.bounds.extend(chunk.bounds);
        prims.names.extend(chunk.prims.into_iter().map(|prim| (geom as u32, prim)));
        report.degenerate += chunk.degenerate;
        let skipped = &mut report.skipped;
        skipped.triangles += chunk.skipped.triangles;
        skipped.index_out_of_range += chunk.skipped.index_out_of_range;
        skipped.bad_vertex += chunk.skipped.bad_vertex;
        skipped.first_triangle = skipped.first_triangle.or(chunk.skipped.first_triangle);
    }
    Ok(())
}

fn reserve<T>(items: &mut Vec<T>, more: usize, what: &'static str) -> Result<(), SceneError> {
    let bytes = (more as u64).saturating_mul(size_of::<T>() as u64);
    items.try_reserve(more).map_err(|_| memory::OutOfMemory { bytes, what })?;
    Ok(())
}

fn check(geom: usize, mesh: &Mesh, range: core::ops::Range<usize>) -> Checked {
    let mut out = Checked::default();
    for prim in range {
        match mesh.defect(prim) {
            None => {
                // Without a defect the corners exist.
                let Some(corners) = mesh.corners(prim) else { continue };
                out.degenerate += u64::from(triangle::is_degenerate(&corners));
                out.bounds.push(Aabb::of_points(&corners));
                out.prims.push(prim as u32);
            }
            Some(defect) => {
                out.skipped.triangles += 1;
                match defect {
                    Defect::IndexOutOfRange { .. } => out.skipped.index_out_of_range += 1,
                    Defect::BadVertex { .. } => out.skipped.bad_vertex += 1,
                }
                let first = &mut out.skipped.first_triangle;
                *first = first.or(Some((geom, prim, defect)));
            }
        }
    }
    out
}

/// Checks, ranks and boxes the instances. A skipped one keeps its number and an empty box.
fn place_instances(
    placed: Vec<Placed>,
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Vec<Instance>, SceneError> {
    let located = parallel::map(placed, |placed| {
        options.context.cancel.check()?;
        let place = locate(&placed);
        Ok((placed, place))
    });
    let mut instances = memory::try_with_capacity(located.len(), "instances")?;
    let mut rank = 1_u64;
    for (index, placed) in located.into_iter().enumerate() {
        let placed: Result<_, Cancelled> = placed;
        let (Placed { structure, world_from_object, mask }, place) = placed?;
        let place = match (place, options.invalid) {
            (Ok(place), _) => place,
            (Err(defect), Invalid::Error) => {
                return Err(SceneError::Instance { instance: index, defect });
            }
            (Err(defect), Invalid::Skip) => {
                report.skipped.instances += 1;
                let first = &mut report.skipped.first_instance;
                *first = first.or(Some((index, defect)));
                Place::NOWHERE
            }
        };
        report.empty_instances += u64::from(structure.layout.bounds.is_empty());
        let paths = structure.paths;
        let Place { object_from_world, bounds, reach } = place;
        instances.push(Instance {
            structure,
            world_from_object,
            object_from_world,
            bounds,
            reach,
            rank,
            mask,
        });
        rank = rank.checked_add(paths).ok_or(SceneError::TooManyPaths)?;
    }
    Ok(instances)
}

/// Where an instance is.
struct Place {
    object_from_world: affine::Affine,
    bounds: Aabb,
    reach: Aabb,
}

impl Place {
    const NOWHERE: Self = Self {
        object_from_world: affine::Affine::IDENTITY,
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
    let image = |bounds: &Aabb| {
        let (lo, hi) = affine::box_image(&exact, bounds.lo, bounds.hi);
        Aabb { lo, hi }
    };
    if placed.structure.layout.bounds.is_empty() {
        return Ok(Place { object_from_world, ..Place::NOWHERE });
    }
    let bounds = placed.structure.cover.iter().map(image).fold(Aabb::EMPTY, |a, b| a.union(&b));
    let reach = image(&placed.structure.reach).union(&bounds);
    let near = reach.lo.iter().chain(&reach.hi).all(|x| x.abs() <= COORDINATE_MAX);
    let Aabb { lo, hi } = reach;
    if near {
        Ok(Place { object_from_world, bounds, reach })
    } else {
        Err(InstanceDefect::TooFar { lo, hi })
    }
}

/// Packs the leaves' contents and derives what walks need to know about the level.
fn finish(
    meshes: Vec<(Mesh, u32)>,
    instances: Vec<Instance>,
    prims: &Prims,
    tree: &Tree,
    lowered: Lowered,
    options: &BuildOptions<'_>,
) -> Result<Structure, SceneError> {
    let triangles = pack(&meshes, prims, &lowered.triangles, options)?;
    let leaf_instances = lowered.instances.iter().map(|&at| prims.instances[at as usize]).collect();

    let bounds = tree.bounds();
    let reach = instances.iter().fold(bounds, |reach, instance| reach.union(&instance.reach));
    let mut slack = Slack::TRIANGLES;
    for instance in instances.iter().filter(|instance| !instance.bounds.is_empty()) {
        // `locate` found it regular.
        let Some(exact) = instance.object_from_world.inverse_f64() else { continue };
        let inner = instance.structure.slack;
        let coordinate_max = f64::from(reach.max_abs());
        slack = slack.max(&inner.through(&instance.object_from_world, &exact, coordinate_max));
    }
    let last = instances.last().map_or(Some(1), |last| last.rank.checked_add(last.structure.paths));
    Ok(Structure {
        geometries: meshes.into_iter().map(|(mesh, mask)| Geometry { mesh, mask }).collect(),
        instances,
        layout: lowered.layout,
        triangles,
        leaf_instances,
        cover: cover(tree),
        reach,
        slack,
        slack_f32: slack.rounded(),
        paths: last.ok_or(SceneError::TooManyPaths)?,
    })
}

fn pack(
    meshes: &[(Mesh, u32)],
    prims: &Prims,
    order: &[u32],
    options: &BuildOptions<'_>,
) -> Result<Vec<PackedTriangle>, SceneError> {
    let empty = PackedTriangle { corners: [[0.0; 3]; 3], geom: 0, prim: 0 };
    let mut triangles = memory::try_filled(empty, order.len(), "packed triangles")?;
    parallel::zip_chunks_mut(order, &mut triangles, CHUNK, |order, out| {
        if options.context.cancel.is_cancelled() {
            return;
        }
        for (&at, out) in order.iter().zip(out) {
            let (geom, prim) = prims.names[at as usize];
            // Only triangles without a defect have a name here.
            if let Some(corners) = meshes[geom as usize].0.corners(prim as usize) {
                *out = PackedTriangle { corners, geom, prim };
            }
        }
    });
    options.context.cancel.check()?;
    Ok(triangles)
}

/// A few boxes of the tree that together contain everything: the largest is opened, again and
/// again.
fn cover(tree: &Tree) -> Vec<Aabb> {
    let mut cut = Vec::with_capacity(COVER_MAX + 1);
    if !tree.nodes.is_empty() {
        cut.push(0);
    }
    while cut.len() < COVER_MAX {
        let inner =
            cut.iter().enumerate().filter_map(|(at, &node)| match tree.nodes[node].kind() {
                Kind::Inner { left } => Some((at, left, tree.nodes[node].bounds.half_area())),
                Kind::Leaf { .. } => None,
            });
        let Some((at, left, _)) = inner.max_by(|a, b| a.2.total_cmp(&b.2)) else { break };
        cut[at] = left;
        cut.push(left + 1);
    }
    cut.into_iter().map(|node: usize| tree.nodes[node].bounds).collect()
}

/// Bytes that walks read on one level.
pub(super) fn level_bytes(level: &Structure) -> u64 {
    let bytes = size_of::<Node2>() * level.layout.nodes.len()
        + size_of::<PackedTriangle>() * level.triangles.len()
        + size_of::<Instance>() * level.instances.len()
        + size_of::<u32>() * level.leaf_instances.len();
    bytes as u64
}

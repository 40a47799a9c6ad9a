//! From meshes and instances to a level that can be walked: gather, build, lower, pack.

use super::builder::{BuildOptions, SceneBuilder};
use super::gather::{Prims, add_triangles};
use super::place::{Placements, place_instances};
use super::report::BuildReport;
use super::{Scene, SceneError};
use crate::bounds::Aabb;
use crate::context::clock::Stopwatch;
use crate::context::parallel;
use crate::geometry::Mesh;
use crate::layout::binary::{self, Lowered, Node2};
use crate::memory;
use crate::trace::structure::{Geometry, Instance, PackedTriangle, Structure};
use crate::tree::{Kind, Tree};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Triangles are packed this many at a time.
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
    let meshes = prims.meshes;
    let placements = place_instances(description.instances, meshes, options, &mut report)?;
    let placed =
        placements.instances.iter().zip(0..).filter(|(instance, _)| !instance.bounds.is_empty());
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
    let structure = finish(description.meshes, placements, &prims, &tree, lowered, options)?;
    report.trace_bytes = level_bytes(&structure);
    report.total_time = total.elapsed();
    Ok(Scene { structure: Arc::new(structure), report: Arc::new(report) })
}

/// Packs the leaves' contents and derives what walks need to know about the level.
fn finish(
    meshes: Vec<(Mesh, u32)>,
    placements: Placements,
    prims: &Prims,
    tree: &Tree,
    lowered: Lowered,
    options: &BuildOptions<'_>,
) -> Result<Structure, SceneError> {
    let triangles = pack(&meshes, prims, &lowered.triangles, options)?;
    let leaf_instances = lowered.instances.iter().map(|&at| prims.instances[at as usize]).collect();

    let Placements { instances, reach, slack, paths } = placements;
    Ok(Structure {
        geometries: meshes.into_iter().map(|(mesh, mask)| Geometry { mesh, mask }).collect(),
        instances,
        layout: lowered.layout,
        triangles,
        leaf_instances,
        cover: cover(tree),
        reach,
        slack,
        paths,
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

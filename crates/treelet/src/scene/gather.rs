//! From meshes to boxes: every triangle is checked, boxed and named.

use super::SceneError;
use super::builder::{BuildOptions, Invalid};
use super::report::{BuildReport, Skipped};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::{Defect, Mesh};
use crate::geometry::triangle;
use crate::memory;
use crate::tree::PRIMS_MAX;
use alloc::vec::Vec;

/// Triangles are checked and boxed this many at a time.
const CHUNK: usize = 16_384;

/// What the tree is built over.
pub(super) struct Prims {
    /// Around all triangles.
    pub(super) meshes: Aabb,
    /// Of the triangles, then of the instances.
    pub(super) bounds: Vec<Aabb>,
    /// `(geom, prim)` of the triangles.
    pub(super) names: Vec<(u32, u32)>,
    /// Indices of the instances, whose boxes come after those of the triangles.
    pub(super) instances: Vec<u32>,
}

impl Default for Prims {
    fn default() -> Self {
        Self { meshes: Aabb::EMPTY, bounds: Vec::new(), names: Vec::new(), instances: Vec::new() }
    }
}

/// What checking a chunk of triangles found.
#[derive(Default)]
struct Checked {
    bounds: Vec<Aabb>,
    prims: Vec<u32>,
    degenerate: u64,
    skipped: Skipped,
}

/// Checks and boxes the triangles of a mesh, and adds them to what the tree is built over.
pub(super) fn add_triangles(
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
    memory::try_reserve(&mut prims.bounds, count, "primitive boxes")?;
    memory::try_reserve(&mut prims.names, count, "primitive names")?;
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
        prims.meshes = chunk.bounds.iter().fold(prims.meshes, |all, bounds| all.union(bounds));
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

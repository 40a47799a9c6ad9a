//! From meshes to boxes: every triangle is checked, boxed and named.
//!
//! Boxes and names are written where they stay; only where a triangle was skipped does what comes
//! after it move up. About 40 instructions a triangle for checking, as many for the box and 20 for
//! asking whether it is degenerate, which exact predicates decide for slivers only.

use super::SceneError;
use super::builder::{BuildOptions, Invalid};
use super::report::{BuildReport, Skipped};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::{COORDINATE_MAX, Defect, Mesh};
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
struct Checked {
    /// How many are kept; they are at the front of the chunk's part of the arrays.
    kept: usize,
    /// Around those.
    bounds: Aabb,
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
    let triangles = mesh.triangles();
    let (before, count) = (prims.names.len(), triangles.len());
    let all = before + count;
    if all > PRIMS_MAX {
        return Err(BuildError::TooManyPrims { prims: all as u64 }.into());
    }
    memory::try_reserve(&mut prims.bounds, count, "primitive boxes")?;
    memory::try_reserve(&mut prims.names, count, "primitive names")?;
    let cancel = &options.context.cancel;
    while prims.names.len() < all {
        cancel.check()?;
        let more = all.min(prims.names.len() + CHUNK);
        prims.bounds.resize(more, Aabb::EMPTY);
        prims.names.resize(more, (0, 0));
    }

    let bounds = prims.bounds[before..].chunks_mut(CHUNK);
    let chunks: Vec<_> =
        bounds.zip(prims.names[before..].chunks_mut(CHUNK)).zip(triangles.chunks(CHUNK)).collect();
    let chunks = chunks.into_iter().enumerate().collect();
    let checked = parallel::map(chunks, |(chunk, ((bounds, names), triangles))| {
        cancel.check()?;
        let first = (geom, chunk * CHUNK);
        Ok(check(mesh, first, triangles, bounds, names))
    });

    // Move up what comes after a skipped triangle.
    let mut end = before;
    for (chunk, checked) in checked.into_iter().enumerate() {
        let checked: Result<Checked, Cancelled> = checked;
        let Checked { kept, bounds, degenerate, skipped } = checked?;
        if let (Invalid::Error, Some((geom, prim, defect))) =
            (options.invalid, skipped.first_triangle)
        {
            return Err(SceneError::Triangle { geom, prim, defect });
        }
        let begin = before + chunk * CHUNK;
        if end < begin {
            prims.bounds.copy_within(begin..begin + kept, end);
            prims.names.copy_within(begin..begin + kept, end);
        }
        end += kept;
        prims.meshes = prims.meshes.union(&bounds);
        report.degenerate += degenerate;
        let sum = &mut report.skipped;
        sum.triangles += skipped.triangles;
        sum.index_out_of_range += skipped.index_out_of_range;
        sum.bad_vertex += skipped.bad_vertex;
        sum.first_triangle = sum.first_triangle.or(skipped.first_triangle);
    }
    prims.bounds.truncate(end);
    prims.names.truncate(end);
    Ok(())
}

/// Boxes and names the sound ones of some triangles, of which `first` is the first.
fn check(
    mesh: &Mesh,
    (geom, first): (usize, usize),
    triangles: &[[u32; 3]],
    bounds: &mut [Aabb],
    names: &mut [(u32, u32)],
) -> Checked {
    let positions = mesh.positions();
    let corners = |[a, b, c]: [u32; 3]| {
        let corner = |index: u32| positions.get(index as usize);
        Some([*corner(a)?, *corner(b)?, *corner(c)?])
    };
    let mut all =
        Checked { kept: 0, bounds: Aabb::EMPTY, degenerate: 0, skipped: Skipped::default() };
    for (&triangle, prim) in triangles.iter().zip(first..) {
        let Some(corners) = corners(triangle).filter(are_near) else {
            // One of the two is wrong: find out which, the slow way.
            if let Some(defect) = mesh.defect(prim) {
                skip(&mut all.skipped, (geom, prim), defect);
            }
            continue;
        };
        let around = Aabb::of_points(&corners);
        all.bounds = all.bounds.union(&around);
        if !surely_has_area(&corners) {
            all.degenerate += u64::from(triangle::is_degenerate(&corners));
        }
        bounds[all.kept] = around;
        names[all.kept] = (geom as u32, prim as u32);
        all.kept += 1;
    }
    all
}

/// Whether f32 can tell that a triangle is not degenerate: no branch before the last, and enough for
/// all but slivers.
///
/// Each of the three components below is off by at most `4.1 u` times the sum of the magnitudes of
/// its products, with `u = 2^-24`, and by `2^-149` where they underflow.
#[inline(always)]
fn surely_has_area([a, b, c]: &[[f32; 3]; 3]) -> bool {
    const RELATIVE: f32 = 1.0 / 1_048_576.0;
    const ABSOLUTE: f32 = f32::MIN_POSITIVE;
    let sure = |i: usize, j: usize| {
        let (p, q) = ((b[i] - a[i]) * (c[j] - a[j]), (b[j] - a[j]) * (c[i] - a[i]));
        (p - q).abs() > RELATIVE * (p.abs() + q.abs()) + ABSOLUTE
    };
    sure(0, 1) | sure(1, 2) | sure(2, 0)
}

/// Whether no coordinate is NaN or too large. No branch before the last.
#[inline(always)]
fn are_near([a, b, c]: &[[f32; 3]; 3]) -> bool {
    let near = |p: &[f32; 3]| {
        (p[0].abs() <= COORDINATE_MAX)
            & (p[1].abs() <= COORDINATE_MAX)
            & (p[2].abs() <= COORDINATE_MAX)
    };
    near(a) & near(b) & near(c)
}

#[cold]
fn skip(skipped: &mut Skipped, (geom, prim): (usize, usize), defect: Defect) {
    skipped.triangles += 1;
    match defect {
        Defect::IndexOutOfRange { .. } => skipped.index_out_of_range += 1,
        Defect::BadVertex { .. } => skipped.bad_vertex += 1,
    }
    skipped.first_triangle = skipped.first_triangle.or(Some((geom, prim, defect)));
}

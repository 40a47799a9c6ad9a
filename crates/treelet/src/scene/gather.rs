//! From geometries to boxes: every primitive is checked, boxed and named.
//!
//! Boxes are written where they stay; only where a triangle was skipped does what comes after it move
//! up. Names are written down only where they are not the numbers themselves. All in four lanes (coordinate by
//! coordinate it took twice the instructions); whether a triangle is degenerate exact predicates decide for
//! slivers only.

use super::SceneError;
use super::builder::{BuildOptions, Invalid};
use super::report::{BuildReport, Skipped};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancelled, parallel};
use crate::geometry::mesh::{COORDINATE_MAX, Defect, Mesh};
use crate::geometry::triangle;
use crate::memory::{self, Pages};
use crate::simd::f4::F4;
use crate::trace::placements::{BLOCK, Block};
use crate::trace::structure::Geometry;
use crate::tree::PRIMS_MAX;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Triangles are checked and boxed this many at a time.
const CHUNK: usize = 16_384;

/// What the tree is built over.
pub(super) struct Prims {
    /// Around all triangles, and all primitives of other kinds.
    pub(super) around: Aabb,
    /// How many triangles.
    pub(super) triangles: usize,
    pub(super) names: Names,
    /// What is alone in its leaf, by the numbers that leaves call it; boxes come after those of the triangles.
    pub(super) singles: Vec<u32>,
    /// Room for the boxes of the triangles, then of the singles.
    bounds: Pages<Aabb>,
}

/// `(geom, prim)` of the triangles.
pub(super) enum Names {
    /// All triangles of one mesh.
    Whole {
        /// Which mesh.
        geom: u32,
    },
    /// One after the other.
    Listed(Vec<(u32, u32)>),
}

impl Names {
    /// Of a triangle, by its number among the boxes.
    #[inline(always)]
    pub(super) fn of(&self, at: u32) -> (u32, u32) {
        match self {
            Self::Whole { geom } => (*geom, at),
            Self::Listed(names) => names.get(at as usize).copied().unwrap_or_default(),
        }
    }

    /// The names of the first `count` as a list, which has room for `all`.
    fn into_list(self, count: usize, all: usize) -> Result<Vec<(u32, u32)>, BuildError> {
        match self {
            Self::Whole { geom } => {
                let mut names = memory::try_with_capacity(all, "primitive names")?;
                names.extend((0..count as u32).map(|prim| (geom, prim)));
                Ok(names)
            }
            Self::Listed(mut names) => {
                memory::try_reserve(&mut names, all - count, "primitive names")?;
                Ok(names)
            }
        }
    }
}

impl Prims {
    /// Room for as many triangles, and primitives of other kinds and instances.
    pub(super) fn with_room(triangles: usize, singles: usize) -> Result<Self, BuildError> {
        let all = triangles.saturating_add(singles);
        if all > PRIMS_MAX {
            return Err(BuildError::TooManyPrims { prims: all as u64 });
        }
        Ok(Self {
            around: Aabb::EMPTY,
            triangles: 0,
            names: Names::Whole { geom: 0 },
            singles: memory::try_with_capacity(singles, "numbers of instances")?,
            bounds: Pages::zeroed(all, "primitive boxes")?,
        })
    }

    /// Of the triangles, then of the singles.
    pub(super) fn bounds(&self) -> &[Aabb] {
        self.bounds.get(..self.triangles + self.singles.len()).unwrap_or_default()
    }

    /// Lets the boxes go.
    pub(super) fn forget_bounds(&mut self) {
        self.bounds = Pages::default();
    }

    /// Adds all instances of these blocks, if none of them is nowhere; otherwise none, and says so.
    pub(super) fn add_blocks(&mut self, blocks: &[Arc<Block>]) -> bool {
        let count = blocks.iter().map(|block| block.items.len()).sum::<usize>();
        let Some(bounds) = self.bounds.get_mut(self.triangles..self.triangles + count) else {
            return false;
        };
        let jobs: Vec<_> = blocks.iter().zip(bounds.chunks_mut(BLOCK)).collect();
        let whole = parallel::map(jobs, |(block, bounds)| {
            for (instance, bounds) in block.items.iter().zip(&mut *bounds) {
                *bounds = instance.bounds();
            }
            bounds.iter().all(|bounds| !bounds.is_empty())
        });
        let all = whole.iter().all(|&whole| whole) && self.singles.is_empty();
        if all {
            self.singles = (0..count as u32).collect();
        }
        all
    }

    /// Adds what is alone in its leaf; numbers rise, and triangles must not follow.
    pub(super) fn add_single(&mut self, number: u32, bounds: Aabb) {
        self.bounds[self.triangles + self.singles.len()] = bounds;
        self.singles.push(number);
    }
}

/// What checking a chunk of triangles found.
struct Checked {
    /// How many are kept; their boxes are at the front of the chunk's part of the array.
    kept: usize,
    /// Which, if not all are.
    which: Vec<u32>,
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
    let (before, count) = (prims.triangles, triangles.len());
    if count == 0 {
        return Ok(());
    }
    let cancel = &options.context.cancel;
    let room = &mut prims.bounds[before..before + count];
    let chunks = room.chunks_mut(CHUNK).zip(triangles.chunks(CHUNK)).enumerate().collect();
    let checked = parallel::map(chunks, |(chunk, (bounds, triangles))| {
        cancel.check()?;
        let first = (geom, chunk * CHUNK);
        Ok(check(mesh, first, triangles, bounds))
    });
    let checked = checked.into_iter().collect::<Result<Vec<Checked>, Cancelled>>()?;

    // Name the triangles, if they are not all of one mesh.
    let all_kept = checked.iter().map(|chunk| chunk.kept).sum::<usize>() == count;
    if before == 0 && all_kept {
        prims.names = Names::Whole { geom: geom as u32 };
    } else {
        let nothing = Names::Listed(Vec::new());
        let names = core::mem::replace(&mut prims.names, nothing);
        let mut names = names.into_list(before, before + count)?;
        for (chunk, checked) in checked.iter().enumerate() {
            cancel.check()?;
            let first = (chunk * CHUNK) as u32;
            if checked.which.is_empty() {
                names.extend((first..).take(checked.kept).map(|prim| (geom as u32, prim)));
            } else {
                names.extend(checked.which.iter().map(|&prim| (geom as u32, prim)));
            }
        }
        prims.names = Names::Listed(names);
    }

    // Move up the boxes that come after a skipped triangle.
    let mut end = before;
    for (chunk, Checked { kept, bounds, degenerate, skipped, .. }) in
        checked.into_iter().enumerate()
    {
        tell(report, degenerate, skipped, options)?;
        let begin = before + chunk * CHUNK;
        if end < begin {
            prims.bounds.copy_within(begin..begin + kept, end);
        }
        end += kept;
        prims.around = prims.around.union(&bounds);
    }
    prims.triangles = end;
    Ok(())
}

/// Ids and boxes of the sound primitives of all geometries that are no meshes.
pub(super) fn other_boxes(
    geometries: &[Geometry],
    first_ids: &[u32],
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Vec<(u32, Aabb)>, SceneError> {
    let mut all = Vec::new();
    for (geom, (Geometry { shape, .. }, &first_id)) in geometries.iter().zip(first_ids).enumerate()
    {
        if shape.mesh().is_some() {
            continue;
        }
        let chunks = (0..shape.len()).step_by(CHUNK).collect();
        let boxed = parallel::map(chunks, |first: usize| {
            options.context.cancel.check()?;
            let prims = first..shape.len().min(first + CHUNK);
            Ok(prims.map(|prim| (shape.bounds(prim), shape.defect(prim))).collect::<Vec<_>>())
        });
        memory::try_reserve(&mut all, shape.len(), "boxes of primitives")?;
        let boxed = boxed.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
        for (prim, (bounds, defect)) in boxed.into_iter().flatten().enumerate() {
            let Some(defect) = defect else {
                all.push((first_id + prim as u32, bounds));
                continue;
            };
            if options.invalid == Invalid::Error {
                let kind = shape.kind();
                return Err(SceneError::Primitive { geom, kind, prim, defect });
            }
            let Skipped { others, first_other, .. } = &mut report.skipped;
            *others += 1;
            *first_other = first_other.or(Some((geom, prim, defect)));
        }
    }
    report.others = all.len() as u64;
    Ok(all)
}

/// For each geometry, the id of its first primitive.
pub(super) fn first_ids(geometries: &[Geometry]) -> Result<Vec<u32>, BuildError> {
    let mut id = 0_u32;
    let mut next = |geometry: &Geometry| {
        let (first, count) = (id, geometry.shape.len());
        let end = u32::try_from(count).ok().and_then(|count| first.checked_add(count));
        id = end.ok_or(BuildError::TooManyPrims { prims: u64::from(first) + count as u64 })?;
        Ok(first)
    };
    geometries.iter().map(&mut next).collect()
}

/// Boxes the sound ones of some triangles, of which `first` is the first.
fn check(
    mesh: &Mesh,
    (geom, first): (usize, usize),
    triangles: &[[u32; 3]],
    bounds: &mut [Aabb],
) -> Checked {
    let positions = mesh.positions();
    let corners = |[a, b, c]: [u32; 3]| {
        let corner = |index: u32| positions.get(index as usize);
        Some([*corner(a)?, *corner(b)?, *corner(c)?])
    };
    let mut all = Checked {
        kept: 0,
        which: Vec::new(),
        bounds: Aabb::EMPTY,
        degenerate: 0,
        skipped: Skipped::default(),
    };
    let (mut low, mut high) = (F4::splat(f32::INFINITY), F4::splat(f32::NEG_INFINITY));
    for (&triangle, prim) in triangles.iter().zip(first..) {
        let found = corners(triangle);
        let lanes = found.as_ref().map(in_lanes).filter(are_near);
        let (Some(corners), Some(lanes)) = (found, lanes) else {
            // One of the two is wrong: find out which, the slow way.
            if let Some(defect) = mesh.defect(prim) {
                if all.skipped.triangles == 0 {
                    all.which.extend(first as u32..prim as u32);
                }
                skip(&mut all.skipped, (geom, prim), defect);
            }
            continue;
        };
        if all.skipped.triangles > 0 {
            all.which.push(prim as u32);
        }
        let [a, b, c] = lanes;
        let (lo, hi) = (c.min(b.min(a)), c.max(b.max(a)));
        (low, high) = (lo.min(low), hi.max(high));
        if !surely_has_area(&lanes) {
            all.degenerate += u64::from(triangle::is_degenerate(&corners));
        }
        bounds[all.kept] = aabb(lo, hi);
        all.kept += 1;
    }
    all.bounds = aabb(low, high);
    all
}

/// The corners of a triangle; the fourth lane of each means nothing.
#[inline(always)]
fn in_lanes(corners: &[[f32; 3]; 3]) -> [F4; 3] {
    let corner = |[x, y, z]: [f32; 3]| F4::new(x, y, z, z);
    [corner(corners[0]), corner(corners[1]), corner(corners[2])]
}

/// The box from one corner to another.
#[inline(always)]
fn aabb(lo: F4, hi: F4) -> Aabb {
    let ([x, y, z, _], [far_x, far_y, far_z, _]) = (lo.to_array(), hi.to_array());
    Aabb { lo: [x, y, z], hi: [far_x, far_y, far_z] }
}

/// The lanes that count.
const XYZ: usize = 0b111;

/// Whether f32 can tell that a triangle is not degenerate: no branch before the last, and enough for
/// all but slivers.
///
/// Each of the three components below is off by at most `4.1 u` times the sum of the magnitudes of
/// its products, with `u = 2^-24`, and by `2^-149` where they underflow.
#[inline(always)]
fn surely_has_area([a, b, c]: &[F4; 3]) -> bool {
    const RELATIVE: f32 = 1.0 / 1_048_576.0;
    const ABSOLUTE: f32 = f32::MIN_POSITIVE;
    let (u, v) = (b.sub(*a), c.sub(*a));
    let (p, q) = (u.mul(v.yzxw()), u.yzxw().mul(v));
    let unsure = F4::splat(RELATIVE).mul(p.abs().add(q.abs())).add(F4::splat(ABSOLUTE));
    unsure.less_bits(p.sub(q).abs()) & XYZ != 0
}

/// Whether no coordinate is NaN or too large. No branch before the last.
#[inline(always)]
fn are_near([a, b, c]: &[F4; 3]) -> bool {
    const TOO_FAR: f32 = COORDINATE_MAX.next_up();
    let near = |p: &F4| p.abs().less_bits(F4::splat(TOO_FAR));
    near(a) & near(b) & near(c) & XYZ == XYZ
}

/// Adds what was found of some triangles to the report; or stops at the first that is no good, where the caller chose so.
pub(super) fn tell(
    report: &mut BuildReport,
    degenerate: u64,
    skipped: Skipped,
    options: &BuildOptions<'_>,
) -> Result<(), SceneError> {
    if let (Invalid::Error, Some((geom, prim, defect))) = (options.invalid, skipped.first_triangle)
    {
        return Err(SceneError::Triangle { geom, prim, defect });
    }
    report.degenerate += degenerate;
    report.skipped.add(&skipped);
    Ok(())
}

#[cold]
pub(super) fn skip(skipped: &mut Skipped, (geom, prim): (usize, usize), defect: Defect) {
    skipped.triangles += 1;
    match defect {
        Defect::IndexOutOfRange { .. } => skipped.index_out_of_range += 1,
        _ => skipped.bad_vertex += 1,
    }
    skipped.first_triangle = skipped.first_triangle.or(Some((geom, prim, defect)));
}

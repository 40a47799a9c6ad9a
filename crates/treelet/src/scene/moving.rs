//! Meshes that move: checked at every step, and given as many trees as pay.
//!
//! A mesh that moves is one entry of the level's tree, in a box around it at all times, and has trees of its own
//! (`layout::moving`): one, or one for each of equal segments of time. Each is built over the boxes of the middle of its
//! segment by the plan of the level.
//!
//! # How many segments
//!
//! Boxes that move along lines over a segment are larger than boxes at a moment: by what vertices leave lines, and
//! because triangles that were neighbours in the middle part. Either way, what the nodes' areas come to in the mean
//! over the segment, over what they come to in its middle, says what is lost; where that is more than
//! [`LOST_MAX`], twice as many segments are tried, again and again, and kept where they take [`GAIN_MIN`] off the mean
//! areas, up to [`SEGMENTS_MAX`]. Nodes and deltas are there once for each segment; triangles once a step, and once more
//! for each segment where it begins inside.
//!
//! A segment is no longer than it must be and may be a part of a step: between two steps the boxes are good
//! at any time, but which triangles belong together changes.
//!
//! Cost: all trees that are tried, which are less than twice those that are kept, or eight times where none gain.

use super::builder::BuildOptions;
use super::gather::{skip, tell};
use super::report::{BuildReport, Skipped};
use super::{Plan, SceneError};
use crate::bounds::Aabb;
use crate::build::Clip;
use crate::context::{Cancel, Cancelled, parallel};
use crate::geometry::{Mesh, Shape, triangle};
use crate::layout::lower::{Numbered, Packed, lower, split_leaves};
use crate::layout::moving::{Segment, Span, areas, widened_way};
use crate::math::pose::Moment;
use crate::trace::moving::{MovingMesh, Trees};
use crate::trace::structure::{Geometry, Layout, Structure};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The most segments of time, and so trees, of a mesh: the factor by which temporal splits may multiply its nodes.
pub const SEGMENTS_MAX: usize = 32;

/// Mean areas over those of the middle that need no further segments.
const LOST_MAX: f64 = 1.1;

/// What doubling the segments must take off the mean areas to be kept.
pub(super) const GAIN_MIN: f64 = 0.1;

/// Doublings in a row that may gain nothing: what comes and goes is in the same boxes in both halves.
const VAIN_MAX: usize = 2;

/// Triangles that one task checks.
const CHUNK: usize = 16_384;

/// A mesh that moves, checked.
#[derive(Clone, Debug)]
pub(super) struct Moving {
    geom: usize,
    /// The id of its first triangle, which is how leaves name it.
    pub(super) first_id: u32,
    /// Its triangles without a defect.
    which: Vec<u32>,
    /// Around those at all times.
    pub(super) bounds: Aabb,
}

/// Checks and boxes the meshes that move; those without a sound triangle are left out.
pub(super) fn gather(
    geometries: &[Geometry],
    first_ids: &[u32],
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Vec<Moving>, SceneError> {
    let mut all = Vec::new();
    for (geom, (geometry, &first_id)) in geometries.iter().zip(first_ids).enumerate() {
        let Some(mesh) = geometry.mesh().filter(|mesh| mesh.is_moving()) else { continue };
        if let Some((step, vertices)) = mesh.uneven_step() {
            let first = mesh.positions().len();
            return Err(SceneError::Steps { geom, step, vertices, first });
        }
        let moving = check((geom, first_id), mesh, options, report)?;
        if !moving.which.is_empty() {
            all.push(moving);
        }
    }
    Ok(all)
}

/// Checks and boxes a mesh.
fn check(
    (geom, first_id): (usize, u32),
    mesh: &Mesh,
    options: &BuildOptions<'_>,
    report: &mut BuildReport,
) -> Result<Moving, SceneError> {
    struct Checked {
        which: Vec<u32>,
        bounds: Aabb,
        degenerate: u64,
        skipped: Skipped,
    }
    let cancel = &options.context.cancel;
    let chunks = parallel::map_chunks(mesh.triangles(), CHUNK, |first, triangles| {
        cancel.check()?;
        let (mut which, skipped) = (Vec::with_capacity(triangles.len()), Skipped::default());
        let mut chunk = Checked { which: Vec::new(), bounds: Aabb::EMPTY, degenerate: 0, skipped };
        for prim in first..first + triangles.len() {
            if let Some(defect) = mesh.defect(prim) {
                skip(&mut chunk.skipped, (geom, prim), defect);
                continue;
            }
            which.push(prim as u32);
            for step in 0..mesh.steps() {
                let moment = Moment::at(step as f32, mesh.steps());
                let corners = mesh.corners_of(prim, moment).unwrap_or_default();
                chunk.bounds = chunk.bounds.union(&Aabb::of_points(&corners));
                chunk.degenerate += u64::from(step == 0 && triangle::is_degenerate(&corners));
            }
        }
        Ok(Checked { which, ..chunk })
    });
    let mut all = Moving { geom, first_id, which: Vec::new(), bounds: Aabb::EMPTY };
    for chunk in chunks {
        let chunk: Result<Checked, Cancelled> = chunk;
        let Checked { which, bounds, degenerate, skipped } = chunk?;
        tell(report, degenerate, skipped, options)?;
        all.which.extend(which);
        all.bounds = all.bounds.union(&bounds);
    }
    all.bounds = widened_way(&all.bounds);
    report.triangles += all.which.len() as u64;
    Ok(all)
}

/// Builds the trees of the meshes that move on a level, but for those of geometries that are `known`, and puts them there.
pub(super) fn build(
    structure: &mut Structure,
    (moving, known): (&[Moving], &[(usize, MovingMesh)]),
    plan: &Plan<'_>,
    options: &BuildOptions<'_>,
) -> Result<(), SceneError> {
    for moving in moving {
        let Moving { geom, first_id, bounds, .. } = *moving;
        let Geometry { shape: Shape::Mesh(mesh), mask } = &structure.geometries[geom] else {
            continue;
        };
        let is_wide8 = matches!(structure.layout, Layout::Wide8(_));
        let known = known.iter().find(|(at, known)| *at == geom && known.is_wide8() == is_wide8);
        if let Some((_, known)) = known {
            structure.repeats |= known.repeats;
            structure.moves = true;
            structure.moving.push(MovingMesh {
                geom,
                first_id,
                mask: *mask,
                bounds,
                ..known.clone()
            });
            continue;
        }
        let maker = Maker { moving, mesh, plan, options };
        let (trees, Cut { parts, strides }, repeats, built) = match structure.layout {
            Layout::Wide8(_) => {
                let made = maker.segments::<8>()?;
                let price = made.price();
                (Trees::Wide8(made.segments), made.cut, made.repeats, price)
            }
            // Where nodes are packed, those of what moves are not: their deltas are the larger part.
            Layout::Wide16(_) | Layout::Compact(_) => {
                let made = maker.segments::<16>()?;
                let price = made.price();
                (Trees::Wide16(made.segments), made.cut, made.repeats, price)
            }
        };
        structure.repeats |= repeats;
        structure.moves = true;
        structure.moving.push(MovingMesh {
            geom,
            first_id,
            mask: *mask,
            steps: mesh.steps(),
            parts,
            strides,
            bounds,
            repeats,
            built,
            trees: Arc::new(trees),
        });
    }
    Ok(())
}

/// How long segments are: a part of a step, or some steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cut {
    parts: u32,
    strides: u32,
}

impl Cut {
    /// Half as long.
    fn halved(self) -> Self {
        match self {
            Self { strides: 1, parts } => Self { parts: 2 * parts, strides: 1 },
            Self { strides, parts } => Self { parts, strides: strides.div_ceil(2) },
        }
    }

    /// The segments up to the last step.
    fn spans(self, last: usize) -> Vec<Span> {
        let length = self.strides as f32 / self.parts as f32;
        let count = (last as u64 * u64::from(self.parts)).div_ceil(u64::from(self.strides));
        let end = |i: u64| (i as f32 * length).min(last as f32);
        (0..count).map(|i| Span { start: end(i), end: end(i + 1) }).collect()
    }
}

/// What the trees of a mesh are made of.
struct Maker<'a> {
    moving: &'a Moving,
    mesh: &'a Mesh,
    plan: &'a Plan<'a>,
    options: &'a BuildOptions<'a>,
}

/// The trees of one cut.
struct Tried<const W: usize> {
    segments: Vec<Segment<W>>,
    cut: Cut,
    repeats: bool,
    /// Half areas of all nodes' children, in the mean over time, and in the middles of the segments.
    mean: f64,
    middle: f64,
    /// Half areas of the triangles' boxes, in the middles.
    prims: f64,
}

impl<const W: usize> Tried<W> {
    fn nothing(cut: Cut) -> Self {
        let (mean, middle, prims) = (0.0, 0.0, 0.0);
        Self { segments: Vec::new(), cut, repeats: false, mean, middle, prims }
    }

    /// Boxes that a long random line meets for each triangle whose box it meets, as of trees that stand still.
    fn price(&self) -> f64 {
        let price = self.mean / self.prims;
        if price.is_finite() && price > 0.0 { price } else { 1.0 }
    }

    /// Adds the tree of a segment, and what it is worth.
    fn push(&mut self, segment: Segment<W>, span: Span) {
        /// Where in a segment areas are looked at.
        const LOOKS: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
        let look = |share: &f32| segment.areas(share * (span.end - span.start));
        self.mean += LOOKS.iter().map(look).sum::<f64>() / LOOKS.len() as f64;
        self.segments.push(segment);
    }
}

impl Maker<'_> {
    fn segments<const W: usize>(&self) -> Result<Tried<W>, SceneError> {
        let last = self.mesh.steps() - 1;
        let whole = Cut { parts: 1, strides: last as u32 };
        let mut best = self.attempt::<W>(whole)?;
        let (mut cut, mut vain) = (whole.halved(), 0);
        while self.options.temporal_splits
            && best.mean > LOST_MAX * best.middle
            && vain < VAIN_MAX
            && cut.spans(last).len() <= SEGMENTS_MAX
        {
            let tried = self.attempt(cut)?;
            vain += 1;
            if tried.mean <= (1.0 - GAIN_MIN) * best.mean {
                (best, vain) = (tried, 0);
            }
            cut = cut.halved();
        }
        Ok(best)
    }

    fn attempt<const W: usize>(&self, cut: Cut) -> Result<Tried<W>, SceneError> {
        let mut tried = Tried::nothing(cut);
        for span in cut.spans(self.mesh.steps() - 1) {
            self.add(span, &mut tried)?;
        }
        Ok(tried)
    }

    /// Adds the tree of a segment.
    fn add<const W: usize>(&self, span: Span, tried: &mut Tried<W>) -> Result<(), SceneError> {
        let Self { mesh, moving: Moving { which, .. }, plan, options } = self;
        let cancel: &Cancel = &options.context.cancel;
        let steps = mesh.steps();
        let middle = Moment::at(span.middle(), steps);
        let bounds = boxes(mesh, which, middle);
        tried.prims += bounds.iter().map(Aabb::half_area).sum::<f64>();

        // The tree of the middle.
        let tree = plan.build(&bounds, &Whole(&bounds), &options.context)?;
        let tree = split_leaves(tree, &bounds, bounds.len())?;
        tried.repeats |= tree.prims.len() > bounds.len();
        let source = |prims: &[u32], packed: &mut [Packed]| {
            for (&at, packed) in prims.iter().zip(packed) {
                let prim = which[at as usize];
                let corners = mesh.corners_of(prim as usize, middle).unwrap_or_default();
                *packed = Packed { corners, id: prim };
            }
        };
        let wide = lower::<W>(&tree, Numbered::NONE, &source, plan.collapse, cancel)?;
        tried.middle += areas(&wide.nodes);

        // The same, moving.
        let corners = |prim: u32, step: usize| {
            let moment = Moment::at(step as f32, steps);
            mesh.corners_of(prim as usize, moment).unwrap_or_default()
        };
        let segment = Segment::new(wide, span, &corners, cancel)?;
        tried.push(segment, span);
        Ok(())
    }
}

/// The boxes of some triangles at a moment.
fn boxes(mesh: &Mesh, which: &[u32], moment: Moment) -> Vec<Aabb> {
    let boxes = parallel::map_chunks(which, CHUNK, |_, which| {
        let corners = which.iter().map(|&prim| mesh.corners_of(prim as usize, moment));
        let boxes = corners.map(|corners| Aabb::of_points(&corners.unwrap_or_default()));
        boxes.collect::<Vec<_>>()
    });
    boxes.into_iter().flatten().collect()
}

/// The trees of a mesh that moves, around the same triangles on other ways, in as many steps; all are sound before and now. And how
/// much dearer they are than when they were built.
pub(super) fn refit(
    old: &MovingMesh,
    mesh: &Mesh,
    cancel: &Cancel,
) -> Result<(MovingMesh, f64), SceneError> {
    let cut = Cut { parts: old.parts, strides: old.strides };
    let (trees, price) = match &*old.trees {
        Trees::Wide8(segments) => {
            let made = refitted(segments, cut, mesh, cancel)?;
            let price = made.price();
            (Trees::Wide8(made.segments), price)
        }
        Trees::Wide16(segments) => {
            let made = refitted(segments, cut, mesh, cancel)?;
            let price = made.price();
            (Trees::Wide16(made.segments), price)
        }
    };
    Ok((MovingMesh { trees: Arc::new(trees), ..old.clone() }, price / old.built))
}

fn refitted<const W: usize>(
    segments: &[Segment<W>],
    cut: Cut,
    mesh: &Mesh,
    cancel: &Cancel,
) -> Result<Tried<W>, SceneError> {
    let steps = mesh.steps();
    let which: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
    let corners = |prim: u32, step: usize| {
        let moment = Moment::at(step as f32, steps);
        mesh.corners_of(prim as usize, moment).unwrap_or_default()
    };
    let mut made = Tried::nothing(cut);
    for (segment, span) in segments.iter().zip(cut.spans(steps - 1)) {
        let bounds = boxes(mesh, &which, Moment::at(span.middle(), steps));
        made.prims += bounds.iter().map(Aabb::half_area).sum::<f64>();
        made.push(Segment::new(segment.still()?, span, &corners, cancel)?, span);
    }
    Ok(made)
}

/// Boxes of what moves are not cut: their parts move, too.
pub(super) struct Whole<'a>(pub(super) &'a [Aabb]);

impl Clip for Whole<'_> {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        self.0[prim as usize].intersection(region)
    }

    fn least_half_area(&self, _: u32) -> Option<f64> {
        None
    }
}

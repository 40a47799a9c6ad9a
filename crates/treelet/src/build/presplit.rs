//! Spatial splits before the build: large slanted primitives are handed to a builder in pieces.
//!
//! Source: T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", HPG 2013, section 5: each primitive gets a number of splits by a priority, the cube
//! root of what its box wastes, halved for each level of the grid whose planes it crosses; pieces are
//! cut where they cross the most important plane of the scene's grid, so that cuts of neighbours
//! meet. Differs from it: what a piece's box is comes from [`Clip`], and pieces with nothing in them
//! are left out.
//!
//! A builder then takes pieces for primitives. Afterwards each piece is the primitive again, so a
//! primitive may lie in several leaves; siblings that turn out to be pieces of one primitive are put
//! together.
//!
//! # Why no answer changes
//!
//! The culling lemma of [`crate::geometry::triangle`] speaks of boxes around the whole triangle. A
//! piece's box is smaller, so here is what replaces it. With `u = 2^-24`, `R` the reach, and the ray
//! at `t` written `r(t)`:
//!
//! - A hit's weights name a point `p` of the exact triangle. Sheared corners are within `6 u R` of
//!   where they should be, so the ray passes `p` within `6 u R` on each axis, at `p`'s own depth.
//! - The depth is that of corners rounded by `u R`, and `t` is rounded once: along the longest axis
//!   of the direction, and so along every axis, `r(t)` is within `2 u R` of that place. Together,
//!   `r(t)` is within `8 u R` of `p` on each axis. (`tests/lemma.rs` measures it.)
//! - Pieces cover the triangle, faces included, so `p` lies in one of their boxes, `B`
//!   ([`crate::geometry::clip`]).
//! - The slab test takes `B` for wider by at least `16 u R`, and rounds each plane by `3 u R` at
//!   most. `8 + 3 < 16`: `t` lies in the interval of `B`, with `5 u R` to spare. Both sides of the
//!   comparison are rounded last, to f32, and rounding is monotone: what f32 cannot tell apart still
//!   compares as it should, however small or large `t` is.
//! - A box around `B` has an interval around that of `B`, bit for bit, as ever.
//! - `t` is not moved by clamping: the triangle's own box contains `B`, so `t` lies in its interval;
//!   and it lies in those of the instances on the way, whose boxes are widened by what is derived in
//!   `trace::slack` for every `t` in the interval of a box inside. That derivation needs a hit to be
//!   within `16 u R` of a box inside, which `8 u R` is.
//!
//! Far origins have a large `R`, thin triangles exact weights: neither is a special case. Where
//! `u R` itself leaves f32, so would the sums above: scenes smaller than [`EXTENT_MIN`] are not
//! split. Brute force never sees a piece, and `tests/splits.rs` compares every bit with it.
//!
//! Instances are not split: entering one twice costs more than a tighter box saves.
//!
//! Cost: a few clips a split, O(n) otherwise; 28 bytes a piece until the tree is done.

use super::clip::Clip;
use super::{BuildError, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancel, Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::tree::{PRIMS_MAX, Tree};
use alloc::vec::Vec;

/// Scenes whose longest edge is shorter are not split.
pub const EXTENT_MIN: f32 = 1.0 / (1_u64 << 60) as f32;

/// Primitives are looked at this many at a time.
const CHUNK: usize = 4096;

/// Planes lie on a grid of this many cells an axis, `2^LEVELS`.
const LEVELS: u32 = 20;

/// A primitive is cut into at most this many pieces.
const PIECES_MAX: u32 = 64;

/// Splits large primitives before a build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Presplit {
    /// Splits at most, as a share of the number of primitives, in `0..=4`.
    pub budget: f32,
}

impl Presplit {
    /// As users write it.
    pub const NAME: &'static str = "presplit";

    /// At most 30 % more entries.
    pub const DEFAULT: Self = Self { budget: 0.3 };
}

/// Pieces, and whose they are.
#[derive(Debug)]
pub(crate) struct Pieces {
    pub(crate) bounds: Vec<Aabb>,
    pub(crate) prims: Vec<u32>,
}

impl Presplit {
    /// The pieces of primitives with these boxes; `None` if nothing is worth a split.
    pub(crate) fn split(
        &self,
        bounds: &[Aabb],
        clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Option<Pieces>, BuildError> {
        check_option("budget", f64::from(self.budget), 0.0..=4.0, "0..=4")?;
        let budget = libm::floor(f64::from(self.budget) * bounds.len() as f64);
        let budget = budget.min((PRIMS_MAX - bounds.len().min(PRIMS_MAX)) as f64);
        let scene = around(bounds, context)?;
        if scene.is_empty() || crate::math::vec3::max_abs(scene.extent()) < EXTENT_MIN {
            return Ok(None);
        }
        let stage = Stage::new(context, "split", bounds.len() as u64);
        let grid = Grid::new(&scene);
        let priorities = priorities(&grid, bounds, clip, &stage)?;
        let scale = scale(&priorities, budget, &stage)?;
        if scale == 0.0 {
            stage.advance(bounds.len() as u64);
            return Ok(None);
        }

        // Cut each primitive as often as its priority says.
        let cutter = Cutter { grid: &grid, clip };
        let parts = parallel::map_chunks(bounds, CHUNK, |first, bounds| {
            stage.check()?;
            let mut pieces = Pieces { bounds: Vec::new(), prims: Vec::new() };
            for (at, bounds) in (first..).zip(bounds) {
                cutter.cut(at as u32, bounds, splits(priorities[at], scale), &mut pieces);
            }
            stage.advance(bounds.len() as u64);
            Ok(pieces)
        });
        let mut all = Pieces { bounds: Vec::new(), prims: Vec::new() };
        for part in parts {
            let part: Result<Pieces, Cancelled> = part;
            let part = part?;
            memory::try_reserve(&mut all.bounds, part.bounds.len(), "boxes of pieces")?;
            memory::try_reserve(&mut all.prims, part.prims.len(), "names of pieces")?;
            all.bounds.extend(part.bounds);
            all.prims.extend(part.prims);
        }
        Ok(Some(all))
    }
}

impl Pieces {
    /// Makes the leaves of a tree over the pieces name the primitives.
    pub(crate) fn name_prims(&self, tree: &mut Tree, cancel: &Cancel) -> Result<(), Cancelled> {
        for chunk in tree.prims.chunks_mut(CHUNK) {
            cancel.check()?;
            chunk.iter_mut().for_each(|entry| *entry = self.prims[*entry as usize]);
        }
        Ok(())
    }
}

/// The box around all boxes.
fn around(bounds: &[Aabb], context: &Context<'_>) -> Result<Aabb, Cancelled> {
    let parts = parallel::map_chunks(bounds, CHUNK, |_, bounds| {
        context.cancel.check()?;
        Ok(bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds)))
    });
    parts.into_iter().try_fold(Aabb::EMPTY, |all, part| Ok(all.union(&part?)))
}

/// The planes at which pieces are cut: a grid of cubes over the scene, halved again and again.
struct Grid {
    origin: [f32; 3],
    cell: f64,
}

/// A plane of the grid.
struct Plane {
    axis: usize,
    at: f32,
    /// Halvings of the scene until it appears: 0 for its middle.
    level: u32,
}

impl Grid {
    fn new(scene: &Aabb) -> Self {
        let longest = f64::from(crate::math::vec3::max_abs(scene.extent()));
        Self { origin: scene.lo, cell: longest / f64::from(1 << LEVELS) }
    }

    /// The most important plane strictly inside the box; of equals that of the longest side.
    fn plane(&self, bounds: &Aabb) -> Option<Plane> {
        let mut best: Option<Plane> = None;
        let extent = bounds.extent();
        for axis in 0..3 {
            let origin = f64::from(self.origin[axis]);
            let cell = |x: f32| ((f64::from(x) - origin) / self.cell) as u32;
            let (lo, hi) = (cell(bounds.lo[axis]), cell(bounds.hi[axis]));
            if lo == hi {
                continue;
            }
            // The highest bit that differs: the plane is where it becomes one.
            let bit = 31 - (lo ^ hi).leading_zeros();
            let at = (origin + f64::from(hi >> bit << bit) * self.cell) as f32;
            if !(bounds.lo[axis] < at && at < bounds.hi[axis]) {
                continue;
            }
            let level = LEVELS.saturating_sub(bit + 1);
            let better = best.as_ref().is_none_or(|best| {
                level < best.level || level == best.level && extent[axis] > extent[best.axis]
            });
            if better {
                best = Some(Plane { axis, at, level });
            }
        }
        best
    }
}

/// How much each primitive wants to be cut.
fn priorities(
    grid: &Grid,
    bounds: &[Aabb],
    clip: &dyn Clip,
    stage: &Stage<'_>,
) -> Result<Vec<f32>, BuildError> {
    let mut out = memory::try_filled(0.0, bounds.len(), "priorities of splits")?;
    let numbered: Vec<_> = bounds.chunks(CHUNK).zip(out.chunks_mut(CHUNK)).enumerate().collect();
    let done = parallel::map(numbered, |(chunk, (bounds, out))| {
        stage.check()?;
        let first = chunk * CHUNK;
        for (at, (bounds, out)) in (first..).zip(bounds.iter().zip(out)) {
            let Some(plane) = grid.plane(bounds) else { continue };
            let waste = bounds.half_area() - clip.ideal_area(at as u32);
            if waste > 0.0 {
                let importance = 1.0 / f64::from(1_u32 << plane.level.min(31));
                *out = libm::cbrt(importance * waste) as f32;
            }
        }
        Ok(())
    });
    done.into_iter().collect::<Result<(), Cancelled>>()?;
    Ok(out)
}

/// How often a primitive of this priority is cut.
fn splits(priority: f32, scale: f64) -> u32 {
    // Truncated; NaN, of an overflow, is none.
    ((f64::from(priority) * scale) as u32).min(PIECES_MAX - 1)
}

/// The largest scale, to some digits, whose splits stay within the budget; 0 if none does.
fn scale(priorities: &[f32], budget: f64, stage: &Stage<'_>) -> Result<f64, Cancelled> {
    let total = |scale: f64| -> Result<f64, Cancelled> {
        let parts = parallel::map_chunks(priorities, CHUNK, |_, priorities| {
            stage.check()?;
            Ok(priorities.iter().map(|&p| u64::from(splits(p, scale))).sum::<u64>())
        });
        parts.into_iter().sum::<Result<u64, Cancelled>>().map(|sum| sum as f64)
    };
    let most = priorities.iter().fold(0.0_f32, |most, &p| most.max(p));
    if !(most > 0.0 && most.is_finite() && budget >= 1.0) {
        return Ok(0.0);
    }
    // Below `low` nothing is split; at `high` the first has all it may have.
    let (mut low, mut high) = (0.0, f64::from(PIECES_MAX) * 1e3 / f64::from(most));
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if total(middle)? <= budget {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(low)
}

/// Halvings of the interval in which the scale is sought.
const STEPS: u32 = 24;

/// Cuts primitives.
struct Cutter<'a> {
    grid: &'a Grid,
    clip: &'a dyn Clip,
}

impl Cutter<'_> {
    /// Appends the pieces of a primitive.
    fn cut(&self, prim: u32, bounds: &Aabb, splits: u32, pieces: &mut Pieces) {
        let mut open = alloc::vec![(*bounds, splits)];
        while let Some((bounds, splits)) = open.pop() {
            let plane = if splits > 0 { self.grid.plane(&bounds) } else { None };
            let Some(Plane { axis, at, .. }) = plane else {
                pieces.bounds.push(bounds);
                pieces.prims.push(prim);
                continue;
            };
            let (mut left, mut right) = (bounds, bounds);
            left.hi[axis] = at;
            right.lo[axis] = at;
            let [left, right] = [left, right].map(|region| self.clip.clip(prim, &region));
            match (left.is_empty(), right.is_empty()) {
                (true, true) => open.push((bounds, 0)),
                (true, false) => open.push((right, splits - 1)),
                (false, true) => open.push((left, splits - 1)),
                (false, false) => {
                    // The rest goes where the longer sides are.
                    let longest =
                        |piece: &Aabb| f64::from(crate::math::vec3::max_abs(piece.extent()));
                    let (a, b) = (longest(&left), longest(&right));
                    let rest = splits - 1;
                    let share = if a + b > 0.0 { a / (a + b) } else { 0.5 };
                    let to_left = ((f64::from(rest) * share + 0.5) as u32).min(rest);
                    open.push((right, rest - to_left));
                    open.push((left, to_left));
                }
            }
        }
    }
}

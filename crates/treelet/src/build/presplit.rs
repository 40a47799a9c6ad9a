//! Splitting before the build: large slanted primitives are cut into pieces, and any builder makes
//! its tree over those.
//!
//! Source: T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", HPG 2013, section 4. A budget of extra pieces is dealt out by priority, the cube root of
//! how much area the primitive's box wastes, halved for each level by which the most important plane
//! through it is less important than the one in the middle of the scene. That plane, of a grid whose
//! cells are halved again and again, cuts it; the rest of its cuts go to the halves in proportion to
//! their longest edges. What came together again in a leaf is one again.
//!
//! Differs from it: the grid's cells are cubes; a half that holds nothing of the primitive costs no cut.
//!
//! A piece's box is one that [`Clip`] makes, as those of [`super::sbvh`], whose module says why no answer
//! changes. The same scenes are too small to be cut.
//!
//! Long shards among small triangles are what it is for: with three extra pieces for ten triangles
//! `hploc`'s SAH falls from 133 to 94, that of `sweep-sah` from 116 to 82, of `lbvh` from 154 to 104, `sbvh`'s
//! own from 115 to 86 (6000 triangles of a test). On real scenes it lost. `hploc` after it traced 0.65 to 0.81
//! times as many single rays a second on arches of 1.0 M triangles, 0.77 to 0.87 times on a car of 0.8 M, 0.85
//! to 0.98 times on a house of 1.6 M; with full reinsertion, against `binned-sah` and the same, 0.79 to 0.90
//! (arches) and 0.68 to 0.89 (car). With a third of the budget, `binned-sah` and full reinsertion: 0.91 to
//! 0.96 (house). Hence it is in no quality level.
//!
//! Cost: O(n) time, 4 bytes a primitive and 32 a piece, besides the builder's. With `hploc` after it, arches
//! are built and lowered at 1.7 M triangles a second of one core's time instead of 6.6.

use super::clip::Clip;
use super::sbvh::EXTENT_MIN;
use super::{BuildError, Builder, Info, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::math::vec3;
use crate::memory;
use crate::tree::{Kind, PRIMS_MAX, Tree};
use alloc::vec::Vec;

/// Primitives are looked at this many at a time.
const CHUNK: usize = 16_384;

/// The longest edge of the scene has `2^21` cells, as Morton codes of 63 bits have.
const GRID_BITS: u32 = 21;

/// How often the number of cuts a priority is worth is searched between what is surely too few and
/// what is surely too many: the budget is then used up to some thousandth.
const BISECTIONS: u32 = 12;

/// Cuts primitives into pieces, then hands the pieces to another builder.
#[derive(Clone, Copy)]
pub struct Presplit<'a> {
    /// Makes the tree over the pieces.
    pub builder: &'a dyn Builder,
    /// Extra pieces at most, as a share of the primitives, in `0..=4`.
    pub budget: f32,
}

impl<'a> Presplit<'a> {
    /// As users write it before `+` and a builder's name.
    pub const NAME: &'static str = "presplit";

    /// The pass, whatever builder comes after it.
    pub const INFO: Info = Info {
        name: Self::NAME,
        summary: "before any builder: cuts large slanted primitives into pieces",
        source: "Karras and Aila 2013",
    };

    /// A third more pieces than primitives at most.
    pub const fn before(builder: &'a dyn Builder) -> Self {
        Self { builder, budget: 0.3 }
    }
}

impl Builder for Presplit<'_> {
    fn info(&self) -> Info {
        Self::INFO
    }

    fn inner(&self) -> Option<&dyn Builder> {
        Some(self.builder)
    }

    /// Without a geometry to ask nothing is cut.
    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        self.check()?;
        self.builder.build(bounds, context)
    }

    fn build_clipped(
        &self,
        bounds: &[Aabb],
        clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        self.check()?;
        match self.pieces(bounds, clip, context)? {
            None => self.builder.build_clipped(bounds, clip, context),
            Some((bounds, of)) => {
                let pieces = Pieces { bounds: &bounds, of: &of, clip };
                let tree = self.builder.build_clipped(&bounds, &pieces, context)?;
                merge(tree, &of, context)
            }
        }
    }
}

/// What is cut, and how finely.
struct Cutting<'a> {
    grid: Grid,
    clip: &'a dyn Clip,
    stage: Stage<'a>,
}

/// Boxes of pieces, and the primitive that each is a piece of; those of one primitive are neighbours.
type Cut = (Vec<Aabb>, Vec<u32>);

/// Pieces as primitives.
struct Pieces<'a> {
    bounds: &'a [Aabb],
    of: &'a [u32],
    clip: &'a dyn Clip,
}

impl Clip for Pieces<'_> {
    fn clip(&self, piece: u32, region: &Aabb) -> Aabb {
        let region = self.bounds[piece as usize].intersection(region);
        self.clip.clip(self.of[piece as usize], &region)
    }

    fn least_half_area(&self, piece: u32) -> Option<f64> {
        // That of the whole may be too much for a piece. Whether there is any is what is asked.
        self.clip.least_half_area(self.of[piece as usize])
    }

    fn group(&self, piece: u32) -> u32 {
        self.clip.group(self.of[piece as usize])
    }
}

impl Presplit<'_> {
    fn check(&self) -> Result<(), BuildError> {
        check_option("budget", f64::from(self.budget), 0.0..=4.0, "0..=4")
    }

    /// The pieces, if anything is to be cut.
    fn pieces(
        &self,
        bounds: &[Aabb],
        clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Option<Cut>, BuildError> {
        let count = bounds.len();
        let extra = libm::floor(f64::from(self.budget) * count as f64) as usize;
        let budget = extra.min(PRIMS_MAX.saturating_sub(count));
        let around = bounds.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
        if budget == 0 || vec3::max_abs(around.extent()) < EXTENT_MIN {
            return Ok(None);
        }
        let stage = Stage::new(context, "presplit", 2 * count as u64);
        let cutting = Cutting { grid: Grid::new(&around), clip, stage };
        let priorities = cutting.priorities(bounds)?;
        let worth = cutting.worth(&priorities, budget)?;
        cutting.cut(bounds, &priorities, worth, budget).map(Some)
    }
}

impl Cutting<'_> {
    /// How much each primitive wants to be cut.
    fn priorities(&self, bounds: &[Aabb]) -> Result<Vec<f32>, BuildError> {
        let mut priorities = memory::try_filled(0.0, bounds.len(), "priorities of primitives")?;
        let chunks = bounds.chunks(CHUNK).zip(priorities.chunks_mut(CHUNK)).enumerate().collect();
        let done = parallel::map(chunks, |(chunk, (bounds, priorities))| {
            self.stage.check()?;
            for ((bounds, out), prim) in bounds.iter().zip(priorities).zip(chunk * CHUNK..) {
                *out = self.priority(prim as u32, bounds);
            }
            self.stage.advance(bounds.len() as u64);
            Ok(())
        });
        done.into_iter().collect::<Result<(), Cancelled>>()?;
        Ok(priorities)
    }

    fn priority(&self, prim: u32, bounds: &Aabb) -> f32 {
        let Some(plane) = self.grid.most_important(bounds) else { return 0.0 };
        let Some(least) = self.clip.least_half_area(prim) else { return 0.0 };
        // In the scene's own unit, so that no scene is too large or too small for f32.
        let waste = (bounds.half_area() - least) * self.grid.per_area;
        let important = 1.0 / (1_u64 << plane.level) as f64;
        if waste > 0.0 { libm::cbrt(waste * important) as f32 } else { 0.0 }
    }

    /// The most cuts a unit of priority can have if all together are to be within the budget.
    fn worth(&self, priorities: &[f32], budget: usize) -> Result<f32, BuildError> {
        let sums = parallel::map_chunks(priorities, CHUNK, |_, priorities| {
            priorities.iter().map(|&priority| f64::from(priority)).sum::<f64>()
        });
        let all: f64 = sums.into_iter().sum();
        if all <= 0.0 {
            return Ok(0.0);
        }
        // Rounding down loses less than one cut a primitive.
        let (mut fits, mut exceeds) = (0.0, ((budget + priorities.len()) as f64 / all) as f32);
        let mut middle = (budget as f64 / all) as f32;
        for _ in 0..BISECTIONS {
            let sums = parallel::map_chunks(priorities, CHUNK, |_, priorities| {
                self.stage.check()?;
                Ok(priorities.iter().map(|&priority| cuts(priority, middle) as u64).sum::<u64>())
            });
            let sum = sums.into_iter().sum::<Result<u64, Cancelled>>()?;
            *if sum <= budget as u64 { &mut fits } else { &mut exceeds } = middle;
            middle = 0.5 * (fits + exceeds);
        }
        Ok(fits)
    }

    /// Cuts every primitive as often as its priority says.
    fn cut(
        &self,
        bounds: &[Aabb],
        priorities: &[f32],
        worth: f32,
        budget: usize,
    ) -> Result<Cut, BuildError> {
        let chunks = bounds.chunks(CHUNK).zip(priorities.chunks(CHUNK)).enumerate().collect();
        let parts = parallel::map(chunks, |(chunk, (bounds, priorities))| {
            self.stage.check()?;
            let mut pieces = memory::try_with_capacity(bounds.len(), "pieces of primitives")?;
            for ((bounds, &priority), prim) in bounds.iter().zip(priorities).zip(chunk * CHUNK..) {
                self.cut_one(prim as u32, bounds, cuts(priority, worth), &mut pieces)?;
            }
            self.stage.advance(bounds.len() as u64);
            Ok(pieces)
        });
        let parts = parts.into_iter().collect::<Result<Vec<_>, BuildError>>()?;
        let count = parts.iter().map(Vec::len).sum();
        debug_assert!(count <= bounds.len() + budget);
        let mut boxes = memory::try_with_capacity(count, "pieces of primitives")?;
        let mut of = memory::try_with_capacity(count, "pieces of primitives")?;
        for part in parts {
            self.stage.check()?;
            boxes.extend(part.iter().map(|(bounds, _)| *bounds));
            of.extend(part.iter().map(|(_, prim)| *prim));
        }
        Ok((boxes, of))
    }

    /// Cuts a primitive at most `cuts` times.
    fn cut_one(
        &self,
        prim: u32,
        bounds: &Aabb,
        cuts: usize,
        pieces: &mut Vec<(Aabb, u32)>,
    ) -> Result<(), BuildError> {
        if cuts == 0 {
            // There is room for one piece of each primitive, and for more where more was made.
            pieces.push((*bounds, prim));
            return Ok(());
        }
        memory::try_reserve(pieces, cuts + CHUNK, "pieces of primitives")?;
        let mut open = alloc::vec![(*bounds, cuts)];
        while let Some((bounds, cuts)) = open.pop() {
            let plane = if cuts > 0 { self.grid.most_important(&bounds) } else { None };
            let Some(Plane { axis, at, .. }) = plane else {
                pieces.push((bounds, prim));
                continue;
            };
            let (mut below, mut above) = (bounds, bounds);
            below.hi[axis] = at;
            above.lo[axis] = at;
            let [below, above] = [below, above].map(|region| self.clip.clip(prim, &region));
            match (below.is_empty(), above.is_empty()) {
                (false, false) => {
                    let longest = [&below, &above].map(|half| vec3::max_abs(half.extent()) as f64);
                    let rest = cuts - 1;
                    let share = longest[0] / (longest[0] + longest[1]);
                    // Both may be points; then there is nothing left to cut either.
                    let to_below = (rest as f64 * share + 0.5) as usize;
                    let to_below = to_below.min(rest);
                    open.extend([(above, rest - to_below), (below, to_below)]);
                }
                // Nothing of it in one half: the other one is the same thing in a smaller box.
                (true, false) => open.push((above, cuts)),
                (false, true) => open.push((below, cuts)),
                (true, true) => pieces.push((bounds, prim)),
            }
        }
        Ok(())
    }
}

/// How many cuts a priority gets.
fn cuts(priority: f32, worth: f32) -> usize {
    (priority * worth) as u32 as usize
}

/// Planes at powers of two times a cell's edge.
struct Grid {
    origin: [f32; 3],
    /// Edge of a cell, and its reciprocal.
    cell: f64,
    per_cell: f64,
    /// One over the square of the scene's longest edge.
    per_area: f64,
}

/// A plane through a box.
struct Plane {
    axis: usize,
    at: f32,
    /// 0 for the middle of the scene's longest edge, one more for each halving of cells.
    level: u32,
}

impl Grid {
    fn new(around: &Aabb) -> Self {
        let longest = f64::from(vec3::max_abs(around.extent()));
        let cell = longest / f64::from(1_u32 << GRID_BITS);
        let per_area = 1.0 / (longest * longest);
        Self { origin: around.lo, cell, per_cell: 1.0 / cell, per_area }
    }

    /// The plane of the lowest level strictly inside a box of the scene; the lowest axis wins a tie.
    fn most_important(&self, bounds: &Aabb) -> Option<Plane> {
        let mut best: Option<Plane> = None;
        for axis in 0..3 {
            let place = |x: f32| (f64::from(x) - f64::from(self.origin[axis])) * self.per_cell;
            // The first cell that the box enters, and the last one.
            let first = libm::floor(place(bounds.lo[axis])) as u32;
            let last = (libm::ceil(place(bounds.hi[axis])) as u32).max(1) - 1;
            if first >= last {
                continue;
            }
            let bit = (first ^ last).ilog2();
            let level = GRID_BITS.saturating_sub(bit + 1);
            let at = f64::from(self.origin[axis]) + f64::from(last >> bit << bit) * self.cell;
            let at = at as f32;
            let inside = bounds.lo[axis] < at && at < bounds.hi[axis];
            if inside && best.as_ref().is_none_or(|best| level < best.level) {
                best = Some(Plane { axis, at, level });
            }
        }
        best
    }
}

/// The tree over primitives instead of their pieces. Those of one primitive in a leaf are one again.
fn merge(mut tree: Tree, of: &[u32], context: &Context<'_>) -> Result<Tree, BuildError> {
    /// What is no primitive's number.
    const GONE: u32 = u32::MAX;
    tree.prims.iter_mut().for_each(|piece| *piece = of[*piece as usize]);
    let mut gone = 0_usize;
    for (step, node) in tree.nodes.iter_mut().enumerate() {
        if step % CHUNK == 0 {
            context.cancel.check()?;
        }
        let Kind::Leaf { first, count } = node.kind() else { continue };
        let prims = &mut tree.prims[first..first + count];
        let mut kept = 0;
        for at in 0..count {
            if !prims[..kept].contains(&prims[at]) {
                prims[kept] = prims[at];
                kept += 1;
            }
        }
        prims[kept..].fill(GONE);
        gone += count - kept;
        node.count = kept as u32;
    }
    if gone == 0 {
        return Ok(tree);
    }

    // Close the gaps. What was before each entry says where a leaf begins now.
    let mut before = memory::try_with_capacity(tree.prims.len(), "places of primitives")?;
    let mut kept = 0_u32;
    before.extend(tree.prims.iter().map(|&prim| {
        let place = kept;
        kept += u32::from(prim != GONE);
        place
    }));
    for node in &mut tree.nodes {
        if node.count > 0 {
            node.first = before[node.first as usize];
        }
    }
    tree.prims.retain(|&prim| prim != GONE);
    Ok(tree)
}

//! Binned SAH with spatial splits: a node may be cut by a plane through its primitives, which then
//! go to both sides, in pieces.
//!
//! Source: M. Stich, H. Friedrich, A. Dietrich, "Spatial Splits in Bounding Volume Hierarchies", HPG
//! 2009: a spatial split is tried where the children of the best object split overlap by more than a
//! share of the scene's area; pieces are counted where they enter and where they leave; a straddling
//! reference stays whole on one side if that is cheaper. Differs from it: pieces are boxes that
//! [`Clip`] makes, and the number of extra references is bounded by a budget, which the halves of a
//! cut share in proportion to their references.
//!
//! # What it is good for
//!
//! Single rays a second on one core after full reinsertion, as shares of those through a tree of
//! `binned-sah` and the same reinsertion ([`crate::Quality::Best`]):
//!
//! | scene, triangles | primary | occlusion | diffuse |
//! |---|---|---|---|
//! | house, 1.6 M | 1.11 | 1.16 | 1.14 |
//! | arches, 1.0 M | 1.06 | 1.08 | 1.09 |
//! | coffee maker, 0.2 M | 1.00 | 0.98 | 0.96 |
//! | car, 0.8 M | 0.95 | 1.05 | 1.00 |
//! | kitchen, 1.4 M | 0.97 | 0.88 | 0.93 |
//!
//! That is 1.02 on average and a worst case of 0.88, so no quality level splits; buildings
//! may want to. In the kitchen it is the splits that lose: with a budget of 0 this builder and reinsertion
//! are as fast as the other. Reinsertion lifts a large triangle, whole, to where it is in nobody's way,
//! which takes most of what splits give: by splits the kitchen's SAH falls from 44.7 to 36.8, by
//! reinsertion to 34.5, by both to 32.5; and yet rays slow down.
//!
//! # What was tried
//!
//! With full reinsertion after each, the same shares, in the order above (occlusion in the kitchen, diffuse
//! in the house, diffuse in the coffee maker):
//! - taking cuts through primitives at 0.95 of the other cut's cost (0.99 is Embree's rule): 0.79, 1.12,
//!   0.99 against 0.88, 1.14, 0.96;
//! - looking for them wherever children overlap by 1e-5 of the scene and by 0.05 of the node, as the source
//!   does without the latter, at 0.95: 0.81, 1.12, 0.99; up to six times the time where all overlaps;
//! - half as many references again (`budget` 0.5) at 1e-5: 0.81, 1.14, 0.87;
//! - looking only where children overlap by 3e-3 of the scene, at 0.99: 0.77 in the kitchen; a quarter of the
//!   references (`budget` 0.05): 0.91, diffuse 0.95;
//! - 32 bins at 0.95: 0.71, 1.08, 0.96, and a third more time;
//! - leaves of one triangle, which give reinsertion more to move: 0.79, 1.09, 0.85;
//! - prices by blocks of four (`block`), as `binned-sah` has: 0.81 in the kitchen; in the house diffuse
//!   rays are 0.96 times as fast as by single tests.
//!
//! Splitting after the build, leaf by leaf, where cutting one in the middle and reinserting a half
//! lowers the cost: it hardly ever does (SAH 34.52 to 34.49). Splitting before the build is
//! [`super::presplit`].
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
//! Instances are not split ([`Clip::least_half_area`] says so): entering one twice costs more than a
//! tighter box saves.
//!
//! Cost: O(n log n) time, 28 bytes a reference. Ranges are cut in parallel with budgets of their own, in
//! proportion to their references, so the tree is the same for any number of threads. Arches of 1.0 M
//! triangles are built and lowered at 0.47 M triangles a second of one core's time (`hploc`: 6.6), the car
//! at 0.20; the kitchen with full reinsertion takes 4.3 s of it.

mod partition;
mod planes;

use self::planes::BINS_MAX;
use super::clip::Clip;
use super::{BuildError, Builder, Info, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::math::vec3;
use crate::memory;
use crate::tree::{DEPTH_MAX, Node, PRIMS_MAX, Tree};
use alloc::vec::Vec;

/// Scenes whose longest edge is shorter are not split.
pub const EXTENT_MIN: f32 = 1.0 / (1_u64 << 60) as f32;

/// Passes over references are cut into chunks of this size.
const CHUNK: usize = 16_384;

/// A range is cut in rounds while it has more than 1/64 of all references, and at least this many.
const ROUND_MIN: usize = 16_384;
/// How many tasks to aim for.
const TASKS: usize = 64;

/// Cuts at the cheapest of a few planes, between primitives or through them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sbvh {
    /// Most primitives in a leaf, in `1..=64`.
    pub leaf_max: u32,
    /// Bins an axis, in `2..=32`.
    pub bins: u32,
    /// Price of visiting a node in units of one leaf test, in `0..=1000`.
    pub visit_cost: f32,
    /// How many primitives one leaf test tests, in `1..=64`: 1 where each is tested by itself, 4 where
    /// four are tested side by side.
    pub block: u32,
    /// Cuts through primitives are tried where the children overlap by more than this share of the
    /// scene's area, in `0..=1`.
    pub overlap_min: f32,
    /// ... and by more than this share of the node's own area, in `0..=1`.
    pub node_overlap_min: f32,
    /// A cut through primitives is taken if its cost is below this share of that of the best cut
    /// between them, in `0..=1`.
    pub advantage: f32,
    /// Extra references at most, as a share of the primitives, in `0..=4`.
    pub budget: f32,
    /// Pieces clipped to look for planes, for each primitive, the last look of each range aside; in
    /// `0..=1000000`. Where all triangles are long and slanted (hair), each node looks at up to three
    /// pieces a bin of all that it has: with no limit but time half a million of them took 70 s instead
    /// of 20 s on a busy core, for the same SAH.
    pub clips: u32,
}

impl Sbvh {
    /// Sixteen bins, leaves of up to four, at most a fifth as many references again.
    pub const DEFAULT: Self = Self {
        leaf_max: 4,
        bins: 16,
        visit_cost: 1.0,
        block: 1,
        overlap_min: 1e-4,
        node_overlap_min: 0.1,
        advantage: 0.99,
        budget: 0.2,
        clips: 128,
    };
}

impl Builder for Sbvh {
    fn info(&self) -> Info {
        Info {
            name: "sbvh",
            summary: "cuts at the cheapest of a few planes, also through primitives",
            source: "Stich, Friedrich, Dietrich 2009",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        self.run(bounds, None, context)
    }

    fn build_clipped(
        &self,
        bounds: &[Aabb],
        clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        self.run(bounds, Some(clip), context)
    }
}

/// A primitive or a piece of one.
#[derive(Clone, Copy, Debug)]
struct Ref {
    bounds: Aabb,
    prim: u32,
}

/// The two boxes that decide a split.
#[derive(Clone, Copy, Debug)]
struct Extent {
    bounds: Aabb,
    centers: Aabb,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, centers: Aabb::EMPTY };

    #[inline(always)]
    fn add(&mut self, bounds: &Aabb) {
        let center = bounds.center();
        self.bounds = self.bounds.union(bounds);
        self.centers = self.centers.union(&Aabb { lo: center, hi: center });
    }
}

/// A node to be, over references that lie elsewhere.
#[derive(Clone, Copy)]
struct Range {
    node: usize,
    depth: u32,
    extent: Extent,
    /// Extra references that may still be made below.
    budget: usize,
    /// Pieces that may still be clipped below to look for planes.
    clips: u64,
}

/// A range that owns its references.
struct Task {
    range: Range,
    refs: Vec<Ref>,
}

/// A finished range: its root is node 0, its leaves count from 0.
struct Subtree {
    nodes: Vec<Node>,
    prims: Vec<u32>,
}

/// The two sides of a cut.
struct Sides {
    left: Extent,
    right: Extent,
    /// Extra references made.
    made: usize,
    /// Pieces clipped to find the plane.
    clips: u64,
}

struct Build<'a> {
    options: Sbvh,
    /// Nothing is split without it.
    clip: Option<&'a dyn Clip>,
    /// Half area by which children must overlap.
    overlap_min: f64,
    stage: &'a Stage<'a>,
}

impl Sbvh {
    fn run(
        &self,
        bounds: &[Aabb],
        clip: Option<&dyn Clip>,
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        check_option("bins", f64::from(self.bins), 2.0..=BINS_MAX as f64, "2..=32")?;
        check_option("visit_cost", f64::from(self.visit_cost), 0.0..=1000.0, "0..=1000")?;
        check_option("block", f64::from(self.block), 1.0..=64.0, "1..=64")?;
        check_option("overlap_min", f64::from(self.overlap_min), 0.0..=1.0, "0..=1")?;
        check_option("node_overlap_min", f64::from(self.node_overlap_min), 0.0..=1.0, "0..=1")?;
        check_option("advantage", f64::from(self.advantage), 0.0..=1.0, "0..=1")?;
        check_option("budget", f64::from(self.budget), 0.0..=4.0, "0..=4")?;
        check_option("clips", f64::from(self.clips), 0.0..=1e6, "0..=1000000")?;
        let count = bounds.len();
        if count > PRIMS_MAX {
            return Err(BuildError::TooManyPrims { prims: count as u64 });
        }
        if count == 0 {
            return Ok(Tree::default());
        }
        let stage = Stage::new(context, "build", count as u64);
        let (refs, extent) = gather(bounds, &stage)?;
        let root_area = extent.bounds.half_area();
        let large = vec3::max_abs(extent.bounds.extent()) >= EXTENT_MIN;
        let build = Build {
            options: *self,
            clip: clip.filter(|_| large),
            overlap_min: f64::from(self.overlap_min) * root_area,
            stage: &stage,
        };
        let extra = libm::floor(f64::from(self.budget) * count as f64) as usize;
        let budget = extra.min(PRIMS_MAX - count);
        let clips = u64::from(self.clips) * count as u64;
        let range = Range { node: 0, depth: 0, extent, budget, clips };
        build.run(Task { range, refs })
    }
}

impl Sbvh {
    /// Leaf tests that so many primitives take.
    fn tests(&self, prims: usize) -> f64 {
        prims.div_ceil(self.block as usize) as f64
    }
}

impl Build<'_> {
    fn run(&self, root: Task) -> Result<Tree, BuildError> {
        let count = root.refs.len();
        let round_min = ROUND_MIN.max(count / TASKS);
        let mut nodes = alloc::vec![Node::leaf(root.range.extent.bounds, 0, 1)];

        // Cut the large ranges, round by round, all in the order of their places in the tree.
        let mut line = alloc::vec![root];
        while line.iter().any(|task| task.refs.len() > round_min) {
            let cut = parallel::map(line, |mut task| {
                if task.refs.len() <= round_min {
                    return Ok((task, None));
                }
                let sides = self.cut(&mut task.refs, 0, &task.range)?;
                Ok((task, sides))
            });
            line = Vec::new();
            for task in cut {
                let task: Result<_, BuildError> = task;
                match task? {
                    (task, None) => line.push(task),
                    (mut task, Some((sides, right))) => {
                        let [a, b] =
                            divide(&mut nodes, &task.range, &sides, task.refs.len(), right);
                        let left = task.refs.split_off(right);
                        line.extend([
                            Task { range: a, refs: left },
                            Task { range: b, refs: task.refs },
                        ]);
                    }
                }
            }
        }

        // Finish each by itself, then append what they made.
        let subtrees = parallel::map(line, |task| {
            let node = task.range.node;
            let size = task.refs.len();
            let subtree = self.finish(task)?;
            // Pieces are no progress.
            self.stage.advance((size * count / count.max(1)) as u64);
            Ok((node, subtree))
        });
        let mut prims = memory::try_with_capacity(count, "the tree's primitives")?;
        for subtree in subtrees {
            let subtree: Result<(usize, Subtree), BuildError> = subtree;
            let (at, subtree) = subtree?;
            memory::try_reserve(&mut nodes, subtree.nodes.len(), "the tree's nodes")?;
            memory::try_reserve(&mut prims, subtree.prims.len(), "the tree's primitives")?;
            let (children, first) = (nodes.len() - 1, prims.len());
            let [root, below @ ..] = subtree.nodes.as_slice() else { continue };
            nodes[at] = root.shifted(children, first);
            nodes.extend(below.iter().map(|node| node.shifted(children, first)));
            prims.extend(subtree.prims);
        }
        Ok(Tree { nodes, prims })
    }

    /// A whole subtree, depth first. The references of open ranges lie in one stack, those of the
    /// next range on top.
    fn finish(&self, task: Task) -> Result<Subtree, BuildError> {
        let Task { range, mut refs } = task;
        let mut nodes = Vec::with_capacity(2 * refs.len());
        let mut prims = Vec::with_capacity(refs.len());
        nodes.push(Node::leaf(range.extent.bounds, 0, 1));
        let mut open = alloc::vec![(Range { node: 0, ..range }, 0)];
        while let Some((range, begin)) = open.pop() {
            self.stage.check()?;
            let Some((sides, right)) = self.cut(&mut refs, begin, &range)? else {
                let first = prims.len();
                for item in refs.drain(begin..) {
                    // Pieces of one primitive that end up together are one again.
                    if !prims[first..].contains(&item.prim) {
                        prims.push(item.prim);
                    }
                }
                nodes[range.node] = Node::leaf(range.extent.bounds, first, prims.len() - first);
                continue;
            };
            let count = refs.len() - begin;
            let [left, right_range] = divide(&mut nodes, &range, &sides, count, right);
            open.push((right_range, begin));
            open.push((left, begin + right));
        }
        Ok(Subtree { nodes, prims })
    }

    /// Cuts the references from `begin` on: those of the right side come first, then as many as
    /// there are left. `None` makes a leaf.
    fn cut(
        &self,
        refs: &mut Vec<Ref>,
        begin: usize,
        range: &Range,
    ) -> Result<Option<(Sides, usize)>, BuildError> {
        let here = &mut refs[begin..];
        let count = here.len();
        let may_stay = count <= self.options.leaf_max as usize;
        if count == 1 || may_stay && count <= self.options.block as usize {
            return Ok(None);
        }
        // A halved range of `count` still needs this many levels below this one.
        let levels = usize::BITS - (count - 1).leading_zeros();
        if range.depth + levels + 1 < DEPTH_MAX {
            let area = range.extent.bounds.half_area();
            let object = self.object_plane(here, &range.extent)?;
            let object_cost = object.as_ref().map_or(f64::INFINITY, |plane| plane.cost);
            let node_min = f64::from(self.options.node_overlap_min) * area;
            let limit = f64::from(self.options.advantage) * object_cost;
            let (spatial, clips) = match &object {
                Some(plane) if plane.overlap <= self.overlap_min.max(node_min) => (None, 0),
                _ => self.spatial_plane(here, range)?,
            };
            let spatial = spatial.filter(|plane| plane.cost < limit);
            let counted = |(sides, right)| (Sides { clips, ..sides }, right);
            let best = spatial.as_ref().map_or(object_cost, |plane| plane.cost);
            let stay = self.options.tests(count) * area;
            if may_stay && best + f64::from(self.options.visit_cost) * area >= stay {
                return Ok(None);
            }
            if let Some(plane) = spatial
                && let Some(cut) = self.cut_through(refs, begin, range, &plane)?
            {
                return Ok(Some(counted(cut)));
            }
            if let Some(plane) = object
                && let Some(cut) = self.cut_between(&mut refs[begin..], &range.extent, &plane)?
            {
                return Ok(Some(counted(cut)));
            }
        }
        if count <= self.options.leaf_max as usize {
            return Ok(None);
        }
        // Nothing tells them apart, or the tree is too deep: cut in the middle.
        let right = count - count / 2;
        let (b, a) = refs[begin..].split_at(right);
        let sides =
            Sides { left: self.extent_of(a)?, right: self.extent_of(b)?, made: 0, clips: 0 };
        Ok(Some((sides, right)))
    }

    fn extent_of(&self, refs: &[Ref]) -> Result<Extent, Cancelled> {
        let mut extent = Extent::EMPTY;
        for chunk in refs.chunks(CHUNK) {
            self.stage.check()?;
            chunk.iter().for_each(|item| extent.add(&item.bounds));
        }
        Ok(extent)
    }
}

/// Makes the range's node an inner one; returns the ranges of its children, left and right.
fn divide(
    nodes: &mut Vec<Node>,
    range: &Range,
    sides: &Sides,
    count: usize,
    right: usize,
) -> [Range; 2] {
    let children = nodes.len();
    nodes[range.node] = Node::inner(range.extent.bounds, children);
    let to_right = |all: u64| (u128::from(all) * right as u128 / count as u128) as u64;
    let shared = |all: u64| [all - to_right(all), to_right(all)];
    let budgets = shared((range.budget - sides.made) as u64);
    let clips = shared(range.clips.saturating_sub(sides.clips));
    let extents = [sides.left, sides.right];
    let mut side = 0;
    budgets.map(|budget| {
        let extent = extents[side];
        nodes.push(Node::leaf(extent.bounds, 0, 1));
        side += 1;
        let (budget, clips) = (budget as usize, clips[side - 1]);
        Range { node: children + side - 1, depth: range.depth + 1, extent, budget, clips }
    })
}

/// One reference for each box, and their extent.
fn gather(bounds: &[Aabb], stage: &Stage<'_>) -> Result<(Vec<Ref>, Extent), BuildError> {
    let mut refs = memory::try_with_capacity(bounds.len(), "primitive references")?;
    let mut extent = Extent::EMPTY;
    for chunk in bounds.chunks(CHUNK) {
        stage.check()?;
        let first = refs.len() as u32;
        refs.extend(chunk.iter().zip(first..).map(|(bounds, prim)| Ref { bounds: *bounds, prim }));
        chunk.iter().for_each(|bounds| extent.add(bounds));
    }
    Ok((refs, extent))
}

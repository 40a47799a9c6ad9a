//! Binned SAH: drop the centers into a few bins an axis, cut at the cheapest bin edge.
//!
//! Source: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", IEEE Symposium
//! on Interactive Ray Tracing, 2007. Differs from it: every axis is tried, not only the widest one;
//! small ranges get fewer bins; large ranges are cut where a sample of them says (`groups`).
//!
//! O(n log n) time; 64 bytes a primitive for the references, half of them only while its group is
//! being finished, and the nodes twice while they are put together. Boxes are as wide as the processor's
//! vectors: with AVX-512, scenes of 0.8 and 1.4 M triangles are built in 5 to 9 % less time than with
//! SSE2.
//!
//! Where leaves are tested in blocks, a leaf of four costs what a leaf of one costs, and trees are
//! built for that price (`block`): by it they are 0.3 to 11 % cheaper than trees built for the price
//! of single tests, have half the nodes, and wide trees made of them were traced 0.97 to 1.07 times
//! as fast.
//!
//! Tried and lost, on a kitchen of 1.4 M triangles and a car of 0.8 M, prices by blocks:
//! - 16 bins instead of 32: 2 % dearer trees, 0.4 % fewer instructions;
//! - fewer bins for small ranges (`4 + n / 8`): 0.5 % dearer, 4 % fewer instructions; more (`4 + n / 2`):
//!   the same trees, 5 % more instructions;
//! - samples of 1024 of a large range: up to 3 % dearer; of 4096: the same, 3 % slower;
//! - partitions in place through a buffer for one side: as fast, 7 % more instructions and 60 lines.

use super::bins::{BINS_MAX, Bins, Grid, Plane, unit};
use super::groups::{self, Top};
use super::lanes::{Box4, Extent4, Ref};
use super::{BuildError, Builder, Info, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::simd::{Checked, Kernel, Level, Simd};
use crate::tree::{DEPTH_MAX, Kind, Node, PRIMS_MAX, Tree};
use alloc::boxed::Box;
use alloc::vec::Vec;

/// Cuts at the cheapest of a few planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinnedSah {
    /// Most primitives in a leaf, in `1..=64`.
    pub leaf_max: u32,
    /// Bins an axis, in `2..=32`. More find better cuts in large ranges and cost time in small ones.
    pub bins: u32,
    /// Price of visiting a node in units of one leaf test, in `0..=1000`. Higher makes fuller
    /// leaves.
    pub visit_cost: f32,
    /// How many primitives one leaf test tests, rounded up to a power of two, in `1..=64`: 1 where
    /// each is tested by itself, 4 where four are tested side by side.
    pub block: u32,
}

impl BinnedSah {
    /// Thirty-two bins, leaves of up to four, tested side by side.
    pub const DEFAULT: Self = Self { leaf_max: 4, bins: 32, visit_cost: 1.0, block: 4 };
}

impl Builder for BinnedSah {
    fn info(&self) -> Info {
        Info {
            name: "binned-sah",
            summary: "cuts at the cheapest of a few planes by the surface area heuristic",
            source: "Wald 2007",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        check_option("bins", f64::from(self.bins), 2.0..=BINS_MAX as f64, "2..=32")?;
        check_option("visit_cost", f64::from(self.visit_cost), 0.0..=1000.0, "0..=1000")?;
        check_option("block", f64::from(self.block), 1.0..=64.0, "1..=64")?;
        if bounds.len() > PRIMS_MAX {
            return Err(BuildError::TooManyPrims { prims: bounds.len() as u64 });
        }
        if bounds.is_empty() {
            return Ok(Tree::default());
        }
        let stage = Stage::new(context, "build", bounds.len() as u64);
        // The tree is the same at every level.
        let level = Level::best().checked().unwrap_or(Checked::SCALAR);
        let (mut refs, top) = groups::gather(bounds, level, context)?;
        let mut prims = memory::try_filled(0, bounds.len(), "the tree's primitives")?;

        // One task a group: what it does depends on nothing else.
        let mut tasks = Vec::with_capacity(top.groups.len());
        let (mut refs_left, mut prims_left) = (&mut *refs, prims.as_mut_slice());
        for group in &top.groups {
            let (refs, rest) = refs_left.split_at_mut(group.count);
            let (prims, names) = prims_left.split_at_mut(group.count);
            (refs_left, prims_left) = (rest, names);
            tasks.push((refs, prims, group.depth));
        }
        let subtrees = parallel::map(tasks, |(refs, prims, depth)| {
            let count = refs.len() as u64;
            let mut other = memory::try_filled(Ref::none(), refs.len(), "primitive references")?;
            let refs = [refs, other.as_mut_slice()];
            let nodes = level.run(Grow { options: self, refs, prims, stage: &stage, depth })?;
            stage.advance(count);
            Ok(nodes)
        });
        let subtrees = subtrees.into_iter().collect::<Result<Vec<_>, BuildError>>()?;
        drop(refs);
        Ok(Tree { nodes: join(&top, subtrees)?, prims })
    }
}

/// The top and the trees of its groups as one tree.
fn join(top: &Top, subtrees: Vec<Vec<Node>>) -> Result<Vec<Node>, BuildError> {
    let count = top.len() + subtrees.iter().map(|nodes| nodes.len() - 1).sum::<usize>();
    let mut nodes = memory::try_with_capacity(count, "the tree's nodes")?;
    nodes.resize(top.len(), Node::inner(Aabb::EMPTY, 0));
    let mut prims = 0;
    for (group, subtree) in top.groups.iter().zip(subtrees) {
        // Node 1 of the subtree lands at the present end.
        let children = nodes.len() - 1;
        nodes[group.node] = subtree[0].shifted(children, prims);
        nodes.extend(subtree[1..].iter().map(|node| node.shifted(children, prims)));
        prims += group.count;
    }
    for at in (0..top.len()).rev() {
        if let Some(left) = top.left(at) {
            let bounds = nodes[left].bounds.union(&nodes[left + 1].bounds);
            nodes[at] = Node::inner(bounds, left);
        }
    }
    Ok(nodes)
}

/// Ranges larger than this are cut where a sample of about this many says.
const SAMPLE_MAX: usize = 2048;
/// Partitions are interrupted at most this many references apart.
const CHECK_EVERY: usize = 16_384;

/// Grows a subtree whose root is at that depth; its root is node 0, its ranges start at 0.
struct Grow<'a> {
    options: &'a BinnedSah,
    /// The second array is as long as the first, and anything.
    refs: [&'a mut [Ref]; 2],
    prims: &'a mut [u32],
    stage: &'a Stage<'a>,
    depth: u32,
}

impl Kernel for Grow<'_> {
    type Output = Result<Vec<Node>, Cancelled>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Grow { options, refs, prims, stage, depth } = self;
        Growth::new(simd, options, refs, prims, stage).grow(depth)
    }
}

/// A subtree being grown over some references.
///
/// A partition moves a range from one of two arrays to the same place in the other: one load and
/// one store a reference. In place, through a buffer for one side, took twice the instructions.
struct Growth<'a, S> {
    simd: S,
    options: &'a BinnedSah,
    block: u32,
    refs: [&'a mut [Ref]; 2],
    prims: &'a mut [u32],
    stage: &'a Stage<'a>,
    nodes: Vec<Node>,
    bins: Box<Bins>,
    /// Nodes whose box is known only when their children's are.
    late: Vec<usize>,
}

/// A node to be, over a range of the references.
#[derive(Clone, Copy)]
struct Open {
    node: usize,
    begin: usize,
    end: usize,
    depth: u32,
    /// Which array the range is in.
    side: usize,
}

/// Where a range is cut, and which array its parts are in.
struct Parts {
    middle: usize,
    side: usize,
}

impl<'a, S: Simd> Growth<'a, S> {
    #[inline(always)]
    fn new(
        simd: S,
        options: &'a BinnedSah,
        refs: [&'a mut [Ref]; 2],
        prims: &'a mut [u32],
        stage: &'a Stage<'a>,
    ) -> Self {
        Self {
            simd,
            options,
            block: options.block.next_power_of_two(),
            nodes: Vec::with_capacity(refs[0].len()),
            bins: Bins::new(),
            late: Vec::new(),
            refs,
            prims,
            stage,
        }
    }

    #[inline(always)]
    fn grow(mut self, depth: u32) -> Result<Vec<Node>, Cancelled> {
        let root = Open { node: 0, begin: 0, end: self.prims.len(), depth, side: 0 };
        self.nodes.push(Node::inner(Aabb::EMPTY, 0));
        let mut open = alloc::vec![root];
        while let Some(range) = open.pop() {
            self.stage.check()?;
            let (bounds, parts) = self.decide(&range)?;
            let bounds = bounds.to_aabb();
            let Some(Parts { middle, side }) = parts else {
                self.nodes[range.node] = Node::leaf(bounds, range.begin, range.end - range.begin);
                let items = &self.refs[range.side][range.begin..range.end];
                let prims = &mut self.prims[range.begin..range.end];
                prims.iter_mut().zip(items).for_each(|(prim, item)| *prim = item.prim());
                continue;
            };
            let left = self.nodes.len();
            self.nodes[range.node] = Node::inner(bounds, left);
            self.nodes.extend([Node::inner(Aabb::EMPTY, 0); 2]);
            let depth = range.depth + 1;
            open.push(Open { node: left + 1, begin: middle, end: range.end, depth, side });
            open.push(Open { node: left, begin: range.begin, end: middle, depth, side });
        }
        for &at in self.late.iter().rev() {
            if let Kind::Inner { left } = self.nodes[at].kind() {
                self.nodes[at].bounds = self.nodes[left].bounds.union(&self.nodes[left + 1].bounds);
            }
        }
        Ok(self.nodes)
    }

    /// The box of a range and where it is cut, if it is not to be a leaf.
    #[inline(always)]
    fn decide(&mut self, range: &Open) -> Result<(Box4, Option<Parts>), Cancelled> {
        let count = range.end - range.begin;
        // A halved range of `count` still needs this many levels below this one.
        let levels = usize::BITS - (count - 1).leading_zeros();
        let may_choose = range.depth + levels + 1 < DEPTH_MAX;
        let halves = Parts { middle: range.begin + count / 2, side: range.side };
        if count > SAMPLE_MAX {
            self.late.push(range.node);
            let parts = if may_choose { self.cut_by_sample(range)? } else { None };
            return Ok((Box4::EMPTY, Some(parts.unwrap_or(halves))));
        }
        let extent = Extent4::of(self.simd, self.refs[range.side][range.begin..range.end].iter());
        let parts = if count > 1 && may_choose { self.cut(range, &extent) } else { None };
        let full = count > self.options.leaf_max as usize;
        Ok((extent.bounds, parts.or(full.then_some(halves))))
    }

    /// Cuts a small range at its cheapest plane.
    #[inline(always)]
    fn cut(&mut self, range: &Open, extent: &Extent4) -> Option<Parts> {
        let [a, b] = &mut self.refs;
        let (from, to) = if range.side == 0 { (&**a, &mut **b) } else { (&**b, &mut **a) };
        let (from, to) = (&from[range.begin..range.end], &mut to[range.begin..range.end]);
        let (count, block) = (from.len(), self.block as usize);
        let may_stay = count <= self.options.leaf_max as usize;
        if may_stay && count <= block {
            return None;
        }
        let grid = Grid::new(extent.centers, bins_for(count, self.options.bins as usize));
        self.bins.fill(self.simd, &grid, from.iter());
        let unit = unit(extent.bounds);
        let plane = self.bins.cheapest(self.simd, grid.bins, unit, self.block)?;
        if may_stay {
            let area = extent.bounds.half_area(unit);
            let stay = count.div_ceil(block) as f32 * area;
            if plane.cost + self.options.visit_cost * area >= stay {
                return None;
            }
        }
        let left = partition(from, to, &grid, &plane);
        Some(Parts { middle: range.begin + left, side: 1 - range.side })
    }

    /// Cuts a large range at the plane that is cheapest for a sample of it.
    #[inline(always)]
    fn cut_by_sample(&mut self, range: &Open) -> Result<Option<Parts>, Cancelled> {
        let [a, b] = &mut self.refs;
        let (from, to) = if range.side == 0 { (&**a, &mut **b) } else { (&**b, &mut **a) };
        let (from, to) = (&from[range.begin..range.end], &mut to[range.begin..range.end]);
        let stride = from.len().div_ceil(SAMPLE_MAX);
        let extent = Extent4::of(self.simd, from.iter().step_by(stride));
        let grid = Grid::new(extent.centers, self.options.bins as usize);
        self.bins.fill(self.simd, &grid, from.iter().step_by(stride));
        let Some(plane) = self.bins.cheapest(self.simd, grid.bins, unit(extent.bounds), 1) else {
            return Ok(None);
        };
        // What is not yet placed lies between what went left and what went right.
        let (mut left, mut end) = (0, to.len());
        for chunk in from.chunks(CHECK_EVERY) {
            self.stage.check()?;
            let free = &mut to[left..end];
            let room = free.len();
            let more = partition(chunk, free, &grid, &plane);
            left += more;
            end = left + room - chunk.len();
        }
        let parts = Parts { middle: range.begin + left, side: 1 - range.side };
        Ok((0 < left && left < from.len()).then_some(parts))
    }
}

/// Moves a chunk to the two ends of an array at least as long, what goes left to its front in order,
/// the rest to its back in reverse; returns how many went left. No branch depends on where a
/// reference goes.
#[inline(always)]
fn partition(from: &[Ref], to: &mut [Ref], grid: &Grid, plane: &Plane) -> usize {
    let last = to.len().wrapping_sub(1);
    let mut left = 0_usize;
    for (at, item) in from.iter().enumerate() {
        let goes = grid.is_below(item, plane);
        // Left: the next place from the front; right: the next one from the back.
        let back = last.wrapping_sub(at) & goes.wrapping_sub(1);
        to[left.wrapping_add(back)] = *item;
        left += goes;
    }
    left
}

/// How many bins an axis to try for so many primitives.
fn bins_for(count: usize, most: usize) -> usize {
    (4 + count / 4).min(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_out_of_range_are_named() {
        let build = |builder: BinnedSah| builder.build(&[], &Context::default());
        let bad = build(BinnedSah { bins: 33, ..BinnedSah::DEFAULT });
        assert_eq!(bad, Err(BuildError::Option { option: "bins", value: 33.0, allowed: "2..=32" }));
        assert!(build(BinnedSah { leaf_max: 0, ..BinnedSah::DEFAULT }).is_err());
        assert!(build(BinnedSah { visit_cost: f32::NAN, ..BinnedSah::DEFAULT }).is_err());
        assert!(build(BinnedSah { block: 0, ..BinnedSah::DEFAULT }).is_err());
        assert!(build(BinnedSah::DEFAULT).is_ok());
    }
}

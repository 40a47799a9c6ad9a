//! The top of a large tree from a sample: primitives are sorted into a few dozen groups in two
//! passes, instead of being moved once a level.
//!
//! Sources: P. Ganestam, R. Barringer, M. Doggett, T. Akenine-Moeller, "Bonsai: Rapid Bounding
//! Volume Hierarchy Generation using Mini Trees", JCGT 4(3), 2015 (small groups first, trees over
//! them after); L. Tessari, A. Dittebrandt, M. Doyle, C. Benthin, "Stochastic Subsets for BVH
//! Construction", Computer Graphics Forum 42(2), 2023 (a subset of the primitives tells where to
//! cut). Differs from both: the subset is every k-th primitive, so the tree is the same every time,
//! and its tree is kept as the top of the final one, with boxes taken from below.
//!
//! Cost: one pass that names each primitive's group (a descent of 6 to 10 planes), one that moves
//! it there; 1 byte a primitive besides the references.

use super::BuildError;
use super::bins::{BINS_MAX, Bins, Grid, unit};
use super::lanes::{Extent4, Ref};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, parallel};
use crate::memory::Pages;
use crate::simd::{Checked, Kernel, Simd};
use alloc::vec::Vec;

/// The most primitives in the sample. A quarter of it made trees 3 % dearer, one eighth 9 % (a
/// kitchen, whose few large walls matter most).
const SAMPLE: usize = 131_072;
/// A group is not cut when it has at most this many of the sample.
const GROUP_SAMPLE: usize = 2048;
/// Fewer primitives are one group.
const GROUPS_MIN: usize = 8192;
/// The most groups: their numbers are bytes.
const GROUPS_MAX: usize = 256;
/// The top is no deeper than this.
const TOP_DEPTH_MAX: u32 = 32;
/// How many primitives descend side by side.
const ABREAST: usize = 8;
/// Primitives are named and moved this many at a time.
const CHUNK: usize = 16_384;

/// A node of the top.
#[derive(Clone, Copy)]
struct TopNode {
    /// Centers from here on go right; NaN, which nothing reaches, in a leaf.
    edge: f32,
    axis: u32,
    /// The left child; the right one is next. A leaf leads to itself.
    left: u32,
    /// Of a leaf.
    group: u32,
}

/// One part of the primitives: a leaf of the top.
pub(super) struct Group {
    /// Its node in the top, and how deep that is.
    pub(super) node: usize,
    pub(super) depth: u32,
    /// How many primitives.
    pub(super) count: usize,
}

/// The top of a tree: what its nodes lead to, and the groups at its leaves.
pub(super) struct Top {
    nodes: Vec<TopNode>,
    pub(super) groups: Vec<Group>,
    depth: u32,
}

impl Top {
    /// A top that is one group.
    fn of_one(count: usize) -> Self {
        let leaf = TopNode { edge: f32::NAN, axis: 0, left: 0, group: 0 };
        let group = Group { node: 0, depth: 0, count };
        Self { nodes: alloc::vec![leaf], groups: alloc::vec![group], depth: 0 }
    }

    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The left child of an inner node.
    pub(super) fn left(&self, node: usize) -> Option<usize> {
        let left = self.nodes[node].left as usize;
        (left != node).then_some(left)
    }

    /// The groups of some primitives, and how many are in each. No branch depends on where one goes.
    ///
    /// Several descend side by side: each step waits for the one before, but not for the others' (one
    /// after the other took three times as long).
    fn name(&self, bounds: &[Aabb]) -> (Vec<u8>, [u32; GROUPS_MAX]) {
        let mut groups = Vec::with_capacity(bounds.len());
        let mut counts = [0_u32; GROUPS_MAX];
        for bounds in bounds.chunks(ABREAST) {
            let mut centers2 = [[0.0; 4]; ABREAST];
            for (center2, bounds) in centers2.iter_mut().zip(bounds) {
                for axis in 0..3 {
                    center2[axis] = bounds.lo[axis] + bounds.hi[axis];
                }
            }
            let mut at = [0_u32; ABREAST];
            for _ in 0..self.depth {
                for lane in 0..ABREAST {
                    let node = &self.nodes[at[lane] as usize];
                    let right = centers2[lane][node.axis as usize % 4] >= node.edge;
                    at[lane] = node.left + u32::from(right);
                }
            }
            for &at in &at[..bounds.len()] {
                let group = self.nodes[at as usize].group as u8;
                counts[usize::from(group)] += 1;
                groups.push(group);
            }
        }
        (groups, counts)
    }
}

/// The primitives, one group after the other, and the top that leads to the groups.
pub(super) fn gather(
    bounds: &[Aabb],
    level: Checked,
    context: &Context<'_>,
) -> Result<(Pages<Ref>, Top), BuildError> {
    // Fresh pages, first touched by whoever moves references there.
    let mut refs = Pages::zeroed(bounds.len(), "primitive references")?;
    if bounds.len() <= GROUPS_MIN {
        for ((bounds, prim), place) in bounds.iter().zip(0..).zip(&mut *refs) {
            *place = Ref::new(bounds, prim);
        }
        return Ok((refs, Top::of_one(bounds.len())));
    }
    let mut top = level.run(CutSample { bounds, context })?;

    // Name everybody's group.
    let named = parallel::map_chunks(bounds, CHUNK, |_, bounds| {
        context.cancel.check()?;
        Ok(top.name(bounds))
    });
    let named = named.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
    for (at, group) in top.groups.iter_mut().enumerate() {
        group.count = named.iter().map(|(_, counts)| counts[at] as usize).sum();
    }

    // Give each chunk its part of each group, in the order of the chunks, and move everybody there.
    let mut parts: Vec<Vec<&mut [Ref]>> =
        named.iter().map(|_| Vec::with_capacity(top.groups.len())).collect();
    let mut rest = &mut *refs;
    for at in 0..top.groups.len() {
        for (part, (_, counts)) in parts.iter_mut().zip(&named) {
            let (head, tail) = rest.split_at_mut(counts[at] as usize);
            part.push(head);
            rest = tail;
        }
    }
    let chunks: Vec<_> = bounds.chunks(CHUNK).zip(&named).zip(parts).enumerate().collect();
    let moved = parallel::map(chunks, |(chunk, ((bounds, (groups, _)), mut parts))| {
        context.cancel.check()?;
        let mut next = [0_u32; GROUPS_MAX];
        for ((bounds, prim), &group) in bounds.iter().zip((chunk * CHUNK) as u32..).zip(groups) {
            let group = usize::from(group);
            parts[group][next[group] as usize] = Ref::new(bounds, prim);
            next[group] += 1;
        }
        Ok(())
    });
    moved.into_iter().collect::<Result<(), Cancelled>>()?;
    Ok((refs, top))
}

/// Cuts a sample into groups.
struct CutSample<'a> {
    bounds: &'a [Aabb],
    context: &'a Context<'a>,
}

impl Kernel for CutSample<'_> {
    type Output = Result<Top, Cancelled>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        cut_sample(simd, self.bounds, self.context)
    }
}

#[inline(always)]
fn cut_sample<S: Simd>(simd: S, bounds: &[Aabb], context: &Context<'_>) -> Result<Top, Cancelled> {
    let stride = bounds.len().div_ceil(SAMPLE);
    let mut sample: Vec<Ref> =
        bounds.iter().step_by(stride).map(|bounds| Ref::new(bounds, 0)).collect();
    let mut top = Top::of_one(sample.len());
    top.groups.clear();
    let mut bins = Bins::new();

    // Breadth first, so that the groups are about equal when their number is used up.
    let mut open = alloc::collections::VecDeque::from([(0, 0..sample.len(), 0)]);
    while let Some((node, range, depth)) = open.pop_front() {
        context.cancel.check()?;
        let part = &mut sample[range.clone()];
        let may_cut = part.len() > GROUP_SAMPLE
            && depth < TOP_DEPTH_MAX
            && top.groups.len() + open.len() + 2 <= GROUPS_MAX;
        let cut = if may_cut { cut_part(simd, part, &mut bins) } else { None };
        let Some((axis, edge, middle)) = cut else {
            top.nodes[node].group = top.groups.len() as u32;
            top.groups.push(Group { node, depth, count: 0 });
            top.depth = top.depth.max(depth);
            continue;
        };
        let left = top.nodes.len();
        top.nodes[node] = TopNode { edge, axis: axis as u32, left: left as u32, group: 0 };
        let middle = range.start + middle;
        for (side, range) in [range.start..middle, middle..range.end].into_iter().enumerate() {
            let node = left + side;
            top.nodes.push(TopNode { edge: f32::NAN, axis: 0, left: node as u32, group: 0 });
            open.push_back((node, range, depth + 1));
        }
    }
    Ok(top)
}

/// Partitions a part of the sample at its cheapest plane: the axis, where, and how many are left.
#[inline(always)]
fn cut_part<S: Simd>(simd: S, part: &mut [Ref], bins: &mut Bins) -> Option<(usize, f32, usize)> {
    let extent = Extent4::of(simd, part.iter());
    let grid = Grid::new(extent.centers, BINS_MAX);
    bins.fill(simd, &grid, part.iter());
    let plane = bins.cheapest(simd, grid.bins, unit(extent.bounds), 1)?;
    let edge = grid.edge(plane.axis, plane.bin);
    let mut left = 0;
    for at in 0..part.len() {
        if part[at].center2().to_array()[plane.axis] < edge {
            part.swap(at, left);
            left += 1;
        }
    }
    (0 < left && left < part.len()).then_some((plane.axis, edge, left))
}

//! What builders over Morton codes share: sort along the curve, cut it into leaves, join from below.
//!
//! A builder is told the leaves one after the other, each with the level at which the curve parts it
//! from the next, and joins clusters as it likes. Every piece of the curve knows beforehand how many
//! nodes it makes, so all of them write to their final places at once. Pieces depend on the input
//! alone: so does the tree.
//!
//! O(n) time. 8 bytes a primitive of scratch while joining, besides the tree.

use super::BuildError;
use super::curve_leaves::{Mark, take};
use super::curve_order::{Order, Piece};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::tree::{Node, PRIMS_MAX, Tree};
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::AtomicU64;

/// A subtree whose root has no place yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    pub(super) root: Node,
    /// Edges on the longest path below.
    pub(super) height: u32,
}

/// Where the nodes of a piece go, pairs of siblings from the end to the front: what is joined later
/// lies above, so children come after their parents.
pub(super) struct Below<'a> {
    nodes: &'a mut [Node],
    /// Index of the first of `nodes` in the tree.
    base: usize,
    free: usize,
}

impl<'a> Below<'a> {
    fn new(nodes: &'a mut [Node], base: usize) -> Self {
        Self { free: nodes.len(), nodes, base }
    }

    /// Gives two clusters their places and a parent.
    #[inline(always)]
    pub(super) fn join(&mut self, left: &Cluster, right: &Cluster) -> Cluster {
        self.free -= 2;
        self.nodes[self.free] = left.root;
        self.nodes[self.free + 1] = right.root;
        let bounds = left.root.bounds.union(&right.root.bounds);
        let height = left.height.max(right.height) + 1;
        Cluster { root: Node::inner(bounds, self.base + self.free), height }
    }
}

/// How a builder joins clusters.
pub(super) trait Join: Sync {
    /// What it keeps between one cluster and the next.
    type Open: Default;

    /// Takes neighbours on the curve that belong together; `level` is where the last of them parts
    /// from what comes next: the greater, the closer. 0 at the end.
    fn push(&self, open: &mut Self::Open, group: &[Cluster], level: u8, below: &mut Below<'_>);

    /// Joins what is open until `count` clusters are left.
    fn finish(&self, open: &mut Self::Open, count: usize, below: &mut Below<'_>) -> Vec<Cluster>;

    /// How many clusters a piece of many leaves hands to the top of the tree.
    fn keep(&self) -> usize;
}

/// Builds the tree that `join` joins, with leaves of up to `leaf_max`; says how deep it is.
pub(super) fn build<J: Join>(
    join: &J,
    leaf_max: u32,
    bounds: &[Aabb],
    context: &Context<'_>,
) -> Result<(Tree, u32), BuildError> {
    let count = bounds.len();
    if count > PRIMS_MAX {
        return Err(BuildError::TooManyPrims { prims: count as u64 });
    }
    let stage = Stage::new(context, "build", count as u64);
    stage.check()?;
    if count == 0 {
        return Ok((Tree::default(), 0));
    }

    // Sort along the curve and find the leaves.
    let mut order = Order::new(bounds, &stage)?;
    let mut prims = memory::try_filled(0, count, "the tree's primitives")?;
    order.find_leaves(bounds, leaf_max, &mut prims, &stage)?;

    // Give every piece its place, behind what joins the pieces.
    let keep = |piece: &Piece| piece.leaves.min(join.keep());
    let kept: usize = order.pieces.iter().map(keep).sum();
    let leaves: usize = order.pieces.iter().map(|piece| piece.leaves).sum();
    let unwritten = Node::leaf(Aabb::EMPTY, 0, 1);
    let mut nodes = memory::try_filled(unwritten, 2 * leaves - 1, "the tree's nodes")?;
    let (top, mut rest) = nodes.split_at_mut(2 * kept - 1);
    let mut base = top.len();
    let mut marks = order.entries.as_mut_slice();
    let mut tasks = Vec::with_capacity(order.pieces.len());
    for piece in &order.pieces {
        let size = 2 * (piece.leaves - keep(piece));
        let marks = take(&mut marks, piece.prims.len());
        let below = Below::new(take(&mut rest, size), base);
        tasks.push((piece, &mut marks[..piece.leaves], below));
        base += size;
    }

    // Join inside pieces, all at once, then join the pieces.
    let groups = parallel::map(tasks, |(piece, marks, mut below)| {
        stage.check()?;
        let leaves = Leaves { bounds, prims: &prims, piece, stage: &stage };
        let mut open = J::Open::default();
        leaves.each(marks, |leaf, level| join.push(&mut open, &[leaf], level, &mut below))?;
        let group = join.finish(&mut open, keep(piece), &mut below);
        stage.advance(piece.prims.len() as u64);
        Ok((piece.level, group))
    });
    let (root, top) = top.split_at_mut(1);
    let mut below = Below::new(top, 1);
    let mut open = J::Open::default();
    for group in groups {
        let group: Result<_, Cancelled> = group;
        let (level, group) = group?;
        join.push(&mut open, &group, level, &mut below);
    }
    stage.check()?;
    let last = join.finish(&mut open, 1, &mut below);
    debug_assert!(last.len() == 1 && below.free == 0);
    root[0] = last[0].root;
    Ok((Tree { nodes, prims }, last[0].height + 1))
}

/// The leaves of a piece.
struct Leaves<'a> {
    bounds: &'a [Aabb],
    /// Of the whole tree.
    prims: &'a [u32],
    piece: &'a Piece,
    stage: &'a Stage<'a>,
}

/// Boxes are loaded this many at a time: nothing but loads, so that as many as can be are on their
/// way at once.
const BLOCK: usize = 128;
const _: () = assert!(BLOCK >= super::LEAF_MAX as usize);

impl Leaves<'_> {
    /// Shows each leaf and the level at which it parts from the next.
    #[inline(always)]
    fn each(
        &self,
        marks: &mut [AtomicU64],
        mut show: impl FnMut(Cluster, u8),
    ) -> Result<(), Cancelled> {
        let begin = self.piece.prims.start;
        let mut boxes = [Aabb::EMPTY; BLOCK];
        let mut loaded = 0..0;
        for leaf in 0..marks.len() {
            let Mark { first, level } = Mark::unpack(*marks[leaf].get_mut());
            let next = marks.get_mut(leaf + 1);
            let end = next.map_or(self.piece.prims.end, |next| {
                begin + Mark::unpack(*next.get_mut()).first as usize
            });
            let first = begin + first as usize;
            if end > loaded.end {
                self.stage.check()?;
                loaded = first..self.piece.prims.end.min(first + BLOCK);
                self.load(loaded.clone(), &mut boxes);
            }
            let bounds = around(&boxes[first - loaded.start..end - loaded.start]);
            show(Cluster { root: Node::leaf(bounds, first, end - first), height: 0 }, level);
        }
        Ok(())
    }

    #[inline(never)]
    fn load(&self, range: Range<usize>, boxes: &mut [Aabb; BLOCK]) {
        for (prim, out) in self.prims[range].iter().zip(boxes) {
            *out = self.bounds[*prim as usize];
        }
    }
}

/// The box of boxes, at least one of them. Four at a time: a box counted twice changes nothing, and
/// no branch depends on the length of a leaf of up to four.
#[inline(always)]
fn around(boxes: &[Aabb]) -> Aabb {
    let mut around = Aabb::EMPTY;
    for at in (0..boxes.len()).step_by(4) {
        for step in 0..4 {
            around = around.union(&boxes[(at + step).min(boxes.len() - 1)]);
        }
    }
    around
}

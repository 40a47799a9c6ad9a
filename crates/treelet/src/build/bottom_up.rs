//! What builders over Morton codes share: sort along the curve, cut it into leaves, join from below.
//!
//! A builder is told the leaves one after the other, each with the level at which the curve parts it
//! from the next, and joins clusters as it likes. Every piece of the curve knows beforehand how many
//! nodes it makes, so all of them write to their final places at once. Pieces depend on the input
//! alone: so does the tree.
//!
//! O(n) time. 8 bytes a primitive of scratch while joining, besides the tree. Memory is asked for before it
//! is needed, here and where quick levels collapse and write trees. Asking for the corners of leaves as well
//! gained nothing.

use super::BuildError;
use super::curve_leaves::{Mark, take};
use super::curve_order::{Order, Piece};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory::{self, prefetch};
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
    pub(super) fn new(nodes: &'a mut [Node], base: usize) -> Self {
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

    /// Writes all of them at once.
    pub(super) fn fill(&mut self, nodes: &[Node]) {
        debug_assert!(self.free == self.nodes.len());
        self.nodes.copy_from_slice(nodes);
        self.free = 0;
    }
}

/// Neighbours on the curve that belong together.
pub(super) struct Part<'a> {
    /// A leaf, or what a piece handed up.
    pub(super) clusters: &'a [Cluster],
    /// How many leaves are below them.
    pub(super) leaves: usize,
    /// Where they part from what comes next: the greater, the closer. 0 at the end.
    pub(super) level: u8,
}

/// What a piece hands to the top of the tree.
pub(super) struct Handed {
    pub(super) clusters: Vec<Cluster>,
    leaves: usize,
    level: u8,
}

/// How a builder joins clusters.
pub(super) trait Join: Sync {
    /// What it keeps between one part and the next.
    type Open: Default;

    /// Takes the next part.
    fn push(&self, open: &mut Self::Open, part: &Part<'_>, below: &mut Below<'_>);

    /// Joins what is open until `count` clusters are left.
    fn finish(&self, open: &mut Self::Open, count: usize, below: &mut Below<'_>) -> Vec<Cluster>;

    /// How many clusters a piece with these leaves hands to the top of the tree.
    fn keep(&self, leaves: &mut [AtomicU64]) -> usize;

    /// Joins what the pieces handed up, into one cluster.
    fn join_pieces(
        &self,
        pieces: Vec<Handed>,
        below: &mut Below<'_>,
        _context: &Context<'_>,
    ) -> Result<Cluster, BuildError> {
        let mut open = Self::Open::default();
        for Handed { clusters, leaves, level } in &pieces {
            self.push(&mut open, &Part { clusters, leaves: *leaves, level: *level }, below);
        }
        Ok(self.finish(&mut open, 1, below)[0])
    }
}

/// Which leaves the curve is cut into.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    /// Most primitives in one.
    pub(super) leaf_max: u32,
    /// Bits of a code.
    pub(super) code_bits: u32,
}

/// Builds the tree that `join` joins; says how deep it is.
pub(super) fn build<J: Join>(
    join: &J,
    cut: Cut,
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
    let mut order = Order::new(bounds, cut.code_bits, &stage)?;
    let mut prims = memory::try_filled(0, count, "the tree's primitives")?;
    order.find_leaves(bounds, cut.leaf_max, &mut prims, &stage)?;

    // Give every piece its place, behind what joins the pieces.
    let mut marks = &mut *order.entries;
    let mut kept = Vec::with_capacity(order.pieces.len());
    for piece in &order.pieces {
        let marks = take(&mut marks, piece.prims.len());
        kept.push(join.keep(&mut marks[..piece.leaves]));
    }
    let leaves: usize = order.pieces.iter().map(|piece| piece.leaves).sum();
    let unwritten = Node::leaf(Aabb::EMPTY, 0, 1);
    let mut nodes = memory::try_filled(unwritten, 2 * leaves - 1, "the tree's nodes")?;
    let (top, mut rest) = nodes.split_at_mut(2 * kept.iter().sum::<usize>() - 1);
    let mut base = top.len();
    let mut marks = &mut *order.entries;
    let mut tasks = Vec::with_capacity(order.pieces.len());
    for (piece, keep) in order.pieces.iter().zip(kept) {
        let size = 2 * (piece.leaves - keep);
        let marks = take(&mut marks, piece.prims.len());
        let below = Below::new(take(&mut rest, size), base);
        tasks.push((piece, &mut marks[..piece.leaves], keep, below));
        base += size;
    }

    // Join inside pieces, all at once, then join the pieces.
    let pieces = parallel::map(tasks, |(piece, marks, keep, mut below)| {
        stage.check()?;
        let leaves = Leaves { bounds, prims: &prims, piece, stage: &stage };
        let mut open = J::Open::default();
        leaves.each(marks, |part| join.push(&mut open, part, &mut below))?;
        let clusters = join.finish(&mut open, keep, &mut below);
        debug_assert!(clusters.len() == keep && below.free == 0);
        stage.advance(piece.prims.len() as u64);
        Ok(Handed { clusters, leaves: piece.leaves, level: piece.level })
    });
    let pieces = pieces.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
    stage.check()?;
    let (root, top) = top.split_at_mut(1);
    let mut below = Below::new(top, 1);
    let last = join.join_pieces(pieces, &mut below, context)?;
    debug_assert!(below.free == 0);
    root[0] = last.root;
    Ok((Tree { nodes, prims }, last.height + 1))
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
    /// Shows each leaf.
    #[inline(always)]
    fn each(
        &self,
        marks: &mut [AtomicU64],
        mut show: impl FnMut(&Part<'_>),
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
                self.expect(loaded.end..self.piece.prims.end.min(loaded.end + BLOCK));
            }
            let boxes = &boxes[first - loaded.start..end - loaded.start];
            let root = Node::leaf(around(boxes), first, end - first);
            show(&Part { clusters: &[Cluster { root, height: 0 }], leaves: 1, level });
        }
        Ok(())
    }

    /// Asks for boxes that are loaded soon.
    #[inline(always)]
    fn expect(&self, range: Range<usize>) {
        for prim in &self.prims[range] {
            prefetch(self.bounds, *prim as usize);
        }
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

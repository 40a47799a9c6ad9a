//! Lowering: a binary tree becomes wide nodes, its triangles blocks of words.
//!
//! The tree is cut below its top into many subtrees. Each is planned by itself, then the top over
//! them ([`super::collapse`]; quick levels choose by [`super::greedy`]); then it is known what fills
//! the slots of every wide node ([`super::select`]), and so how many there are; then each subtree is
//! written by itself, straight to where it stays ([`super::write`]). What is written depends on the
//! tree alone, not on the number of threads. Last, the children of each node are put in the order in
//! which any-hit walks enter them ([`super::order`]).
//!
//! Cost: O(n) time; beyond the result about 26 bytes an inner node of the tree for the plans, then
//! `4 W + 12` bytes a wide node.

use super::collapse::{Plan, Priced};
pub(crate) use super::leaves::split_leaves;
use super::order::{self, Outlook};
use super::select::{Entry, Selected, Selection, Top};
use super::wide::{BLOCK_WORDS, Child, ENTRIES_MAX, TRIANGLE_WORDS, Wide};
use super::write::{Output, Writer};
use super::{Collapse, greedy};
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::{self, Pages};
use crate::tree::{Kind, Tree};
use alloc::vec::Vec;

/// Trees with fewer nodes are one piece.
const CUT_MIN: usize = 8192;
/// Levels of the tree above the cut: up to 256 pieces.
const CUT_LEVELS: usize = 8;

/// A triangle as leaves store it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Packed {
    pub(crate) corners: [[f32; 3]; 3],
    pub(crate) id: u32,
}

/// The primitives that are instances.
#[derive(Clone, Copy)]
pub(crate) struct Numbered<'a> {
    /// Primitives from here on are.
    pub(crate) first: u32,
    /// Their numbers among all instances of the level, in rising order.
    pub(crate) numbers: &'a [u32],
}

impl Numbered<'_> {
    /// Where there is none.
    pub(crate) const NONE: Self = Self { first: u32::MAX, numbers: &[] };

    /// The number of the instance that a primitive is.
    #[inline(always)]
    pub(super) fn of(&self, prim: u32) -> Option<usize> {
        let at = prim.checked_sub(self.first)?;
        self.numbers.get(at as usize).map(|&number| number as usize)
    }

    /// How many numbers there are, used or not.
    fn count(&self) -> usize {
        self.numbers.last().map_or(0, |&last| last as usize + 1)
    }
}

/// Lowers a tree whose leaves fit ([`split_leaves`]). `source` gives the triangles of some numbers.
pub(crate) fn lower<const W: usize>(
    tree: &Tree,
    instances: Numbered<'_>,
    source: &(impl Fn(&[u32], &mut [Packed]) + Sync),
    collapse: Collapse,
    cancel: &Cancel,
) -> Result<Wide<W>, BuildError> {
    if tree.prims.len() > ENTRIES_MAX {
        return Err(BuildError::TooManyPrims { prims: tree.prims.len() as u64 });
    }
    if tree.nodes.is_empty() {
        let words = Pages::zeroed(BLOCK_WORDS, "leaf blocks")?;
        let nodes = Pages::zeroed(0, "wide nodes")?;
        return Ok(Wide { nodes, root: Child::END, words, triangles: 0 });
    }
    let selection = select(tree, instances.first, collapse, cancel)?;
    let triangles = selection.pieces.iter().map(|piece| piece.entries[0]).sum();
    let unit = order::unit(&tree.bounds());
    if triangles + instances.count() > ENTRIES_MAX {
        return Err(BuildError::TooManyPrims { prims: (triangles + instances.count()) as u64 });
    }
    let writer = Writer { tree, source, instances, triangles, unit, cancel };
    write(&writer, selection)
}

/// Chooses what becomes wide nodes.
fn select<const W: usize>(
    tree: &Tree,
    first_instance: u32,
    collapse: Collapse,
    cancel: &Cancel,
) -> Result<Selection<W>, Cancelled> {
    let root_area = tree.bounds().half_area();
    let scale = if root_area > 0.0 { 1.0 / root_area } else { 0.0 };
    let priced = Priced { tree, first_instance, scale };
    if collapse == Collapse::Greedy {
        return greedy::select(&priced, cancel);
    }

    // Plan the pieces, then the top over them.
    let roots = cut(tree);
    let plans = parallel::map(roots.clone(), |root| {
        cancel.check()?;
        Ok(Plan::<W>::new(&priced, root, |_| None))
    });
    let plans = plans.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
    let top = Top::new(&priced, &roots, &plans);

    // Select inside the pieces what fills the places that the top leaves them.
    let jobs = plans.into_iter().zip(&top.entries).collect();
    let pieces = parallel::map(jobs, |(plan, entries): (Plan<W>, &Vec<Entry>)| {
        Selected::new(&priced, &plan, entries, cancel)
    });
    let pieces = pieces.into_iter().collect::<Result<_, Cancelled>>()?;
    Ok(Selection { top, pieces })
}

/// The roots of the pieces: everything at some depth, and leaves above it.
fn cut(tree: &Tree) -> Vec<u32> {
    let mut cut = alloc::vec![0];
    if tree.nodes.len() < CUT_MIN {
        return cut;
    }
    for _ in 0..CUT_LEVELS {
        let opened = cut.iter().flat_map(|&node| match tree.nodes[node as usize].kind() {
            Kind::Inner { left } => [Some(left as u32), Some(left as u32 + 1)],
            Kind::Leaf { .. } => [Some(node), None],
        });
        cut = opened.flatten().collect();
    }
    cut
}

/// Writes what was selected: the top's nodes first, then piece after piece.
fn write<const W: usize, F: Fn(&[u32], &mut [Packed]) + Sync>(
    writer: &Writer<'_, F>,
    selection: Selection<W>,
) -> Result<Wide<W>, BuildError> {
    let Selection { top, pieces } = selection;
    let total = |count: fn(&Selected<W>) -> usize| pieces.iter().map(count).sum::<usize>();
    let triangles = writer.triangles;
    let inside = total(|piece| piece.nodes.len());
    let mut nodes = Pages::zeroed(top.nodes.len() + inside, "wide nodes")?;
    let mut outlooks = memory::try_with_capacity(nodes.len(), "outlooks of wide nodes")?;
    outlooks.resize(nodes.len(), Outlook::default());
    let mut words = Pages::zeroed(triangles * TRIANGLE_WORDS + BLOCK_WORDS, "leaf blocks")?;

    // Give every piece its place.
    let (of_top, mut rest_of_nodes) = nodes.split_at_mut(top.nodes.len());
    let mut rest_of_outlooks = outlooks.get_mut(top.nodes.len()..).unwrap_or_default();
    let mut rest_of_words = &mut *words;
    let mut jobs = Vec::with_capacity(pieces.len());
    let (mut base, mut triangle) = (top.nodes.len() as u32, 0);
    for piece in pieces {
        let count = piece.nodes.len();
        let (nodes, after) = core::mem::take(&mut rest_of_nodes).split_at_mut(count);
        rest_of_nodes = after;
        let (outlooks, after) = core::mem::take(&mut rest_of_outlooks).split_at_mut(count);
        rest_of_outlooks = after;
        let [of_triangles, _] = piece.entries;
        let (words, after) =
            core::mem::take(&mut rest_of_words).split_at_mut(of_triangles * TRIANGLE_WORDS);
        rest_of_words = after;
        jobs.push((piece, Output { nodes, base, outlooks, words, triangle }));
        base += count as u32;
        triangle += of_triangles;
    }
    let written = parallel::map(jobs, |(piece, output)| writer.piece(&piece, output));

    // Tell the top where its children are.
    of_top.copy_from_slice(&top.nodes);
    let mut root = Child::inner(0);
    for (written, entries) in written.into_iter().zip(&top.entries) {
        let written: Result<Vec<Child>, Cancelled> = written;
        for (child, entry) in written?.into_iter().zip(entries) {
            match entry.place {
                Some((node, slot)) => of_top[node].children[slot] = child,
                None => root = child,
            }
        }
    }
    order::arrange(of_top, 0, triangles, writer.unit, &mut outlooks);
    Ok(Wide { nodes, root, words, triangles })
}

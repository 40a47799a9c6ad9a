//! The loop that top-down builders share: it owns the work list, the nodes and the threads, and
//! asks one question of a range: where to cut it, or to stop.
//!
//! Ranges above a size that depends on the input alone are cut in rounds, all of a round in
//! parallel; the ranges below it are finished one task each. Tasks end up in the order of their
//! ranges, so the tree is the same for any number of threads. Nothing recurses. A range about to
//! exceed the depth limit is halved by count from there on, which bounds the depth by
//! [`DEPTH_MAX`] whatever a builder answers.
//!
//! Cost: O(n) memory beyond the builder's slots; time is the builder's.

use super::{BuildError, LEAF_MAX};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::tree::{DEPTH_MAX, Node, PRIMS_MAX, Tree};
use alloc::vec::Vec;

/// A range is cut in rounds while it has more than 1/64 of all primitives, and at least this many.
const ROUND_MIN: usize = 16_384;
/// How many tasks to aim for.
const TASKS: usize = 64;

/// A part of the primitives that will become a subtree.
pub(crate) struct Range<'a, S> {
    /// The builder's slots, one a primitive, to be permuted.
    pub(crate) slots: &'a mut [S],
    /// Around the primitives, and around their centers.
    pub(crate) extent: Extent,
}

/// The two boxes that decide a split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// Around the primitives.
    pub(crate) bounds: Aabb,
    /// Around their centers.
    pub(crate) centers: Aabb,
}

impl Extent {
    pub(crate) const EMPTY: Self = Self { bounds: Aabb::EMPTY, centers: Aabb::EMPTY };

    #[inline(always)]
    pub(crate) fn add(&mut self, bounds: &Aabb) {
        let center = bounds.center();
        self.bounds = self.bounds.union(bounds);
        self.centers = self.centers.union(&Aabb { lo: center, hi: center });
    }

    pub(crate) fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            centers: self.centers.union(&other.centers),
        }
    }
}

/// Where a range was cut: its first `left` slots are the left child, both children not empty.
pub(crate) struct Cut {
    pub(crate) left: usize,
    pub(crate) extents: [Extent; 2],
}

/// What a top-down builder answers.
pub(crate) trait Splitter: Sync {
    /// What a builder keeps for each primitive of a range.
    type Slot: Copy + Send + Sync;
    /// Buffers that live as long as a task.
    type Scratch: Default;

    /// The primitive whose place in the tree's list is this slot's.
    fn prim(slot: &Self::Slot) -> u32;

    /// Permutes the range and says where it is cut; `None` makes a leaf, where one is allowed.
    fn cut(
        &self,
        range: &mut Range<'_, Self::Slot>,
        scratch: &mut Self::Scratch,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled>;

    /// Cuts a range of at least two in the middle by count, in whatever order is at hand.
    fn halve(
        &self,
        range: &mut Range<'_, Self::Slot>,
        scratch: &mut Self::Scratch,
        stage: &Stage<'_>,
    ) -> Result<Cut, Cancelled>;

    /// The most primitives that may stay in a leaf.
    fn leaf_max(&self) -> u32;
}

/// An open range and the node it will become.
struct Task<'a, S> {
    node: usize,
    begin: usize,
    depth: u32,
    range: Range<'a, S>,
}

/// Builds the tree of `splitter` over `slots`, whose extent is `extent`.
pub(crate) fn build<P: Splitter>(
    splitter: &P,
    slots: &mut [P::Slot],
    extent: Extent,
    context: &Context<'_>,
) -> Result<Tree, BuildError> {
    debug_assert!(splitter.leaf_max() <= LEAF_MAX);
    let count = slots.len();
    if count > PRIMS_MAX {
        return Err(BuildError::TooManyPrims { prims: count as u64 });
    }
    if count == 0 {
        return Ok(Tree::default());
    }
    let stage = Stage::new(context, "build", count as u64);

    let mut nodes = alloc::vec![Node::leaf(extent.bounds, 0, count)];
    let root = Task { node: 0, begin: 0, depth: 0, range: Range { slots, extent } };
    let tasks = cut_in_rounds(splitter, &mut nodes, root, count, &stage)?;

    // Finish each task by itself, then append what they made in the order of their ranges.
    let subtrees = parallel::map(tasks, |task| {
        let (node, size) = (task.node, task.range.slots.len());
        let subtree = finish(splitter, task, &stage);
        stage.advance(size as u64);
        subtree.map(|subtree| (node, subtree))
    });
    let mut made = Vec::with_capacity(subtrees.len());
    for subtree in subtrees {
        made.push(subtree?);
    }
    let more = made.iter().map(|(_, subtree)| subtree.nodes.len()).sum();
    memory::try_reserve(&mut nodes, more, "the tree's nodes")?;
    made.iter().for_each(|(node, subtree)| append(&mut nodes, *node, subtree));
    let mut prims = memory::try_with_capacity(count, "the tree's primitives")?;
    prims.extend(slots.iter().map(P::prim));
    Ok(Tree { nodes, prims })
}

/// Cuts the large ranges, round by round; returns the small ones in the order of their slots.
fn cut_in_rounds<'a, P: Splitter>(
    splitter: &P,
    nodes: &mut Vec<Node>,
    root: Task<'a, P::Slot>,
    count: usize,
    stage: &Stage<'_>,
) -> Result<Vec<Task<'a, P::Slot>>, BuildError> {
    let round_min = ROUND_MIN.max(count / TASKS);
    let mut open = alloc::vec![root];
    let mut small = Vec::new();
    while !open.is_empty() {
        let round = core::mem::take(&mut open);
        let (large, rest): (Vec<_>, Vec<_>) =
            round.into_iter().partition(|task| task.range.slots.len() > round_min);
        small.extend(rest);
        let answers = parallel::map(large, |mut task| {
            let cut = decide(splitter, &mut task, &mut P::Scratch::default(), stage);
            cut.map(|cut| (task, cut))
        });
        for answer in answers {
            match answer? {
                (task, Some(cut)) => open.extend(divide(nodes, task, &cut)),
                // A large range is never a leaf: `decide` halves what a builder would not cut.
                (task, None) => small.push(task),
            }
        }
    }
    small.sort_by_key(|task| task.begin);
    Ok(small)
}

/// A whole subtree, one range after the other. Its root is node 0 and its ranges start at 0.
fn finish<P: Splitter>(
    splitter: &P,
    task: Task<'_, P::Slot>,
    stage: &Stage<'_>,
) -> Result<Subtree, Cancelled> {
    let begin = task.begin;
    let mut nodes = Vec::with_capacity(task.range.slots.len());
    let mut scratch = P::Scratch::default();
    nodes.push(Node::leaf(task.range.extent.bounds, 0, task.range.slots.len()));
    let mut open = alloc::vec![Task { node: 0, begin: 0, ..task }];
    while let Some(mut task) = open.pop() {
        stage.check()?;
        if let Some(cut) = decide(splitter, &mut task, &mut scratch, stage)? {
            let [left, right] = divide(&mut nodes, task, &cut);
            open.push(right);
            open.push(left);
        }
    }
    Ok(Subtree { nodes, begin })
}

/// What a task made: its root is node 0, its ranges count from `begin`.
struct Subtree {
    nodes: Vec<Node>,
    begin: usize,
}

/// Asks the builder, and overrules it where the leaf would be too full or the tree too deep.
fn decide<P: Splitter>(
    splitter: &P,
    task: &mut Task<'_, P::Slot>,
    scratch: &mut P::Scratch,
    stage: &Stage<'_>,
) -> Result<Option<Cut>, Cancelled> {
    let count = task.range.slots.len();
    if count == 1 {
        return Ok(None);
    }
    // A halved range of `count` still needs this many levels below this one.
    let levels = usize::BITS - (count - 1).leading_zeros();
    if task.depth + levels + 1 < DEPTH_MAX
        && let Some(cut) = splitter.cut(&mut task.range, scratch, stage)?
    {
        debug_assert!(0 < cut.left && cut.left < count);
        return Ok(Some(cut));
    }
    let full = count > splitter.leaf_max() as usize;
    full.then(|| splitter.halve(&mut task.range, scratch, stage)).transpose()
}

/// Makes the task's node an inner one, and two tasks of its halves.
fn divide<'a, S>(nodes: &mut Vec<Node>, task: Task<'a, S>, cut: &Cut) -> [Task<'a, S>; 2] {
    let left = nodes.len();
    nodes[task.node] = Node::inner(task.range.extent.bounds, left);
    let slots = task.range.slots.split_at_mut(cut.left);
    let begins = [task.begin, task.begin + cut.left];
    let mut side = 0;
    <[_; 2]>::from(slots).map(|slots| {
        let (extent, begin) = (cut.extents[side], begins[side]);
        nodes.push(Node::leaf(extent.bounds, begin, slots.len()));
        let range = Range { slots, extent };
        side += 1;
        Task { node: left + side - 1, begin, depth: task.depth + 1, range }
    })
}

/// Puts a subtree where its root's node already is; all its other nodes go to the end.
fn append(nodes: &mut Vec<Node>, at: usize, subtree: &Subtree) {
    // Node 1 of the subtree lands at the present end.
    let children = nodes.len() - 1;
    let [root, below @ ..] = subtree.nodes.as_slice() else { return };
    nodes[at] = root.shifted(children, subtree.begin);
    nodes.extend(below.iter().map(|node| node.shifted(children, subtree.begin)));
}

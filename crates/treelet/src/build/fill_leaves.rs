//! The last step of builders that join single primitives: small subtrees become leaves, nodes and
//! primitives go to the order in which walks meet them, and no path stays too long.
//!
//! Every largest subtree of up to `leaf_max` primitives becomes a leaf. A subtree at the depth from
//! which only halving fits below [`DEPTH_MAX`] is replaced by halves of its primitives, in the order
//! in which the old ones had them: near the root nothing is lost by that.
//!
//! O(n) time: one sweep that counts, one walk that writes; 4 bytes a node of scratch, and the nodes
//! twice while they are put together.

use super::BuildError;
use crate::bounds::Aabb;
use crate::context::{Cancelled, Stage, parallel};
use crate::memory;
use crate::tree::{DEPTH_MAX, Kind, Node, Tree};
use alloc::vec::Vec;

/// A subtree is a task of its own if it has at most 1/64 of all primitives, or this many.
const TASK_MIN: usize = 16_384;
/// How many tasks to aim for.
const TASKS: usize = 64;
/// Walks are interrupted at most this many nodes apart.
const CHECK_EVERY: usize = 16_384;

/// The tree with full leaves, from one whose leaves are single primitives; children come after their
/// parents in both.
pub(super) fn fill_leaves(
    tree: &Tree,
    leaf_max: u32,
    stage: &Stage<'_>,
) -> Result<Tree, BuildError> {
    let Some(&root) = tree.nodes.first() else { return Ok(Tree::default()) };
    let old = Old { tree, counts: count(tree, stage)?, leaf_max: leaf_max as usize };
    let all = old.counts[0] as usize;

    // The top, node by node; its leaves become tasks, in the order of their primitives.
    let task_max = TASK_MIN.max(all / TASKS);
    let mut nodes = alloc::vec![root];
    let mut tasks: Vec<Open> = Vec::new();
    let mut open = alloc::vec![Open { old: 0, new: 0, depth: 0 }];
    while let Some(node) = open.pop() {
        match old.children(&node) {
            Some(left) if old.count(node.old) > task_max => {
                let first = nodes.len();
                nodes[node.new] = Node::inner(tree.nodes[node.old].bounds, first);
                nodes.extend_from_slice(&tree.nodes[left..left + 2]);
                for side in [1, 0] {
                    let depth = node.depth + 1;
                    open.push(Open { old: left + side, new: first + side, depth });
                }
            }
            _ => tasks.push(node),
        }
    }

    // Each task writes its primitives to their place, its nodes to a list of its own.
    let mut prims = memory::try_filled(0, all, "the tree's primitives")?;
    let mut rest = prims.as_mut_slice();
    let mut begin = 0;
    let mut work = Vec::with_capacity(tasks.len());
    for task in &tasks {
        let count = old.count(task.old);
        let (prims, more) = core::mem::take(&mut rest).split_at_mut(count);
        rest = more;
        work.push((task, Subtree { nodes: Vec::new(), prims, begin, used: 0 }));
        begin += count;
    }
    let subtrees = parallel::map(work, |(task, subtree)| subtree.write(&old, task, stage));
    let subtrees = subtrees.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
    drop(old);

    // Node 1 of each lands at the present end.
    let more = subtrees.iter().map(|nodes| nodes.len() - 1).sum();
    memory::try_reserve(&mut nodes, more, "the tree's nodes")?;
    for (task, subtree) in tasks.iter().zip(subtrees) {
        stage.check()?;
        let children = nodes.len() - 1;
        nodes[task.new] = subtree[0].shifted(children, 0);
        nodes.extend(subtree[1..].iter().map(|node| node.shifted(children, 0)));
    }
    Ok(Tree { nodes, prims })
}

/// How many primitives are below each node.
fn count(tree: &Tree, stage: &Stage<'_>) -> Result<Vec<u32>, BuildError> {
    let mut counts = memory::try_filled(0, tree.nodes.len(), "counting primitives")?;
    for at in (0..tree.nodes.len()).rev() {
        if at % CHECK_EVERY == 0 {
            stage.check()?;
        }
        counts[at] = match tree.nodes[at].kind() {
            Kind::Inner { left } => counts[left] + counts[left + 1],
            Kind::Leaf { count, .. } => count as u32,
        };
    }
    Ok(counts)
}

/// A node of the old tree that has a place in the new one.
#[derive(Clone, Copy)]
struct Open {
    old: usize,
    new: usize,
    depth: u32,
}

/// What subtrees are made from.
struct Old<'a> {
    tree: &'a Tree,
    counts: Vec<u32>,
    leaf_max: usize,
}

impl Old<'_> {
    fn count(&self, node: usize) -> usize {
        self.counts[node] as usize
    }

    /// The left child, if the node stays an inner one and what is below fits.
    #[inline(always)]
    fn children(&self, node: &Open) -> Option<usize> {
        let count = self.count(node.old);
        // A halved range still needs this many levels below this one.
        let levels = usize::BITS - (count - 1).leading_zeros();
        match self.tree.nodes[node.old].kind() {
            Kind::Inner { left }
                if count > self.leaf_max && node.depth + levels + 1 < DEPTH_MAX =>
            {
                Some(left)
            }
            _ => None,
        }
    }
}

/// A part of the new tree: its root is node 0.
struct Subtree<'a> {
    nodes: Vec<Node>,
    prims: &'a mut [u32],
    /// Of `prims` in the tree.
    begin: usize,
    /// How many of `prims` are written.
    used: usize,
}

impl Subtree<'_> {
    fn write(
        mut self,
        old: &Old<'_>,
        task: &Open,
        stage: &Stage<'_>,
    ) -> Result<Vec<Node>, Cancelled> {
        let tree = old.tree;
        self.nodes.push(tree.nodes[task.old]);
        let mut open = alloc::vec![Open { new: 0, ..*task }];
        let mut below = Vec::new();
        let mut steps = 0_usize;
        while let Some(node) = open.pop() {
            steps += 1;
            if steps.is_multiple_of(CHECK_EVERY) {
                stage.check()?;
            }
            let bounds = tree.nodes[node.old].bounds;
            if let Some(left) = old.children(&node) {
                let first = self.nodes.len();
                self.nodes[node.new] = Node::inner(bounds, first);
                self.nodes.extend_from_slice(&tree.nodes[left..left + 2]);
                let depth = node.depth + 1;
                open.push(Open { old: left + 1, new: first + 1, depth });
                open.push(Open { old: left, new: first, depth });
                continue;
            }
            let begin = self.used;
            let boxes = if old.count(node.old) > old.leaf_max { Some(Vec::new()) } else { None };
            let boxes = self.gather(tree, node.old, &mut below, boxes);
            match boxes {
                None => {
                    self.nodes[node.new] =
                        Node::leaf(bounds, self.begin + begin, self.used - begin);
                }
                Some(boxes) => self.halve(node.new, begin, &boxes, old.leaf_max),
            }
        }
        Ok(self.nodes)
    }

    /// Writes the primitives below a node, and their boxes if somebody wants them.
    #[inline(always)]
    fn gather(
        &mut self,
        tree: &Tree,
        node: usize,
        below: &mut Vec<usize>,
        mut boxes: Option<Vec<Aabb>>,
    ) -> Option<Vec<Aabb>> {
        below.push(node);
        while let Some(at) = below.pop() {
            match tree.nodes[at].kind() {
                Kind::Inner { left } => below.extend([left + 1, left]),
                Kind::Leaf { first, .. } => {
                    self.prims[self.used] = tree.prims[first];
                    self.used += 1;
                    if let Some(boxes) = &mut boxes {
                        boxes.push(tree.nodes[at].bounds);
                    }
                }
            }
        }
        boxes
    }

    /// A balanced subtree over primitives from `begin` on.
    #[cold]
    fn halve(&mut self, node: usize, begin: usize, boxes: &[Aabb], leaf_max: usize) {
        let mut made = alloc::vec![node];
        let mut open = alloc::vec![(node, 0..boxes.len())];
        while let Some((node, range)) = open.pop() {
            if range.len() <= leaf_max {
                let around = boxes[range.clone()].iter().fold(Aabb::EMPTY, |a, b| a.union(b));
                self.nodes[node] =
                    Node::leaf(around, self.begin + begin + range.start, range.len());
                continue;
            }
            let (left, middle) = (self.nodes.len(), range.start + range.len() / 2);
            self.nodes[node] = Node::inner(Aabb::EMPTY, left);
            self.nodes.extend([Node::inner(Aabb::EMPTY, 0); 2]);
            made.extend([left, left + 1]);
            open.push((left + 1, middle..range.end));
            open.push((left, range.start..middle));
        }
        for &at in made.iter().rev() {
            if let Kind::Inner { left } = self.nodes[at].kind() {
                self.nodes[at].bounds = self.nodes[left].bounds.union(&self.nodes[left + 1].bounds);
            }
        }
    }
}

//! Reinsertion near the root: the largest nodes are arranged anew, what is below them stays as it is.
//!
//! Areas fall from parent to child, so the nodes of largest area form the top of the tree. The top is
//! cut off, reinsertion ([`super::reinsertion`]) arranges it as a tree of its own, and what hung below
//! is hung where its root went. The large triangles of walls and floors, which centers in bins leave
//! deep among small ones, are all in there.
//!
//! Source: as reinsertion; the cut is ours.
//!
//! Measured with one thread on an interior of 1.4 M triangles and a house of 1.6 M, `binned-sah` before:
//! the SAH falls from 39.4 to 32.2 and from 46.7 to 39.2 (reinsertion everywhere with a share of 0.05: to
//! 31.6 and 36.0), and single rays are 1.07 to 1.16 times as many a second (1.08 to 1.21). With a top four
//! times as large: 31.9 and 37.3, five times the time.
//!
//! Cost: about 10 ms for the top, and one pass over the tree that writes it anew.

use super::Optimizer;
use super::reinsertion::Reinsertion;
use crate::build::{BuildError, Info, check_option};
use crate::context::{Cancel, Context};
use crate::memory;
use crate::tree::{DEPTH_MAX, Kind, Node, Tree};
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Reverse;

/// Moves the largest subtrees to where they cost least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TopReinsertion {
    /// Inner nodes of the top, the largest ones, in `1..=1000000`.
    pub top: u32,
    /// How the top is arranged.
    pub reinsertion: Reinsertion,
}

impl TopReinsertion {
    /// A top of 4096 nodes, a third of which is searched in the first of four rounds.
    pub const DEFAULT: Self =
        Self { top: 4096, reinsertion: Reinsertion { share: 0.3, rounds: 4, gain_min: 0.002 } };
}

impl Optimizer for TopReinsertion {
    fn info(&self) -> Info {
        Info {
            name: "top-reinsertion",
            summary: "moves the largest subtrees to where they cost least",
            source: "Meister and Bittner 2018",
        }
    }

    fn optimize(&self, tree: Tree, context: &Context<'_>) -> Result<Tree, BuildError> {
        check_option("top", f64::from(self.top), 1.0..=1e6, "1..=1000000")?;
        let cancel = &context.cancel;
        let (top, below) = cut_off(&tree, self.top as usize, cancel)?;
        let top = self.reinsertion.optimize(top, context)?;
        let sewn = sew(&tree, &top, &below, cancel)?;
        Ok(sewn.unwrap_or(tree))
    }
}

/// The top of a tree, with a leaf of one number for each node where it ends, and those nodes by number.
fn cut_off(tree: &Tree, size: usize, cancel: &Cancel) -> Result<(Tree, Vec<usize>), BuildError> {
    let mut top = Tree::default();
    let mut old = Vec::new();
    if !tree.nodes.is_empty() {
        top.nodes.push(Node::leaf(tree.bounds(), 0, 1));
        old.push(0);
    }
    // Open the largest inner node, again and again; of equal ones the first in the tree.
    let area = |at: usize| (tree.nodes[at].bounds.half_area() as f32).to_bits();
    let mut open = BinaryHeap::from([(u32::MAX, Reverse(0), 0)]);
    let mut opened = 0;
    while opened < size
        && let Some((_, Reverse(at), here)) = open.pop()
    {
        cancel.check()?;
        let Some(Kind::Inner { left }) = tree.nodes.get(at).map(Node::kind) else { continue };
        opened += 1;
        top.nodes[here] = Node::inner(tree.nodes[at].bounds, top.nodes.len());
        for child in [left, left + 1] {
            open.push((area(child), Reverse(child), top.nodes.len()));
            top.nodes.push(Node::leaf(tree.nodes[child].bounds, 0, 1));
            old.push(child);
        }
    }

    // Number the leaves.
    let mut below = Vec::with_capacity(opened + 1);
    for (node, old) in top.nodes.iter_mut().zip(old) {
        if let Kind::Leaf { .. } = node.kind() {
            *node = Node::leaf(node.bounds, below.len(), 1);
            top.prims.push(below.len() as u32);
            below.push(old);
        }
    }
    Ok((top, below))
}

/// Where a node comes from.
#[derive(Clone, Copy)]
enum From {
    Top(usize),
    Tree(usize),
}

/// The tree with another top, depth first; none if it would be too deep.
fn sew(
    tree: &Tree,
    top: &Tree,
    below: &[usize],
    cancel: &Cancel,
) -> Result<Option<Tree>, BuildError> {
    let mut nodes = memory::try_with_capacity(tree.nodes.len(), "the tree's nodes")?;
    let mut prims = memory::try_with_capacity(tree.prims.len(), "the tree's primitives")?;
    let mut open = Vec::new();
    if !tree.nodes.is_empty() {
        nodes.push(tree.nodes[0]);
        open.push((From::Top(0), 0, 1));
    }
    while let Some((from, here, depth)) = open.pop() {
        cancel.check()?;
        if depth > DEPTH_MAX {
            return Ok(None);
        }
        // Where the top ends, the tree goes on.
        let from = match from {
            From::Top(at) => match top.nodes[at].kind() {
                Kind::Inner { .. } => from,
                Kind::Leaf { first, .. } => From::Tree(below[top.prims[first] as usize]),
            },
            From::Tree(_) => from,
        };
        let node = match from {
            From::Top(at) => top.nodes[at],
            From::Tree(at) => tree.nodes[at],
        };
        match node.kind() {
            Kind::Inner { left } => {
                let children = nodes.len();
                nodes[here] = Node::inner(node.bounds, children);
                nodes.extend([node; 2]);
                let child = |side: usize| match from {
                    From::Top(_) => From::Top(left + side),
                    From::Tree(_) => From::Tree(left + side),
                };
                open.push((child(1), children + 1, depth + 1));
                open.push((child(0), children, depth + 1));
            }
            Kind::Leaf { first, count } => {
                nodes[here] = Node::leaf(node.bounds, prims.len(), count);
                prims.extend_from_slice(&tree.prims[first..first + count]);
            }
        }
    }
    Ok(Some(Tree { nodes, prims }))
}

//! Leaves of builders become leaves of wide trees: few triangles, or one of anything else.
//!
//! Chunks of nodes are looked at side by side; what a chunk adds stands together behind all nodes that were there, so
//! the same nodes come of it whatever the number of threads. Where a builder fills leaves with four of a million instances, one
//! thread for all took as long as the builder.

use super::wide::LEAF_MAX;
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::parallel;
use crate::memory::{self, prefetch};
use crate::tree::{Kind, Node, Tree};
use alloc::vec::Vec;
use core::ops::Range;

/// Nodes that one task looks at.
const CHUNK: usize = 4096;

/// What a leaf of the wide tree may hold: few triangles, or one instance, whose box is then asked with
/// those of its siblings. Other leaves of the tree over
/// `bounds` are cut in halves until they do.
pub(crate) fn split_leaves(
    mut tree: Tree,
    bounds: &[Aabb],
    triangles: usize,
) -> Result<Tree, BuildError> {
    // Find out how much room it takes. Of mixed leaves the triangles go first.
    let found = parallel::map_chunks(&tree.nodes, CHUNK, |_, nodes| {
        let mut found = Found { leaves: 0, mixed: Vec::new() };
        for node in nodes {
            let Kind::Leaf { first, count } = node.kind() else { continue };
            let prims = &tree.prims[first..first + count];
            let of_triangles = triangles_in(prims, triangles);
            found.leaves += leaves(of_triangles) + (count - of_triangles) - 1;
            if !of_triangles.is_multiple_of(count) {
                found.mixed.push(first..first + count);
            }
        }
        found
    });
    let more = found.iter().map(|chunk| 2 * chunk.leaves).sum::<usize>();
    if more == 0 {
        return Ok(tree);
    }
    for range in found.iter().flat_map(|chunk| &chunk.mixed) {
        tree.prims[range.clone()].sort_unstable();
    }

    // Cut them, each chunk into a room of its own.
    let before = tree.nodes.len();
    memory::try_reserve(&mut tree.nodes, more, "leaves that are cut")?;
    parallel::extend(&mut tree.nodes, more, Node::leaf(Aabb::EMPTY, 0, 1));
    let (nodes, mut rest) = tree.nodes.split_at_mut(before);
    let mut jobs = Vec::with_capacity(found.len());
    let mut base = before;
    for (nodes, Found { leaves, .. }) in nodes.chunks_mut(CHUNK).zip(&found) {
        let (new, after) = rest.split_at_mut(2 * leaves);
        rest = after;
        if !new.is_empty() {
            jobs.push((nodes, Room { base, used: 0, nodes: new }));
        }
        base += 2 * leaves;
    }
    let cut = Cut { prims: &tree.prims, bounds, triangles };
    parallel::map(jobs, |(nodes, mut room)| {
        for at in 0..nodes.len() {
            if let Some(soon) = nodes.get(at + AHEAD) {
                cut.expect(soon);
            }
            cut.node(&mut nodes[at], &mut room);
        }
    });
    Ok(tree)
}

/// Boxes are asked for this many nodes ahead.
const AHEAD: usize = 8;

/// What is to be cut in a chunk of nodes.
struct Found {
    /// How many leaves there will be more.
    leaves: usize,
    /// Of leaves with triangles and others.
    mixed: Vec<Range<usize>>,
}

/// How many of them are triangles.
#[inline(always)]
fn triangles_in(prims: &[u32], triangles: usize) -> usize {
    if triangles == 0 {
        return 0;
    }
    prims.iter().filter(|&&prim| (prim as usize) < triangles).count()
}

/// Leaves that triangles of one leaf are cut into.
fn leaves(triangles: usize) -> usize {
    match triangles {
        0 => 0,
        1..=LEAF_MAX => 1,
        _ => leaves(triangles / 2) + leaves(triangles - triangles / 2),
    }
}

/// Where the nodes of a chunk go that were not there.
struct Room<'a> {
    /// The number of the first.
    base: usize,
    used: usize,
    nodes: &'a mut [Node],
}

struct Cut<'a> {
    prims: &'a [u32],
    bounds: &'a [Aabb],
    triangles: usize,
}

impl Cut<'_> {
    /// Asks for the boxes that cutting a leaf will read.
    #[inline(always)]
    fn expect(&self, node: &Node) {
        if let Kind::Leaf { first, count } = node.kind()
            && count > 1
        {
            let prims = &self.prims[first..first + count];
            prims.iter().for_each(|&prim| prefetch(self.bounds, prim as usize));
        }
    }

    /// Cuts a leaf, and what it is cut into, until all fit.
    fn node(&self, node: &mut Node, room: &mut Room<'_>) {
        let mut done = room.used;
        self.once(node, room);
        while done < room.used {
            let mut node = room.nodes[done];
            self.once(&mut node, room);
            room.nodes[done] = node;
            done += 1;
        }
    }

    /// Cuts a leaf that does not fit.
    fn once(&self, node: &mut Node, room: &mut Room<'_>) {
        let Kind::Leaf { first, count } = node.kind() else { return };
        let prims = &self.prims[first..first + count];
        let of_triangles = triangles_in(prims, self.triangles);
        if count == 1 || (of_triangles == count && count <= LEAF_MAX) {
            return;
        }
        // Triangles go before others; leaves of one kind are halved.
        let left = if of_triangles.is_multiple_of(count) { count / 2 } else { of_triangles };
        let around = |prims: &[u32]| {
            prims.iter().fold(Aabb::EMPTY, |all, &prim| all.union(&self.bounds[prim as usize]))
        };
        let at = room.used;
        room.nodes[at] = Node::leaf(around(&prims[..left]), first, left);
        room.nodes[at + 1] = Node::leaf(around(&prims[left..]), first + left, count - left);
        room.used += 2;
        *node = Node::inner(node.bounds, room.base + at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Kind;

    /// Leaves of all sizes and mixtures, in several chunks.
    #[test]
    fn every_leaf_fits_and_nothing_is_lost() {
        const TRIANGLES: usize = 5000;
        let counts = (0..3 * CHUNK).map(|at| 1 + at * at % 11);
        let (mut nodes, mut prims) = (Vec::new(), Vec::<u32>::new());
        for count in counts {
            nodes.push(Node::leaf(Aabb::EMPTY, prims.len(), count));
            // Triangles and others in turn, in no order.
            let from = prims.len();
            let other = |at: usize| if at % 7 < 3 { at % TRIANGLES } else { TRIANGLES + at };
            prims.extend((from..from + count).map(|at| other(at) as u32));
        }
        let most = *prims.iter().max().unwrap() as usize + 1;
        let at = |prim: usize| [(prim % 977) as f32, (prim % 31) as f32, 1.0];
        let bounds: Vec<_> = (0..most).map(|prim| Aabb { lo: at(prim), hi: at(prim) }).collect();
        let before = Tree { nodes, prims };
        let tree = split_leaves(before.clone(), &bounds, TRIANGLES).unwrap();
        let mut held = 0;
        for node in &tree.nodes {
            let Kind::Leaf { first, count } = node.kind() else { continue };
            let prims = &tree.prims[first..first + count];
            let of_triangles = triangles_in(prims, TRIANGLES);
            assert!(count == 1 || (of_triangles == count && count <= LEAF_MAX));
            held += count;
        }
        assert_eq!(held, before.prims.len());
        // Boxes that were cut hold what is below.
        let inner = |at: usize| tree.nodes[at].kind();
        for at in before.nodes.len()..tree.nodes.len() {
            let held = |at: usize| match inner(at) {
                Kind::Inner { left } => tree.nodes[left].bounds.union(&tree.nodes[left + 1].bounds),
                Kind::Leaf { first, count } => tree.prims[first..first + count]
                    .iter()
                    .fold(Aabb::EMPTY, |all, &prim| all.union(&bounds[prim as usize])),
            };
            assert_eq!(tree.nodes[at].bounds, held(at), "{at}");
        }
        let sorted = |mut prims: Vec<u32>| {
            prims.sort_unstable();
            prims
        };
        assert_eq!(sorted(tree.prims), sorted(before.prims));
    }
}

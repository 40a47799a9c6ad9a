//! Rotations: where a tree has decayed, children change places with what is near them while boxes are mended.
//!
//! Source: D. Kopta, T. Ize, J. Spjut, E. Brunvand, A. Davis, A. Kensler, "Fast, Effective BVH Updates for Animated Scenes", Symposium on
//! Interactive 3D Graphics and Games, 2012. Theirs are of binary trees; here a grandchild leaves its node for its parent, for a
//! sibling of its parent, or in exchange for a child of its grandparent. Only what alone holds a face of its node's box can
//! gain by leaving, at most six of a node, so few places are tried. A node that is left with one child gives it its own place. Leaves are
//! taken apart, too: one whose triangles have parted becomes two where its node has a free slot.
//!
//! Children go on standing after their parents: a node may come under those that stand before it only.
//!
//! Cost: a sweep looks at every fourth node, in turns ([`TURNS`]), and only in trees that have decayed: a refit of a bursting kitchen of 1.4
//! million triangles took 32 ms instead of 26 (one core), of a house 36 instead of 27. Worth: after 48 frames rays that were traced with refits alone
//! visited 21 and 18 % fewer nodes, 19 and 12 % fewer leaves. What repairs mend anyway gains next to nothing (within 5 %).

use super::areas::{around, of_node, used};
use super::half_area;
use crate::bounds::Aabb;
use crate::layout::lower::Packed;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, ChildKind, LEAF_MAX, Node, Plain};
use crate::simd::f4::F4;

/// Sweeps until every node was looked at. With 1, refits of a bursting kitchen took half as long again as without any, for some 6 %
/// fewer visits of nodes.
pub(super) const TURNS: u32 = 4;
/// A move gains at least this share of the half area of the node in which it happens.
const WORTH: f64 = 0.01;
/// Moves in a node, at most, each sweep.
const MOVES: usize = 4;
/// A leaf is taken apart where its box has this many times the surface of the boxes of its triangles,
const LOOSE: f64 = 1.5;
/// and the boxes of its halves have at most this share of its own.
const HALVES: f64 = 0.7;
/// The most children of a node that hold faces of its box.
const FACES: usize = 6;

/// Nodes that are swept, their children included.
pub(super) struct Rotations<'a, F, const W: usize> {
    pub(super) nodes: &'a mut [Node<W>],
    /// The number of the first.
    pub(super) base: usize,
    /// Half areas of the triangles in the leaves of each node.
    pub(super) triangles: &'a mut [f32],
    /// Half areas of the triangles in a leaf.
    pub(super) of_leaf: F,
}

/// A child that is a node.
#[derive(Clone, Copy)]
struct Inner {
    slot: usize,
    node: usize,
    used: usize,
    bounds: Aabb,
    area: f64,
}

/// A child of an inner child, and the box of what would be left without it.
#[derive(Clone, Copy)]
struct Leaver {
    slot: usize,
    rest: Aabb,
}

/// Where it goes.
#[derive(Clone, Copy)]
enum Goal {
    Parent,
    Sibling(Inner),
    /// To the parent, for what is in that slot.
    InExchange(usize),
}

#[derive(Clone, Copy)]
struct Move {
    from: Inner,
    leaver: Leaver,
    goal: Goal,
    gain: f64,
}

impl<F: Fn(Child) -> f32, const W: usize> Rotations<'_, F, W> {
    /// Makes the moves that gain most, one after the other, among the grandchildren of node `at`, whose half area is given. Returns
    /// by how much the half areas of all boxes fell.
    pub(super) fn rotate(&mut self, at: usize, half_area: f64) -> f64 {
        let mut gained = 0.0;
        for _ in 0..MOVES {
            let Some(best) = self.best(at, WORTH * half_area) else { break };
            gained += best.gain;
            self.make(at, &best);
        }
        gained
    }

    /// The move that gains most, if that is more than `least`.
    fn best(&self, at: usize, least: f64) -> Option<Move> {
        let parent = &self.nodes[at];
        let count = used(&parent.children);
        let mut inner = [None; W];
        for (slot, inner) in inner.iter_mut().enumerate().take(count) {
            *inner = self.inner(at, slot);
        }
        let mut best: Option<Move> = None;
        for from in inner.iter().flatten().filter(|from| from.used > 1 && from.area > least) {
            let (leavers, len) = leavers(&self.nodes[from.node], &from.bounds);
            for leaver in &leavers[..len] {
                // What is left takes the place of its node if it is alone. No goal is better than a free slot of the parent.
                let left = if from.used == 2 { 0.0 } else { half_area(&leaver.rest) };
                let gone = from.area - left;
                if gone <= best.map_or(least, |best| best.gain) {
                    continue;
                }
                let mut offer = |goal: Goal, gain: f64| {
                    if gain > best.map_or(least, |best| best.gain) {
                        best = Some(Move { from: *from, leaver: *leaver, goal, gain });
                    }
                };
                if count < W {
                    offer(Goal::Parent, gone);
                    continue;
                }
                let (child, bounds) = child(&self.nodes[from.node], leaver.slot);
                for to in inner.iter().flatten().filter(|to| to.slot != from.slot && to.used < W) {
                    if self.may_stand_under(child, to.node) {
                        let grown = half_area(&to.bounds.union(&bounds)) - to.area;
                        offer(Goal::Sibling(*to), gone - grown);
                    }
                }
                for slot in (0..count).filter(|&slot| slot != from.slot) {
                    if self.may_stand_under(parent.children[slot], from.node) {
                        let sibling = <Plain as Packing<W>>::bounds(parent, slot);
                        let instead = half_area(&leaver.rest.union(&sibling));
                        offer(Goal::InExchange(slot), from.area - instead);
                    }
                }
            }
        }
        best
    }

    /// What is in a slot, if that is a node.
    fn inner(&self, at: usize, slot: usize) -> Option<Inner> {
        let (child, bounds) = child(&self.nodes[at], slot);
        let ChildKind::Inner { node } = child.kind() else { return None };
        let node = node - self.base;
        let used = used(&self.nodes[node].children);
        Some(Inner { slot, node, used, bounds, area: half_area(&bounds) })
    }

    fn may_stand_under(&self, child: Child, node: usize) -> bool {
        match child.kind() {
            ChildKind::Inner { node: child } => child > self.base + node,
            ChildKind::Leaf { .. } => true,
        }
    }

    fn make(&mut self, at: usize, &Move { from, leaver, goal, .. }: &Move) {
        let leaving = child(&self.nodes[from.node], leaver.slot);
        match goal {
            Goal::InExchange(slot) => {
                let down = child(&self.nodes[at], slot);
                self.nodes[from.node].set(leaver.slot, &down.1, down.0);
                self.nodes[at].set(slot, &leaving.1, leaving.0);
                self.account(leaving.0, from.node, at);
                self.account(down.0, at, from.node);
            }
            Goal::Parent | Goal::Sibling(_) => {
                let to = if let Goal::Sibling(to) = goal { to.node } else { at };
                take(&mut self.nodes[from.node], leaver.slot);
                let end = used(&self.nodes[to].children);
                self.nodes[to].set(end, &leaving.1, leaving.0);
                self.account(leaving.0, from.node, to);
            }
        }
        if let Goal::Sibling(to) = goal {
            self.mend(at, to.slot);
        }

        // A node with one child gives it its place, and stays behind empty.
        let node = &self.nodes[from.node];
        if used(&node.children) == 1 {
            let (rest, bounds) = child(node, 0);
            self.nodes[at].set(from.slot, &bounds, rest);
            self.account(rest, from.node, at);
            self.nodes[from.node] = Node::EMPTY;
        } else {
            self.mend(at, from.slot);
        }
    }

    /// The box of an inner child anew.
    fn mend(&mut self, at: usize, slot: usize) {
        let word = self.nodes[at].children[slot];
        if let ChildKind::Inner { node } = word.kind() {
            let (bounds, _) = of_node(&self.nodes[node - self.base].planes);
            self.nodes[at].set(slot, &bounds, word);
        }
    }

    /// Takes down that the triangles of a leaf are under another node.
    fn account(&mut self, child: Child, from: usize, to: usize) {
        if !child.is_inner() {
            let area = (self.of_leaf)(child);
            self.triangles[from] -= area;
            self.triangles[to] += area;
        }
    }
}

fn child<const W: usize>(node: &Node<W>, slot: usize) -> (Child, Aabb) {
    (node.children[slot], <Plain as Packing<W>>::bounds(node, slot))
}

/// Takes a child out; those after it move up.
fn take<const W: usize>(node: &mut Node<W>, slot: usize) {
    let end = used(&node.children);
    for later in slot + 1..end {
        let (child, bounds) = child(node, later);
        node.set(later - 1, &bounds, child);
    }
    node.set(end - 1, &Aabb::EMPTY, Child::END);
}

/// The children of a node that alone hold a face of its box.
fn leavers<const W: usize>(node: &Node<W>, bounds: &Aabb) -> ([Leaver; FACES], usize) {
    // For each face, who holds it, and where it would be without.
    let mut holders = [None; FACES];
    for (face, holder) in holders.iter_mut().enumerate() {
        let planes = &node.planes[face / 2][face % 2];
        let lower = face % 2 == 0;
        let (outer, next) = if lower { two::<true, W>(planes) } else { two::<false, W>(planes) };
        if outer != next {
            let slot = planes.iter().position(|&plane| plane == outer);
            *holder = slot.map(|slot| (slot, next));
        }
    }

    // Who holds several leaves them all.
    let mut leavers = [Leaver { slot: 0, rest: *bounds }; FACES];
    let mut len = 0;
    for (face, holder) in holders.iter().enumerate() {
        let Some((slot, next)) = *holder else { continue };
        let known = leavers[..len].iter().position(|leaver| leaver.slot == slot);
        let at = known.unwrap_or_else(|| {
            leavers[len].slot = slot;
            len += 1;
            len - 1
        });
        let rest = &mut leavers[at].rest;
        *if face % 2 == 0 { &mut rest.lo[face / 2] } else { &mut rest.hi[face / 2] } = next;
    }
    (leavers, len)
}

/// The outermost plane and the one after it: the least two of lower planes, the greatest two of upper ones.
fn two<const LOWER: bool, const W: usize>(planes: &[f32; W]) -> (f32, f32) {
    let far = if LOWER { f32::INFINITY } else { f32::NEG_INFINITY };
    let merge = |(outer, next): (F4, F4), plane: F4| {
        if LOWER {
            (outer.min(plane), next.min(outer.max(plane)))
        } else {
            (outer.max(plane), next.max(outer.min(plane)))
        }
    };
    let mut found = (F4::splat(far), F4::splat(far));
    for &[a, b, c, d] in planes.as_chunks::<4>().0 {
        found = merge(found, F4::new(a, b, c, d));
    }
    // The same of the lanes.
    let mut all = (F4::splat(far), F4::splat(far));
    for lane in found.0.to_array().into_iter().chain(found.1.to_array()) {
        all = merge(all, F4::splat(lane));
    }
    (all.0.to_array()[0], all.1.to_array()[0])
}

/// Puts the triangles of a leaf into two halves that are worth a box each; returns how many the first one has.
pub(super) fn halve(triangles: &mut [Packed], bounds: &Aabb, prims: f64) -> Option<usize> {
    let area = half_area(bounds);
    if triangles.len() < 2 || area <= LOOSE * prims {
        return None;
    }
    // Every way to share them out; the last one stays in the second half.
    let half = |mask: usize, first: bool| {
        let mut half = [Packed::default(); LEAF_MAX];
        let mut len = 0;
        for (at, triangle) in triangles.iter().enumerate() {
            if (mask >> at & 1 == 1) == first {
                half[len] = *triangle;
                len += 1;
            }
        }
        (half, len)
    };
    let mut best = (HALVES * area, 0);
    for mask in 1..1 << (triangles.len() - 1) {
        let halves = [true, false].map(|first| {
            let (half, len) = half(mask, first);
            half_area(&around(&half[..len]).0)
        });
        let sum = halves[0] + halves[1];
        if sum < best.0 {
            best = (sum, mask);
        }
    }
    let (_, mask) = best;
    if mask == 0 {
        return None;
    }
    let (first, len) = half(mask, true);
    let (second, rest) = half(mask, false);
    triangles[..len].copy_from_slice(&first[..len]);
    triangles[len..].copy_from_slice(&second[..rest]);
    Some(len)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::Random;
    use alloc::vec::Vec;

    const W: usize = 8;

    fn area_of(leaf: Child) -> f32 {
        match leaf.kind() {
            ChildKind::Leaf { first, .. } => 1.0 + first as f32,
            ChildKind::Inner { .. } => 0.0,
        }
    }

    /// Half areas of all boxes below a node, the first entries of its leaves, and whether it is as it should be.
    fn walk(nodes: &[Node<W>], at: usize, base: usize, leaves: &mut Vec<usize>) -> f64 {
        let mut sum = 0.0;
        for slot in 0..used(&nodes[at].children) {
            let (child, bounds) = child(&nodes[at], slot);
            sum += half_area(&bounds);
            match child.kind() {
                ChildKind::Inner { node } => {
                    assert!(node - base > at, "children stand after their parents");
                    assert_eq!(bounds, of_node(&nodes[node - base].planes).0);
                    sum += walk(nodes, node - base, base, leaves);
                }
                ChildKind::Leaf { first, .. } => leaves.push(first),
            }
        }
        sum
    }

    /// Nodes under a root whose leaves are near one of three points, at random; the root may be full.
    fn mixed(random: &mut Random, base: usize, is_full: bool) -> Vec<Node<W>> {
        let mut nodes = alloc::vec![Node::<W>::EMPTY; 7];
        let mut leaves = 0;
        for at in (1..nodes.len()).rev() {
            let below = if at < 4 { 3 + at } else { 0 };
            for slot in 0..3 + random.below(6) as usize {
                if slot == 1 && below > 0 {
                    let (bounds, _) = of_node(&nodes[below].planes);
                    nodes[at].set(slot, &bounds, Child::inner((base + below) as u32));
                    continue;
                }
                let away = 100.0 * random.below(3) as f32;
                let lo = [(); 3].map(|()| away + random.between(0.0, 9.0));
                let bounds = Aabb { lo, hi: lo.map(|x| x + 1.0) };
                nodes[at].set(slot, &bounds, Child::leaf(leaves, 1));
                leaves += 1;
            }
        }
        for slot in 0..3 {
            let (bounds, _) = of_node(&nodes[slot + 1].planes);
            nodes[0].set(slot, &bounds, Child::inner((base + slot + 1) as u32));
        }
        for slot in 3..if is_full { W } else { 3 } {
            let lo = [100.0 * random.below(3) as f32; 3];
            nodes[0].set(slot, &Aabb { lo, hi: lo.map(|x| x + 1.0) }, Child::leaf(leaves, 1));
            leaves += 1;
        }
        nodes
    }

    #[test]
    fn rotations_lower_the_areas_by_what_they_say_and_lose_nothing() {
        let mut random = Random::new(7);
        let mut gained = 0;
        for round in 0..200 {
            let base = 1000 * (round % 2);
            let mut nodes = mixed(&mut random, base, round % 4 < 2);
            let of_leaves = |nodes: &[Node<W>]| -> Vec<f32> {
                let of_node = |node: &Node<W>| {
                    let leaves = node.children[..used(&node.children)].iter();
                    leaves.map(|&child| area_of(child)).sum()
                };
                nodes.iter().map(of_node).collect()
            };
            let mut triangles = of_leaves(&nodes);
            let mut before = Vec::new();
            let (bounds, _) = of_node(&nodes[0].planes);
            let sum = walk(&nodes, 0, base, &mut before);
            let mut tree =
                Rotations { nodes: &mut nodes, base, triangles: &mut triangles, of_leaf: area_of };
            let gain = tree.rotate(0, half_area(&bounds));
            let mut after = Vec::new();
            let now = walk(&nodes, 0, base, &mut after);
            assert!((sum - gain - now).abs() < 1e-6 * sum, "{round}: {sum} - {gain} is not {now}");
            assert_eq!(of_node(&nodes[0].planes).0, bounds);
            before.sort_unstable();
            after.sort_unstable();
            assert_eq!(before, after, "{round}");
            assert_eq!(triangles, of_leaves(&nodes), "{round}");
            gained += usize::from(gain > 0.1 * sum);
        }
        assert!(gained > 100, "{gained}");
    }

    #[test]
    fn leaves_are_taken_apart_where_their_triangles_are_apart() {
        let triangle = |id: u32, x: f32| Packed {
            corners: [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 1.0]],
            id,
        };
        let half = |xs: [f32; 4]| {
            let mut triangles = Vec::new();
            xs.iter().enumerate().for_each(|(id, &x)| triangles.push(triangle(id as u32, x)));
            let (bounds, prims) = around(&triangles);
            let half = halve(&mut triangles, &bounds, prims);
            (half, triangles.iter().map(|packed| packed.id).collect::<Vec<_>>())
        };
        assert_eq!(half([0.0, 0.5, 0.2, 0.1]), (None, alloc::vec![0, 1, 2, 3]));
        assert_eq!(half([0.0, 90.0, 0.5, 91.0]), (Some(2), alloc::vec![0, 2, 1, 3]));
        assert_eq!(half([0.0, 90.0, 0.5, 1.0]), (Some(1), alloc::vec![1, 0, 2, 3]));
    }
}

//! The best partner of a cluster, exactly, among clusters that come and go.
//!
//! Clusters wait in slots along the Morton curve, under a complete binary tree. A node keeps, a axis,
//! the greatest lower and the least upper face of the boxes below it: the box of those with any other
//! box is no larger than what any of them makes with it. That bound sees how far away they are and
//! how large; and it stays true when some of them are joined, so what is above may be mended late.

use crate::bounds::Aabb;
use crate::memory::{self, OutOfMemory};
use alloc::vec::Vec;

/// What decides between pairs: less is better.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Key {
    /// Half the area of the common box.
    area: f32,
    /// Primitives in both.
    prims: u32,
    /// The bits in which their numbers differ.
    differ: u32,
}

/// A partner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) slot: usize,
    key: Key,
}

impl Found {
    /// Worse than all pairs, not worse than an empty slot.
    pub(super) const NOTHING: Self =
        Self { slot: usize::MAX, key: Key { area: f32::MAX, prims: u32::MAX, differ: 0 } };

    /// The same pair as the other one sees it.
    pub(super) fn of(self, slot: usize) -> Self {
        Self { slot, ..self }
    }

    pub(super) fn better(self, other: Self) -> Self {
        if other.key < self.key { other } else { self }
    }
}

/// What is known of the clusters below a node; a cluster in a slot.
#[derive(Clone, Copy)]
struct Node {
    /// The greatest lower faces.
    lo: [f32; 3],
    /// The fewest primitives in one of them.
    prims: u32,
    /// The least upper faces.
    hi: [f32; 3],
    /// Of a slot: the number of its cluster, or of the last one there. Of others: nothing.
    number: u32,
}

impl Node {
    /// Where no cluster is. Numbers must not fall from slot to slot there either.
    fn empty(number: u32) -> Self {
        Self { lo: [f32::NEG_INFINITY; 3], prims: u32::MAX, hi: [f32::INFINITY; 3], number }
    }

    fn above(a: &Self, b: &Self) -> Self {
        let mut out = *a;
        for axis in 0..3 {
            out.lo[axis] = greater(a.lo[axis], b.lo[axis]);
            out.hi[axis] = lesser(a.hi[axis], b.hi[axis]);
        }
        out.prims = a.prims.min(b.prims);
        out
    }

    fn is_same(&self, other: &Self) -> bool {
        self.lo == other.lo && self.hi == other.hi && self.prims == other.prims
    }

    /// Half the area of what a cluster makes with those below, or more; as f32 rounds it, so never
    /// less for larger boxes.
    #[inline(always)]
    fn area(&self, cluster: &Self) -> f32 {
        let length = |axis: usize| {
            greater(self.hi[axis], cluster.hi[axis]) - lesser(self.lo[axis], cluster.lo[axis])
        };
        let (x, y, z) = (length(0), length(1), length(2));
        // Beyond f32 all areas are equal.
        lesser(x * y + (x + y) * z, f32::MAX)
    }
}

/// Clusters in slots, and the tree above.
pub(super) struct Search {
    /// The root is node 1; the children of `i` are `2 i` and `2 i + 1`; slots are the last half.
    nodes: Vec<Node>,
    slots: usize,
    live: usize,
    /// Nodes still to be looked at, and their areas.
    open: Vec<(f32, u32)>,
}

impl Search {
    /// Each box a cluster of one primitive, numbered in this order.
    pub(super) fn new(boxes: impl ExactSizeIterator<Item = Aabb>) -> Result<Self, OutOfMemory> {
        let live = boxes.len();
        let slots = live.next_power_of_two();
        let mut nodes = memory::try_filled(Node::empty(u32::MAX), 2 * slots, "searching clusters")?;
        for ((node, bounds), number) in nodes[slots..].iter_mut().zip(boxes).zip(0..) {
            *node = Node { lo: bounds.lo, prims: 1, hi: bounds.hi, number };
        }
        let mut search = Self { nodes, slots, live, open: Vec::new() };
        search.mend_all();
        Ok(search)
    }

    fn mend_all(&mut self) {
        for at in (1..self.slots).rev() {
            self.nodes[at] = Node::above(&self.nodes[2 * at], &self.nodes[2 * at + 1]);
        }
    }

    pub(super) fn is_live(&self, slot: usize) -> bool {
        self.nodes[self.slots + slot].prims != u32::MAX
    }

    /// Whether most slots are empty.
    pub(super) fn is_sparse(&self) -> bool {
        2 * self.live <= self.slots && self.slots > 1
    }

    /// Joins the clusters of two slots, the first of which they keep, as well as its number.
    pub(super) fn join(&mut self, left: usize, right: usize) {
        let (left, right) = (self.slots + left, self.slots + right);
        let (a, b) = (self.nodes[left], self.nodes[right]);
        let mut both = a;
        for axis in 0..3 {
            both.lo[axis] = lesser(a.lo[axis], b.lo[axis]);
            both.hi[axis] = greater(a.hi[axis], b.hi[axis]);
        }
        both.prims = a.prims + b.prims;
        self.nodes[left] = both;
        self.nodes[right] = Node::empty(b.number);
        self.live -= 1;
        self.mend(left);
        self.mend(right);
    }

    /// Brings what is above a node up to date.
    fn mend(&mut self, node: usize) {
        let mut at = node / 2;
        while at > 0 {
            let above = Node::above(&self.nodes[2 * at], &self.nodes[2 * at + 1]);
            if above.is_same(&self.nodes[at]) {
                return;
            }
            self.nodes[at] = above;
            at /= 2;
        }
    }

    /// Moves clusters to the first slots, in order.
    pub(super) fn close_gaps(&mut self) {
        let old = self.slots;
        let slots = self.live.next_power_of_two();
        let mut used = slots;
        for at in old..2 * old {
            let node = self.nodes[at];
            if node.prims != u32::MAX {
                self.nodes[used] = node;
                used += 1;
            }
        }
        self.nodes.truncate(2 * slots);
        self.nodes[used..].fill(Node::empty(u32::MAX));
        self.slots = slots;
        self.mend_all();
    }

    /// Two slots as a pair, found by the first one.
    pub(super) fn pair(&self, of: usize, slot: usize) -> Found {
        let cluster = &self.nodes[self.slots + of];
        let other = &self.nodes[self.slots + slot];
        Found { slot, key: key(cluster, other, other.area(cluster)) }
    }

    /// The best partner of a cluster, given one or none.
    pub(super) fn best(&mut self, slot: usize, so_far: Found) -> Found {
        let mut at = self.slots + slot;
        let cluster = self.nodes[at];
        let mut best = so_far;
        let mut open = core::mem::take(&mut self.open);
        // Neighbours on the curve first: they are near, so that most others need no look.
        while at > 1 {
            self.visit(at ^ 1, &cluster, &mut best, &mut open);
            at /= 2;
        }
        self.open = open;
        best
    }

    /// Looks for better partners below a node.
    #[inline(always)]
    fn visit(&self, node: usize, cluster: &Node, best: &mut Found, open: &mut Vec<(f32, u32)>) {
        let area = self.nodes[node].area(cluster);
        if !self.may_be_better(node, area, cluster, best) {
            return;
        }
        open.push((area, node as u32));
        while let Some((area, node)) = open.pop() {
            let node = node as usize;
            if !self.may_be_better(node, area, cluster, best) {
                continue;
            }
            if node >= self.slots {
                let key = key(cluster, &self.nodes[node], area);
                *best = Found { slot: node - self.slots, key };
                continue;
            }
            let children = [2 * node, 2 * node + 1];
            let areas = children.map(|child| self.nodes[child].area(cluster));
            // The better one is looked at next; of equal ones, the one with the cluster's own bits.
            let right_first = areas[1] < areas[0]
                || (areas[1] == areas[0]
                    && self.differ(children[1], cluster) < self.differ(children[0], cluster));
            let first = usize::from(right_first);
            for side in [1 - first, first] {
                open.push((areas[side], children[side] as u32));
            }
        }
    }

    /// Whether a cluster below the node might make a better pair; of a slot: whether it does.
    #[inline(always)]
    fn may_be_better(&self, node: usize, area: f32, cluster: &Node, best: &Found) -> bool {
        if area != best.key.area {
            return area < best.key.area;
        }
        let prims = self.nodes[node].prims.saturating_add(cluster.prims);
        if prims != best.key.prims {
            return prims < best.key.prims;
        }
        self.differ(node, cluster) < best.key.differ
    }

    /// The least number whose bits say where a cluster's number and those below a node differ, or
    /// something less.
    #[inline(never)]
    fn differ(&self, node: usize, cluster: &Node) -> u32 {
        let height = self.slots.ilog2() - node.ilog2();
        let first = node << height;
        let numbers = [first, first + (1 << height) - 1].map(|slot| self.nodes[slot].number);
        // Numbers rise from slot to slot: what these two have in common, all have.
        let unknown = u32::BITS - (numbers[0] ^ numbers[1]).leading_zeros();
        let differ = u64::from(numbers[0] ^ cluster.number);
        (differ >> unknown << unknown) as u32
    }
}

/// How good the pair of two clusters is, whose area is known.
fn key(a: &Node, b: &Node, area: f32) -> Key {
    Key { area, prims: a.prims + b.prims, differ: a.number ^ b.number }
}

/// The lesser one, and `b` if `a` is NaN.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater one.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

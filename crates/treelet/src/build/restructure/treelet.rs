//! One treelet: which nodes are in it, and how they are put together anew.

use super::best::Sets;
use crate::bounds::Aabb;
use crate::tree::sweep::{Below, Root, Slot};

/// Nodes at the edge of a treelet: the paper's choice. Each one more triples the pairs of parts; other
/// sizes were not tried here.
pub(crate) const LEAVES: usize = 7;

/// A treelet changes only if that saves more than this share of its root's area: less is rounding.
const NOISE: f64 = 1e-9;

/// What it must seem to save before it is looked at closer, as a share of its cost: some roundings in
/// f32.
const HOPE: f32 = 1e-6;

/// A node and its largest descendants.
#[derive(Clone, Copy)]
pub(super) struct Treelet {
    /// At its edge.
    leaves: [Option<Slot>; LEAVES],
    count: usize,
    /// Where the pairs of siblings between the root and the edge lie, the root's children first.
    pairs: [usize; LEAVES - 1],
    /// Subtrees of up to so many leaves cost what a block does, their area.
    block: u32,
    /// What it costs, but for the root's area and what is below the edge.
    cost: f64,
    /// A tree must cost less in f32 to be looked at, in the units of [`Treelet::load`], with the root.
    hope: f32,
}

/// A node of a treelet to be: its children, each a leaf's number or that of a planned node after
/// [`LEAVES`].
type Planned = [usize; 2];

impl Treelet {
    pub(super) const NONE: Self = Self {
        leaves: [None; LEAVES],
        count: 0,
        pairs: [0; LEAVES - 1],
        block: 0,
        cost: 0.0,
        hope: 0.0,
    };

    /// Opens the largest node at the edge until there are enough; of equal ones the first.
    pub(super) fn form(below: &Below<'_>, root: &Root, block: u32) -> Self {
        let mut treelet = Self { block, ..Self::NONE };
        let mut areas = [f64::NEG_INFINITY; LEAVES];
        let mut open = (0, root.left, root.leaves);
        loop {
            let (at, left, leaves) = open;
            treelet.pairs[treelet.count.saturating_sub(1)] = left;
            for (leaf, child) in [(at, left), (treelet.count.max(1), left + 1)] {
                let slot = *below.at(child);
                treelet.leaves[leaf] = Some(slot);
                areas[leaf] = slot.node.bounds.half_area();
                if leaves > block && slot.leaves <= block {
                    treelet.cost += areas[leaf];
                }
            }
            treelet.count = treelet.count.max(1) + 1;
            if treelet.count == LEAVES {
                return treelet;
            }
            let mut largest = None;
            let mut most = f64::NEG_INFINITY;
            for leaf in 0..treelet.count {
                let Some(slot) = treelet.leaves[leaf] else { continue };
                let Some(left) = slot.left() else { continue };
                if areas[leaf] > most {
                    (largest, most) = (Some((leaf, left, slot.leaves)), areas[leaf]);
                }
            }
            let Some(next) = largest else { return treelet };
            // A block is counted already, what is in it is not.
            treelet.cost += if next.2 > block { most } else { 0.0 };
            open = next;
        }
    }

    /// Shows its edge to who finds the best tree, in units of the root's longest edge.
    pub(super) fn load(&mut self, root: &Root, sets: &mut Sets, lane: usize) {
        let origin = root.bounds.lo.map(f64::from);
        let [x, y, z] = root.bounds.extent();
        let unit = 1.0 / f64::from(x.max(y).max(z)).max(f64::MIN_POSITIVE);
        for (leaf, slot) in self.leaves.iter().flatten().enumerate() {
            let Aabb { lo, hi } = slot.node.bounds;
            let mut units = [[0.0; 3]; 2];
            for axis in 0..3 {
                units[0][axis] = ((f64::from(lo[axis]) - origin[axis]) * unit) as f32;
                units[1][axis] = ((f64::from(hi[axis]) - origin[axis]) * unit) as f32;
            }
            sets.put([lane, leaf], units, slot.leaves);
        }
        self.hope = ((self.cost + root.bounds.half_area()) * unit * unit) as f32 * (1.0 - HOPE);
    }

    /// Puts the best tree in its place if it is better, and not too deep; returns what that saves.
    pub(super) fn rebuild(
        &self,
        below: &mut Below<'_>,
        root: &Root,
        sets: &Sets,
        lane: usize,
    ) -> f64 {
        // Most treelets are as good as can be after a round.
        let seems_better = sets.cost(lane, (1 << self.count) - 1) < self.hope;
        if !seems_better {
            return 0.0;
        }

        // Put subtrees together from below.
        let (planned, inner) = self.plan(sets, lane);
        let mut slots = [None; LEAVES + LEAVES - 1];
        slots[..LEAVES].copy_from_slice(&self.leaves);
        let mut cost = 0.0;
        for (at, parts) in planned[..inner].iter().enumerate().rev() {
            let [Some(a), Some(b)] = parts.map(|part| slots[part]) else { return 0.0 };
            let slot = Slot::around(self.pairs[at], [&a, &b]);
            slots[LEAVES + at] = Some(slot);
            // A node costs its area, a block too; what is in a block costs nothing.
            for (part, below) in parts.iter().zip([a, b]) {
                let counts = *part >= LEAVES || below.leaves <= self.block;
                if counts && slot.leaves > self.block {
                    cost += below.node.bounds.half_area();
                }
            }
        }

        // Keep it if it is better.
        let Some(top) = slots[LEAVES] else { return 0.0 };
        let gain = self.cost - cost;
        // Not so where areas are infinite, either.
        let is_better = gain > NOISE * root.bounds.half_area();
        if !is_better || !root.has_room(0, &top) {
            return 0.0;
        }
        for (parts, pair) in planned[..inner].iter().zip(self.pairs) {
            for (side, &part) in parts.iter().enumerate() {
                if let Some(slot) = slots[part] {
                    below.set(pair + side, slot);
                }
            }
        }
        gain
    }

    /// The inner nodes of the best tree, parents first, and how many they are.
    fn plan(&self, sets: &Sets, lane: usize) -> ([Planned; LEAVES - 1], usize) {
        let mut planned = [[0; 2]; LEAVES - 1];
        let mut open = [0; LEAVES - 1];
        open[0] = (1 << self.count) - 1;
        let (mut next, mut inner) = (0, 1);
        while next < inner {
            for (side, part) in sets.split(lane, open[next]).into_iter().enumerate() {
                if part & (part - 1) == 0 {
                    planned[next][side] = part.trailing_zeros() as usize;
                } else {
                    planned[next][side] = LEAVES + inner;
                    open[inner] = part;
                    inner += 1;
                }
            }
            next += 1;
        }
        (planned, inner)
    }
}

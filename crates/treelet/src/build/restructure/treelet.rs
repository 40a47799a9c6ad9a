//! One treelet: which nodes are in it, and how they are put together anew.

use super::best::Sets;
use crate::bounds::Aabb;
use crate::tree::sweep::{Below, Root, Slot};

/// Nodes at the edge of a treelet (Karras and Aila 2013, section 3.1: more of them cost ten times as
/// much and gain little).
pub(crate) const LEAVES: usize = 7;

/// A treelet changes only if that saves more than this share of its root's area: less is rounding.
const NOISE: f64 = 1e-9;

/// A node and its largest descendants.
#[derive(Clone, Copy)]
pub(super) struct Treelet {
    /// At its edge.
    leaves: [Option<Slot>; LEAVES],
    count: usize,
    /// Where the pairs of siblings between the root and the edge lie, the root's children first.
    pairs: [usize; LEAVES - 1],
    /// The areas of the nodes in between.
    area: f64,
}

/// A node of a treelet to be: its children, each a leaf's number or that of a planned node after
/// [`LEAVES`].
type Planned = [usize; 2];

impl Treelet {
    pub(super) const NONE: Self =
        Self { leaves: [None; LEAVES], count: 0, pairs: [0; LEAVES - 1], area: 0.0 };

    /// Opens the largest node at the edge until there are enough; of equal ones the first.
    pub(super) fn form(below: &Below<'_>, root: &Root) -> Self {
        let mut treelet = Self::NONE;
        let mut areas = [f64::NEG_INFINITY; LEAVES];
        let mut open = (0, root.left);
        loop {
            let (at, left) = open;
            treelet.pairs[treelet.count.saturating_sub(1)] = left;
            for (leaf, child) in [(at, left), (treelet.count.max(1), left + 1)] {
                let slot = *below.at(child);
                treelet.leaves[leaf] = Some(slot);
                areas[leaf] = slot.node.bounds.half_area();
            }
            treelet.count = treelet.count.max(1) + 1;
            if treelet.count == LEAVES {
                return treelet;
            }
            let mut largest = None;
            let mut most = f64::NEG_INFINITY;
            for leaf in 0..treelet.count {
                let Some(left) = treelet.leaves[leaf].and_then(|slot| slot.left()) else {
                    continue;
                };
                if areas[leaf] > most {
                    (largest, most) = (Some((leaf, left)), areas[leaf]);
                }
            }
            let Some(next) = largest else { return treelet };
            treelet.area += most;
            open = next;
        }
    }

    /// Shows its edge to who finds the best tree, in units of the root's longest edge.
    pub(super) fn load(&self, root: &Root, sets: &mut Sets, lane: usize) {
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
            sets.put(lane, leaf, units[0], units[1]);
        }
    }

    /// Puts the best tree in its place if it is better, and not too deep; returns what that saves.
    pub(super) fn rebuild(
        &self,
        below: &mut Below<'_>,
        root: &Root,
        sets: &Sets,
        lane: usize,
    ) -> f64 {
        // Put subtrees together from below.
        let (planned, inner) = self.plan(sets, lane);
        let mut slots = [None; LEAVES + LEAVES - 1];
        slots[..LEAVES].copy_from_slice(&self.leaves);
        let mut area = 0.0;
        for (at, parts) in planned[..inner].iter().enumerate().rev() {
            let [Some(a), Some(b)] = parts.map(|part| slots[part]) else { return 0.0 };
            let slot = Slot::around(self.pairs[at], [&a, &b]);
            area += slot.node.bounds.half_area();
            slots[LEAVES + at] = Some(slot);
        }

        // Keep it if it is better.
        let Some(top) = slots[LEAVES] else { return 0.0 };
        let root_area = root.bounds.half_area();
        let gain = self.area - (area - root_area);
        // Not so where areas are infinite, either.
        let is_better = gain > NOISE * root_area;
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

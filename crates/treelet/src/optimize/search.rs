//! The best place for something loose, by branch and bound.
//!
//! Source: D. Meister and J. Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy
//! Optimization", Computer Graphics Forum 37(2), 2018, algorithm 1: up from where it is, and at each
//! step down into the subtree beside the way. Places beside the nodes on the way up are tried as
//! well: a large thing found deep in the tree belongs near the root.

use super::pairs::{Id, Loose, Pairs, ROOT};
use alloc::vec::Vec;

/// A search, with its stack.
pub(super) struct Search<'a> {
    pub(super) pairs: &'a Pairs,
    /// Inner nodes to be looked into, and what is saved if their own growth is paid for.
    open: Vec<(f64, Id)>,
}

/// The best place so far.
pub(super) struct Best {
    pub(super) gain: f64,
    pub(super) target: Id,
}

impl Best {
    fn offer(&mut self, gain: f64, target: Id) {
        if gain > self.gain {
            self.gain = gain;
            self.target = target;
        }
    }
}

impl<'a> Search<'a> {
    pub(super) fn new(pairs: &'a Pairs) -> Self {
        Self { pairs, open: Vec::new() }
    }

    /// The place that saves most; its gain is 0 if none saves anything. `sibling` takes the place of
    /// its parent when a node is taken away.
    pub(super) fn best_place(&mut self, loose: &Loose, sibling: Id) -> Best {
        let item = Item { loose, area: loose.bounds.half_area() };
        let mut best = Best { gain: 0.0, target: ROOT };
        // The sibling grows to what the parent was.
        self.look_below(&item, sibling, loose.rest.half_area(), &mut best);
        let (mut below, mut rest, mut saved) = (loose.below, loose.rest, loose.saved);
        while below != ROOT {
            // Beside the sibling of this node above it, or anywhere below that one.
            self.look_at(&item, below ^ 1, saved, &mut best);
            let above = self.pairs.parent(below);
            rest = rest.union(&self.pairs.at(below ^ 1).bounds);
            let rest_area = rest.half_area();
            best.offer(saved - rest_area, above);
            saved += self.pairs.at(above).bounds.half_area() - rest_area;
            below = above;
        }
        best
    }

    /// Looks at a target and everything below it.
    fn look_at(&mut self, item: &Item<'_>, target: Id, saved: f64, best: &mut Best) {
        if saved - item.area <= best.gain {
            return;
        }
        let place = self.pairs.at(target);
        let merged = place.bounds.union(&item.loose.bounds).half_area();
        best.offer(saved - merged, target);
        self.look_below(item, target, saved - (merged - place.bounds.half_area()), best);
    }

    /// Looks at everything below a target, whose own growth is paid for.
    fn look_below(&mut self, item: &Item<'_>, target: Id, saved: f64, best: &mut Best) {
        let bounds = item.loose.bounds;
        self.open.push((saved, target));
        while let Some((saved, target)) = self.open.pop() {
            // Wherever it goes, its new parent is at least as large as itself.
            if saved - item.area <= best.gain {
                continue;
            }
            let Some(left) = self.pairs.at(target).left() else { continue };
            let mut next = [(f64::NEG_INFINITY, left); 2];
            for (side, next) in next.iter_mut().enumerate() {
                let id = left + side as Id;
                let place = self.pairs.at(id);
                let merged = place.bounds.union(&bounds).half_area();
                best.offer(saved - merged, id);
                if place.left().is_some() {
                    *next = (saved - (merged - place.bounds.half_area()), id);
                }
            }
            // The more promising one is looked into first.
            if next[0].0 > next[1].0 {
                next.swap(0, 1);
            }
            self.open.extend(next.iter().filter(|next| next.0 - item.area > best.gain));
        }
    }
}

/// What is searched a place for.
struct Item<'a> {
    loose: &'a Loose,
    area: f64,
}

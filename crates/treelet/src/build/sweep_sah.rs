//! Sweep SAH: try every cut of the sorted centers, on every axis. The yardstick for other builders.
//!
//! Source: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", IEEE Symposium
//! on Interactive Ray Tracing, 2007 (the sweep it approximates); the three lists are sorted once
//! and kept sorted by stable partition, as in I. Wald and V. Havran, "On building fast kd-Trees for
//! Ray Tracing, and on doing that in O(N log N)", IEEE Symposium on Interactive Ray Tracing, 2006.
//!
//! O(n log n) time; 12 bytes a primitive in place, 16 more for the sort. Ties of the sort go to the
//! lower primitive, ties of the cost to the lower axis and the earlier cut.

use super::radix_sort::{self, ordered_bits};
use super::top_down::{self, Cut, Extent, Range, Splitter};
use super::{BuildError, Builder, Info, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::tree::Tree;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, Ordering};

/// Cuts at the cheapest of all places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSah {
    /// Most primitives in a leaf, in `1..=64`.
    pub leaf_max: u32,
    /// Price of visiting a node in units of one primitive test, in `0..=1000`. Higher makes fuller
    /// leaves.
    pub visit_cost: f32,
}

impl SweepSah {
    /// Leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4, visit_cost: 1.0 };
}

impl Builder for SweepSah {
    fn info(&self) -> Info {
        Info {
            name: "sweep-sah",
            summary: "cuts at the cheapest of all places by the surface area heuristic",
            source: "Wald 2007; Wald and Havran 2006",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        check_option("visit_cost", f64::from(self.visit_cost), 0.0..=1000.0, "0..=1000")?;
        let mut extent = Extent::EMPTY;
        let mut goes_left = memory::try_with_capacity(bounds.len(), "sides of primitives")?;
        for chunk in bounds.chunks(CHECK_EVERY) {
            context.cancel.check()?;
            chunk.iter().for_each(|bounds| extent.add(bounds));
            goes_left.extend(chunk.iter().map(|_| AtomicBool::new(false)));
        }
        let mut slots = sort_on_three_axes(bounds, context)?;
        let sweep = Sweep { options: *self, bounds, goes_left };
        top_down::build(&sweep, &mut slots, extent, context)
    }
}

/// Place `i` of the three lists: the primitives of rank `i` by center along x, y and z.
type Ranked = [u32; 3];

fn sort_on_three_axes(bounds: &[Aabb], context: &Context<'_>) -> Result<Vec<Ranked>, BuildError> {
    let stage = Stage::new(context, "sort", 3);
    let sorted = parallel::map(alloc::vec![0, 1, 2], |axis| {
        // The key in the upper half of an entry, the primitive in the lower one.
        let mut keyed = memory::try_with_capacity(bounds.len(), "sort keys")?;
        let mut spare = memory::try_with_capacity(bounds.len(), "sorting")?;
        let key = |bounds: &Aabb| u64::from(ordered_bits(bounds.center()[axis])) << 32;
        for chunk in bounds.chunks(CHECK_EVERY) {
            stage.check()?;
            let first = keyed.len() as u64;
            keyed.extend(chunk.iter().zip(first..).map(|(bounds, prim)| key(bounds) | prim));
            spare.resize(keyed.len(), 0);
        }
        radix_sort::sort(&mut keyed, &mut spare, 32..64, &stage)?;
        stage.advance(1);
        Ok(keyed)
    });
    let mut lists = Vec::with_capacity(3);
    for list in sorted {
        let list: Result<Vec<u64>, BuildError> = list;
        lists.push(list?);
    }
    let mut slots = memory::try_with_capacity(bounds.len(), "sorted lists")?;
    for first in (0..bounds.len()).step_by(CHECK_EVERY) {
        context.cancel.check()?;
        let end = bounds.len().min(first + CHECK_EVERY);
        slots.extend((first..end).map(|at| [0, 1, 2].map(|axis| lists[axis][at] as u32)));
    }
    Ok(slots)
}

/// The builder with what it knows of the primitives.
struct Sweep<'a> {
    options: SweepSah,
    bounds: &'a [Aabb],
    /// By primitive: which side it goes to, while its range is being partitioned. Ranges share no
    /// primitive, so tasks never touch each other's entries.
    goes_left: Vec<AtomicBool>,
}

/// Buffers as long as the longest range of a task.
#[derive(Default)]
struct Scratch {
    right_cost: Vec<f64>,
    right_prims: Vec<u32>,
}

impl Splitter for Sweep<'_> {
    type Slot = Ranked;
    type Scratch = Scratch;

    fn prim(slot: &Ranked) -> u32 {
        slot[0]
    }

    fn leaf_max(&self) -> u32 {
        self.options.leaf_max
    }

    fn cut(
        &self,
        range: &mut Range<'_, Ranked>,
        scratch: &mut Scratch,
        stage: &Stage<'_>,
    ) -> Result<Option<Cut>, Cancelled> {
        let mut best: Option<Place> = None;
        for axis in 0..3 {
            let place = self.cheapest(range.slots, axis, scratch, stage)?;
            if best.as_ref().is_none_or(|best| place.cost < best.cost) {
                best = Some(place);
            }
        }
        let Some(place) = best else { return Ok(None) };
        let count = range.slots.len();
        let area = range.extent.bounds.half_area();
        let split_pays =
            place.cost + f64::from(self.options.visit_cost) * area < count as f64 * area;
        if count <= self.options.leaf_max as usize && !split_pays {
            return Ok(None);
        }
        self.apply(range.slots, &place, scratch, stage).map(Some)
    }

    fn halve(
        &self,
        range: &mut Range<'_, Ranked>,
        scratch: &mut Scratch,
        stage: &Stage<'_>,
    ) -> Result<Cut, Cancelled> {
        let place = Place { axis: 0, left: range.slots.len() / 2, cost: 0.0 };
        self.apply(range.slots, &place, scratch, stage)
    }
}

/// The first `left` of the list of `axis` go left.
struct Place {
    axis: usize,
    left: usize,
    /// Primitive tests, weighted by half area.
    cost: f64,
}

/// Sweeps are interrupted at most this many steps apart.
const CHECK_EVERY: usize = 16_384;

impl Sweep<'_> {
    /// The cheapest cut of a range of at least two along one axis.
    fn cheapest(
        &self,
        slots: &[Ranked],
        axis: usize,
        scratch: &mut Scratch,
        stage: &Stage<'_>,
    ) -> Result<Place, Cancelled> {
        let bounds = |slot: &Ranked| &self.bounds[slot[axis] as usize];
        let count = slots.len();
        // From the right: the cost of everything from each place on.
        scratch.right_cost.clear();
        scratch.right_cost.resize(count, 0.0);
        let mut right = Aabb::EMPTY;
        for at in (1..count).rev() {
            if at % CHECK_EVERY == 0 {
                stage.check()?;
            }
            right = right.union(bounds(&slots[at]));
            scratch.right_cost[at] = right.half_area() * (count - at) as f64;
        }
        // From the left: add the cost of everything before it.
        let mut best = Place { axis, left: 1, cost: f64::INFINITY };
        let mut left = Aabb::EMPTY;
        for at in 1..count {
            if at % CHECK_EVERY == 0 {
                stage.check()?;
            }
            left = left.union(bounds(&slots[at - 1]));
            let cost = left.half_area() * at as f64 + scratch.right_cost[at];
            if cost < best.cost {
                best = Place { axis, left: at, cost };
            }
        }
        Ok(best)
    }

    /// Partitions the two other lists, keeping their order.
    fn apply(
        &self,
        slots: &mut [Ranked],
        place: &Place,
        scratch: &mut Scratch,
        stage: &Stage<'_>,
    ) -> Result<Cut, Cancelled> {
        let mut extents = [Extent::EMPTY; 2];
        for (at, slot) in slots.iter().enumerate() {
            if at % CHECK_EVERY == 0 {
                stage.check()?;
            }
            let prim = slot[place.axis] as usize;
            let goes_left = at < place.left;
            self.goes_left[prim].store(goes_left, Ordering::Relaxed);
            extents[usize::from(!goes_left)].add(&self.bounds[prim]);
        }
        for axis in (0..3).filter(|&axis| axis != place.axis) {
            scratch.right_prims.clear();
            let mut next = 0;
            for at in 0..slots.len() {
                if at % CHECK_EVERY == 0 {
                    stage.check()?;
                }
                let prim = slots[at][axis];
                if self.goes_left[prim as usize].load(Ordering::Relaxed) {
                    slots[next][axis] = prim;
                    next += 1;
                } else {
                    scratch.right_prims.push(prim);
                }
            }
            let right = slots[next..].iter_mut().zip(&scratch.right_prims);
            right.for_each(|(slot, &prim)| slot[axis] = prim);
        }
        Ok(Cut { left: place.left, extents })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Kind;

    /// The root's cut is the best of all subsets that a plane between two centers can make.
    #[test]
    fn no_cut_of_the_root_is_cheaper() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let bounds: Vec<Aabb> = (0..60)
            .map(|_| {
                let lo: [f32; 3] = core::array::from_fn(|_| random() * 10.0);
                Aabb { lo, hi: lo.map(|x| x + random()) }
            })
            .collect();
        let tree = SweepSah { leaf_max: 1, visit_cost: 1.0 }.build(&bounds, &Context::default());
        let tree = tree.unwrap();
        tree.validate(&bounds).unwrap();

        let cost = |ids: &[usize]| {
            let around = ids.iter().fold(Aabb::EMPTY, |all, &id| all.union(&bounds[id]));
            around.half_area() * ids.len() as f64
        };
        let mut best = f64::INFINITY;
        for axis in 0..3 {
            let mut ids: Vec<usize> = (0..bounds.len()).collect();
            let key = |id: &usize| (ordered_bits(bounds[*id].center()[axis]), *id);
            ids.sort_by_key(key);
            for left in 1..ids.len() {
                best = best.min(cost(&ids[..left]) + cost(&ids[left..]));
            }
        }
        let Kind::Inner { left } = tree.nodes[0].kind() else { panic!("60 primitives are cut") };
        let below = |root: usize| {
            let (mut open, mut ids) = (alloc::vec![root], Vec::new());
            while let Some(node) = open.pop() {
                match tree.nodes[node].kind() {
                    Kind::Inner { left } => open.extend([left, left + 1]),
                    Kind::Leaf { first, count } => {
                        ids.extend(tree.prims[first..first + count].iter().map(|&id| id as usize));
                    }
                }
            }
            ids
        };
        let chosen = cost(&below(left)) + cost(&below(left + 1));
        assert!((chosen - best).abs() <= best * 1e-12, "chosen {chosen}, best {best}");
    }
}

//! The instances of a level, in blocks that snapshots share: an edit of one copies its block, not all.

use super::motion::Motion;
use super::slack::Near;
use super::structure::Structure;
use crate::bounds::Aabb;
use crate::layout::wide::Child;
use crate::math::{Affine, affine};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;

/// Instances of a block; all blocks but the last are full.
///
/// One move among 50,000 copies a block and a list of blocks: 39 KB and 2 KB.
pub(crate) const BLOCK: usize = 256;

/// Another level, placed into this one.
///
/// What walks read are the first two cache lines, vectors as `x, y, z, z`:
///
/// | bytes    | field               |
/// |----------|---------------------|
/// | 0..64    | `columns`           |
/// | 64..96   | `corners`           |
/// | 96..104  | `structure`         |
/// | 104..112 | `rank`              |
/// | 112..116 | `mask`              |
/// | 120..128 | `motion`            |
/// | 128..176 | `world_from_object` |
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Instance {
    /// The map that rays go through, column by column.
    pub(crate) columns: Columns,
    /// Of the box around what is placed, in this level's space, widened as `slack` says; empty if
    /// there is nothing in it.
    pub(crate) corners: [[f32; 4]; 2],
    /// What is placed.
    pub(crate) structure: Arc<Structure>,
    /// What this instance adds to the rank of the path that leads to this level.
    pub(crate) rank: u64,
    pub(crate) mask: u32,
    /// How it moves, if it does: the map and the box above are then those of its first time step, and around it at
    /// all times.
    pub(crate) motion: Option<Arc<Motion>>,
    /// As the caller gave it; of the first time step, if it moves.
    pub(crate) world_from_object: Affine,
}

const _: () = assert!(size_of::<Instance>() == 192);

/// An affine map, column by column.
pub(crate) type Columns = [[f32; 4]; 4];

impl Instance {
    /// `object_from_world` as columns.
    #[inline]
    pub(crate) fn columns(object_from_world: &Affine) -> Columns {
        // Written out: `map` is not inlined, and this is done for every instance.
        let [x, y, z] = &object_from_world.0;
        let column = |at: usize| [x[at], y[at], z[at], z[at]];
        [column(0), column(1), column(2), column(3)]
    }

    /// The map that rays go through.
    pub(crate) fn object_from_world(&self) -> Affine {
        let [a, b, c, d] = &self.columns;
        Affine([0, 1, 2].map(|row: usize| [a[row], b[row], c[row], d[row]]))
    }

    /// The box around what is placed.
    #[inline]
    pub(crate) fn bounds(&self) -> Aabb {
        let [[x, y, z, _], [far_x, far_y, far_z, _]] = self.corners;
        Aabb { lo: [x, y, z], hi: [far_x, far_y, far_z] }
    }

    /// The instance as seen by rays that are `near`.
    pub(crate) fn outside(&self, near: &Near) -> Outside {
        let map = self.object_from_world();
        // Not singular, or it would be nowhere.
        let world_from_object = map.inverse_f64().unwrap_or_default();
        let (by, _) = near.widening(&self.structure.slack, &map, &world_from_object);
        Outside { world_from_object, by, bounds: self.bounds() }
    }

    pub(crate) fn set_bounds(&mut self, bounds: &Aabb) {
        self.corners = Self::corners(bounds);
    }

    /// A box as corners.
    #[inline]
    pub(crate) fn corners(bounds: &Aabb) -> [[f32; 4]; 2] {
        let corner = |[x, y, z]: [f32; 3]| [x, y, z, z];
        [corner(bounds.lo), corner(bounds.hi)]
    }
}

/// A block, and what the level needs to know of it as a whole.
#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) items: Vec<Instance>,
    /// Contains the images of the reaches of all of them.
    pub(crate) reach: Aabb,
    /// What near means inside, seen from this level: see [`Near::limit`].
    pub(crate) limit: f64,
    /// The greatest that [`Near::widening`] said.
    pub(crate) far_share: f64,
    /// Paths that lead into them.
    pub(crate) paths: u64,
    /// Whether one of them holds a primitive in several leaves.
    pub(crate) repeats: bool,
    /// How many of them hold nothing.
    pub(crate) empty: u64,
    /// The layouts of what they place, a bit each: `Layout::bit`.
    pub(crate) layouts: u8,
    /// Whether one of them moves, or something in it.
    pub(crate) moves: bool,
    /// What their boxes were widened for.
    pub(crate) near: Near,
}

impl Block {
    pub(crate) fn first_rank(&self) -> Option<u64> {
        self.items.first().map(|instance| instance.rank)
    }

    /// Whether it is as it is to be where rays are `near`, and ranks begin at `rank`.
    pub(crate) fn stays(&self, near: Near, rank: u64) -> bool {
        self.near == near && self.first_rank() == Some(rank)
    }
}

/// What a leaf holds in place of an instance that was opened: what is below one child of its tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// Of which instance.
    pub(crate) instance: u32,
    /// Where the walk inside begins.
    pub(crate) start: Child,
}

/// An instance as seen from its level: takes boxes inside to boxes around what rays may hit in them.
pub(crate) struct Outside {
    /// The exact inverse of the map that rays go through.
    world_from_object: [[f64; 4]; 3],
    /// What [`Near::widening`] says.
    by: f32,
    /// Of the whole instance.
    bounds: Aabb,
}

impl Outside {
    /// A box around what may be hit in a box inside; never more than that of the whole instance. Why it
    /// admits whatever is hit is what `trace/slack.rs` derives: it speaks of any box inside.
    pub(crate) fn image(&self, inside: &Aabb) -> Aabb {
        let (lo, hi) = affine::box_image(&self.world_from_object, inside.lo, inside.hi);
        Aabb { lo, hi }.widened(self.by).intersection(&self.bounds)
    }
}

/// All instances of a level, in the caller's order.
///
/// Leaves name what they hold by number: an instance, or beyond the last of these a part.
#[derive(Clone, Debug, Default)]
pub(crate) struct Instances {
    pub(crate) blocks: Vec<Arc<Block>>,
    len: usize,
    /// Those of one instance side by side, the instances in rising order.
    parts: Arc<[Part]>,
    /// The boxes of the parts, inside: what walks do not read.
    boxes: Arc<[Aabb]>,
}

impl Instances {
    /// Of full blocks, but for the last.
    pub(crate) fn new(blocks: Vec<Arc<Block>>) -> Self {
        let len = blocks.iter().map(|block| block.items.len()).sum();
        Self { blocks, len, ..Self::default() }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Puts parts in the place of the instances that they are of. Those of one instance side by side, the
    /// instances in rising order.
    #[must_use]
    pub(crate) fn opened(self, parts: &[(Part, Aabb)]) -> Self {
        let boxes = parts.iter().map(|(_, bounds)| *bounds).collect();
        Self { parts: parts.iter().map(|(part, _)| *part).collect(), boxes, ..self }
    }

    /// Opened as others are that had the same instances; `None` if what is inside one of the opened is
    /// another, or it moves with time now.
    pub(crate) fn opened_as(self, before: &Self) -> Option<Self> {
        for (block, (old, new)) in before.blocks.iter().zip(&self.blocks).enumerate() {
            if Arc::ptr_eq(old, new) {
                continue;
            }
            let place = |at: usize| before.parts.partition_point(|it| (it.instance as usize) < at);
            for part in &before.parts[place(block * BLOCK)..place((block + 1) * BLOCK)] {
                let at = part.instance as usize % BLOCK;
                let (new, moves) = (&new.items[at].structure, new.items[at].motion.is_some());
                // Nobody begins in what is gone; what moves is not where the boxes of parts are.
                let is_same = Arc::ptr_eq(&old.items[at].structure, new) && !moves;
                if !is_same && !new.bounds.is_empty() {
                    return None;
                }
            }
        }
        let (parts, boxes) = (Arc::clone(&before.parts), Arc::clone(&before.boxes));
        Some(Self { parts, boxes, ..self })
    }

    /// Numbers of instances and of parts.
    #[inline(always)]
    pub(crate) fn entries(&self) -> usize {
        self.len + self.parts.len()
    }

    /// What a number stands for: an instance, and where the walk inside begins if not at the root.
    #[inline(always)]
    pub(crate) fn entry(&self, number: usize) -> (usize, Option<Child>) {
        match number.checked_sub(self.len) {
            None => (number, None),
            Some(part) => {
                let Part { instance, start } = self.parts[part];
                (instance as usize, Some(start))
            }
        }
    }

    /// The numbers that stand for an instance: its own, or if it is opened those of its parts.
    pub(crate) fn numbers(&self, instance: usize) -> Range<usize> {
        let place = |at: usize| self.parts.partition_point(|it| (it.instance as usize) < at);
        let (first, end) = (place(instance), place(instance + 1));
        if first == end { instance..instance + 1 } else { self.len + first..self.len + end }
    }

    /// The box of what a number stands for, in this level's space.
    pub(crate) fn bounds(&self, number: usize) -> Aabb {
        let Some(part) = number.checked_sub(self.len) else { return self.at(number).bounds() };
        self.outside(self.parts[part].instance as usize).image(&self.boxes[part])
    }

    /// An instance as seen from this level.
    pub(crate) fn outside(&self, index: usize) -> Outside {
        self.at(index).outside(&self.blocks[index / BLOCK].near)
    }

    /// Bytes that walks read.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Instance>() * self.len + size_of::<Part>() * self.parts.len()
    }

    /// An instance that is there.
    #[inline(always)]
    pub(crate) fn at(&self, index: usize) -> &Instance {
        &self.blocks[index / BLOCK].items[index % BLOCK]
    }

    pub(crate) fn get(&self, index: usize) -> Option<&Instance> {
        self.blocks.get(index / BLOCK)?.items.get(index % BLOCK)
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Instance> + Clone {
        self.blocks.iter().flat_map(|block| &block.items)
    }

    /// The last instance whose rank is not above `rank`, if there is one: ranks rise.
    pub(crate) fn of_rank(&self, rank: u64) -> Option<(usize, &Instance)> {
        let first = |block: &Arc<Block>| block.first_rank().is_some_and(|first| first <= rank);
        let block = self.blocks.partition_point(first).checked_sub(1)?;
        let items = &self.blocks[block].items;
        let at = items.partition_point(|instance| instance.rank <= rank).checked_sub(1)?;
        Some((block * BLOCK + at, &items[at]))
    }

    /// What is placed by instances that no other snapshot shares.
    pub(crate) fn into_structures(self, structures: &mut Vec<Arc<Structure>>) {
        for block in self.blocks.into_iter().filter_map(Arc::into_inner) {
            for Instance { structure, .. } in block.items {
                // Of many of one kind, the first is enough to hold it.
                if structures.last().is_none_or(|last| !Arc::ptr_eq(last, &structure)) {
                    structures.push(structure);
                }
            }
        }
    }
}

//! Rays that are walked together: up to 16 packets of 16, and what bounds them.

use super::super::record::{
    Class, Columns, FAR, NEAR, RAYS, RECIPROCAL, Record, Rest, T_MAX, T_MIN, columns, gather,
};
use super::super::structure::Structure;
use super::bundles::Bundles;
use crate::bounds::Aabb;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, Wide as WideTree};
use crate::math::Ray;
use crate::memory::{OutOfMemory, try_with_capacity};
use crate::simd::{Floats, Four, Simd, Wide};
use alloc::vec::Vec;

/// Packets of a group, at most.
pub(super) const PACKETS: usize = 16;

/// Rays of a group, at most.
pub(crate) const GROUP: usize = PACKETS * RAYS;

/// No triangle has this id.
pub(super) const NONE: u32 = u32::MAX;

/// 16 rays, a ray a lane.
#[derive(Clone, Copy)]
pub(super) struct Packet {
    /// The words of their records.
    pub(super) columns: Columns,
    /// Directions along the longest axis.
    pub(super) along: [f32; RAYS],
    /// Where the rays are in the slice.
    pub(super) slots: [u32; RAYS],
    /// Lanes that hold a ray which can hit something.
    pub(super) alive: u32,
    /// Lanes that hold a ray at all.
    pub(super) len: usize,
    /// Of the nearest hits that packets found: weights and ids, [`NONE`] where there is none. Their
    /// `t` are the greatest that matter.
    pub(super) u: [f32; RAYS],
    pub(super) v: [f32; RAYS],
    pub(super) id: [u32; RAYS],
}

impl Packet {
    const EMPTY: Self = Self {
        columns: [[0.0; RAYS]; 16],
        along: [0.0; RAYS],
        slots: [0; RAYS],
        alive: 0,
        len: 0,
        u: [0.0; RAYS],
        v: [0.0; RAYS],
        id: [NONE; RAYS],
    };

    /// One of them, as single walks want it.
    #[inline(always)]
    pub(super) fn ray(&self, lane: usize) -> (Record, Rest) {
        let mut record = Record([0.0; 16]);
        for word in 0..16 {
            record.0[word] = self.columns[word][lane];
        }
        (record, Rest { slot: self.slots[lane], along: self.along[lane] })
    }

    /// The greatest `t` that matters to any of them.
    #[inline(always)]
    pub(super) fn t_max<S: Simd>(&self, simd: S) -> f32 {
        most(simd, &self.columns[T_MAX])
    }
}

/// What is known of several rays at once, of one class: where planes are measured from so that they
/// come as early, or as late, as for any of the rays, by axis, and the range of the reciprocals.
///
/// With `n` in `[.., near]` and `r` in `[least, most]`, both of one sign, the monotone steps of the
/// slab test give `(plane - n) r` no less than the lesser of `(plane - near) least` and
/// `(plane - near) most`, bit for bit; so for exits. What a ray of the group is admitted to, the
/// group is.
#[derive(Clone, Copy, Default)]
pub(super) struct Spread<T> {
    near: [T; 3],
    far: [T; 3],
    least: [T; 3],
    most: [T; 3],
    t_min: T,
    pub(super) t_max: T,
}

/// Children that wait, at most: what finds no room goes on in smaller parts.
pub(super) const WAITING: usize = 128;

/// A child to be visited later.
#[derive(Clone, Copy)]
pub(super) struct Waiting {
    pub(super) child: Child,
    /// Where its box is.
    pub(super) node: u32,
    pub(super) slot: u16,
    /// The packets, or the rays of one, that are to visit it.
    pub(super) some: u16,
    /// Where the first of them may enter it.
    pub(super) entry: f32,
}

impl Waiting {
    /// Where a walk begins.
    #[inline(always)]
    pub(super) fn new(child: Child, some: u16) -> Self {
        Self { child, node: u32::MAX, slot: 0, some, entry: f32::NEG_INFINITY }
    }

    /// The child's box; `None` where a walk begins.
    #[inline(always)]
    pub(super) fn bounds<K: Packing<W>, const W: usize>(
        &self,
        wide: &WideTree<W, K>,
    ) -> Option<Aabb> {
        wide.nodes.get(self.node as usize).map(|node| K::bounds(node, usize::from(self.slot)))
    }

    /// Stacks a child of the node whose children begin at `base`: the nearer above, if asked for.
    #[inline(always)]
    pub(super) fn push(
        stack: &mut [Self; WAITING],
        base: usize,
        len: &mut usize,
        child: Self,
        nearer_above: bool,
    ) {
        let mut place = *len;
        while nearer_above && place > base && stack[(place - 1) % WAITING].entry < child.entry {
            stack[place % WAITING] = stack[(place - 1) % WAITING];
            place -= 1;
        }
        stack[place % WAITING] = child;
        *len += 1;
    }
}

/// The rays of a group.
pub(crate) struct Group {
    /// [`PACKETS`] once a group was walked; the first `count` are in use.
    pub(super) packets: Vec<Packet>,
    pub(super) count: usize,
    pub(super) bundles: Bundles,
    /// Of each packet, a packet a lane.
    pub(super) spreads: Spread<[f32; PACKETS]>,
    /// Of all of them, as they were to begin with.
    pub(super) all: Spread<f32>,
    /// Of groups, and of packets.
    pub(super) stacks: [[Waiting; WAITING]; 2],
    /// Whether no `t` and no sheared corner can be infinite.
    pub(super) tame: bool,
}

/// Coordinates and reciprocals up to here are tame: their products are far from infinite.
const TAME: f32 = (1_u64 << 58) as f32;

impl Group {
    /// Room for a group.
    pub(crate) fn new() -> Result<Self, OutOfMemory> {
        let nothing = Waiting::new(Child::END, 0);
        Ok(Self {
            packets: try_with_capacity(PACKETS, "packets of rays")?,
            count: 0,
            bundles: Bundles::new()?,
            spreads: Spread::default(),
            all: Spread::default(),
            stacks: [[nothing; WAITING]; 2],
            tame: false,
        })
    }

    /// Takes in the rays of `slots`, [`GROUP`] at most, all of a class: a bundle of the run of `len`.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        structure: &Structure,
        class: Class,
        rays: &[Ray],
        slots: &[u32],
        len: usize,
    ) {
        self.count = slots.len().div_ceil(RAYS);
        // Slices whose rays never go together do not pay for what is cleared here.
        self.packets.resize(PACKETS, Packet::EMPTY);
        let whole = self.bundles.whole(len);
        for (at, (slots, packet)) in slots.chunks(RAYS).zip(&mut self.packets).enumerate() {
            let words = &mut packet.columns;
            packet.along = match whole {
                Some(rows) => columns(simd, structure, class, &rows[at % PACKETS].rays, words),
                None => columns(simd, structure, class, &gather(simd, rays, slots), words),
            };
            packet.len = slots.len();
            packet.id = [NONE; RAYS];
            let mut seeing = 0;
            for lane in 0..RAYS {
                let slot = slots[lane.min(slots.len() - 1)];
                packet.slots[lane] = slot;
                seeing |= u32::from(rays[slot as usize].mask != 0) << lane;
            }
            packet.alive = seeing & ((1 << slots.len()) - 1);
            if packet.alive != u32::from(u16::MAX) {
                for lane in (0..RAYS).filter(|lane| packet.alive >> lane & 1 == 0) {
                    packet.columns[T_MAX][lane] = f32::NEG_INFINITY;
                }
            }
        }
        self.bound(simd, structure, class);
    }

    #[inline(always)]
    fn bound<S: Simd>(&mut self, simd: S, structure: &Structure, class: Class) {
        let spreads = &mut self.spreads;
        let packets = &self.packets[..self.count.min(PACKETS)];
        for axis in 0..3 {
            let near = extremes(simd, packets, NEAR + axis);
            let far = extremes(simd, packets, FAR + axis);
            let backward = usize::from(class.backward()[axis] & 1);
            spreads.near[axis] = near[backward ^ 1];
            spreads.far[axis] = far[backward];
            [spreads.least[axis], spreads.most[axis]] = extremes(simd, packets, RECIPROCAL + axis);
        }
        spreads.t_min = extremes(simd, packets, T_MIN)[0];
        spreads.t_max = extremes(simd, packets, T_MAX)[1];

        let mut tame = structure.reach.max_abs() <= TAME;
        let all = &mut self.all;
        let [.., longest] = class.axes();
        for axis in 0..3 {
            let (near, far) = (&spreads.near[axis], &spreads.far[axis]);
            let backward = class.backward()[axis] == 1;
            all.near[axis] = if backward { least(simd, near) } else { most(simd, near) };
            all.far[axis] = if backward { most(simd, far) } else { least(simd, far) };
            all.least[axis] = least(simd, &spreads.least[axis]);
            all.most[axis] = most(simd, &spreads.most[axis]);
            tame &= all.near[axis].abs() <= TAME && all.far[axis].abs() <= TAME;
            if axis == usize::from(longest) {
                tame &= all.least[axis].abs() <= TAME && all.most[axis].abs() <= TAME;
            }
        }
        all.t_min = least(simd, &spreads.t_min);
        all.t_max = most(simd, &spreads.t_max);
        self.tame = tame;
    }
}

impl Spread<f32> {
    /// Of one packet.
    #[inline(always)]
    pub(super) fn of(spreads: &Spread<[f32; PACKETS]>, packet: usize) -> Self {
        let one =
            |lanes: &[[f32; PACKETS]; 3]| [lanes[0][packet], lanes[1][packet], lanes[2][packet]];
        Self {
            near: one(&spreads.near),
            far: one(&spreads.far),
            least: one(&spreads.least),
            most: one(&spreads.most),
            t_min: spreads.t_min[packet],
            t_max: spreads.t_max[packet],
        }
    }

    /// The children of a node that any of the rays may meet, and where the first may.
    #[inline(always)]
    pub(super) fn meets<K: Packing<W>, S: Wide<W>, const W: usize>(
        &self,
        simd: S,
        backward: [usize; 3],
        node: &K::Node,
    ) -> (u32, S::F) {
        let splat = |x: f32| S::F::splat(simd, x);
        let (mut entry, mut exit) = (splat(self.t_min), splat(self.t_max));
        for axis in 0..3 {
            let first = K::planes(simd, node, axis, backward[axis] & 1);
            let last = K::planes(simd, node, axis, backward[axis] & 1 ^ 1);
            let (least, most) = (splat(self.least[axis]), splat(self.most[axis]));
            let first = first.sub(splat(self.near[axis]));
            let last = last.sub(splat(self.far[axis]));
            entry = first.mul(least).min(first.mul(most)).max(entry);
            exit = last.mul(least).max(last.mul(most)).min(exit);
        }
        (entry.le(exit) & K::slots(node), entry)
    }
}

impl Spread<[f32; PACKETS]> {
    /// The packets of which any ray may meet the box.
    #[inline(always)]
    pub(super) fn meets<S: Simd>(&self, simd: S, backward: [usize; 3], bounds: &Aabb) -> u32 {
        let splat = |x: f32| S::F16::splat(simd, x);
        let load = |lanes: &[f32; PACKETS]| S::F16::load(simd, lanes);
        let (mut entry, mut exit) = (load(&self.t_min), load(&self.t_max));
        for axis in 0..3 {
            let planes = [bounds.lo[axis], bounds.hi[axis]];
            let (least, most) = (load(&self.least[axis]), load(&self.most[axis]));
            let first = splat(planes[backward[axis] & 1]).sub(load(&self.near[axis]));
            let last = splat(planes[backward[axis] & 1 ^ 1]).sub(load(&self.far[axis]));
            entry = first.mul(least).min(first.mul(most)).max(entry);
            exit = last.mul(least).max(last.mul(most)).min(exit);
        }
        entry.le(exit)
    }
}

/// The least and the greatest of a column, by packet. Lanes beyond the last packet repeat it.
#[inline(always)]
fn extremes<S: Simd>(simd: S, packets: &[Packet], column: usize) -> [[f32; PACKETS]; 2] {
    let last = packets.len() - 1;
    let mut rows = [&packets[0].columns[column]; PACKETS];
    for packet in 0..PACKETS {
        rows[packet] = &packets[packet.min(last)].columns[column];
    }
    let mut lanes = [[0.0; PACKETS]; RAYS];
    simd.transpose(&rows, &mut lanes);
    let mut low = S::F16::load(simd, &lanes[0]);
    let mut high = low;
    for lane in 1..RAYS {
        let other = S::F16::load(simd, &lanes[lane]);
        low = other.min(low);
        high = other.max(high);
    }
    [low.lanes(), high.lanes()]
}

/// The greatest lane.
#[inline(always)]
fn most<S: Simd>(simd: S, lanes: &[f32; 16]) -> f32 {
    let eight = |first: usize| {
        S::F8::load(simd, lanes[first..].first_chunk().unwrap_or(&[f32::NEG_INFINITY; 8]))
    };
    let eight = eight(0).max(eight(8)).lanes();
    let four = |first: usize| {
        S::F4::load(simd, eight[first..].first_chunk().unwrap_or(&[f32::NEG_INFINITY; 4]))
    };
    four(0).max(four(4)).max_lane().lanes()[0]
}

/// The least lane.
#[inline(always)]
fn least<S: Simd>(simd: S, lanes: &[f32; 16]) -> f32 {
    let eight = |first: usize| {
        S::F8::load(simd, lanes[first..].first_chunk().unwrap_or(&[f32::INFINITY; 8]))
    };
    let eight = eight(0).min(eight(8)).lanes();
    let mut least = eight[0];
    for lane in 1..8 {
        least = if eight[lane] < least { eight[lane] } else { least };
    }
    least
}

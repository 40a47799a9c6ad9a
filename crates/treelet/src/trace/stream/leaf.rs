//! A list at a leaf: 16 rays against one triangle after the other, or one ray against all of them.

use super::room::List;
use super::{Answers, Stream};
use crate::bounds::Interval;
use crate::geometry::block::{self, BlockTest};
use crate::simd::Simd;
use crate::trace::leaf::Leaf;
use crate::trace::record::{RAYS, T_MAX, T_MIN, bundle, prepared};
use crate::trace::walk::{Found, Visitor};

/// Fewer rays than this are tested one by one.
const BUNDLE_MIN: usize = 5;

impl<'a, A: Answers<'a>> Stream<'a, '_, A> {
    /// Tests the list against the triangles of a leaf.
    #[inline(always)]
    pub(super) fn leaf<S: Simd>(&mut self, simd: S, leaf: Leaf<'_>, list: List) {
        let mut at = list.start;
        let end = list.start + list.len;
        while at < end {
            let len = RAYS.min(end - at);
            if len < BUNDLE_MIN {
                for at in at..at + len {
                    self.leaf_of_one(simd, leaf, self.room.ids[at] as usize);
                }
            } else {
                self.leaf_of_many(simd, leaf, at, len);
            }
            at += len;
        }
    }

    /// All triangles against one ray.
    #[inline(always)]
    fn leaf_of_one<S: Simd>(&mut self, simd: S, leaf: Leaf<'_>, id: usize) {
        let structure = self.structure;
        let (record, rest) = (&mut self.room.records[id], &self.room.rest[id]);
        let slot = rest.slot as usize;
        let mask_of_ray = self.rays[slot].mask;
        let ray = prepared(record, rest, self.class, &self.rays[slot], structure);
        let range = (record.0[T_MIN], record.0[T_MAX]);
        let (slab, clip) = (&ray.slab, &Interval::ALL);
        let ray = (&ray.triangle, slab);
        let hits = simd.apply::<BlockTest<'_, _>>((leaf.rows, leaf.stride), ray, clip, range);
        let mut mask = hits.mask & ((1 << leaf.count) - 1);
        if mask == 0 {
            return;
        }
        let mut visitor = self.answers.visitor(slot, record.0[T_MAX]);
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % block::LANES;
            mask &= mask - 1;
            let id = leaf.id(lane);
            let (t, u, v) = (hits.t[lane], hits.u[lane], hits.v[lane]);
            if t > visitor.t_max() || !structure.sees(id, mask_of_ray) {
                continue;
            }
            if visitor.hit(Found { t, u, v, id, inst: 0, structure }).is_break() {
                break;
            }
        }
        record.0[T_MAX] = self.answers.settle(slot, record.0[T_MAX], visitor);
    }

    /// One triangle after the other against up to 16 rays.
    #[inline(always)]
    fn leaf_of_many<S: Simd>(&mut self, simd: S, leaf: Leaf<'_>, at: usize, len: usize) {
        let structure = self.structure;
        let room = &mut *self.room;
        // Lanes beyond the last ray repeat it.
        let mut ids = [0; RAYS];
        for lane in 0..RAYS {
            ids[lane] = room.ids[at + lane.min(len - 1)] as usize;
        }
        let mut rows = [&room.records[ids[0]].0; RAYS];
        let mut along = [0.0; RAYS];
        for lane in 0..RAYS {
            rows[lane] = &room.records[ids[lane]].0;
            along[lane] = room.rest[ids[lane]].along;
        }
        let mut columns = [[0.0; RAYS]; 16];
        simd.transpose(&rows, &mut columns);
        let mut t_max = columns[T_MAX];
        let bundle = bundle(self.class, &columns, &along);
        // Hits that were found since the list was made may hide the whole leaf.
        let lanes = ((1 << len) - 1) & bundle.meets(simd, &leaf.bounds, &t_max);
        if lanes == 0 {
            return;
        }
        for triangle in 0..leaf.count {
            let met = bundle.hit(simd, &leaf.corners(triangle), lanes, &t_max);
            let Some(met) = met else { continue };
            let id = leaf.id(triangle);
            let mut mask = met.mask;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize % RAYS;
                mask &= mask - 1;
                let slot = room.rest[ids[lane]].slot as usize;
                if !structure.sees(id, self.rays[slot].mask) {
                    continue;
                }
                let (t, u, v) = (met.t[lane], met.u[lane], met.v[lane]);
                let mut visitor = self.answers.visitor(slot, t_max[lane]);
                // Whether the ray goes on, its record knows.
                let _ = visitor.hit(Found { t, u, v, id, inst: 0, structure });
                t_max[lane] = self.answers.settle(slot, t_max[lane], visitor);
                room.records[ids[lane]].0[T_MAX] = t_max[lane];
            }
        }
    }
}

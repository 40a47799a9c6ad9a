//! What a stream works in: records of rays, lists of their ids.

use super::Batch;
use crate::layout::wide::Child;
use crate::memory::{OutOfMemory, try_reserve};
use crate::simd::Simd;
use crate::trace::record::{RAYS, Record, Rest, records};
use crate::trace::structure::Structure;
use alloc::vec::Vec;

/// Rays of a batch, at most: their records fill half of a usual second-level cache.
pub(crate) const BATCH: usize = 2048;

/// Ids of all lists that wait, at most. Lists that find no room go on as single rays.
const IDS_MAX: usize = 32 * BATCH;

/// Items that [`Simd::select`] handles at once.
pub(super) const STEP: usize = 16;

/// Rays that are to visit a child.
#[derive(Clone, Copy)]
pub(super) struct List {
    pub(super) child: Child,
    /// Where the child's box is.
    pub(super) node: u32,
    pub(super) slot: u32,
    pub(super) start: usize,
    pub(super) len: usize,
}

/// What a stream works in.
#[derive(Default)]
pub(crate) struct Room {
    pub(super) records: Vec<Record>,
    pub(super) rest: Vec<Rest>,
    pub(super) ids: Vec<u32>,
    pub(super) masks: Vec<u32>,
    pub(super) lists: Vec<List>,
}

impl Room {
    /// For batches of up to `len` rays.
    pub(crate) fn new(len: usize) -> Result<Self, OutOfMemory> {
        const WHAT: &str = "a stream of rays";
        let mut room = Self::default();
        try_reserve(&mut room.records, len.min(BATCH) + RAYS, WHAT)?;
        try_reserve(&mut room.rest, len.min(BATCH) + RAYS, WHAT)?;
        try_reserve(&mut room.masks, len.min(BATCH) + STEP, WHAT)?;
        room.masks.resize(len.min(BATCH) + STEP, 0);
        let ids = (32 * len).min(IDS_MAX) + STEP;
        try_reserve(&mut room.ids, ids, WHAT)?;
        room.ids.resize(ids, 0);
        try_reserve(&mut room.lists, 256, WHAT)?;
        Ok(room)
    }

    /// Makes the records of a batch, and puts all of it on one list.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        structure: &Structure,
        batch: Batch<'_>,
        root: Child,
    ) {
        let Batch { class, rays, slots, .. } = batch;
        self.records.clear();
        self.rest.clear();
        let [.., longest] = class.axes();
        let len = slots.len().min(BATCH);
        for slots in slots[..len].chunks(RAYS) {
            let first = self.records.len();
            self.records.extend_from_slice(&[Record([0.0; 16]); RAYS]);
            let Some(made) = self.records[first..].first_chunk_mut() else { break };
            records(simd, structure, class, rays, slots, made);
            for &slot in slots {
                let along = rays[slot as usize].direction[usize::from(longest)];
                self.rest.push(Rest { slot, along });
            }
        }
        for i in 0..len {
            self.ids[i] = i as u32;
        }
        self.lists.clear();
        self.lists.push(List { child: root, node: u32::MAX, slot: 0, start: 0, len });
    }
}

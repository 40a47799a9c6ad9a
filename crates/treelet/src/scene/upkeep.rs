//! What a scene remembers so that it can be kept up: what its tree was worth when it was built, what building, mending
//! and tracing took, and how many rays were asked.

use super::Scene;
use super::edit::Ledger;
use crate::layout::refit::Areas;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

/// Shorter slices are not timed: asking the clock would show.
pub(super) const TIMED_MIN: usize = 1024;

/// See the head of the module.
#[derive(Debug, Default)]
pub(super) struct Upkeep {
    /// `None` until somebody edits the scene.
    pub(super) standing: Option<Standing>,
    /// `None` likewise.
    pub(super) ledger: Option<Ledger>,
    tally: Tally,
}

/// What the tree is worth.
#[derive(Clone, Debug)]
pub(super) struct Standing {
    /// What it cost when it was built, see [`Areas::price`].
    pub(super) built: f64,
    pub(super) areas: Areas,
    /// How often all its boxes were made anew since then.
    pub(super) sweeps: u32,
    /// What each node cost when it was built.
    pub(super) prices: Arc<Vec<f32>>,
    /// Half areas of the boxes of the triangles in the leaves of each node, now.
    pub(super) triangles: Arc<[f32]>,
}

/// Rays asked of a snapshot.
#[derive(Debug, Default)]
struct Tally {
    rays: AtomicU64,
    nanos: AtomicU64,
}

impl Upkeep {
    pub(super) fn new(standing: Option<Standing>, ledger: Option<Ledger>) -> Arc<Self> {
        Arc::new(Self { standing, ledger, tally: Tally::default() })
    }

    /// Takes down that rays were asked.
    pub(super) fn note(&self, rays: u64, time: Duration) {
        add(&self.tally.rays, rays);
        add(&self.tally.nanos, u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }

    /// Seconds that a ray took, all threads tracing; `None` if nobody asked any, or nobody knows.
    pub(super) fn ray_seconds(&self) -> Option<f64> {
        let [rays, nanos] =
            [&self.tally.rays, &self.tally.nanos].map(|it| it.load(Ordering::Relaxed) as f64);
        (rays > 0.0 && nanos > 0.0).then(|| 1e-9 * nanos / rays)
    }
}

impl Scene {
    /// Tells a scene that `rays` single rays were asked, and how long that took on the clock on the wall, all threads
    /// tracing: what [`Quality::Auto`](super::Quality::Auto) and [`Policy::Rays`](super::Policy::Rays) go by. Slices of 1024 rays
    /// and more are counted without that.
    pub fn note_traced(&self, rays: u64, time: Duration) {
        self.upkeep.note(rays, time);
        if let Some(auto) = &self.auto {
            auto.note(rays, time);
        }
    }
}

/// Adds; stays at the end of the range.
pub(super) fn add(sum: &AtomicU64, more: u64) {
    let old = sum.fetch_add(more, Ordering::Relaxed);
    if old.checked_add(more).is_none() {
        sum.store(u64::MAX, Ordering::Relaxed);
    }
}

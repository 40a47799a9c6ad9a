//! Refit, repair or rebuild: what was paid, what it would have saved, and what to do next.
//!
//! Whoever does not know how a scene will go on moving stands before the rental of skis: going on with a tree that has
//! decayed costs a little every frame, mending it costs much once. Mending when the rent paid since the last time has come
//! to the price never costs more than twice what the best plan in hindsight would have (A. Karlin, M. Manasse, L.
//! Rudolph, D. Sleator, "Competitive Snoopy Caching", 1988). For a decay that grows steadily, it is the best plan: with a loss
//! of `a` more each frame and a price of `b`, `b / k + a k / 2` a frame is least for `a k^2 / 2 = b`.
//!
//! There are two shops. A *repair* brings the tree back to the *floor*: the least that it cost since the last one. Only a *rebuild* goes
//! below that, to the *base*: the least that it cost since the last build. Or so they promise: what has grown dearer may be the
//! shape, for which no tree would be better. So either rent is discounted by what was brought of what was promised last time.
//!
//! No clock, no scene: everything here is a pure function of numbers, in seconds.

use super::{DECAY_MAX, Policy};
use crate::scene::choice::RAY_NS;

/// What a refit is taken to cost before one was made, of a build.
const REFIT_SHARE: f64 = 0.08;
/// What a repair is taken to cost before one was made, of a build.
const REPAIR_SHARE: f64 = 0.2;
/// What brought nothing last time is still tried when ten times the rent was paid.
const TRUST_MIN: f64 = 0.1;
/// Promises below this say nothing about what they are worth.
const PROMISE_MIN: f64 = 0.02;
/// What has decayed by more, since it was last as good as it was, is rotated while it is refitted.
const WORN: f64 = 1.02;
/// Under a budget, what has decayed less than this is left alone.
const NEGLIGIBLE: f64 = 1.02;

/// What was measured, and what was lost so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::scene) struct Ledger {
    /// Seconds.
    pub(super) build: f64,
    pub(super) refit: f64,
    pub(super) repair: f64,
    /// Of a ray, all threads tracing.
    pub(super) ray: f64,
    repairs: Shop,
    rebuilds: Shop,
}

/// A way to mend.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shop {
    /// What the tree costs afterwards: the least since the last time.
    least: f64,
    /// Seconds lost since the last time for want of another.
    rent: f64,
    /// Of what it promised the last time, what it brought.
    trust: f64,
}

impl Shop {
    const NEW: Self = Self { least: 1.0, rent: 0.0, trust: 1.0 };

    /// Of rays through a tree that costs `now`, takes down the part that would be saved.
    fn lose(&mut self, time: f64, now: f64) {
        self.rent += time * self.trust * (1.0 - self.least / now).max(0.0);
    }

    /// Starts again: mending brought a tree that cost `before` to `after`.
    fn mended(&mut self, before: f64, after: f64) {
        let (promised, brought) = (1.0 - self.least / before, 1.0 - after / before);
        if promised > PROMISE_MIN {
            self.trust = (brought / promised).clamp(TRUST_MIN, 1.0);
        }
        (self.least, self.rent) = (after, 0.0);
    }
}

/// What to do to a tree that was refitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    Nothing,
    Repair,
    Rebuild,
}

impl Ledger {
    /// Of a scene that took so long to build; on so many threads.
    pub(super) fn new(build: f64, threads: usize) -> Self {
        Self {
            build,
            refit: REFIT_SHARE * build,
            repair: REPAIR_SHARE * build,
            ray: 1e-9 * RAY_NS / threads.max(1) as f64,
            repairs: Shop::NEW,
            rebuilds: Shop::NEW,
        }
    }

    /// What to do, now that the tree costs `decay` times what it did when it was built.
    pub(super) fn next(&mut self, policy: Policy, decay: f64) -> Next {
        let Self { repairs, rebuilds, .. } = self;
        repairs.least = repairs.least.min(decay);
        rebuilds.least = rebuilds.least.min(decay);
        match policy {
            Policy::Refit => Next::Nothing,
            Policy::Repair => Next::Repair,
            Policy::Rebuild => Next::Rebuild,
            Policy::Auto if decay <= DECAY_MAX => Next::Nothing,
            Policy::Auto => Next::Repair,
            Policy::Rays(rays) => {
                // Of the time of a frame's rays, what a better tree would save.
                let time = rays as f64 * self.ray;
                repairs.lose(time, decay);
                rebuilds.lose(time, repairs.least);
                if rebuilds.rent >= self.build {
                    Next::Rebuild
                } else if repairs.rent >= self.repair {
                    Next::Repair
                } else {
                    Next::Nothing
                }
            }
            Policy::Budget(budget) => {
                let left = budget.as_secs_f64() - self.refit;
                if decay > NEGLIGIBLE * self.rebuilds.least && self.build <= left {
                    Next::Rebuild
                } else if decay > NEGLIGIBLE * self.repairs.least && self.repair <= left {
                    Next::Repair
                } else {
                    Next::Nothing
                }
            }
        }
    }

    /// Whether it pays to look for rotations in a tree that costs `decay` times what it did when it was built.
    pub(super) fn is_worn(&self, decay: f64) -> bool {
        decay > WORN * self.repairs.least
    }

    /// Takes down a repair: of a tree that had decayed to `before`, to `after`.
    pub(super) fn repaired(&mut self, seconds: f64, before: f64, after: f64) {
        self.repair = seconds;
        self.repairs.mended(before, after);
    }

    /// Takes down that too little was left to repair.
    pub(super) fn beyond_repair(&mut self, decay: f64) {
        self.repairs.mended(decay, decay);
    }

    /// Takes down a build: of a tree that had decayed to `before`, to `after` as old ones are measured.
    pub(super) fn rebuilt(&mut self, seconds: f64, before: f64, after: f64) {
        self.build = seconds;
        self.rebuilds.mended(before, after);
        self.rebuilds.least = 1.0;
        self.repairs = Shop { trust: self.repairs.trust, ..Shop::NEW };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAYS: Policy = Policy::Rays(1_000_000);

    /// A build takes a second, a frame's rays too, as long as the tree is as it was built.
    fn ledger() -> Ledger {
        Ledger { ray: 1e-6, repair: 0.1, ..Ledger::new(1.0, 1) }
    }

    /// Rents are paid until they come to the price: for a loss of `a` more each frame, in the frame of `sqrt(2 b / a)`.
    #[test]
    fn a_repair_comes_when_its_rent_has_come_to_its_price() {
        let mut ledger = ledger();
        let decay = |frame: usize| 1.0 / (1.0 - 0.002 * frame as f64);
        let frame = (1..100).find(|&frame| ledger.next(RAYS, decay(frame)) != Next::Nothing);
        assert_eq!(frame, Some(10));
        assert_eq!(ledger.next(RAYS, decay(10)), Next::Repair);
        // Ten times the rays are worth it sooner, a tenth later.
        for (rays, frame) in [(10_000_000, 3), (100_000, 32)] {
            let mut ledger = Ledger { ray: 1e-6, repair: 0.1, ..Ledger::new(1.0, 1) };
            let rays = Policy::Rays(rays);
            assert_eq!(
                (1..).find(|&at| ledger.next(rays, decay(at)) != Next::Nothing),
                Some(frame)
            );
        }
    }

    /// What no repair brings back, a rebuild may; what it did not bring either is asked for ten times as long.
    #[test]
    fn what_repairs_leave_is_a_rebuilds() {
        let mut ledger = ledger();
        let rebuild = |ledger: &mut Ledger| {
            (1..1000).find(|_| match ledger.next(RAYS, 1.5) {
                Next::Repair => {
                    ledger.repaired(0.1, 1.5, 1.25);
                    false
                }
                next => next == Next::Rebuild,
            })
        };
        // The first repair leaves a fifth of the time to a rebuild.
        let first = rebuild(&mut ledger).unwrap();
        assert!((6..=7).contains(&first), "{first}");
        // It brings nothing: the shape is dearer.
        ledger.rebuilt(1.0, 1.25, 1.25);
        let again = rebuild(&mut ledger).unwrap();
        assert!((40..70).contains(&again), "{again}");
    }

    /// A tree that gets cheaper by itself has a new mark to be held against.
    #[test]
    fn the_least_that_a_tree_cost_counts() {
        let (mut risen, mut fallen) = (ledger(), ledger());
        assert_eq!([0.5, 1.0].map(|decay| risen.next(RAYS, decay)), [Next::Nothing, Next::Repair]);
        assert_eq!([1.0, 0.5, 0.5].map(|decay| fallen.next(RAYS, decay)), [Next::Nothing; 3]);
    }

    #[test]
    fn a_budget_buys_the_best_that_it_can() {
        let budget =
            |milliseconds: u64| Policy::Budget(core::time::Duration::from_millis(milliseconds));
        let next = |milliseconds, decay| ledger().next(budget(milliseconds), decay);
        assert_eq!(next(2000, 1.3), Next::Rebuild);
        assert_eq!(next(900, 1.3), Next::Repair);
        assert_eq!(next(150, 1.3), Next::Nothing);
        assert_eq!(next(2000, 1.01), Next::Nothing);
        // What a repair does not change is not repaired again.
        let mut ledger = ledger();
        ledger.repaired(0.1, 1.3, 1.29);
        assert_eq!(ledger.next(budget(900), 1.3), Next::Nothing);
    }

    #[test]
    fn other_policies_look_at_the_decay_alone() {
        for (policy, next) in [
            (Policy::Refit, [Next::Nothing; 2]),
            (Policy::Repair, [Next::Repair; 2]),
            (Policy::Rebuild, [Next::Rebuild; 2]),
            (Policy::Auto, [Next::Nothing, Next::Repair]),
        ] {
            assert_eq!([1.3, 1.5].map(|decay| ledger().next(policy, decay)), next, "{policy:?}");
        }
    }
}

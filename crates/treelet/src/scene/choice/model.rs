//! What is believed of every contender, and which to build next.
//!
//! The time that `n` rays take is `build + n * ray`. Before anything is built, both come from the table, and
//! the time of a ray is known to a factor of two or three only. Once a tree stands, its build says how fast the
//! machine is and its pilot rays how dear the scene's rays are; what the others cost follows from the table's
//! proportions, as a lognormal belief that narrows with every tree tried.
//!
//! - The *first* tree is the one whose regret is least on average: its total relative to the best contender's,
//!   over what a ray may cost, if afterwards the best use is made of the chance to build another.
//! - The *next* one is the contender with the greatest expected improvement beyond its build (J. Mockus'
//!   criterion; D. Jones, M. Schonlau, W. Welch, "Efficient Global Optimization of Expensive Black-Box
//!   Functions", 1998), for as long as there is one.
//!
//! No clock, no scene: everything here is a pure function of numbers, in seconds.

use super::table::{CONTENDERS, Contender, RAY_NS, RAY_SPREAD};
use alloc::vec::Vec;

/// Speculation, building what is not expected to be better but may be, may take this share of the rays' time.
const SPECULATION_MAX: f64 = 0.04;

/// What a ray may cost, in standard deviations, and how likely: quantiles of the normal distribution in five
/// equal parts.
const QUANTILES: [f64; 5] = [-1.28, -0.52, 0.0, 0.52, 1.28];

/// A first pilot on a tree is not exact: pilot rays are some of all, on a machine that does other things, too.
const PILOT_SPREAD: f64 = 0.03;

/// A contender in this scene.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Entry {
    pub(in crate::scene) contender: &'static Contender,
    /// By the table, at this number of threads.
    build: f64,
    /// Found by building it.
    built: Option<f64>,
    /// Found by tracing pilot rays.
    traced: Option<f64>,
}

/// What is believed about one scene.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Model {
    pub(in crate::scene) entries: Vec<Entry>,
    /// Rays to come.
    rays: f64,
    /// Time that all builds share and that is spent once: gathering.
    shared: f64,
    /// Time by the table to time here.
    pace: f64,
    /// A ray in the reference's tree; all threads tracing.
    ray: f64,
    /// Standard deviation of its logarithm.
    ray_spread: f64,
}

impl Model {
    /// Of a scene of so many primitives.
    pub(in crate::scene) fn new(prims: usize, threads: usize, rays: u64) -> Self {
        let threads = threads.max(1) as f64;
        let entry = |contender: &'static Contender| {
            let parallel = contender.serial + (1.0 - contender.serial) / threads;
            let build = prims as f64 * contender.build_ns * 1e-9 * parallel;
            Entry { contender, build, built: None, traced: None }
        };
        Self {
            entries: CONTENDERS.iter().map(entry).collect(),
            rays: rays as f64,
            shared: 0.0,
            pace: 1.0,
            ray: RAY_NS * 1e-9 / threads,
            ray_spread: RAY_SPREAD,
        }
    }

    /// Time to build it, gathering included.
    pub(in crate::scene) fn build(&self, at: usize) -> f64 {
        self.entries[at].built.unwrap_or(self.entries[at].build * self.pace)
    }

    /// Time of one of its rays.
    pub(in crate::scene) fn ray(&self, at: usize) -> f64 {
        self.entries[at].traced.unwrap_or(self.ray * self.entries[at].contender.slowness)
    }

    /// Time of all its rays.
    pub(in crate::scene) fn rays(&self, at: usize) -> f64 {
        self.rays * self.ray(at)
    }

    /// Whether both of its numbers were found here.
    pub(in crate::scene) fn is_measured(&self, at: usize) -> bool {
        self.entries[at].traced.is_some()
    }

    /// What to build if only one tree will ever be built.
    pub(in crate::scene) fn only(&self) -> usize {
        self.least(|at| self.build(at) + self.rays(at))
    }

    /// What to build first if others may follow.
    pub(in crate::scene) fn first(&self) -> usize {
        self.least(|first| QUANTILES.iter().map(|&z| self.regret(first, z)).sum())
    }

    /// The total of building `first` and then the best thing, relative to that of knowing all; rays being
    /// `z` standard deviations dearer than believed.
    fn regret(&self, first: usize, z: f64) -> f64 {
        let scale = libm::exp(z * self.ray_spread);
        let total = |at: usize| self.build(at) + scale * self.rays(at);
        let least = |from: f64, at: usize| from.min(total(at));
        let all = 0..self.entries.len();
        let best = all.clone().fold(f64::INFINITY, least);
        let next = all.fold(f64::INFINITY, least) + self.build(first) - self.shared;
        if best > 0.0 { total(first).min(next) / best } else { 1.0 }
    }

    /// Takes down what building took, gathering included, of which `shared`.
    pub(in crate::scene) fn built(&mut self, at: usize, build: f64, shared: f64) {
        let entry = &mut self.entries[at];
        entry.built = Some(build);
        self.shared = shared;
        // The dearest build says most about the dearer ones.
        if entry.build > 0.0 && build > 0.0 {
            self.pace = build / entry.build;
        }
    }

    /// Takes down what a ray took.
    pub(in crate::scene) fn traced(&mut self, at: usize, ray: f64) {
        self.entries[at].traced = Some(ray);
        // What rays cost here is the mean of what each traced tree says, weighted by how well it knows.
        let (mut sum, mut weights) = (0.0, 0.0);
        for entry in &self.entries {
            let Some(ray) = entry.traced else { continue };
            let spread = entry.contender.spread;
            let weight = 1.0 / (spread * spread + PILOT_SPREAD * PILOT_SPREAD);
            sum += weight * libm::log(ray / entry.contender.slowness);
            weights += weight;
        }
        if weights > 0.0 && f64::is_finite(sum) {
            self.ray = libm::exp(sum / weights);
            self.ray_spread = libm::sqrt(1.0 / weights);
        }
    }

    /// Never to be built (again).
    pub(in crate::scene) fn give_up(&mut self, at: usize) {
        self.entries[at].built = Some(self.build(at));
    }

    /// What to build after `best`, which stands; `tried` is the time spent on trees that were left, so far.
    pub(in crate::scene) fn next(&self, best: usize, tried: f64) -> Option<usize> {
        let left = (0..self.entries.len()).filter(|&at| self.entries[at].built.is_none());
        let gain = |at: usize| {
            let cost = (self.build(at) - self.shared).max(0.0);
            let expected = self.rays(best) - self.rays(at) - cost;
            let speculative = expected <= 0.0;
            if speculative && tried + cost > SPECULATION_MAX * self.rays(best) {
                return f64::NEG_INFINITY;
            }
            self.rays * self.improvement(best, at) - cost
        };
        let most = left.map(|at| (at, gain(at))).max_by(|a, b| a.1.total_cmp(&b.1))?;
        (most.1 > 0.0).then_some(most.0)
    }

    /// Whether another tree could be worth building after `best`, were its rays, not yet traced, as dear as
    /// they hardly ever are.
    pub(in crate::scene) fn may_go_on(&self, best: usize) -> bool {
        let mut dear = self.clone();
        dear.ray *= libm::exp(2.0 * self.ray_spread);
        dear.ray_spread = self.entries[best].contender.spread;
        dear.next(best, 0.0).is_some()
    }

    /// By how much a ray is expected to be quicker than in `best`, where it is quicker at all.
    fn improvement(&self, best: usize, at: usize) -> f64 {
        let now = self.ray(best);
        let spread = self.entries[at].contender.spread;
        let spread = libm::sqrt(spread * spread + self.ray_spread * self.ray_spread);
        let mean = self.ray(at);
        if !(now > 0.0 && mean > 0.0) {
            return 0.0;
        }
        // E max(0, now - X) of a lognormal X around `mean`.
        let d = libm::log(now / mean) / spread + 0.5 * spread;
        now * normal(d) - mean * normal(d - spread)
    }

    fn least(&self, cost: impl Fn(usize) -> f64) -> usize {
        let costs = (0..self.entries.len()).map(|at| (at, cost(at)));
        costs.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(at, _)| at)
    }
}

/// The normal distribution's share below `x`.
fn normal(x: f64) -> f64 {
    0.5 * libm::erfc(-x * core::f64::consts::FRAC_1_SQRT_2)
}

//! What is believed of every contender, and which to build next.
//!
//! The time that `n` rays take is `build + n * ray`. Before anything is built, both come from the table, and
//! the time of a ray is known to a factor of two or three only. Once a tree stands, its build says how fast the
//! machine is and its pilot rays how dear the scene's rays are; what the others cost follows from the table's
//! proportions, as a lognormal belief that narrows with every tree tried.
//!
//! - The *first* tree is the one whose squared regret is least on average: its total relative to the best contender's,
//!   over what a ray may cost, if afterwards the best use is made of the chance to build another.
//! - The *next* one is the contender with the greatest expected improvement beyond its build (J. Mockus'
//!   criterion; D. Jones, M. Schonlau, W. Welch, "Efficient Global Optimization of Expensive Black-Box
//!   Functions", 1998), for as long as there is one.
//!
//! No clock, no scene: everything here is a pure function of numbers, in seconds.

use super::table::{CONTENDERS, Contender, RAY_NS, RAY_SPREAD};
use alloc::vec::Vec;

/// A tree must be expected to save so many times what it costs: what is hardly worth it on paper is not, once
/// caches are cold and pilots unlucky (without, one choice of 72 lost a quarter).
const WORTH: f64 = 1.2;

/// Speculation, building what is not expected to be better but may be, may take this share of the rays' time.
/// With 0.04, twelve trees that were within 5 % of each other cost 6 to 10 % of ten seconds of tracing.
const SPECULATION_MAX: f64 = 0.02;

/// Tracing pilot rays through a tree and the one that it is compared with takes this share of the rays' time.
pub(in crate::scene) const TRIAL_SHARE: f64 = 0.003;

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
        // Squared, so that being far off once counts for more than being slightly off everywhere.
        let excess = |first: usize, z: f64| self.regret(first, z) - 1.0;
        self.least(|first| QUANTILES.iter().map(|&z| excess(first, z) * excess(first, z)).sum())
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

    /// The same beliefs, for another number of rays.
    pub(in crate::scene) fn for_rays(&self, rays: u64) -> Self {
        Self { rays: rays as f64, ..self.clone() }
    }

    /// What to build after `best`, which stands, in no more than `budget` seconds; `tried` is the time spent on
    /// trees that were left, so far.
    pub(in crate::scene) fn next(&self, best: usize, tried: f64, budget: f64) -> Option<usize> {
        let left = (0..self.entries.len())
            .filter(|&at| self.entries[at].built.is_none() && self.build(at) <= budget);
        let gain = |at: usize| {
            let trial = TRIAL_SHARE * self.rays(best);
            let cost = (self.build(at) - self.shared).max(0.0) + trial;
            let expected = self.rays(best) - self.rays(at) - cost;
            let speculative = expected <= 0.0;
            if speculative && tried + cost > SPECULATION_MAX * self.rays(best) {
                return f64::NEG_INFINITY;
            }
            self.rays * self.improvement(best, at) - WORTH * cost
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
        dear.next(best, 0.0, f64::INFINITY).is_some()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::Random;

    /// What builds and rays really take in some scene.
    struct World {
        prims: usize,
        builds: Vec<f64>,
        rays: Vec<f64>,
    }

    impl World {
        /// Where everything is as the table says, and a ray so many times as dear.
        fn usual(prims: usize, dear: f64) -> Self {
            let model = Model::new(prims, 1, 0);
            let all = 0..model.entries.len();
            let builds = all.clone().map(|at| model.build(at)).collect();
            let rays = all.map(|at| dear * model.ray(at)).collect();
            Self { prims, builds, rays }
        }

        /// Where everything is off by as much as it is from scene to scene.
        fn random(random: &mut Random) -> Self {
            let mut normal = || (0..12).map(|_| f64::from(random.unit())).sum::<f64>() - 6.0;
            let prims = libm::exp(12.0 + 2.0 * normal()) as usize;
            let dear = libm::exp(RAY_SPREAD * normal());
            let mut world = Self::usual(prims, dear);
            let pace = libm::exp(0.4 * normal());
            for (at, contender) in CONTENDERS.iter().enumerate() {
                world.builds[at] *= pace * libm::exp(0.05 * normal());
                world.rays[at] *= pace * libm::exp(contender.spread * normal());
            }
            world
        }

        fn best(&self, rays: f64) -> f64 {
            let totals = self.builds.iter().zip(&self.rays).map(|(build, ray)| build + rays * ray);
            totals.fold(f64::INFINITY, f64::min)
        }

        /// What `for_rays` would build, and the time that takes in all.
        fn search(&self, rays: u64) -> (usize, f64) {
            let mut model = Model::new(self.prims, 1, rays);
            let mut best = model.first();
            let mut spent = self.builds[best];
            let mut tried = 0.0;
            if model.may_go_on(best) {
                model.built(best, self.builds[best], 0.0);
                model.traced(best, self.rays[best]);
                while let Some(at) = model.next(best, tried, f64::INFINITY) {
                    spent += self.builds[at] + TRIAL_SHARE * rays as f64 * self.rays[best];
                    model.built(at, self.builds[at], 0.0);
                    model.traced(at, self.rays[at]);
                    let better = self.rays[at] < self.rays[best];
                    tried += self.builds[if better { best } else { at }];
                    best = if better { at } else { best };
                }
            }
            (best, spent + rays as f64 * self.rays[best])
        }

        /// What `Auto` takes, relative to the best in hindsight: the most wherever rays end, and when they do not.
        fn ski_rental(&self) -> [f64; 2] {
            let mut model = Model::new(self.prims, 1, 0);
            let mut at = model.only();
            model.built(at, self.builds[at], 0.0);
            let (mut rays, mut time, mut tried, mut worst) = (0.0, self.builds[at], 0.0, 1.0_f64);
            // Slices that grow by an eighth, to some thousand times what the dearest build takes.
            let mut slice = 1e-3 * self.builds[at] / self.rays[at];
            while rays * self.rays[at] < 3e3 * self.builds.iter().fold(0.0_f64, |a, &b| a.max(b)) {
                (rays, time) = (rays + slice, time + slice * self.rays[at]);
                slice = rays / 8.0;
                worst = worst.max(time / self.best(rays));
                model = model.for_rays(rays as u64);
                model.traced(at, self.rays[at]);
                if let Some(next) = model.next(at, tried, f64::INFINITY) {
                    time += self.builds[next];
                    model.built(next, self.builds[next], 0.0);
                    model.traced(next, self.rays[next]);
                    let better = self.rays[next] < self.rays[at];
                    tried += self.builds[if better { at } else { next }];
                    at = if better { next } else { at };
                    worst = worst.max(time / self.best(rays));
                }
            }
            [worst, time / self.best(rays)]
        }
    }

    /// Numbers of rays, half a decade apart.
    fn counts() -> impl Iterator<Item = u64> {
        (4..=22).map(|e| libm::pow(10.0, f64::from(e) / 2.0) as u64)
    }

    #[test]
    fn regret_is_small_in_random_scenes() {
        let mut random = Random::new(5);
        let mut regrets = Vec::new();
        for _ in 0..200 {
            let world = World::random(&mut random);
            regrets
                .extend(counts().map(|rays| world.search(rays).1 / world.best(rays as f64) - 1.0));
        }
        regrets.sort_by(f64::total_cmp);
        let quantile = |share: f64| regrets[(share * (regrets.len() - 1) as f64) as usize];
        let all = [quantile(0.5), quantile(0.95), quantile(1.0)];
        assert!(all[0] < 0.02 && all[1] < 0.12 && all[2] < 0.5, "{all:?}");
    }

    #[test]
    fn more_rays_never_get_slower_ones() {
        for prims in [100, 100_000, 10_000_000] {
            for dear in [0.2, 1.0, 5.0] {
                let world = World::usual(prims, dear);
                let rays: Vec<_> = counts().map(|n| world.rays[world.search(n).0]).collect();
                assert!(rays.is_sorted_by(|a, b| a >= b), "{prims} {dear}: {rays:?}");
                assert!(rays[0] > rays[18], "{prims} {dear}");
            }
        }
    }

    #[test]
    fn few_rays_get_the_quickest_build() {
        for rays in [0, 1, 1000] {
            let model = Model::new(1_000_000, 1, rays);
            let quickest = model.least(|at| model.build(at));
            assert_eq!((model.first(), model.only()), (quickest, quickest));
            assert!(!model.may_go_on(quickest), "{rays} rays");
        }
        assert!(Model::new(1_000_000, 1, u64::MAX).may_go_on(0));
    }

    #[test]
    fn hindsight_is_never_far_ahead_of_auto() {
        let mut random = Random::new(7);
        for _ in 0..200 {
            let [worst, last] = World::random(&mut random).ski_rental();
            assert!(worst < 1.8 && last < 1.15 && worst >= last, "{worst} {last}");
        }
    }

    /// Against sums over the lognormal distribution.
    #[test]
    fn improvement_is_what_it_says() {
        let mut model = Model::new(1_000_000, 1, 1_000_000);
        (0..3).for_each(|at| model.traced(at, 1e-7 * CONTENDERS[at].slowness));
        for at in 3..model.entries.len() {
            let (now, mean) = (model.ray(0), model.ray(at));
            let own = model.entries[at].contender.spread;
            let spread = libm::sqrt(own * own + model.ray_spread * model.ray_spread);
            let mut sum = 0.0;
            for step in -4000..4000 {
                let z = f64::from(step) / 500.0;
                let density = libm::exp(-0.5 * z * z) / libm::sqrt(core::f64::consts::TAU) / 500.0;
                let ray = mean * libm::exp(spread * z - 0.5 * spread * spread);
                sum += density * (now - ray).max(0.0);
            }
            let improvement = model.improvement(0, at);
            assert!((improvement - sum).abs() < 1e-4 * now, "{improvement} {sum}");
        }
    }
}

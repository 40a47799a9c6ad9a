//! Tracing pilot rays: how long a ray takes in a tree that stands.
//!
//! Stretches of the given rays, evenly spread over them, are traced one ray a call, on all threads of the
//! caller's pool, as the rays to come will be. Trees that are compared take turns.

use super::Pilot;
use crate::context::clock::Stopwatch;
use crate::context::{Cancel, Cancelled, parallel};
use crate::math::{Ray, vec3};
use crate::scene::Scene;
use alloc::vec::Vec;
use core::hint::black_box;

/// Rays that are traced one after the other, by one thread: as many as a tile of a picture has.
const STRETCH: usize = 256;

/// With fewer rays, the first ones, which find cold caches, are too large a part.
const RAYS_MIN: usize = 128;

/// With fewer rays, threads take longer to wake up than to trace.
const RAYS_SHARED: usize = 4096;

/// The most rays that are made where none are given.
const OWN_MAX: usize = 8192;

/// Making a ray costs as much as tracing so many.
const OWN_COST: f64 = 4.0;

/// Turns that each tree takes where time is short: there are as many rays as that leaves time for.
const ROUNDS: f64 = 5.0;

/// Turns that each tree takes at most, and at least where that is quick.
const ROUNDS_MAX: usize = 25;

/// What is quick, in seconds: a machine's hiccup lasts some milliseconds.
const QUICK: f64 = 0.01;

/// Turns that tiny samples take at most.
const ROUNDS_QUICK: usize = 99;

/// Points of this many dimensions are spread by the square roots of as many primes (R. Richtmyer, 1951): evenly, and
/// without random numbers, which this folder knows nothing of.
const PRIMES: [f64; 9] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0];

/// Rays to try trees with.
pub(in crate::scene) struct Probe<'a> {
    given: Pilot<'a>,
    own: Vec<Ray>,
}

impl<'a> Probe<'a> {
    /// With the caller's rays.
    pub(in crate::scene) fn new(given: Pilot<'a>) -> Self {
        Self { given, own: Vec::new() }
    }

    /// Seconds a ray in each of the scenes, a low one of some turns; `None` where `budget` seconds do not suffice to
    /// tell. `ray` is what a ray is expected to take.
    pub(in crate::scene) fn compare<const N: usize>(
        &mut self,
        scenes: [&Scene; N],
        budget: f64,
        ray: f64,
        cancel: &Cancel,
    ) -> Result<Option<[f64; N]>, Cancelled> {
        let affordable = budget / (N as f64 * ray.max(1e-9));
        if affordable < RAYS_MIN as f64 {
            return Ok(None);
        }
        if self.given.is_empty() && self.own.is_empty() {
            let count = (affordable / OWN_COST) as usize;
            self.own = own_rays(scenes[0], count.min(OWN_MAX), cancel)?;
        }
        let Pilot { closest, any } = self.given;
        let closest = if self.given.is_empty() { &*self.own } else { closest };

        // One tree alone is to tell what a ray takes, so it gets other rays at each turn, as long as there are: the
        // same few would find their nodes in the caches (and seem a fifth quicker). Trees that are compared
        // all get the same.
        let all = closest.len() + any.len();
        let fresh = N == 1 && affordable < ROUNDS * all as f64;
        let count = if fresh { affordable } else { affordable / ROUNDS };
        let count = all.min(count as usize).max(all.min(RAYS_MIN));
        let share = count as f64 / all.max(1) as f64;
        let work: Vec<_> = stretches(closest, share)
            .map(|rays| (rays, false))
            .chain(stretches(any, share).map(|rays| (rays, true)))
            .collect();
        let count = rays_of(&work);
        if count == 0 {
            return Ok(None);
        }
        let quick = (QUICK / (count as f64 * ray)) as usize;
        let rounds = ROUNDS_MAX.max(quick.min(ROUNDS_QUICK));
        let rounds = rounds.min((affordable / count as f64) as usize).max(1);
        let turns: Vec<Vec<_>> = if fresh {
            let parts = work.len().min(ROUNDS as usize);
            (0..parts).map(|i| work.iter().copied().skip(i).step_by(parts).collect()).collect()
        } else {
            (0..rounds).map(|_| work.clone()).collect()
        };

        // Trace; where the same rays come again, the first turn only warms up.
        let mut times = [const { Vec::new() }; N];
        for turn in &turns {
            for (scene, times) in scenes.iter().zip(&mut times) {
                cancel.check()?;
                times.push(trace(scene, turn) / rays_of(turn) as f64);
            }
        }
        Ok(Some(times.map(|mut times| {
            if !fresh && times.len() > 1 {
                times.remove(0);
            }
            // What else a machine does only ever adds: the lower quartile. With medians of nine turns, one of
            // twelve trees within 5 % of each other was the quickest by chance.
            quantile(&mut times, if fresh { 2 } else { 4 })
        })))
    }
}

/// A stretch of rays, and whether they ask for any hit.
type Stretch<'a> = (&'a [Ray], bool);

/// How many they are.
fn rays_of(work: &[Stretch<'_>]) -> usize {
    work.iter().map(|(rays, _)| rays.len()).sum()
}

/// Stretches that hold about that share of the rays, evenly spread.
fn stretches(rays: &[Ray], share: f64) -> impl Iterator<Item = &[Ray]> {
    let all = rays.len().div_ceil(STRETCH);
    let count = libm::ceil(all as f64 * share.min(1.0)) as usize;
    let nth = move |i: usize| i * all / count.max(1) * STRETCH;
    (0..count).filter_map(move |i| rays.get(nth(i)..rays.len().min(nth(i) + STRETCH)))
}

/// Seconds that all stretches take.
fn trace(scene: &Scene, work: &[Stretch<'_>]) -> f64 {
    let ask = |&(rays, any): &Stretch<'_>| {
        if any {
            rays.iter().for_each(|ray| _ = black_box(scene.any(ray)));
        } else {
            rays.iter().for_each(|ray| _ = black_box(scene.closest(ray)));
        }
    };
    let threads = parallel::threads();
    if threads == 1 || rays_of(work) < RAYS_SHARED {
        let clock = Stopwatch::start();
        work.iter().for_each(ask);
        return clock.elapsed().as_secs_f64() / threads as f64;
    }
    let clock = Stopwatch::start();
    parallel::map(work.iter().collect(), ask);
    clock.elapsed().as_secs_f64()
}

/// The time that one of so many parts stays below.
fn quantile(times: &mut [f64], parts: usize) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / parts).copied().unwrap_or(0.0)
}

/// Rays that leave the surfaces by about the cosine, from what lines through the scene's box meet first; fewer where lines
/// miss.
fn own_rays(scene: &Scene, count: usize, cancel: &Cancel) -> Result<Vec<Ray>, Cancelled> {
    let bounds = scene.bounds();
    if bounds.is_empty() {
        return Ok(Vec::new());
    }
    let roots = PRIMES.map(libm::sqrt);
    let offset = 1e-4 * vec3::max_abs(bounds.extent());
    let mut rays = Vec::with_capacity(count);
    for line in 0..2 * count {
        if rays.len() == count {
            break;
        }
        if line % STRETCH == 0 {
            cancel.check()?;
        }
        let spread = |dimension: usize| {
            let turns = (line + 1) as f64 * roots[dimension];
            (turns - libm::floor(turns)) as f32
        };
        let inside = |first: usize| {
            [0, 1, 2].map(|axis: usize| {
                let share = spread(first + axis);
                bounds.lo[axis] * (1.0 - share) + bounds.hi[axis] * share
            })
        };
        let from = inside(0);
        let line = Ray::new(from, vec3::sub(inside(3), from));
        // A line that meets nothing is a ray to come as good as any.
        let leaving = scene.closest(&line).and_then(|hit| {
            let normal = scene.normal(&line, &hit)?;
            let side = if vec3::dot(normal, line.direction) > 0.0 { -1.0 } else { 1.0 };
            let normal = vec3::scale(normal, side);
            let around = vec3::normalize([6, 7, 8].map(|axis| 2.0 * spread(axis) - 1.0))?;
            let direction = vec3::normalize(vec3::add(normal, around))?;
            let start = vec3::add(line.at(hit.t), vec3::scale(normal, offset));
            Some(Ray::new(start, direction))
        });
        rays.extend(leaving.or(Some(line)));
    }
    Ok(rays)
}

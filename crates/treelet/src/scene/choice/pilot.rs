//! Tracing pilot rays: how long a ray takes in a tree that stands.
//!
//! Stretches of the given rays, evenly spread over them, are traced one ray a call, on all threads of the
//! caller's pool, as the rays to come will be. Trees that are compared take turns.

use super::Pilot;
use crate::context::clock::Stopwatch;
use crate::context::{Cancel, Cancelled, parallel};
use crate::math::{Ray, vec3};
use crate::scene::Scene;
use crate::verify::Random;
use alloc::vec::Vec;
use core::hint::black_box;

/// Rays that are traced one after the other, by one thread: as many as a tile of a picture has.
const STRETCH: usize = 256;

/// With fewer rays, the first ones, which find cold caches, are too large a part.
const RAYS_MIN: usize = 128;

/// With fewer rays, threads take longer to wake up than to trace.
const RAYS_SHARED: usize = 4096;

/// The most rays that are made where none are given.
const OWN_MAX: usize = 16_384;

/// Making a ray costs as much as tracing so many.
const OWN_COST: f64 = 4.0;

/// Turns that each tree takes at most, and at least where that is quick.
const ROUNDS_MAX: usize = 9;

/// What is quick, in seconds: a machine's hiccup lasts some milliseconds.
const QUICK: f64 = 0.01;

/// Turns that tiny samples take at most.
const ROUNDS_QUICK: usize = 99;

/// The seed of rays that are made here.
const SEED: u64 = 0x9107;

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

    /// Seconds a ray in each of the scenes, the median of a few turns; `None` where `budget` seconds do not suffice to
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

        // Choose stretches and turns.
        let all = closest.len() + any.len();
        let count = all.min((affordable / 3.0) as usize).max(all.min(RAYS_MIN));
        let share = count as f64 / all.max(1) as f64;
        let work: Vec<_> = stretches(closest, share)
            .map(|rays| (rays, false))
            .chain(stretches(any, share).map(|rays| (rays, true)))
            .collect();
        let count: usize = work.iter().map(|(rays, _)| rays.len()).sum();
        if count < RAYS_MIN.min(all) || count == 0 {
            return Ok(None);
        }
        let quick = (QUICK / (count as f64 * ray)) as usize;
        let rounds = ROUNDS_MAX.max(quick.min(ROUNDS_QUICK));
        let rounds = rounds.min((affordable / count as f64) as usize).max(1);

        // Trace; the first turn only warms up, if there are several.
        let mut times = [const { Vec::new() }; N];
        for _ in 0..rounds {
            for (scene, times) in scenes.iter().zip(&mut times) {
                cancel.check()?;
                times.push(trace(scene, &work, count));
            }
        }
        Ok(Some(times.map(|mut times| {
            if times.len() > 1 {
                times.remove(0);
            }
            median(&mut times) / count as f64
        })))
    }
}

/// Stretches that hold about that share of the rays, evenly spread.
fn stretches(rays: &[Ray], share: f64) -> impl Iterator<Item = &[Ray]> {
    let all = rays.len().div_ceil(STRETCH);
    let count = libm::ceil(all as f64 * share.min(1.0)) as usize;
    let nth = move |i: usize| i * all / count.max(1) * STRETCH;
    (0..count).filter_map(move |i| rays.get(nth(i)..rays.len().min(nth(i) + STRETCH)))
}

/// Seconds that all stretches take.
fn trace(scene: &Scene, work: &[(&[Ray], bool)], count: usize) -> f64 {
    let ask = |&(rays, any): &(&[Ray], bool)| {
        if any {
            rays.iter().for_each(|ray| _ = black_box(scene.any(ray)));
        } else {
            rays.iter().for_each(|ray| _ = black_box(scene.closest(ray)));
        }
    };
    let threads = parallel::threads();
    if threads == 1 || count < RAYS_SHARED {
        let clock = Stopwatch::start();
        work.iter().for_each(ask);
        return clock.elapsed().as_secs_f64() / threads as f64;
    }
    let clock = Stopwatch::start();
    parallel::map(work.iter().collect(), ask);
    clock.elapsed().as_secs_f64()
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(0.0)
}

/// Rays that leave the surfaces by cosine, from what lines through the scene's box meet first; fewer where lines
/// miss.
fn own_rays(scene: &Scene, count: usize, cancel: &Cancel) -> Result<Vec<Ray>, Cancelled> {
    let bounds = scene.bounds();
    if bounds.is_empty() {
        return Ok(Vec::new());
    }
    let mut random = Random::new(SEED);
    let offset = 1e-4 * vec3::max_abs(bounds.extent());
    let mut rays = Vec::with_capacity(count);
    for line in 0..2 * count {
        if rays.len() == count {
            break;
        }
        if line % STRETCH == 0 {
            cancel.check()?;
        }
        let mut inside =
            || [0, 1, 2].map(|axis: usize| random.between(bounds.lo[axis], bounds.hi[axis]));
        let from = inside();
        let line = Ray::new(from, vec3::sub(inside(), from));
        // A line that meets nothing is a ray to come as good as any.
        let leaving = scene.closest(&line).and_then(|hit| {
            let normal = scene.normal(&hit)?;
            let side = if vec3::dot(normal, line.direction) > 0.0 { -1.0 } else { 1.0 };
            let normal = vec3::scale(normal, side);
            let around = vec3::normalize(random.direction())?;
            let direction = vec3::normalize(vec3::add(normal, around))?;
            let start = vec3::add(line.at(hit.t), vec3::scale(normal, offset));
            Some(Ray::new(start, direction))
        });
        rays.extend(leaving.or(Some(line)));
    }
    Ok(rays)
}

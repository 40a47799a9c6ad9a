//! Building what the model says, and telling it what was found.

use super::model::Model;
use super::pilot::Probe;
use super::table::CONTENDERS;
use super::{Candidate, Choice, words};
use crate::context::clock::Stopwatch;
use crate::context::parallel;
use crate::scene::assemble::Gathered;
use crate::scene::{BuildOptions, Quality, Recipe, Scene, SceneError};
use alloc::borrow::ToOwned;
use alloc::sync::Arc;
use core::time::Duration;

/// Pilot rays may take this share of the time expected in all.
const PILOT_SHARE: f64 = 0.01;

/// And, in seconds, no more than this: what they tell does not get better any more.
const PILOT_MAX: f64 = 2.0;

/// Builds what is chosen for `rays` rays.
pub(in crate::scene) fn build(
    gathered: Gathered,
    options: &BuildOptions<'_>,
    rays: u64,
) -> Result<Scene, SceneError> {
    let shared = gathered.elapsed().as_secs_f64();
    let model = Model::new(gathered.prims(), parallel::threads(), rays);
    let probe = Probe::new(options.pilot);
    Search { gathered, options, model, probe, shared, tried: 0.0 }.run(rays)
}

/// A scene that is looking for its builder.
struct Search<'a> {
    gathered: Gathered,
    options: &'a BuildOptions<'a>,
    model: Model,
    probe: Probe<'a>,
    /// Seconds that gathering took; zero where there is no clock.
    shared: f64,
    /// Seconds that went into trees that were left.
    tried: f64,
}

impl Search<'_> {
    fn run(mut self, rays: u64) -> Result<Scene, SceneError> {
        let hopeless = self.shared == 0.0 || self.gathered.prims() == 0;
        let first = if hopeless { self.model.only() } else { self.model.first() };
        let again = !hopeless && self.model.may_go_on(first);
        let (mut scene, mut best) = (self.grow(first, again)?, first);
        if !hopeless && let Some([ray]) = self.compare([&scene], best)? {
            self.model.traced(best, ray);
        }
        // Another tree, as long as one promises more than it costs.
        while again
            && self.model.is_measured(best)
            && let Some(at) = self.model.next(best, self.tried)
        {
            let other = match self.grow(at, true) {
                Ok(other) => other,
                Err(error) if error.is_cancelled() => return Err(error),
                // There is a tree already; this one does not fit into memory, say.
                Err(_) => {
                    self.model.give_up(at);
                    continue;
                }
            };
            if let Some([ray, other]) = self.compare([&scene, &other], best)? {
                self.model.traced(best, ray);
                self.model.traced(at, other);
            }
            let better = self.model.ray(at) < self.model.ray(best);
            self.tried += self.model.build(if better { best } else { at }) - self.shared;
            if better {
                (scene, best) = (other, at);
            }
        }
        Ok(self.told(scene, best, rays))
    }

    /// The scene of a contender.
    fn grow(&mut self, at: usize, again: bool) -> Result<Scene, SceneError> {
        let clock = Stopwatch::start();
        let scene = self.gathered.scene(&recipe(at).options().plan(), self.options, again)?;
        let build = self.shared + clock.elapsed().as_secs_f64();
        self.model.built(at, build, self.shared);
        Ok(scene)
    }

    /// What a ray takes in each of the scenes.
    fn compare<const N: usize>(
        &mut self,
        scenes: [&Scene; N],
        best: usize,
    ) -> Result<Option<[f64; N]>, SceneError> {
        let spent = self.gathered.elapsed().as_secs_f64();
        let budget = (PILOT_SHARE * (spent + self.model.rays(best))).min(PILOT_MAX);
        let ray = self.model.ray(best);
        Ok(self.probe.compare(scenes, budget, ray, &self.options.context.cancel)?)
    }

    /// The scene with its report.
    fn told(self, mut scene: Scene, best: usize, rays: u64) -> Scene {
        let model = &self.model;
        let candidates = CONTENDERS.iter().enumerate().map(|(at, contender)| Candidate {
            variant: contender.name.to_owned(),
            build: seconds(model.build(at)),
            ray_ns: model.ray(at) * 1e9,
            measured: model.is_measured(at),
        });
        let candidates = candidates.collect();
        let reason = words::reason(model, best, rays);
        let elapsed = self.gathered.elapsed();
        let report = Arc::make_mut(&mut scene.report);
        report.total_time = elapsed;
        report.choice = Some(Choice {
            rays,
            variant: CONTENDERS[best].name.to_owned(),
            predicted: seconds(elapsed.as_secs_f64() + model.rays(best)),
            choosing: elapsed.saturating_sub(seconds(model.build(best))),
            reason,
            candidates,
        });
        scene
    }
}

/// How a contender is built. Every name of the table is one; a test parses them all.
pub(super) fn recipe(at: usize) -> Recipe {
    CONTENDERS[at].name.parse().unwrap_or(Quality::Fastest.into())
}

/// As a duration; the longest there is for what is longer.
fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
}

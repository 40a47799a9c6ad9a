//! Scenes that get better while they are traced: [`Quality::Auto`](super::Quality::Auto).
//!
//! Nobody knows how many rays will come, so at any time as many are expected to come as have come: a better tree
//! is built once it would have paid for itself on the rays so far. That is the rule of ski rental: who buys once
//! the rents add up to the price never pays more than twice what the best plan in hindsight would have
//! (A. Karlin, M. Manasse, L. Rudolph, D. Sleator, "Competitive Snoopy Caching", 1988). Here even the first
//! tree answers rays at a good half of the best one's speed, so that waiting is never dear: over random scenes, a test
//! finds at most 1.7 times the best plan's total. Traced, 1e5 to 1e8 single rays in a kitchen, a car, a cave and a
//! coffee maker took 0.9 to 1.9 times that, and 2.3 times in one run of the car (1.5 in another), while other programs
//! had most of the core. What trees cost is predicted as for
//! [`Quality::Rays`](super::Quality::Rays), by [`choice::model`](super::choice::model), and rays are timed where they are asked.
//!
//! Each step gathers anew, which is a tenth of the quickest build: boxes that were kept for it would cost 24
//! bytes a triangle all the time.

use super::assemble::Gathered;
use super::choice::model::{Model, TRIAL_SHARE};
use super::choice::pilot::Probe;
use super::choice::{self, Choice, Pilot};
use super::upkeep::add;
use super::{BuildOptions, Invalid, LayoutChoice, Scene, SceneBuilder, SceneError};
use crate::context::clock::Stopwatch;
use crate::context::{Cancel, Context, parallel};
use crate::math::Ray;
use crate::simd::Level;
use alloc::format;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

/// Pilot rays of each question that are kept.
const PILOT_KEPT: usize = 16_384;

/// What a scene remembers that may be improved.
pub(super) struct Auto {
    /// What it was built from; meshes and scenes inside are shared.
    description: SceneBuilder,
    invalid: Invalid,
    level: Level,
    layout: Option<LayoutChoice>,
    cancel: Cancel,
    closest: Vec<Ray>,
    any: Vec<Ray>,
    /// Which contender it is, and what is believed of the others.
    at: usize,
    model: Model,
    /// Rays that were asked before this scene stood, and seconds spent on trees that were left.
    rays_before: u64,
    left_before: f64,
    /// Rays asked of this scene, and nanoseconds that they took.
    rays: AtomicU64,
    nanos: AtomicU64,
    /// A bit for each contender that was tried against this one and lost, and nanoseconds spent on them.
    lost: AtomicU64,
    lost_nanos: AtomicU64,
}

impl core::fmt::Debug for Auto {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Auto").field("at", &self.at).field("rays", &self.rays).finish()
    }
}

/// Builds what can be built soonest.
pub(super) fn start(
    description: SceneBuilder,
    options: &BuildOptions<'_>,
) -> Result<Scene, SceneError> {
    let few = |rays: &[Ray]| rays.get(..rays.len().min(PILOT_KEPT)).unwrap_or_default().to_vec();
    let kept = description.clone();
    let mut gathered = Gathered::new(description, options)?;
    let mut model = Model::new(gathered.prims(), parallel::threads(), 0);
    let at = model.only();
    let recipe = choice::recipe(at);
    let mut scene = gathered.scene(&recipe.options().plan(), options, false)?;
    model.built(at, scene.report.total_time.as_secs_f64(), 0.0);
    let reason = format!(
        "nobody knows how many rays will come: `{}` is built soonest, and can be improved",
        recipe.name()
    );
    let total = scene.report.total_time;
    Arc::make_mut(&mut scene.report).choice =
        Some(Choice { reason, predicted: total, ..choice::told(&model, at, 0) });
    scene.auto = Some(Arc::new(Auto {
        description: kept,
        invalid: options.invalid,
        level: options.level,
        layout: options.layout,
        cancel: options.context.cancel.clone(),
        closest: few(options.pilot.closest),
        any: few(options.pilot.any),
        at,
        model,
        rays_before: 0,
        left_before: 0.0,
        rays: AtomicU64::new(0),
        nanos: AtomicU64::new(0),
        lost: AtomicU64::new(0),
        lost_nanos: AtomicU64::new(0),
    }));
    Ok(scene)
}

impl Scene {
    /// A scene of [`Quality::Auto`](super::Quality::Auto) that answers the same rays faster, if one is worth building now;
    /// `None` if not, or for a scene of another quality. To be called now and then, between slices or pictures.
    ///
    /// As many rays are expected to come as were asked, of this scene and of those that it improves. Slices are
    /// counted; who asks single rays tells it with [`Scene::note_traced`]. What is expected to take longer than
    /// `budget` to build is not tried. The call runs on the caller's rayon pool and is stopped by the
    /// `Cancel` that the scene was built with. This scene stays as it is, and other threads may go on asking it.
    ///
    /// # Errors
    ///
    /// Cancellation. A better tree that cannot be built (memory, say) is not an error: it is not tried again.
    ///
    /// ```
    /// use treelet::{BuildOptions, Hit, Mesh, Quality, Ray, Scene};
    /// use core::time::Duration;
    ///
    /// let mesh = Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
    /// let options = BuildOptions { quality: Quality::Auto, ..Default::default() };
    /// let mut scene = Scene::builder().mesh(mesh).build(&options)?;
    /// let rays = [Ray::new([0.25, 0.25, -3.0], [0.0, 0.0, 1.0]); 100];
    /// let mut hits = [Hit::MISS; 100];
    /// for _picture in 0..10 {
    ///     scene.closest_many(&rays, &mut hits).unwrap();
    ///     scene = scene.improve(Duration::from_millis(100))?.unwrap_or(scene);
    /// }
    /// # Ok::<(), treelet::SceneError>(())
    /// ```
    pub fn improve(&self, budget: Duration) -> Result<Option<Self>, SceneError> {
        match &self.auto {
            Some(auto) => auto.improve(self, budget.as_secs_f64()),
            None => Ok(None),
        }
    }
}

impl Auto {
    /// Takes down that rays were asked.
    pub(super) fn note(&self, rays: u64, time: Duration) {
        add(&self.rays, rays);
        add(&self.nanos, u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }

    fn improve(&self, scene: &Scene, budget: f64) -> Result<Option<Scene>, SceneError> {
        // As many rays will come as have come, at what they took so far.
        let (rays, nanos) = (self.rays.load(Ordering::Relaxed), self.nanos.load(Ordering::Relaxed));
        if rays == 0 || nanos == 0 {
            return Ok(None);
        }
        let asked = self.rays_before.saturating_add(rays);
        let mut model = self.model.for_rays(asked);
        let lost = self.lost.load(Ordering::Relaxed);
        (0..model.entries.len()).filter(|at| lost >> at & 1 == 1).for_each(|at| model.give_up(at));
        model.traced(self.at, nanos as f64 * 1e-9 / rays as f64);
        let left = self.left_before + self.lost_nanos.load(Ordering::Relaxed) as f64 * 1e-9;
        let Some(at) = model.next(self.at, left, budget) else { return Ok(None) };

        // Build it, and see.
        let clock = Stopwatch::start();
        let Some(other) = self.build(at, &mut model)? else {
            self.lose(at, clock.elapsed());
            return Ok(None);
        };
        let mut probe = Probe::new(Pilot { closest: &self.closest, any: &self.any });
        let (ray, pilot) = (model.ray(self.at), TRIAL_SHARE * model.rays(self.at));
        if let Some([ray, new]) = probe.compare([scene, &other], pilot, ray, &self.cancel)? {
            // Slices are not asked as pilot rays are; what both trees have in common is the scale.
            let scale = model.ray(self.at) / ray;
            model.traced(at, new * scale);
        }
        if model.ray(at) >= model.ray(self.at) {
            self.lose(at, clock.elapsed());
            return Ok(None);
        }
        Ok(Some(self.better(other, at, model, asked, left)))
    }

    /// The scene of a contender; `None` if it cannot be built.
    fn build(&self, at: usize, model: &mut Model) -> Result<Option<Scene>, SceneError> {
        let context = Context { cancel: self.cancel.clone(), progress: None };
        let &Self { invalid, level, layout, .. } = self;
        let options = BuildOptions { invalid, level, layout, context, ..Default::default() };
        let recipe = choice::recipe(at);
        let built = Gathered::new(self.description.clone(), &options)
            .and_then(|mut gathered| gathered.scene(&recipe.options().plan(), &options, false));
        match built {
            Ok(scene) => {
                model.built(at, scene.report.total_time.as_secs_f64(), 0.0);
                Ok(Some(scene))
            }
            Err(error) if error.is_cancelled() => Err(error),
            Err(_) => Ok(None),
        }
    }

    /// Not to be tried against this scene again.
    fn lose(&self, at: usize, time: Duration) {
        self.lost.fetch_or(1 << at, Ordering::Relaxed);
        add(&self.lost_nanos, u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }

    /// The new scene, with all that this one knows.
    fn better(&self, mut scene: Scene, at: usize, model: Model, asked: u64, left: f64) -> Scene {
        let left_before = left + model.build(self.at);
        let told = choice::told(&model, at, asked);
        let predicted = model.build(at) + model.rays(at);
        let predicted = Duration::try_from_secs_f64(predicted).unwrap_or(Duration::MAX);
        Arc::make_mut(&mut scene.report).choice = Some(Choice { predicted, ..told });
        scene.auto = Some(Arc::new(Self {
            description: self.description.clone(),
            cancel: self.cancel.clone(),
            closest: self.closest.clone(),
            any: self.any.clone(),
            at,
            model,
            rays_before: asked,
            left_before,
            rays: AtomicU64::new(0),
            nanos: AtomicU64::new(0),
            lost: AtomicU64::new(self.lost.load(Ordering::Relaxed)),
            lost_nanos: AtomicU64::new(0),
            ..*self
        }));
        scene
    }
}

//! A picture in the making: checks everything once, then computes whole passes.

use crate::camera::Eye;
use crate::error::RenderError;
use crate::film::{Film, NO_SAMPLE, TILE};
use crate::filter::Filter;
use crate::image::check_size;
use crate::integrator::{PAIR_FILTER, PAIR_LENS, World};
use crate::light::Lights;
use crate::material::Materials;
use crate::outside::Outside;
use crate::sampler::Sampler;
use crate::settings::Settings;
use crate::surface::Surfaces;
use crate::wave::{WAVE, Wave};
use core::time::Duration;
use rayon::prelude::*;
use treelet::context::clock::Stopwatch;
use treelet::{Cancel, Ray};
use treelet_model::{Camera, Model, PlacedModel};

/// Renders one model through one camera.
#[derive(Clone, Debug)]
pub struct Renderer<'a> {
    pub(crate) world: World<'a>,
    pub(crate) settings: Settings,
    eye: Eye,
    filter: Filter,
}

/// What a pass took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassStats {
    /// Rays that were traced, shadow rays included.
    pub rays: u64,
    /// What all threads together took.
    pub busy: Duration,
    /// What of it went by in the library's answers to rays; what else it went for is shading.
    pub asking: Duration,
}

impl PassStats {
    /// Both together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            busy: self.busy + other.busy,
            asking: self.asking + other.asking,
        }
    }
}

impl<'a> Renderer<'a> {
    /// Prepares to render `model`, which `placed` was built from, as `camera` sees it.
    ///
    /// The model's environment is the light from outside, or else its sky, or else
    /// [`crate::default_sky`]. Takes time and memory for tables of the
    /// materials and of the emissive triangles; 250 bytes a placement.
    ///
    /// # Errors
    /// If a number is unfit (picture size, camera, sky, a material's factor), a reference in the
    /// model leads nowhere, or memory is refused.
    pub fn new(
        model: &'a Model,
        placed: &'a PlacedModel,
        camera: &Camera,
        settings: Settings,
    ) -> Result<Self, RenderError> {
        check_size(settings.width, settings.height)?;
        if settings.up > 2 {
            return Err(RenderError::Up { axis: settings.up });
        }
        let eye = Eye::new(camera, settings.width, settings.height)?;
        let surfaces = Surfaces::new(model)?;
        let materials = Materials::new(model, settings.regularize)?;
        let outside = Outside::new(model, settings.up, settings.regularize)?;
        let lights = Lights::new(&surfaces, &materials, &model.lights, outside)?;
        let world = World { placed, surfaces, materials, lights };
        Ok(Self { world, settings, eye, filter: Filter::new() })
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// An empty film of the right size.
    ///
    /// # Errors
    /// If memory is refused.
    pub fn film(&self) -> Result<Film, RenderError> {
        Film::new(self.settings.width, self.settings.height)
    }

    /// Adds one sample to every pixel, in parallel on the caller's rayon pool.
    ///
    /// The film depends on the settings and the number of passes only, bit for bit: not on threads,
    /// nor on passes that were cancelled.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] within a few milliseconds once `cancel` is raised, and
    /// [`RenderError::FilmSize`] for a film of another size. Either way the film is as it was.
    pub fn pass(&self, film: &mut Film, cancel: &Cancel) -> Result<PassStats, RenderError> {
        self.check_film(film)?;
        self.pass_where(film, cancel, |_, _| true)
    }

    /// Adds one sample to every pixel of the tiles that are noisier than `limit`, as
    /// [`Film::noise`] measures it; `None` if there is none, and the film is as it was.
    ///
    /// Which tiles are left follows from the film alone, so this too is the same for any number of
    /// threads. A tile is left while it and its neighbours are clean, after 16 samples at least.
    ///
    /// # Errors
    /// Those of [`Renderer::pass`].
    pub fn adaptive_pass(
        &self,
        film: &mut Film,
        limit: f32,
        cancel: &Cancel,
    ) -> Result<Option<PassStats>, RenderError> {
        self.check_film(film)?;
        let noisy = film.noisy_tiles(limit);
        if !noisy.contains(&true) {
            return Ok(None);
        }
        let columns = film.width().div_ceil(TILE);
        let wanted = |x: u32, y: u32| noisy[(y / TILE * columns + x / TILE) as usize];
        self.pass_where(film, cancel, wanted).map(Some)
    }

    fn check_film(&self, film: &Film) -> Result<(), RenderError> {
        let renderer = [self.settings.width, self.settings.height];
        let found = [film.width(), film.height()];
        if found == renderer {
            Ok(())
        } else {
            Err(RenderError::FilmSize { film: found, renderer })
        }
    }

    /// A pass over the pixels that are wanted.
    fn pass_where(
        &self,
        film: &mut Film,
        cancel: &Cancel,
        wanted: impl Fn(u32, u32) -> bool + Sync,
    ) -> Result<PassStats, RenderError> {
        let mut pending = core::mem::take(&mut film.pending);
        let stats = pending
            .par_chunks_mut(WAVE)
            .enumerate()
            .map_init(Wave::default, |wave, (number, pixels)| {
                let sample = |index| film.count_at(index);
                self.sample_pixels(wave, number * WAVE, pixels, &sample, &wanted, cancel)
            })
            .try_reduce(PassStats::default, |a, b| Ok(a.and(b)));
        film.pending = pending;
        let stats = stats?;
        film.commit();
        Ok(stats)
    }

    /// Computes the samples of pixels from number `first` on, one path each.
    fn sample_pixels(
        &self,
        wave: &mut Wave,
        first: usize,
        pixels: &mut [[f32; 3]],
        sample: &dyn Fn(usize) -> u32,
        wanted: &impl Fn(u32, u32) -> bool,
        cancel: &Cancel,
    ) -> Result<PassStats, RenderError> {
        let watch = Stopwatch::start();
        wave.clear();
        let width = self.settings.width as usize;
        for (index, pixel) in (first..).zip(&mut *pixels) {
            let (x, y) = ((index % width) as u32, (index / width) as u32);
            if !wanted(x, y) {
                *pixel = NO_SAMPLE;
                continue;
            }
            *pixel = [0.0; 3];
            let sampler = Sampler::new(self.settings.seed, x, y, sample(index));
            let lens = if self.eye.has_lens() { sampler.pair(PAIR_LENS) } else { [0.0; 2] };
            wave.push(self.filtered_ray(x, y, sampler.pair(PAIR_FILTER), lens), sampler);
        }
        self.world.follow(wave, &self.settings, cancel)?;
        let sampled = pixels.iter_mut().filter(|pixel| **pixel != NO_SAMPLE);
        sampled.zip(&wave.radiance).for_each(|(pixel, radiance)| *pixel = *radiance);
        Ok(PassStats { rays: wave.traced, busy: watch.elapsed(), asking: wave.asking })
    }

    /// The camera ray through a place of a pixel's filter and of the lens.
    #[inline]
    pub(crate) fn filtered_ray(&self, x: u32, y: u32, u: [f32; 2], lens: [f32; 2]) -> Ray {
        let [dx, dy] = self.filter.offset(u);
        self.eye.ray(x as f32 + 0.5 + dx, y as f32 + 0.5 + dy, lens)
    }

    /// The camera ray through the middle of a pixel.
    pub(crate) fn middle_ray(&self, x: u32, y: u32) -> Ray {
        self.eye.ray(x as f32 + 0.5, y as f32 + 0.5, [0.0; 2])
    }
}

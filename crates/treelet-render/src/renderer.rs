//! A picture in the making: checks everything once, then computes whole passes.

use crate::bsdf::{Albedos, Bsdf};
use crate::camera::Pinhole;
use crate::error::RenderError;
use crate::film::Film;
use crate::filter::Filter;
use crate::image::check_size;
use crate::integrator::{BROAD_ALPHA, PAIR_FILTER, World};
use crate::light::Lights;
use crate::sampler::Sampler;
use crate::settings::Settings;
use crate::sky::{Environment, default_sky};
use crate::surface::Surfaces;
use rayon::prelude::*;
use treelet::{Cancel, Ray};
use treelet_model::{Camera, Material, Model, PlacedModel};

/// Renders one model through one camera.
#[derive(Clone, Debug)]
pub struct Renderer<'a> {
    pub(crate) world: World<'a>,
    pub(crate) settings: Settings,
    pinhole: Pinhole,
    filter: Filter,
}

/// What a pass took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassStats {
    /// Rays that were traced, shadow rays included.
    pub rays: u64,
}

impl<'a> Renderer<'a> {
    /// Prepares to render `model`, which `placed` was built from, as `camera` sees it.
    ///
    /// Without a sky in the model, [`default_sky`] is used. Takes time and memory for tables of the
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
        let pinhole = Pinhole::new(camera, settings.width, settings.height)?;
        model.materials.iter().enumerate().try_for_each(|(i, m)| check_material(i, m))?;
        let surfaces = Surfaces::new(model)?;
        let environment = Environment::new(&default_sky(model, settings.up), settings.regularize)?;
        let lights = Lights::new(&surfaces, &model.materials, environment)?;

        let mut albedos = Albedos::default();
        let bsdfs = model.materials.iter().map(|material| {
            let plain = Bsdf::new(material, 0.0, &mut albedos);
            let broad = Bsdf::new(material, BROAD_ALPHA, &mut albedos);
            [plain, broad]
        });
        let bsdfs = bsdfs.collect();
        let materials = &model.materials;
        let world = World { placed, surfaces, materials, bsdfs, lights };
        Ok(Self { world, settings, pinhole, filter: Filter::new() })
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
    /// [`RenderError::Cancelled`] within about a millisecond once `cancel` is raised, and
    /// [`RenderError::FilmSize`] for a film of another size. Either way the film is as it was.
    pub fn pass(&self, film: &mut Film, cancel: &Cancel) -> Result<PassStats, RenderError> {
        let renderer = [self.settings.width, self.settings.height];
        let found = [film.width(), film.height()];
        if found != renderer {
            return Err(RenderError::FilmSize { film: found, renderer });
        }
        let sample = film.passes();
        let rays = film
            .pending
            .par_chunks_exact_mut(self.settings.width as usize)
            .enumerate()
            .map(|(y, row)| self.row(y as u32, sample, row, cancel))
            .try_reduce(|| 0, |a, b| Ok(a + b))?;
        film.commit();
        Ok(PassStats { rays })
    }

    fn row(
        &self,
        y: u32,
        sample: u32,
        row: &mut [[f32; 3]],
        cancel: &Cancel,
    ) -> Result<u64, RenderError> {
        let mut rays = 0;
        for (x, pixel) in row.iter_mut().enumerate() {
            if cancel.is_cancelled() {
                return Err(RenderError::Cancelled);
            }
            let x = x as u32;
            let sampler = Sampler::new(self.settings.seed, x, y, sample);
            let [dx, dy] = self.filter.offset(sampler.pair(PAIR_FILTER));
            let ray = self.pinhole.ray(x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
            let seen = self.world.trace(ray, &sampler, &self.settings);
            *pixel = seen.radiance;
            rays += seen.rays;
        }
        Ok(rays)
    }

    /// The camera ray through the middle of a pixel.
    pub(crate) fn middle_ray(&self, x: u32, y: u32) -> Ray {
        self.pinhole.ray(x as f32 + 0.5, y as f32 + 0.5)
    }
}

/// Names the first factor of a material that cannot be.
fn check_material(index: usize, material: &Material) -> Result<(), RenderError> {
    let [r, g, b] = material.base_color;
    let [er, eg, eb] = material.emission;
    let factors = [
        ("base_color[0]", r),
        ("base_color[1]", g),
        ("base_color[2]", b),
        ("emission[0]", er),
        ("emission[1]", eg),
        ("emission[2]", eb),
        ("metallic", material.metallic),
        ("roughness", material.roughness),
        ("transmission", material.transmission),
        ("ior", material.ior),
    ];
    match factors.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
        None => Ok(()),
        Some((factor, value)) => {
            let name = material.name.clone();
            Err(RenderError::MaterialFactor { material: index, name, factor, value })
        }
    }
}

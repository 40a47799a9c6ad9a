//! Many paths at once, one bounce after the other: their rays ask the library as slices, which it answers
//! faster than ray by ray, and where the time goes can be told without a clock in every ray.
//!
//! Source: S. Laine, T. Karras, T. Aila, "Megakernels Considered Harmful: Wavefront Path Tracing on GPUs",
//! HPG 2013, here for one thread of a CPU and with one stage for all materials. Paths that ended leave no
//! gaps. A path asks the same rays and adds the same light in the same order as if it were alone, so the
//! size of waves changes no bit of a picture.

use crate::path::Path;
use core::time::Duration;
use treelet::{Hit, Ray};

/// Paths that go together: enough for the library to sort them, few enough that their state stays in the cache of a
/// core, and that a picture is many waves for many threads.
pub(crate) const WAVE: usize = 4096;

/// Paths under way, and the light they found.
#[derive(Default)]
pub(crate) struct Wave {
    /// The light of each pixel of the wave.
    pub(crate) radiance: Vec<[f32; 3]>,
    pub(crate) paths: Vec<Path>,
    /// The ray that each path goes along next.
    pub(crate) rays: Vec<Ray>,
    pub(crate) hits: Vec<Hit>,
    pub(crate) shadows: Shadows,
    /// Rays that were traced.
    pub(crate) traced: u64,
    /// What the library's answers took.
    pub(crate) asking: Duration,
}

/// Light on its way to the paths' vertices, if nothing is in between.
#[derive(Default)]
pub(crate) struct Shadows {
    pub(crate) rays: Vec<Ray>,
    pub(crate) light: Vec<Arriving>,
    pub(crate) blocked: Vec<bool>,
}

/// Light for a pixel.
pub(crate) struct Arriving {
    pub(crate) pixel: u32,
    pub(crate) light: [f32; 3],
    /// Decides whether surfaces are there that are there by chance.
    pub(crate) chance: u32,
}

impl Wave {
    /// Begins anew, with nothing.
    pub(crate) fn clear(&mut self) {
        let Self { radiance, paths, rays, traced, asking, .. } = self;
        radiance.clear();
        paths.clear();
        rays.clear();
        (*traced, *asking) = (0, Duration::ZERO);
    }

    /// Adds a path for the next pixel.
    pub(crate) fn push(&mut self, ray: Ray, sampler: crate::sampler::Sampler) {
        let pixel = self.radiance.len() as u32;
        self.radiance.push([0.0; 3]);
        self.paths.push(Path::new(&ray, sampler, pixel));
        self.rays.push(ray);
    }
}

impl Shadows {
    pub(crate) fn clear(&mut self) {
        self.rays.clear();
        self.light.clear();
    }
}

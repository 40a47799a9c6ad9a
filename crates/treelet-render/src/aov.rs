//! Pictures of something else than light: what the middle of each pixel meets, and what finding it
//! cost. One camera ray a pixel, no filter, so a map judges a tree and not the noise.

use crate::error::RenderError;
use crate::heat::{self, Ramp};
use crate::image::Image;
use crate::renderer::Renderer;
use crate::tonemap::srgb8;
use rayon::prelude::*;
use treelet::{Cancel, Counters};

/// What can be shown instead of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// The shading normal in the world, -1 ..= 1 as 0 ..= 255 in each channel; black where nothing is.
    Normal,
    /// About the share of white light that comes back, by channel; white where nothing is.
    Albedo,
    /// A colour for each placement and part, no two neighbours alike; black where nothing is.
    Ids,
    /// The distance from the eye, near is light.
    Depth,
    /// How many nodes of the tree the ray entered.
    Visits,
    /// How many triangles the ray was tested against.
    Tests,
}

/// A line of the catalogue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Info {
    /// Which.
    pub aov: Aov,
    /// What users call it.
    pub name: &'static str,
    /// What it shows, in a few words.
    pub summary: &'static str,
}

/// Everything that can be shown instead of light.
pub const ALL: &[Info] = &[
    Info { aov: Aov::Normal, name: "normal", summary: "shading normals in the world" },
    Info { aov: Aov::Albedo, name: "albedo", summary: "the surface's own colour" },
    Info { aov: Aov::Ids, name: "ids", summary: "a colour for each placed part" },
    Info { aov: Aov::Depth, name: "depth", summary: "distance from the eye, with a scale" },
    Info { aov: Aov::Visits, name: "visits", summary: "tree nodes a ray enters, as a heat map" },
    Info { aov: Aov::Tests, name: "tests", summary: "triangle tests of a ray, as a heat map" },
];

impl Aov {
    /// The one that users call `name`.
    pub fn by_name(name: &str) -> Option<Self> {
        ALL.iter().find(|info| info.name == name).map(|info| info.aov)
    }
}

impl Renderer<'_> {
    /// Computes one of the pictures of [`ALL`], in parallel on the caller's rayon pool.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] once `cancel` is raised; if memory is refused.
    pub fn aov(&self, aov: Aov, cancel: &Cancel) -> Result<Image, RenderError> {
        let (width, height) = (self.settings.width, self.settings.height);
        let scaled =
            |values: Vec<f32>, ramp, title| heat::paint(&values, width, height, ramp, title);
        match aov {
            Aov::Normal => {
                let mut image = Image::filled(width, height, [0; 3])?;
                self.fill(image.pixels_mut(), cancel, |x, y| self.normal(x, y))?;
                Ok(image)
            }
            Aov::Albedo => {
                let mut image = Image::filled(width, height, [0; 3])?;
                self.fill(image.pixels_mut(), cancel, |x, y| self.albedo(x, y))?;
                Ok(image)
            }
            Aov::Ids => {
                let mut image = Image::filled(width, height, [0; 3])?;
                self.fill(image.pixels_mut(), cancel, |x, y| self.id_color(x, y))?;
                Ok(image)
            }
            Aov::Depth => {
                scaled(self.values(cancel, |x, y| self.depth(x, y))?, Ramp::Near, "DISTANCE")
            }
            Aov::Visits => {
                let nodes = |x, y| self.counters(x, y).nodes as f32;
                scaled(self.values(cancel, nodes)?, Ramp::Heat, "NODES ENTERED A RAY")
            }
            Aov::Tests => {
                let triangles = |x, y| self.counters(x, y).triangles as f32;
                scaled(self.values(cancel, triangles)?, Ramp::Heat, "TRIANGLE TESTS A RAY")
            }
        }
    }

    fn normal(&self, x: u32, y: u32) -> [u8; 3] {
        let ray = self.middle_ray(x, y);
        let hit = self.world.closest(&ray, 0);
        let surface = hit.and_then(|hit| self.world.surface(&hit, ray.direction));
        surface.map_or([0; 3], |s| s.shading.map(|c| ((0.5 * c + 0.5) * 255.0 + 0.5) as u8))
    }

    fn albedo(&self, x: u32, y: u32) -> [u8; 3] {
        self.guide(&self.middle_ray(x, y)).0.map(srgb8)
    }

    fn id_color(&self, x: u32, y: u32) -> [u8; 3] {
        let hit = self.world.closest(&self.middle_ray(x, y), 0);
        hit.map_or([0; 3], |hit| {
            let names = hit.inst << 20 ^ u64::from(hit.geom);
            // Neither near black nor near white.
            [0, 1, 2].map(|key| (70.0 + 170.0 * crate::sampler::hashed(names, key)) as u8)
        })
    }

    fn depth(&self, x: u32, y: u32) -> f32 {
        // The ray's direction is of unit length.
        self.world.closest(&self.middle_ray(x, y), 0).map_or(f32::INFINITY, |hit| hit.t)
    }

    fn counters(&self, x: u32, y: u32) -> Counters {
        let mut counters = Counters::default();
        self.world.placed.scene.closest_counted(&self.middle_ray(x, y), &mut counters);
        counters
    }

    /// A number for each pixel.
    fn values(
        &self,
        cancel: &Cancel,
        value: impl Fn(u32, u32) -> f32 + Sync,
    ) -> Result<Vec<f32>, RenderError> {
        let pixels = self.settings.width as usize * self.settings.height as usize;
        let mut values = Vec::new();
        let bytes = (pixels * size_of::<f32>()) as u64;
        values
            .try_reserve_exact(pixels)
            .map_err(|_| RenderError::OutOfMemory { bytes, what: "the map" })?;
        values.resize(pixels, 0.0);
        self.fill(&mut values, cancel, value)?;
        Ok(values)
    }

    /// Fills a plane of pixels, rows in parallel.
    fn fill<T: Send>(
        &self,
        plane: &mut [T],
        cancel: &Cancel,
        pixel: impl Fn(u32, u32) -> T + Sync,
    ) -> Result<(), RenderError> {
        plane.par_chunks_exact_mut(self.settings.width as usize).enumerate().try_for_each(
            |(y, row)| {
                for (x, out) in row.iter_mut().enumerate() {
                    if cancel.is_cancelled() {
                        return Err(RenderError::Cancelled);
                    }
                    *out = pixel(x as u32, y as u32);
                }
                Ok(())
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{ALL, Aov};

    #[test]
    fn names_lead_back() {
        for info in ALL {
            assert_eq!(Aov::by_name(info.name), Some(info.aov));
        }
        assert_eq!(Aov::by_name("beauty"), None);
    }
}

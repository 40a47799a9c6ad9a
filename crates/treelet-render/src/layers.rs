//! What the middle of each pixel meets, in numbers: the layers of an EXR file, and the guides of the
//! denoiser.

use crate::error::RenderError;
use crate::film::plane;
use crate::integrator::PAIR_FILTER;
use crate::renderer::Renderer;
use crate::sampler::Sampler;
use crate::vertex::Vertex;
use rayon::prelude::*;
use treelet::math::vec3;
use treelet::{Cancel, Counters, Ray};

/// Rays a pixel that albedo and normals are means of, so that their edges are as soft as the
/// picture's.
const GUIDE_RAYS: u32 = 8;

/// The planes, row by row from the top.
#[derive(Clone, Debug, Default)]
pub struct Layers {
    /// About the share of white light that comes back, over the pixel filter; 1 for the sky.
    pub albedo: Vec<[f32; 3]>,
    /// The mean shading normal in the world, over the pixel filter; zero for the sky.
    pub normal: Vec<[f32; 3]>,
    /// The distance from the eye; infinite for the sky.
    pub depth: Vec<f32>,
    /// Placement, part and triangle; all ones for the sky.
    pub ids: Vec<[u32; 3]>,
    /// Nodes of the tree that the ray entered.
    pub visits: Vec<u32>,
    /// Triangles that the ray was tested against.
    pub tests: Vec<u32>,
}

/// What one ray meets.
#[derive(Clone, Copy, Default)]
struct Met {
    albedo: [f32; 3],
    normal: [f32; 3],
    depth: f32,
    ids: [u32; 3],
    visits: u32,
    tests: u32,
}

impl Renderer<'_> {
    /// Traces the rays of all layers, in parallel on the caller's rayon pool.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] once `cancel` is raised; if memory is refused.
    pub fn layers(&self, cancel: &Cancel) -> Result<Layers, RenderError> {
        let width = self.settings.width as usize;
        let pixels = width * self.settings.height as usize;
        let mut met = plane(pixels, Met::default())?;
        met.par_chunks_exact_mut(width).enumerate().try_for_each(|(y, row)| {
            for (x, met) in row.iter_mut().enumerate() {
                if cancel.is_cancelled() {
                    return Err(RenderError::Cancelled);
                }
                *met = self.met(x as u32, y as u32);
            }
            Ok(())
        })?;
        Ok(Layers {
            albedo: met.iter().map(|met| met.albedo).collect(),
            normal: met.iter().map(|met| met.normal).collect(),
            depth: met.iter().map(|met| met.depth).collect(),
            ids: met.iter().map(|met| met.ids).collect(),
            visits: met.iter().map(|met| met.visits).collect(),
            tests: met.iter().map(|met| met.tests).collect(),
        })
    }

    fn met(&self, x: u32, y: u32) -> Met {
        // The middle: what is there, and what finding it cost.
        let ray = self.middle_ray(x, y);
        let mut counters = Counters::default();
        self.world.placed.scene.closest_counted(&ray, &mut counters);
        let hit = self.world.closest(&ray, 0);
        let mut met = Met { depth: f32::INFINITY, ids: [u32::MAX; 3], ..Met::default() };
        if let Some(hit) = hit {
            let placement = self.world.placed.placement_index(&hit);
            let placement = placement.and_then(|index| u32::try_from(index).ok());
            met.ids = [placement.unwrap_or(u32::MAX), hit.geom, hit.prim];
            met.depth = hit.t;
        }
        met.visits = counters.nodes as u32;
        met.tests = counters.triangles as u32;

        // The means.
        let share = 1.0 / GUIDE_RAYS as f32;
        for sample in 0..GUIDE_RAYS {
            let sampler = Sampler::new(self.settings.seed, x, y, sample);
            let ray = self.filtered_ray(x, y, sampler.pair(PAIR_FILTER), [0.0; 2]);
            let (albedo, normal) = self.guide(&ray);
            met.albedo = vec3::add(met.albedo, vec3::scale(albedo, share));
            met.normal = vec3::add(met.normal, vec3::scale(normal, share));
        }
        met
    }

    /// Albedo and normal where a ray ends.
    pub(crate) fn guide(&self, ray: &Ray) -> ([f32; 3], [f32; 3]) {
        let world = &self.world;
        let hit = world.closest(ray, 0);
        let surface = hit.and_then(|hit| world.surface(&hit, ray.direction));
        let Some(surface) = surface else { return ([1.0; 3], [0.0; 3]) };
        let mut room = None;
        let vertex = Vertex::new(world, surface, ray.direction, false, &mut room);
        (vertex.bsdf.albedo(), vertex.surface.shading)
    }
}

//! A vertex of a path: the surface there, and where the path goes on.

use crate::bsdf::{Bsdf, Lobes, Odds};
use crate::color;
use crate::frame::{Frame, unit};
use crate::integrator::World;
use crate::path::Path;
use crate::surface::Surface;
use treelet::Ray;
use treelet::math::vec3;

/// A direction drawn with a density below this came from a broad lobe (the peak of GGX of width
/// 0.14 is 4 per steradian), and regularisation starts.
const BROAD_PDF: f32 = 4.0;

/// A vertex of a path, in the frame of its normal.
pub(crate) struct Vertex<'a> {
    pub(crate) surface: Surface,
    pub(crate) bsdf: Bsdf<'a>,
    pub(crate) frame: Frame,
    pub(crate) wo: [f32; 3],
    pub(crate) odds: Odds,
    /// The geometric normal on the side of `wo`.
    pub(crate) facing: [f32; 3],
}

impl<'a> Vertex<'a> {
    /// The vertex where a ray along `direction` meets a surface; `regular` smooths its lobes,
    /// `room` is for numbers of its own.
    #[inline(always)]
    pub(crate) fn new(
        world: &'a World<'_>,
        mut surface: Surface,
        direction: [f32; 3],
        regular: bool,
        room: &'a mut Option<Lobes>,
    ) -> Self {
        let back = vec3::scale(direction, -1.0);
        let outside = vec3::dot(back, surface.geometric) >= 0.0;
        let facing = if outside { surface.geometric } else { vec3::scale(surface.geometric, -1.0) };
        surface.shading = world.materials.shading_normal(&world.surfaces, &surface);
        let frame = Frame::around(surface.shading_toward(back, facing));
        let wo = grazing_at_least(frame.to_local(back));
        let bsdf = world.materials.bsdf(&world.surfaces, &surface.on, outside, regular, room);
        let odds = bsdf.odds(wo);
        Self { surface, bsdf, frame, wo, odds, facing }
    }

    /// Sends the path on, along `ray`; `false` if it ends here.
    #[inline]
    pub(crate) fn scatter(&self, path: &mut Path, ray: &mut Ray, u_lobe: f32, u: [f32; 2]) -> bool {
        let Some(scattered) = self.bsdf.sample(&self.odds, self.wo, u_lobe, u) else {
            return false;
        };
        let mut direction = self.frame.to_world(scattered.wi);
        let through = scattered.wi[2] < 0.0;
        if through == (vec3::dot(direction, self.facing) > 0.0) {
            // The shading normal sends the light to the wrong side of the surface.
            if scattered.pdf > 0.0 {
                return false;
            }
            // Smooth glass tries again with the geometric normal, or its rim would be black.
            let frame = Frame::around(self.facing);
            let wo = grazing_at_least(frame.to_local(vec3::scale(ray.direction, -1.0)));
            match self.bsdf.sample(&self.bsdf.odds(wo), wo, u_lobe, u) {
                Some(again) if again.pdf == 0.0 => direction = frame.to_world(again.wi),
                _ => return false,
            }
        }
        // Frames are of unit vectors, so the length is about 1.
        let direction = unit(direction);
        path.throughput = color::mul(path.throughput, scattered.weight);
        path.pdf = scattered.pdf;
        if scattered.pdf > 0.0 {
            path.scattered += 1;
            path.broad |= scattered.pdf < BROAD_PDF;
        }
        *ray = Ray::new(self.surface.leave(direction), direction);
        color::max(path.throughput) > 0.0
    }
}

/// A direction lifted off the horizon, where lobes divide by its cosine.
#[inline]
fn grazing_at_least(w: [f32; 3]) -> [f32; 3] {
    const COS_MIN: f32 = 1e-5;
    [w[0], w[1], w[2].max(COS_MIN)]
}

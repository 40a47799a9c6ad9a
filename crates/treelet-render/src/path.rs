//! What a path carries, and how light is weighed by it.

use crate::color;
use crate::sampler::Sampler;
use crate::settings::{Settings, Strategy};
use treelet::Ray;
use treelet::math::vec3;

/// What a path has met so far.
#[derive(Clone, Copy)]
pub(crate) struct Path {
    pub(crate) sampler: Sampler,
    /// Which pixel of the wave its light is for.
    pub(crate) pixel: u32,
    pub(crate) throughput: [f32; 3],
    /// The density with which the ray's direction was drawn; 0 if nothing else could draw it.
    pub(crate) pdf: f32,
    /// The share of lights that are somewhere among the light samples where the ray starts.
    pub(crate) share: f32,
    /// The point that the ray starts from.
    pub(crate) from: [f32; 3],
    /// How often it was scattered otherwise than by smooth glass.
    pub(crate) scattered: u32,
    /// Whether it was scattered broadly, so that regularisation applies.
    pub(crate) broad: bool,
}

impl Path {
    /// A path that begins with a camera ray.
    #[inline]
    pub(crate) fn new(ray: &Ray, sampler: Sampler, pixel: u32) -> Self {
        Self {
            sampler,
            pixel,
            throughput: [1.0; 3],
            pdf: 0.0,
            share: 0.0,
            from: ray.origin,
            scattered: 0,
            broad: false,
        }
    }

    /// What light that the path's own ray met brings; `light_pdf` is the density of sampling it as
    /// a light.
    #[inline]
    pub(crate) fn met(
        &self,
        radiance: [f32; 3],
        settings: &Settings,
        light_pdf: impl Fn() -> f32,
    ) -> [f32; 3] {
        let weight = match settings.strategy {
            Strategy::Lobes => 1.0,
            _ if self.pdf == 0.0 => 1.0,
            Strategy::Both => power(self.pdf, light_pdf()),
            // What lights cannot sample is not theirs.
            Strategy::Lights => f32::from(u8::from(light_pdf() <= 0.0)),
        };
        self.brought(vec3::scale(radiance, weight), self.scattered, settings)
    }

    /// What light that was scattered so often brings, cut off if it is indirect.
    #[inline]
    pub(crate) fn brought(
        &self,
        radiance: [f32; 3],
        scattered: u32,
        settings: &Settings,
    ) -> [f32; 3] {
        let light = color::mul(self.throughput, radiance);
        if scattered >= 2 {
            let most = color::max(light);
            if most > settings.clamp_indirect {
                return vec3::scale(light, settings.clamp_indirect / most);
            }
        }
        light
    }
}

/// The power heuristic with exponent 2 for the strategy that drew the sample.
#[inline]
pub(crate) fn power(drawn: f32, other: f32) -> f32 {
    // As a quotient, so that no square overflows.
    let ratio = other / drawn;
    1.0 / (1.0 + ratio * ratio)
}

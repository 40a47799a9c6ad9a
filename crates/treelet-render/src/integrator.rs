//! The path tracer: one path a sample, light sampled at every vertex, both strategies weighed.
//!
//! Sources: J. Kajiya, "The Rendering Equation", SIGGRAPH 1986; E. Veach, "Robust Monte Carlo
//! Methods for Light Transport Simulation", 1997: multiple importance sampling with the power
//! heuristic (exponent 2, section 9.2.4), Russian roulette (section 10.4.1). Path regularisation: see `sky.rs`.
//!
//! A path of `n` vertices costs `n` rays and, where the surface is not smooth, `n` shadow rays.

use crate::bsdf::Bsdf;
use crate::color;
use crate::frame::Frame;
use crate::light::{LightNumbers, Lights};
use crate::sampler::Sampler;
use crate::settings::{Settings, Strategy};
use crate::surface::{Surface, Surfaces};
use treelet::math::vec3;
use treelet::{Hit, Ray};
use treelet_model::{Material, PlacedModel};

/// The pair of the sampler that the pixel filter takes.
pub(crate) const PAIR_FILTER: u32 = 0;
/// Pairs that one bounce takes, and what for.
const PAIRS_A_BOUNCE: u32 = 5;
const PAIR_LIGHT_KIND_AND_LOBE: u32 = 1;
const PAIR_LIGHT_INDEX: u32 = 2;
const PAIR_LIGHT_PLACE: u32 = 3;
const PAIR_DIRECTION: u32 = 4;
const PAIR_ROULETTE: u32 = 5;

/// Paths this long may end by chance, the dimmer the likelier.
const ROULETTE_START: u32 = 3;
/// Even the brightest path ends now and then, so that none goes on for nothing.
const SURVIVAL_MAX: f32 = 0.95;
/// A direction drawn with a density below this came from a broad lobe (the peak of GGX of width
/// 0.14 is 4 per steradian), and regularisation starts.
const BROAD_PDF: f32 = 4.0;
/// The least width of a mirror lobe that a regularised path meets.
pub(crate) const BROAD_ALPHA: f32 = 0.2;

/// What all paths share.
#[derive(Clone, Debug)]
pub(crate) struct World<'a> {
    pub(crate) placed: &'a PlacedModel,
    pub(crate) surfaces: Surfaces<'a>,
    pub(crate) materials: &'a [Material],
    /// For each material: as it is, and as a regularised path meets it.
    pub(crate) bsdfs: Vec<[Bsdf; 2]>,
    pub(crate) lights: Lights,
}

/// What a path has met so far.
struct Path {
    ray: Ray,
    throughput: [f32; 3],
    radiance: [f32; 3],
    /// The density with which the ray's direction was drawn; 0 if nothing else could draw it.
    pdf: f32,
    /// How often it was scattered otherwise than by smooth glass.
    scattered: u32,
    /// Whether it was scattered broadly, so that regularisation applies.
    broad: bool,
}

/// A vertex of a path, in the frame of its normal.
struct Vertex<'a> {
    surface: Surface,
    bsdf: &'a Bsdf,
    frame: Frame,
    wo: [f32; 3],
    /// The geometric normal on the side of `wo`.
    facing: [f32; 3],
    outside: bool,
}

/// The radiance that one sample sees along a camera ray, and how many rays that took.
pub(crate) struct Seen {
    pub(crate) radiance: [f32; 3],
    pub(crate) rays: u64,
}

impl World<'_> {
    /// Follows one path. A sample whose radiance is not finite counts as black.
    pub(crate) fn trace(&self, ray: Ray, sampler: &Sampler, settings: &Settings) -> Seen {
        let mut path = Path {
            ray,
            throughput: [1.0; 3],
            radiance: [0.0; 3],
            pdf: 0.0,
            scattered: 0,
            broad: false,
        };
        let mut rays = 0;
        for bounce in 0..=settings.max_bounces {
            // Find where the path goes, and what shines there.
            rays += 1;
            let Some(vertex) = self.meet(&mut path, settings) else { break };
            if bounce == settings.max_bounces {
                break;
            }

            // Add what the lights send here directly.
            let pair = PAIRS_A_BOUNCE * bounce;
            let [u_kind, u_lobe] = sampler.pair(pair + PAIR_LIGHT_KIND_AND_LOBE);
            if settings.strategy != Strategy::Lobes && !vertex.bsdf.is_smooth_only() {
                let [index, coin] = sampler.pair_bits(pair + PAIR_LIGHT_INDEX);
                let u = LightNumbers {
                    kind: u_kind,
                    index,
                    coin: crate::sampler::fraction(coin),
                    place: sampler.pair(pair + PAIR_LIGHT_PLACE),
                };
                rays += self.add_direct(&mut path, &vertex, u, settings);
            }

            // Go on in a direction of the surface's choice.
            let u = sampler.pair(pair + PAIR_DIRECTION);
            if !vertex.scatter(&mut path, u_lobe, u) {
                break;
            }
            if bounce + 1 >= ROULETTE_START {
                let survival = color::max(path.throughput).min(SURVIVAL_MAX);
                if sampler.pair(pair + PAIR_ROULETTE)[0] >= survival {
                    break;
                }
                path.throughput = vec3::scale(path.throughput, 1.0 / survival);
            }
        }
        let finite = vec3::is_finite(path.radiance);
        Seen { radiance: if finite { path.radiance } else { [0.0; 3] }, rays }
    }

    /// The surface under a hit of a ray along `direction`.
    #[inline]
    pub(crate) fn surface(&self, hit: &Hit, direction: [f32; 3]) -> Option<Surface> {
        self.surfaces.under(hit, self.placed.placement_index(hit)?, direction)
    }

    /// Traces the path's ray, adds the emission it meets, and returns the vertex; `None` ends the
    /// path in the sky.
    fn meet(&self, path: &mut Path, settings: &Settings) -> Option<Vertex<'_>> {
        let direction = path.ray.direction;
        let hit = self.placed.scene.closest(&path.ray);
        let surface = hit.and_then(|hit| Some((hit.t, self.surface(&hit, direction)?)));
        let Some((t, surface)) = surface else {
            // A smooth bounce after a broad one sees the widened sun.
            let wide = path.broad && path.pdf == 0.0;
            let radiance = self.lights.environment.radiance(direction, wide);
            path.add_met(radiance, settings, || self.lights.environment_pdf(direction));
            return None;
        };

        let emission = self.materials[surface.material as usize].emission;
        if color::max(emission) > 0.0 {
            let cos = vec3::dot(direction, surface.geometric);
            let distance_sq = f64::from(t) * f64::from(t);
            path.add_met(emission, settings, || {
                self.lights.emitter_pdf(emission, distance_sq, cos)
            });
        }
        let regular = settings.regularize && path.broad;
        let bsdf = &self.bsdfs[surface.material as usize][usize::from(regular)];
        Some(Vertex::new(surface, bsdf, direction))
    }

    /// Adds the light of one light sample; returns how many rays it took.
    fn add_direct(
        &self,
        path: &mut Path,
        vertex: &Vertex<'_>,
        u: LightNumbers,
        settings: &Settings,
    ) -> u64 {
        let sample = self.lights.sample(&self.surfaces, self.materials, &vertex.surface, u);
        let Some(sample) = sample else { return 0 };
        if vec3::dot(sample.direction, vertex.facing) <= 0.0 {
            return 0;
        }
        let (value, pdf) = vertex.bsdf.eval(vertex.wo, vertex.frame.to_local(sample.direction));
        if color::max(value) <= 0.0 || color::max(sample.radiance) <= 0.0 {
            return 0;
        }
        if !self.placed.scene.any(&sample.shadow) {
            let weight = match settings.strategy {
                Strategy::Both => power(sample.pdf, pdf),
                Strategy::Lights | Strategy::Lobes => 1.0,
            };
            let arriving = vec3::scale(color::mul(value, sample.radiance), weight / sample.pdf);
            path.add(arriving, path.scattered + 1, settings);
        }
        1
    }
}

impl Path {
    /// Adds light that the path's own ray met; `light_pdf` is the density of sampling it as a light.
    #[inline]
    fn add_met(&mut self, radiance: [f32; 3], settings: &Settings, light_pdf: impl Fn() -> f32) {
        let weight = match settings.strategy {
            Strategy::Lobes => 1.0,
            _ if self.pdf == 0.0 => 1.0,
            Strategy::Both => power(self.pdf, light_pdf()),
            // What lights cannot sample is not theirs.
            Strategy::Lights => f32::from(u8::from(light_pdf() <= 0.0)),
        };
        self.add(vec3::scale(radiance, weight), self.scattered, settings);
    }

    /// Adds light that was scattered so often, cut off if it is indirect.
    #[inline]
    fn add(&mut self, radiance: [f32; 3], scattered: u32, settings: &Settings) {
        let mut light = color::mul(self.throughput, radiance);
        if scattered >= 2 {
            let most = color::max(light);
            if most > settings.clamp_indirect {
                light = vec3::scale(light, settings.clamp_indirect / most);
            }
        }
        self.radiance = vec3::add(self.radiance, light);
    }
}

impl<'a> Vertex<'a> {
    fn new(surface: Surface, bsdf: &'a Bsdf, direction: [f32; 3]) -> Self {
        let back = vec3::scale(direction, -1.0);
        let outside = vec3::dot(back, surface.geometric) >= 0.0;
        let facing = if outside { surface.geometric } else { vec3::scale(surface.geometric, -1.0) };
        let frame = Frame::around(surface.shading_toward(back, facing));
        let wo = grazing_at_least(frame.to_local(back));
        Self { surface, bsdf, frame, wo, facing, outside }
    }

    /// Sends the path on; `false` if it ends here.
    fn scatter(&self, path: &mut Path, u_lobe: f32, u: [f32; 2]) -> bool {
        let Some(scattered) = self.bsdf.sample(self.wo, self.outside, u_lobe, u) else {
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
            let wo = grazing_at_least(frame.to_local(vec3::scale(path.ray.direction, -1.0)));
            match self.bsdf.sample(wo, self.outside, u_lobe, u) {
                Some(again) if again.pdf == 0.0 => direction = frame.to_world(again.wi),
                _ => return false,
            }
        }
        let Some(direction) = vec3::normalize(direction) else { return false };
        path.throughput = color::mul(path.throughput, scattered.weight);
        path.pdf = scattered.pdf;
        if scattered.pdf > 0.0 {
            path.scattered += 1;
            path.broad |= scattered.pdf < BROAD_PDF;
        }
        path.ray = Ray::new(self.surface.leave(direction), direction);
        color::max(path.throughput) > 0.0
    }
}

/// A direction lifted off the horizon, where lobes divide by its cosine.
#[inline]
fn grazing_at_least(w: [f32; 3]) -> [f32; 3] {
    const COS_MIN: f32 = 1e-5;
    [w[0], w[1], w[2].max(COS_MIN)]
}

/// The power heuristic with exponent 2 for the strategy that drew the sample.
#[inline]
fn power(drawn: f32, other: f32) -> f32 {
    // As a quotient, so that no square overflows.
    let ratio = other / drawn;
    1.0 / (1.0 + ratio * ratio)
}

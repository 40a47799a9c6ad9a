//! The path tracer: one path a sample, light sampled at every vertex, both strategies weighed.
//!
//! Sources: J. Kajiya, "The Rendering Equation", SIGGRAPH 1986; E. Veach, "Robust Monte Carlo
//! Methods for Light Transport Simulation", 1997: multiple importance sampling with the power
//! heuristic (exponent 2, section 9.2.4), Russian roulette (section 10.4.1). Path regularisation: see `sky.rs`.
//!
//! A path of `n` vertices costs `n` rays and, where the surface is not smooth, `n` shadow rays.

use crate::color;
use crate::light::{LightNumbers, Lights};
use crate::material::Materials;
use crate::path::{Path, power};
use crate::sampler::Sampler;
use crate::settings::{Settings, Strategy};
use crate::surface::{Surface, Surfaces};
use crate::vertex::Vertex;
use treelet::math::vec3;
use treelet::{Hit, Ray};
use treelet_model::PlacedModel;

/// The pairs of the sampler that the pixel filter and the lens take.
pub(crate) const PAIR_FILTER: u32 = 0;
pub(crate) const PAIR_LENS: u32 = 1;
/// Pairs that one bounce takes, and what for.
const PAIRS_A_BOUNCE: u32 = 6;
const PAIR_LIGHT_KIND_AND_LOBE: u32 = 2;
const PAIR_LIGHT_INDEX: u32 = 3;
const PAIR_LIGHT_PLACE: u32 = 4;
const PAIR_DIRECTION: u32 = 5;
const PAIR_ROULETTE: u32 = 6;
const PAIR_ALPHA: u32 = 7;

/// Paths this long may end by chance, the dimmer the likelier.
const ROULETTE_START: u32 = 3;
/// Even the brightest path ends now and then, so that none goes on for nothing.
const SURVIVAL_MAX: f32 = 0.95;

/// `2^90`: sums of such samples stay finite for as many passes as can be counted.
const RADIANCE_MAX: f32 = 1.237_940_039_285_380_3e27;

/// What all paths share.
#[derive(Clone, Debug)]
pub(crate) struct World<'a> {
    pub(crate) placed: &'a PlacedModel,
    pub(crate) surfaces: Surfaces<'a>,
    pub(crate) materials: Materials<'a>,
    pub(crate) lights: Lights<'a>,
}

/// The radiance that one sample sees along a camera ray, and how many rays that took.
pub(crate) struct Seen {
    pub(crate) radiance: [f32; 3],
    pub(crate) rays: u64,
}

impl World<'_> {
    /// Follows one path. A sample whose radiance overflows counts as black.
    pub(crate) fn trace(&self, ray: Ray, sampler: &Sampler, settings: &Settings) -> Seen {
        let mut path = Path::new(ray);
        let mut rays = 0;
        for bounce in 0..=settings.max_bounces {
            // Find where the path goes, and what shines there.
            let pair = PAIRS_A_BOUNCE * bounce;
            let chances = self.chances(sampler, pair);
            rays += 1;
            let Some(vertex) = self.meet(&mut path, chances[0], settings) else { break };
            if bounce == settings.max_bounces {
                break;
            }

            // Add what the lights send here directly.
            let [u_kind, u_lobe] = sampler.pair(pair + PAIR_LIGHT_KIND_AND_LOBE);
            if settings.strategy != Strategy::Lobes && !vertex.bsdf.is_smooth_only() {
                let u = LightNumbers {
                    kind: u_kind,
                    index: sampler.pair_bits(pair + PAIR_LIGHT_INDEX),
                    place: sampler.pair(pair + PAIR_LIGHT_PLACE),
                };
                rays += self.add_direct(&mut path, &vertex, u, chances[1], settings);
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
        let radiance = if finite { path.radiance.map(|c| c.min(RADIANCE_MAX)) } else { [0.0; 3] };
        Seen { radiance, rays }
    }

    /// Numbers that decide where surfaces are there by chance: for the path's ray and its shadow's.
    #[inline]
    fn chances(&self, sampler: &Sampler, pair: u32) -> [u32; 2] {
        if self.materials.any_alpha { sampler.pair_bits(pair + PAIR_ALPHA) } else { [0; 2] }
    }

    /// The first surface of a ray; holes are none.
    #[inline]
    pub(crate) fn closest(&self, ray: &Ray, chance: u32) -> Option<Hit> {
        let scene = &self.placed.scene;
        if !self.materials.any_alpha {
            return scene.closest(ray);
        }
        scene.closest_filtered(ray, |hit| self.is_there(hit, chance))
    }

    /// Whether something is in a ray's way.
    #[inline]
    fn is_blocked(&self, ray: &Ray, chance: u32) -> bool {
        let scene = &self.placed.scene;
        if !self.materials.any_alpha {
            return scene.any(ray);
        }
        scene.any_filtered(ray, |hit| self.is_there(hit, chance))
    }

    /// Whether there is surface where a ray meets a triangle. A pure function of the hit: where
    /// chance decides, the triangle's names and the ray's number are shuffled together.
    fn is_there(&self, hit: &Hit, chance: u32) -> bool {
        let placement = self.placed.placement_index(hit);
        let on = placement.and_then(|placement| self.surfaces.part_point(hit, placement));
        let Some(on) = on else { return true };
        !self.materials.has_alpha(on.material)
            || self.materials.is_there(&self.surfaces, &on, || {
                let names = u64::from(hit.prim) << 32 | u64::from(hit.geom);
                crate::sampler::hashed(names ^ hit.inst.rotate_left(17), chance)
            })
    }

    /// The surface under a hit of a ray along `direction`.
    #[inline]
    pub(crate) fn surface(&self, hit: &Hit, direction: [f32; 3]) -> Option<Surface> {
        self.surfaces.under(hit, self.placed.placement_index(hit)?, direction)
    }

    /// Traces the path's ray, adds the emission it meets, and returns the vertex; `None` ends the
    /// path.
    fn meet(&self, path: &mut Path, chance: u32, settings: &Settings) -> Option<Vertex<'_>> {
        let (direction, share) = (path.ray.direction, path.share);
        let hit = self.closest(&path.ray, chance);
        let surface = hit.and_then(|hit| Some((hit.t, self.surface(&hit, direction)?)));
        let Some((t, surface)) = surface else {
            // A smooth bounce after a broad one sees the widened sun.
            let wide = path.broad && path.pdf == 0.0;
            let radiance = self.lights.outside.radiance(direction, wide);
            path.add_met(radiance, settings, || self.lights.outside_pdf(share, direction));
            return None;
        };

        let cos = vec3::dot(direction, surface.geometric);
        if self.materials.unlit(surface.on.material) {
            // It is shown to the eye and to mirrors, and lights nothing.
            if path.pdf == 0.0 {
                let shown = self.materials.base_color(&self.surfaces, &surface.on);
                path.add(shown, path.scattered, settings);
            }
            return None;
        }
        let emission = self.materials.emission(&self.surfaces, &surface.on, cos <= 0.0);
        if color::max(emission) > 0.0 {
            let distance_sq = f64::from(t) * f64::from(t);
            let from = path.from;
            path.add_met(emission, settings, || {
                let (lights, surfaces) = (&self.lights, &self.surfaces);
                lights.emitter_pdf(surfaces, share, from, surface.on.at, distance_sq, cos)
            });
        }
        path.share = self.lights.emitter_share(surface.point);
        path.from = surface.point;
        let regular = settings.regularize && path.broad;
        Some(Vertex::new(self, surface, direction, regular))
    }

    /// Adds the light of one light sample; returns how many rays it took.
    fn add_direct(
        &self,
        path: &mut Path,
        vertex: &Vertex<'_>,
        u: LightNumbers,
        chance: u32,
        settings: &Settings,
    ) -> u64 {
        let (surfaces, materials) = (&self.surfaces, &self.materials);
        let sample = self.lights.sample(surfaces, materials, &vertex.surface, path.share, u);
        let Some(sample) = sample else { return 0 };
        // The side of the surface and that of its shading normal must be the same.
        let wi = vertex.frame.to_local(sample.direction);
        if (vec3::dot(sample.direction, vertex.facing) > 0.0) != (wi[2] > 0.0) {
            return 0;
        }
        let (value, pdf) = vertex.bsdf.eval(&vertex.odds, vertex.wo, wi);
        if color::max(value) <= 0.0 || color::max(sample.radiance) <= 0.0 {
            return 0;
        }
        if !self.is_blocked(&sample.shadow, chance) {
            let weight = match settings.strategy {
                Strategy::Both if !sample.alone => power(sample.pdf, pdf),
                _ => 1.0,
            };
            let arriving = vec3::scale(color::mul(value, sample.radiance), weight / sample.pdf);
            path.add(arriving, path.scattered + 1, settings);
        }
        1
    }
}

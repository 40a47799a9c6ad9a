//! The path tracer: one path a sample, light sampled at every vertex, both strategies weighed.
//!
//! Sources: J. Kajiya, "The Rendering Equation", SIGGRAPH 1986; E. Veach, "Robust Monte Carlo
//! Methods for Light Transport Simulation", 1997: multiple importance sampling with the power
//! heuristic (exponent 2, section 9.2.4), Russian roulette (section 10.4.1). Path regularisation: see `sky.rs`.
//!
//! A path of `n` vertices costs `n` rays and, where the surface is not smooth, `n` shadow rays. Many paths
//! go together: `wave.rs`.

use crate::bsdf::Lobes;
use crate::color;
use crate::error::RenderError;
use crate::light::{LightNumbers, Lights};
use crate::material::Materials;
use crate::path::{Path, power};
use crate::sampler::Sampler;
use crate::settings::{Settings, Strategy};
use crate::surface::{Place, Surface, Surfaces};
use crate::vertex::Vertex;
use crate::wave::{Arriving, Shadows, Wave};
use treelet::context::clock::Stopwatch;
use treelet::math::vec3;
use treelet::{Cancel, Hit, Ray};
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
/// Hits whose triangles are fetched at once: 256 bytes each.
const FETCHED: usize = 256;

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

impl World<'_> {
    /// Follows all paths of a wave to their ends. A sample whose radiance overflows counts as black.
    pub(crate) fn follow(
        &self,
        wave: &mut Wave,
        settings: &Settings,
        cancel: &Cancel,
    ) -> Result<(), RenderError> {
        let check = || cancel.check().map_err(|_| RenderError::Cancelled);
        for bounce in 0..=settings.max_bounces {
            check()?;
            if wave.paths.is_empty() {
                break;
            }
            self.find_hits(wave, bounce);
            check()?;
            self.step_all(wave, bounce, settings);
            check()?;
            self.add_unblocked(wave);
        }
        for radiance in &mut wave.radiance {
            let [r, g, b] = *radiance;
            let finite = vec3::is_finite([r, g, b]);
            let most = RADIANCE_MAX;
            *radiance = if finite { [r.min(most), g.min(most), b.min(most)] } else { [0.0; 3] };
        }
        Ok(())
    }

    /// Finds the first surface of each path's ray.
    fn find_hits(&self, wave: &mut Wave, bounce: u32) {
        let Wave { paths, rays, hits, .. } = wave;
        let watch = Stopwatch::start();
        hits.resize(rays.len(), Hit::MISS);
        if self.materials.any_alpha {
            for ((path, ray), hit) in paths.iter().zip(&*rays).zip(&mut *hits) {
                let [chance, _] = chances(&path.sampler, bounce);
                *hit = self.closest(ray, chance).unwrap_or(Hit::MISS);
            }
        } else {
            let answered = self.placed.scene.closest_many(rays, hits);
            debug_assert!(answered.is_ok(), "as many hits as rays");
        }
        wave.traced += rays.len() as u64;
        wave.asking += watch.elapsed();
    }

    /// Takes each path to its next ray; those that end are dropped.
    fn step_all(&self, wave: &mut Wave, bounce: u32, settings: &Settings) {
        let Wave { radiance, paths, rays, hits, shadows, .. } = wave;
        shadows.clear();
        let mut kept = 0;
        for index in 0..paths.len() {
            if index % FETCHED == 0 {
                let soon = &hits[index..hits.len().min(index + FETCHED)];
                self.surfaces.fetch(soon.iter().filter_map(|hit| self.place(hit)));
            }
            let (path, ray) = (&mut paths[index], &mut rays[index]);
            let light = &mut radiance[path.pixel as usize];
            if self.step(path, ray, &hits[index], bounce, settings, light, shadows) {
                if kept < index {
                    (paths[kept], rays[kept]) = (paths[index], rays[index]);
                }
                kept += 1;
            }
        }
        paths.truncate(kept);
        rays.truncate(kept);
    }

    /// Adds the light that nothing is in the way of.
    fn add_unblocked(&self, wave: &mut Wave) {
        let Wave { radiance, shadows: Shadows { rays, light, blocked }, .. } = wave;
        let watch = Stopwatch::start();
        blocked.resize(rays.len(), false);
        if self.materials.any_alpha {
            for ((ray, light), blocked) in rays.iter().zip(&*light).zip(&mut *blocked) {
                *blocked = self.is_blocked(ray, light.chance);
            }
        } else {
            let answered = self.placed.scene.any_many(rays, blocked);
            debug_assert!(answered.is_ok(), "as many answers as rays");
        }
        wave.traced += rays.len() as u64;
        wave.asking += watch.elapsed();
        for (light, blocked) in light.iter().zip(&*blocked) {
            if !blocked {
                let sum = &mut radiance[light.pixel as usize];
                *sum = vec3::add(*sum, light.light);
            }
        }
    }

    /// Adds what a path's ray met to `light`, and what lights may send there to `shadows`; then sends
    /// the path on. `false` if it ends.
    #[inline]
    #[expect(clippy::too_many_arguments, reason = "the parts of a wave, borrowed one by one")]
    fn step(
        &self,
        path: &mut Path,
        ray: &mut Ray,
        hit: &Hit,
        bounce: u32,
        settings: &Settings,
        light: &mut [f32; 3],
        shadows: &mut Shadows,
    ) -> bool {
        // Add what shines where the path goes.
        let mut room = None;
        let vertex = self.meet(path, ray, hit, settings, light, &mut room);
        let Some(vertex) = &vertex else { return false };
        if bounce == settings.max_bounces {
            return false;
        }

        // Ask whether what the lights send here arrives.
        let pair = PAIRS_A_BOUNCE * bounce;
        let [u_kind, u_lobe] = path.sampler.pair(pair + PAIR_LIGHT_KIND_AND_LOBE);
        if settings.strategy != Strategy::Lobes && !vertex.bsdf.is_smooth_only() {
            self.ask_lights(path, vertex, bounce, u_kind, settings, shadows);
        }

        // Go on in a direction of the surface's choice.
        let u = path.sampler.pair(pair + PAIR_DIRECTION);
        if !vertex.scatter(path, ray, u_lobe, u) {
            return false;
        }
        if bounce + 1 >= ROULETTE_START {
            let survival = color::max(path.throughput).min(SURVIVAL_MAX);
            if path.sampler.pair(pair + PAIR_ROULETTE)[0] >= survival {
                return false;
            }
            path.throughput = vec3::scale(path.throughput, 1.0 / survival);
        }
        true
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
        self.placed.scene.any_filtered(ray, |hit| self.is_there(hit, chance))
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

    /// The triangle of a hit.
    #[inline]
    fn place(&self, hit: &Hit) -> Option<Place> {
        let placement = self.placed.placement_index(hit).filter(|_| hit.is_hit())?;
        Some(Place { placement: placement as u32, geom: hit.geom, prim: hit.prim })
    }

    /// The surface under a hit of a ray along `direction`.
    #[inline]
    pub(crate) fn surface(&self, hit: &Hit, direction: [f32; 3]) -> Option<Surface> {
        self.surfaces.under(hit, self.placed.placement_index(hit)?, direction)
    }

    /// Adds the emission that the path's ray meets to `light`, and returns the vertex; `None` ends the
    /// path.
    #[inline(always)]
    fn meet<'v>(
        &'v self,
        path: &mut Path,
        ray: &Ray,
        hit: &Hit,
        settings: &Settings,
        light: &mut [f32; 3],
        room: &'v mut Option<Lobes>,
    ) -> Option<Vertex<'v>> {
        let (direction, share) = (ray.direction, path.share);
        let surface = if hit.is_hit() { self.surface(hit, direction) } else { None };
        let Some(surface) = surface else {
            // A smooth bounce after a broad one sees the widened sun.
            let wide = path.broad && path.pdf == 0.0;
            let radiance = self.lights.outside.radiance(direction, wide);
            let pdf = || self.lights.outside_pdf(share, direction);
            *light = vec3::add(*light, path.met(radiance, settings, pdf));
            return None;
        };

        let cos = vec3::dot(direction, surface.geometric);
        if self.materials.unlit(surface.on.material) {
            // It is shown to the eye and to mirrors, and lights nothing.
            if path.pdf == 0.0 {
                let shown = self.materials.base_color(&self.surfaces, &surface.on);
                *light = vec3::add(*light, path.brought(shown, path.scattered, settings));
            }
            return None;
        }
        let emission = self.materials.emission(&self.surfaces, &surface.on, cos <= 0.0);
        if color::max(emission) > 0.0 {
            let distance_sq = f64::from(hit.t) * f64::from(hit.t);
            let found = path.met(emission, settings, || {
                let (lights, surfaces, from) = (&self.lights, &self.surfaces, path.from);
                lights.emitter_pdf(surfaces, share, from, surface.on.at, distance_sq, cos)
            });
            *light = vec3::add(*light, found);
        }
        path.share = self.lights.emitter_share(surface.point);
        path.from = surface.point;
        let regular = settings.regularize && path.broad;
        Some(Vertex::new(self, surface, direction, regular, room))
    }

    /// Draws light for a vertex, and asks whether it arrives.
    #[inline(always)]
    fn ask_lights(
        &self,
        path: &Path,
        vertex: &Vertex<'_>,
        bounce: u32,
        kind: f32,
        settings: &Settings,
        shadows: &mut Shadows,
    ) {
        let (surfaces, materials, pair) =
            (&self.surfaces, &self.materials, PAIRS_A_BOUNCE * bounce);
        let u = LightNumbers {
            kind,
            index: || path.sampler.pair_bits(pair + PAIR_LIGHT_INDEX),
            place: path.sampler.pair(pair + PAIR_LIGHT_PLACE),
        };
        let sample = self.lights.sample(surfaces, materials, &vertex.surface, path.share, u);
        let Some(sample) = &sample else { return };
        // The side of the surface and that of its shading normal must be the same.
        let wi = vertex.frame.to_local(sample.direction);
        if (vec3::dot(sample.direction, vertex.facing) > 0.0) != (wi[2] > 0.0) {
            return;
        }
        let (value, pdf) = vertex.bsdf.eval(&vertex.odds, vertex.wo, wi);
        if color::max(value) <= 0.0 || color::max(sample.radiance) <= 0.0 {
            return;
        }
        let weight = match settings.strategy {
            Strategy::Both if !sample.alone => power(sample.pdf, pdf),
            _ => 1.0,
        };
        let arriving = vec3::scale(color::mul(value, sample.radiance), weight / sample.pdf);
        let light = path.brought(arriving, path.scattered + 1, settings);
        let chance = if materials.any_alpha { chances(&path.sampler, bounce)[1] } else { 0 };
        shadows.rays.push(sample.shadow);
        shadows.light.push(Arriving { pixel: path.pixel, light, chance });
    }
}

/// Numbers that decide where surfaces are there by chance: for the path's ray and its shadow's.
#[inline]
fn chances(sampler: &Sampler, bounce: u32) -> [u32; 2] {
    sampler.pair_bits(PAIRS_A_BOUNCE * bounce + PAIR_ALPHA)
}

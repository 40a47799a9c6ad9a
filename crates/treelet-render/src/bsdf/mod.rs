//! What surfaces do with light: the glTF 2.0 metallic-roughness model, one lobe a file.
//!
//! A surface is three things at once, in shares that add up to 1: a metal (`metallic`), glass
//! (`transmission` of the rest), and a coated diffuse base (what remains). Metal and coat are one
//! GGX lobe with two reflectances. The coat takes what it reflects away from the base (`albedo.rs`),
//! so that a white surface of any roughness loses nothing and gains nothing.
//!
//! Differs from the glTF appendix B: Fresnel's equations instead of Schlick's fit for dielectrics,
//! so that an index of refraction of 1 is plain Lambert; an energy-conserving base; metals brought
//! up to full albedo; glass is solid and smooth.

mod albedo;
mod diffuse;
mod fresnel;
mod ggx;
mod glass;

pub(crate) use albedo::Albedos;

use crate::color;
use albedo::Albedo;
use ggx::Ggx;
use glass::Passage;
use std::sync::Arc;
use treelet_model::Material;

/// A material, prepared for shading.
#[derive(Clone, Debug)]
pub(crate) struct Bsdf {
    ggx: Ggx,
    /// Shares of metal, glass and coated base; they add up to 1.
    metal: f32,
    glass: f32,
    base: f32,
    /// Reflectance of the metal at normal incidence, and albedo of the base.
    color: [f32; 3],
    /// The tint of one passage through the boundary: the root of the colour, as light goes in and out.
    tint: [f32; 3],
    ior: f32,
    coat: Arc<Albedo>,
    mirror: Arc<Albedo>,
}

/// A direction drawn by [`Bsdf::sample`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scattered {
    /// Where the path goes on, in the frame of the normal.
    pub(crate) wi: [f32; 3],
    /// Value times cosine over density.
    pub(crate) weight: [f32; 3],
    /// Density over solid angle; 0 for a direction that no other strategy can draw.
    pub(crate) pdf: f32,
}

/// The probabilities of drawing from each lobe.
struct Odds {
    glass: f32,
    mirror: f32,
    base: f32,
}

impl Bsdf {
    /// Prepares a material; factors above their range count as its end. Not less rough than
    /// `alpha_min`.
    pub(crate) fn new(material: &Material, alpha_min: f32, albedos: &mut Albedos) -> Self {
        let color = material.base_color.map(|c| c.clamp(0.0, 1.0));
        let metal = material.metallic.clamp(0.0, 1.0);
        let glass = (1.0 - metal) * material.transmission.clamp(0.0, 1.0);
        let roughness = material.roughness.clamp(0.0, 1.0);
        let alpha = (roughness * roughness).max(ggx::ALPHA_MIN).max(alpha_min);
        let ior = material.ior.clamp(1.0, IOR_MAX);
        Self {
            ggx: Ggx { alpha },
            metal,
            glass,
            base: (1.0 - metal - glass).max(0.0),
            color,
            tint: color.map(f32::sqrt),
            ior,
            coat: albedos.coat(alpha, ior),
            mirror: albedos.mirror(alpha),
        }
    }

    /// Whether light from a sampled direction can be scattered at all: not by glass alone.
    pub(crate) fn is_smooth_only(&self) -> bool {
        self.metal == 0.0 && self.base == 0.0
    }

    /// Value times the cosine of `wi`, and the density with which [`Bsdf::sample`] draws `wi`.
    /// `wo` is in the upper hemisphere; zero unless `wi` is too.
    pub(crate) fn eval(&self, wo: [f32; 3], wi: [f32; 3]) -> ([f32; 3], f32) {
        if wi[2] <= 0.0 || wo[2] <= 0.0 {
            return ([0.0; 3], 0.0);
        }
        let odds = self.odds(wo);
        let mut value = [0.0; 3];
        let mut pdf = 0.0;

        // The base under its coat.
        if self.base > 0.0 {
            let coat = &self.coat;
            let through = (1.0 - coat.at(wo[2])) * (1.0 - coat.at(wi[2])) / (1.0 - coat.mean);
            let lambert = diffuse::density(wi[2]);
            value = self.color.map(|c| self.base * c * through * lambert);
            pdf += odds.base * lambert;
        }

        // The coat and the metal.
        if odds.mirror > 0.0 {
            let (mirror, density, cos) = self.ggx.eval(wo, wi);
            let reflectance = self.reflectance(wo[2], cos);
            for c in 0..3 {
                value[c] += mirror * reflectance[c];
            }
            pdf += odds.mirror * density;
        }
        (value, pdf)
    }

    /// Draws a direction for `wo` in the upper hemisphere; `None` absorbs.
    ///
    /// `outside` says whether `wo` is on the side the geometric normal points to; `u_lobe` and `u`
    /// are in the unit interval and square, 1 excluded.
    pub(crate) fn sample(
        &self,
        wo: [f32; 3],
        outside: bool,
        u_lobe: f32,
        u: [f32; 2],
    ) -> Option<Scattered> {
        let odds = self.odds(wo);
        if u_lobe < odds.glass {
            return Some(self.sample_glass(wo, outside, u_lobe / odds.glass, odds.glass));
        }
        let wi = if u_lobe < odds.glass + odds.mirror {
            self.ggx.sample(wo, u)
        } else {
            diffuse::sample(u)
        };
        let (value, pdf) = self.eval(wo, wi);
        (pdf > 0.0).then(|| Scattered { wi, weight: value.map(|v| v / pdf), pdf })
    }

    fn sample_glass(&self, wo: [f32; 3], outside: bool, u: f32, odds: f32) -> Scattered {
        let eta = if outside { self.ior } else { 1.0 / self.ior };
        let share = self.glass / odds;
        let (wi, weight) = match glass::sample(wo, eta, u) {
            Passage::Reflected(wi) => (wi, [share; 3]),
            Passage::Refracted(wi) => (wi, self.tint.map(|c| share * c)),
        };
        Scattered { wi, weight, pdf: 0.0 }
    }

    /// The mirror lobe's reflectance, metal and coat together, by the cosines of `wo` with the
    /// normal and with the facet.
    fn reflectance(&self, cos_normal: f32, cos_facet: f32) -> [f32; 3] {
        let coat = self.base * fresnel::dielectric(cos_facet, self.ior);
        if self.metal == 0.0 {
            return [coat; 3];
        }
        let kept = self.mirror.at(cos_normal);
        let lost_again = (1.0 - kept) / kept.max(f32::MIN_POSITIVE);
        let rise = fresnel::schlick(cos_facet);
        self.color.map(|f0| coat + self.metal * (f0 + (1.0 - f0) * rise) * (1.0 + f0 * lost_again))
    }

    /// Lobes are chosen by about what they reflect.
    fn odds(&self, wo: [f32; 3]) -> Odds {
        let coat = self.coat.at(wo[2]);
        let mirror = self.base * coat + self.metal * color::luminance(self.color).max(METAL_LEAST);
        let base = self.base * (1.0 - coat) * color::luminance(self.color);
        let sum = self.glass + mirror + base;
        if sum <= 0.0 {
            // A black surface with no coat: any odds do, as every value is 0.
            return Odds { glass: 0.0, mirror: 0.0, base: 1.0 };
        }
        Odds { glass: self.glass / sum, mirror: mirror / sum, base: base / sum }
    }
}

/// Diamond has 2.4; beyond this the coat is a mirror.
const IOR_MAX: f32 = 100.0;

/// Even a black metal shines at grazing angles, so its lobe is tried this often.
const METAL_LEAST: f32 = 0.1;

//! What surfaces do with light: the glTF 2.0 metallic-roughness model with its common extensions,
//! one lobe a file.
//!
//! A surface is three things at once, in shares that add up to 1: a metal (`metallic`), glass
//! (`transmission` of the rest), and a coated diffuse base (what remains). Metal and coat are one
//! GGX lobe with two reflectances. The coat takes what it reflects away from the base (`albedo.rs`),
//! so that a white surface of any roughness loses nothing and gains nothing. Over all of it may lie
//! a clear coat, another GGX lobe of index 1.5, which likewise takes away what it reflects.
//!
//! Differs from the glTF appendix B: Fresnel's equations instead of Schlick's fit for dielectrics,
//! so that an index of refraction of 1 is plain Lambert; an energy-conserving base; metals and
//! rough glass brought up to full albedo. All lobes are reciprocal.

mod albedo;
mod diffuse;
mod fresnel;
pub(crate) mod ggx;
mod glass;
mod sample;
mod tables;
#[cfg(test)]
mod tests;

pub(crate) use albedo::Albedos;
pub(crate) use tables::Tables;

use crate::color;
use ggx::Ggx;
use treelet::math::vec3;

/// The numbers of a material at a point, as a model gives them; any value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors {
    pub(crate) base_color: [f32; 3],
    pub(crate) metallic: f32,
    pub(crate) roughness: f32,
    pub(crate) transmission: f32,
    pub(crate) specular: [f32; 3],
    pub(crate) clear_coat: f32,
    pub(crate) clear_coat_roughness: f32,
    pub(crate) thin_walled: bool,
}

/// A surface at a point, prepared for shading. Directions are in the frame of the normal on the
/// side of the viewer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bsdf<'a> {
    tables: &'a Tables,
    lobes: &'a Lobes,
    /// Index of refraction of the far side over that of the viewer's.
    eta: f32,
    /// Whether the viewer is on the side the geometric normal points to.
    outside: bool,
}

/// The numbers of a surface, in their ranges: the same from all sides, so that where no texture
/// changes them they are found once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobes {
    ggx: Ggx,
    /// Perceptual: what the tables are asked for.
    roughness: f32,
    /// Shares of metal, glass and coated base; they add up to 1.
    metal: f32,
    glass: f32,
    base: f32,
    /// Reflectance of the metal at normal incidence, and albedo of the base.
    color: [f32; 3],
    luminance: f32,
    /// Factor on the coat's reflection, and its largest channel.
    specular: [f32; 3],
    specular_max: f32,
    /// The reciprocal of what the coat lets out of the base in the mean.
    over_mean: f32,
    clear: f32,
    clear_ggx: Ggx,
    clear_roughness: f32,
    glass_kind: GlassKind,
}

/// How light comes through.
#[derive(Clone, Copy, Debug, PartialEq)]
enum GlassKind {
    Smooth,
    SmoothThin,
    Rough(Ggx, f32),
    RoughThin(Ggx, f32),
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

/// The probabilities of drawing from each lobe, for one view.
#[derive(Clone, Copy)]
pub(crate) struct Odds {
    glass: f32,
    clear: f32,
    mirror: f32,
    diffuse: f32,
    /// What the coat lets out of the base toward the view, over what it lets out in the mean.
    out: f32,
}

/// Even a black metal shines at grazing angles, so its lobe is tried this often.
const METAL_LEAST: f32 = 0.1;

impl Lobes {
    /// Prepares numbers; those above their range count as its end.
    pub(crate) fn new(tables: &Tables, factors: &Factors) -> Self {
        let unit = |x: f32| x.clamp(0.0, 1.0);
        let all = |[r, g, b]: [f32; 3]| [unit(r), unit(g), unit(b)];
        let metal = unit(factors.metallic);
        let glass = (1.0 - metal) * unit(factors.transmission);
        let plain = unit(factors.roughness);
        let roughness = plain.max(tables.roughness_min);
        let clear_roughness = unit(factors.clear_coat_roughness).max(tables.roughness_min);
        let (color, specular) = (all(factors.base_color), all(factors.specular));
        let specular_max = color::max(specular);
        let smooth = plain * plain <= ggx::ALPHA_MIN
            || !factors.thin_walled && tables.ior - 1.0 < glass::BENDS_LEAST;
        let glass_kind = match (smooth, factors.thin_walled) {
            (true, false) => GlassKind::Smooth,
            (true, true) => GlassKind::SmoothThin,
            (false, false) => GlassKind::Rough(Ggx::of_roughness(plain), plain),
            (false, true) => GlassKind::RoughThin(Ggx::of_roughness(plain), plain),
        };
        Self {
            ggx: Ggx::of_roughness(roughness),
            roughness,
            metal,
            glass,
            base: (1.0 - metal - glass).max(0.0),
            color,
            luminance: color::luminance(color),
            specular,
            specular_max,
            over_mean: 1.0 / (1.0 - specular_max * tables.coat.mean(roughness)).max(1e-6),
            clear: unit(factors.clear_coat),
            clear_ggx: Ggx::of_roughness(clear_roughness),
            clear_roughness,
            glass_kind,
        }
    }
}

impl<'a> Bsdf<'a> {
    /// The surface with these numbers; `outside` says whether the viewer is on the side the
    /// geometric normal points to.
    #[inline]
    pub(crate) fn new(tables: &'a Tables, lobes: &'a Lobes, outside: bool) -> Self {
        let eta = if outside { tables.ior } else { 1.0 / tables.ior };
        Self { tables, lobes, eta, outside }
    }

    /// Whether light from a sampled direction cannot be scattered at all: by smooth glass alone.
    pub(crate) fn is_smooth_only(&self) -> bool {
        let rough =
            matches!(self.lobes.glass_kind, GlassKind::Rough(..) | GlassKind::RoughThin(..));
        self.lobes.metal == 0.0 && self.lobes.base == 0.0 && self.lobes.clear == 0.0 && !rough
    }

    /// What the surface looks like in white light, about: for the guides of a denoiser.
    pub(crate) fn albedo(&self) -> [f32; 3] {
        let white = self.lobes.glass;
        self.lobes.color.map(|c| (1.0 - white) * c + white)
    }

    /// Value times the cosine of `wi`, and the density with which [`Bsdf::sample`] draws `wi`.
    /// `wo` is in the upper hemisphere, `odds` are those of it.
    pub(crate) fn eval(&self, odds: &Odds, wo: [f32; 3], wi: [f32; 3]) -> ([f32; 3], f32) {
        if wo[2] <= 0.0 || wi[2] == 0.0 {
            return ([0.0; 3], 0.0);
        }
        if wi[2] < 0.0 {
            return self.eval_glass(wo, wi, odds);
        }
        let (mut value, mut pdf) = ([0.0; 3], 0.0);
        if self.lobes.glass > 0.0 {
            (value, pdf) = self.eval_glass(wo, wi, odds);
        }

        // The base under its coat, and what the metal's facets lose.
        let (under, under_diffuse) = self.under_clear(wo[2], wi[2]);
        let lambert = diffuse::density(wi[2]);
        if self.lobes.base > 0.0 {
            let kept =
                1.0 - self.lobes.specular_max * self.tables.coat.at(self.lobes.roughness, wi[2]);
            let through = odds.out * kept * lambert * under_diffuse * self.lobes.base;
            value = added(value, self.lobes.color, through);
        }
        if self.lobes.metal > 0.0 {
            let again = self.lobes.metal * self.lost_by_metal(wo[2], wi[2]) * lambert * under;
            let mean = self.tables.mirror.mean(self.lobes.roughness);
            let [r, g, b] = self.lobes.color;
            value = added(value, [bounced(r, mean), bounced(g, mean), bounced(b, mean)], again);
        }
        pdf += odds.diffuse * lambert;

        // The coat and the metal.
        if odds.mirror > 0.0 {
            let (mirror, density, cos) = self.lobes.ggx.eval(wo, wi);
            let reflectance = self.reflectance(cos);
            value = added(value, reflectance, mirror * under);
            pdf += odds.mirror * density;
        }

        // The clear coat.
        if odds.clear > 0.0 {
            let (mirror, density, cos) = self.lobes.clear_ggx.eval(wo, wi);
            let shine = self.lobes.clear * fresnel::dielectric(cos, tables::CLEAR_IOR) * mirror;
            value = added(value, [1.0; 3], shine);
            pdf += odds.clear * density;
        }
        (value, pdf)
    }

    /// The mirror lobe's reflectance, metal and coat together, by the cosine with the facet.
    #[inline]
    fn reflectance(&self, cos: f32) -> [f32; 3] {
        let coat =
            if self.lobes.base > 0.0 { fresnel::dielectric(cos, self.tables.ior) } else { 0.0 };
        let coat = vec3::scale(self.lobes.specular, self.lobes.base * coat);
        if self.lobes.metal == 0.0 {
            return coat;
        }
        let metal = color::mix(self.lobes.color, [1.0; 3], fresnel::schlick(cos));
        added(coat, metal, self.lobes.metal)
    }

    /// What single bounces between the metal's facets lose, spread over directions.
    #[inline]
    fn lost_by_metal(&self, cos_o: f32, cos_i: f32) -> f32 {
        let mirror = &self.tables.mirror;
        let lost = |cos| 1.0 - mirror.at(self.lobes.roughness, cos);
        lost(cos_o) * lost(cos_i) / (1.0 - mirror.mean(self.lobes.roughness)).max(1e-6)
    }

    /// What the clear coat leaves of light on its way in and out, for lobes around a mirror
    /// direction and for diffuse ones.
    ///
    /// The second loses nothing on a diffuse base. The first is exact for mirrors, reciprocal, never
    /// gains, and loses up to a tenth under grazing views of rough lobes. The geometric mean of the
    /// two passages, which was tried, gains 8 % there.
    #[inline]
    fn under_clear(&self, cos_o: f32, cos_i: f32) -> (f32, f32) {
        if self.lobes.clear == 0.0 {
            return (1.0, 1.0);
        }
        let clear = &self.tables.clear;
        let kept = |cos| 1.0 - self.lobes.clear * clear.at(self.lobes.clear_roughness, cos);
        let (out, back) = (kept(cos_o), kept(cos_i));
        (
            out.min(back),
            out * back / (1.0 - self.lobes.clear * clear.mean(self.lobes.clear_roughness)),
        )
    }

    /// Lobes are chosen by about what they scatter; to be found once for each view.
    #[inline]
    pub(crate) fn odds(&self, wo: [f32; 3]) -> Odds {
        let luminance = self.lobes.luminance;
        let mut odds =
            Odds { glass: self.lobes.glass, clear: 0.0, mirror: 0.0, diffuse: 0.0, out: 0.0 };
        if self.lobes.base > 0.0 {
            let coat = self.lobes.specular_max * self.tables.coat.at(self.lobes.roughness, wo[2]);
            odds.mirror += self.lobes.base * coat;
            odds.diffuse += self.lobes.base * (1.0 - coat) * luminance;
            odds.out = (1.0 - coat) * self.lobes.over_mean;
        }
        if self.lobes.metal > 0.0 {
            let kept = self.tables.mirror.at(self.lobes.roughness, wo[2]);
            odds.mirror += self.lobes.metal * luminance.max(METAL_LEAST);
            odds.diffuse += self.lobes.metal * luminance * (1.0 - kept);
        }
        if self.lobes.clear > 0.0 {
            let clear = self.lobes.clear * self.tables.clear.at(self.lobes.clear_roughness, wo[2]);
            odds.glass *= 1.0 - clear;
            odds.mirror *= 1.0 - clear;
            odds.diffuse *= 1.0 - clear;
            odds.clear = clear;
        }
        let sum = odds.glass + odds.clear + odds.mirror + odds.diffuse;
        if sum <= 0.0 {
            // A black surface with no coat: any odds do, as every value is 0.
            return Odds { glass: 0.0, clear: 0.0, mirror: 0.0, diffuse: 1.0, out: odds.out };
        }
        let scale = 1.0 / sum;
        Odds {
            glass: odds.glass * scale,
            clear: odds.clear * scale,
            mirror: odds.mirror * scale,
            diffuse: odds.diffuse * scale,
            out: odds.out,
        }
    }
}

/// `a + b * s`.
#[inline(always)]
fn added(a: [f32; 3], b: [f32; 3], s: f32) -> [f32; 3] {
    vec3::add(a, vec3::scale(b, s))
}

/// The colour of light that bounced several times between facets of reflectance `f0`, whose mean
/// albedo is `mean`: the geometric series of Kulla and Conty 2017, with Schlick's mean.
#[inline]
fn bounced(f0: f32, mean: f32) -> f32 {
    let average = f0 + (1.0 - f0) / 21.0;
    average * average * mean / (1.0 - average * (1.0 - mean)).max(1e-6)
}

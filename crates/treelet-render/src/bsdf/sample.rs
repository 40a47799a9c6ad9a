//! Drawing directions from the lobes, and the lobes of glass.

use super::{Bsdf, GlassKind, Odds, Scattered, diffuse, fresnel, ggx::Ggx, glass};
use glass::Passage;
use treelet::math::vec3;

/// Rough glass of one kind, as seen from one side.
struct Rough<'b, 'a> {
    bsdf: &'b Bsdf<'a>,
    ggx: Ggx,
    roughness: f32,
    thin: bool,
}

impl Bsdf<'_> {
    /// Draws a direction for `wo` in the upper hemisphere, whose odds are `odds`; `None` absorbs.
    /// `u_lobe` and `u` are in the unit interval and square, 1 excluded.
    pub(crate) fn sample(
        &self,
        odds: &Odds,
        wo: [f32; 3],
        u_lobe: f32,
        u: [f32; 2],
    ) -> Option<Scattered> {
        let mut choice = u_lobe;
        let wi = if choice < odds.glass {
            // What is left of the number chooses again.
            choice = (choice / odds.glass).min(1.0 - f32::EPSILON);
            match self.rough_glass() {
                None => return Some(self.sample_smooth(wo, choice, odds.glass)),
                Some(rough) => rough.sample(wo, choice, u)?,
            }
        } else if choice < odds.glass + odds.clear {
            above(self.lobes.clear_ggx.sample(wo, u))?
        } else if choice < odds.glass + odds.clear + odds.mirror {
            above(self.lobes.ggx.sample(wo, u))?
        } else {
            diffuse::sample(u)
        };
        let (value, pdf) = self.eval(odds, wo, wi);
        (pdf > 0.0 && pdf.is_finite()).then(|| Scattered {
            wi,
            weight: vec3::scale(value, 1.0 / pdf),
            pdf,
        })
    }

    fn sample_smooth(&self, wo: [f32; 3], u: f32, odds: f32) -> Scattered {
        let share = self.lobes.glass / odds;
        let thin = self.lobes.glass_kind == GlassKind::SmoothThin;
        let passage = if thin {
            glass::sample_thin(wo, self.tables.ior, u)
        } else {
            glass::sample(wo, self.eta, u)
        };
        let (wi, tint) = match passage {
            Passage::Reflected(wi) => (wi, [1.0; 3]),
            Passage::Refracted(wi) => (wi, self.tint(thin)),
        };
        let (under, _) = self.under_clear(wo[2], wi[2].abs());
        Scattered { wi, weight: tint.map(|c| share * c * under), pdf: 0.0 }
    }

    /// What one passage does to colour: light goes in and out of a solid, and through a pane once.
    fn tint(&self, thin: bool) -> [f32; 3] {
        if thin { self.lobes.color } else { self.lobes.color.map(f32::sqrt) }
    }

    fn rough_glass(&self) -> Option<Rough<'_, '_>> {
        let (ggx, roughness, thin) = match self.lobes.glass_kind {
            GlassKind::Rough(ggx, roughness) => (ggx, roughness, false),
            GlassKind::RoughThin(ggx, roughness) => (ggx, roughness, true),
            GlassKind::Smooth | GlassKind::SmoothThin => return None,
        };
        Some(Rough { bsdf: self, ggx, roughness, thin })
    }

    /// The part of [`Bsdf::eval`] that is rough glass.
    pub(super) fn eval_glass(&self, wo: [f32; 3], wi: [f32; 3], odds: &Odds) -> ([f32; 3], f32) {
        let Some(rough) = self.rough_glass().filter(|_| self.lobes.glass > 0.0) else {
            return ([0.0; 3], 0.0);
        };
        let (value, pdf) = rough.eval(wo, wi);
        let (under, _) = self.under_clear(wo[2], wi[2].abs());
        let value = value * self.lobes.glass * under;
        let tint = if wi[2] < 0.0 { self.tint(rough.thin) } else { [1.0; 3] };
        (tint.map(|c| c * value), pdf * odds.glass)
    }
}

/// A mirrored direction, unless its facet sends it below the surface: that light is lost, and must
/// not pass for light that glass lets through.
#[inline]
fn above(wi: [f32; 3]) -> Option<[f32; 3]> {
    (wi[2] > 0.0).then_some(wi)
}

impl Rough<'_, '_> {
    /// What the GGX lobes scatter of light seen under `cos`, from the viewer's side or the other.
    fn albedo(&self, cos: f32, far: bool) -> f32 {
        let tables = self.bsdf.tables;
        if self.thin {
            return tables.pane.as_ref().map_or(1.0, |pane| pane.at(self.roughness, cos));
        }
        let side = usize::from(self.bsdf.outside == far);
        tables.glass.as_ref().map_or(1.0, |glass| glass[side].at(self.roughness, cos))
    }

    fn mean(&self, far: bool) -> f32 {
        let tables = self.bsdf.tables;
        if self.thin {
            return tables.pane.as_ref().map_or(1.0, |pane| pane.mean(self.roughness));
        }
        let side = usize::from(self.bsdf.outside == far);
        tables.glass.as_ref().map_or(1.0, |glass| glass[side].mean(self.roughness))
    }

    /// The share of multiple bounces that goes through.
    fn through(&self) -> f32 {
        let tables = self.bsdf.tables;
        if self.thin {
            tables.pane_through
        } else {
            tables.through(self.roughness, self.bsdf.outside)
        }
    }

    /// What a facet reflects, by the cosine with it.
    fn reflectance(&self, cos: f32) -> f32 {
        if self.thin {
            glass::thin_reflectance(cos, self.bsdf.tables.ior)
        } else {
            fresnel::dielectric(cos, self.bsdf.eta)
        }
    }

    fn sample(&self, wo: [f32; 3], u_lobe: f32, u: [f32; 2]) -> Option<[f32; 3]> {
        // What single bounces lose, diffusely.
        let lost = 1.0 - self.albedo(wo[2], false);
        let flipped = |w: [f32; 3]| [w[0], w[1], -w[2]];
        if u_lobe < lost {
            let wi = diffuse::sample(u);
            return Some(if u_lobe / lost < self.through() { flipped(wi) } else { wi });
        }
        // One facet mirrors or refracts.
        let choice = (u_lobe - lost) / (1.0 - lost);
        let half = self.ggx.facet(wo, u);
        let cos = vec3::dot(wo, half);
        let mirrored = vec3::sub(vec3::scale(half, 2.0 * cos), wo);
        let reflects = choice < self.reflectance(cos);
        let wi = match (reflects, self.thin) {
            (true, _) => mirrored,
            (false, true) => flipped(mirrored),
            (false, false) => glass::refract(wo, half, self.bsdf.eta)?,
        };
        // A facet may send light where the surface is not.
        (reflects == (wi[2] > 0.0)).then_some(wi)
    }

    /// Value times cosine, without colour, and the density of [`Rough::sample`].
    fn eval(&self, wo: [f32; 3], wi: [f32; 3]) -> (f32, f32) {
        let below = wi[2] < 0.0;
        let lost = 1.0 - self.albedo(wo[2], false);
        let lambert = diffuse::density(wi[2].abs());

        // The facets.
        let facet = match (below, self.thin) {
            (false, _) => Some(self.ggx.eval(wo, wi)),
            (true, true) => Some(self.ggx.eval(wo, [wi[0], wi[1], -wi[2]])),
            (true, false) => self.ggx.eval_through(wo, wi, self.bsdf.eta),
        };
        let (mut value, mut pdf) = (0.0, 0.0);
        if let Some((lobe, density, cos)) = facet {
            let reflected = self.reflectance(cos);
            let share = if below { 1.0 - reflected } else { reflected };
            value += share * lobe;
            pdf += (1.0 - lost) * share * density;
        }

        // What they lose.
        let through = self.through();
        let share = if below { through } else { 1.0 - through };
        let lost_far = 1.0 - self.albedo(wi[2].abs(), below);
        let lost_mean = (1.0 - self.mean(below)).max(1e-6);
        value += share * lost * lost_far / lost_mean * lambert;
        pdf += lost * share * lambert;
        (value, pdf)
    }
}

//! How much a GGX lobe scatters in all: tables by the cosine of the viewing angle.
//!
//! They serve what one bounce between facets loses, and what a coat leaves to what is below it.
//!
//! - A diffuse base gets exactly what its coat lets through on the way in and out, after
//!   C. Kelemen, L. Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with
//!   Importance Sampling", EUROGRAPHICS 2001: `(1 - E(o)) (1 - E(i)) / (pi (1 - E_mean))`.
//! - A metal, and rough glass, get back what their facets lose as a diffuse lobe of the same form,
//!   after C. Kulla, A. Conty, "Revisiting Physically Based Shading at Imageworks", 2017. The
//!   factor on the lobe itself of E. Turquin, 2019, costs less, but is not reciprocal.
//!
//! Both forms are reciprocal and, for white surfaces, lossless. A table takes about 0.3 ms; the
//! same lobe is tabulated once. Where a texture says how rough a surface is, 17 tables stand for
//! all roughnesses, and what lies between is interpolated.

use super::ggx::{ALPHA_MIN, Ggx};
use super::{fresnel, glass};
use crate::sampler::sobol;
use std::collections::BTreeMap;
use std::sync::Arc;
use treelet::math::vec3;

/// Entries of a table, at cosines `(i / (NODES - 1))^2`: dense where the curve is steep.
const NODES: usize = 24;
/// Sample points an entry; Sobol points of a smooth integrand err by less than 0.2 %.
const POINTS: u32 = 256;
/// Steps of the integral over the table.
const STEPS: usize = 1024;
/// Entry 0 stands for grazing incidence; at exactly 0 nothing is visible.
const COS_MIN: f32 = 1e-3;
/// Steps of roughness between smooth and rough.
const ROWS: usize = 16;

/// The directional albedo of a lobe.
#[derive(Clone, Debug)]
pub(crate) struct Albedo {
    nodes: [f32; NODES],
    /// The mean over the hemisphere, weighted by the cosine.
    pub(crate) mean: f32,
}

impl Albedo {
    /// Tabulates a lobe by the weights of its samples: of a view and a point of the unit square.
    fn of(weight: impl Fn([f32; 3], [f32; 2]) -> f32) -> Self {
        let nodes = core::array::from_fn(|i| {
            let s = i as f32 / (NODES - 1) as f32;
            let cos = (s * s).max(COS_MIN);
            let wo = [(1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos];
            let sum: f32 = (0..POINTS).map(|point| weight(wo, sobol(point))).sum();
            (sum / POINTS as f32).min(1.0)
        });
        let mut table = Self { nodes, mean: 0.0 };
        let mut sum = 0.0;
        for step in 0..STEPS {
            let cos = (step as f64 + 0.5) / STEPS as f64;
            sum += 2.0 * cos * f64::from(table.at(cos as f32));
        }
        table.mean = (sum / STEPS as f64) as f32;
        table
    }

    /// The share that is scattered of light seen under `cos`, in `0 ..= 1`.
    #[inline(always)]
    pub(crate) fn at(&self, cos: f32) -> f32 {
        let place = cos.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let node = (place as usize).min(NODES - 2);
        let rest = place - node as f32;
        self.nodes[node] + rest * (self.nodes[node + 1] - self.nodes[node])
    }
}

/// The albedos of a lobe of one roughness, or of all.
#[derive(Clone, Debug)]
pub(crate) struct Rows(Vec<Arc<Albedo>>);

impl Rows {
    /// The albedo under `cos` for a perceptual roughness.
    #[inline(always)]
    pub(crate) fn at(&self, roughness: f32, cos: f32) -> f32 {
        self.blend(roughness, |row| row.at(cos))
    }

    /// The mean over the hemisphere.
    #[inline(always)]
    pub(crate) fn mean(&self, roughness: f32) -> f32 {
        self.blend(roughness, |row| row.mean)
    }

    #[inline(always)]
    fn blend(&self, roughness: f32, value: impl Fn(&Albedo) -> f32) -> f32 {
        if let [only] = self.0.as_slice() {
            return value(only);
        }
        let place = roughness.clamp(0.0, 1.0) * ROWS as f32;
        let row = (place as usize).min(ROWS - 1);
        let rest = place - row as f32;
        (1.0 - rest) * value(&self.0[row]) + rest * value(&self.0[row + 1])
    }
}

/// Which lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Lobe {
    /// A mirror that reflects everything.
    Mirror,
    /// A boundary between dielectrics, what it reflects.
    Coat,
    /// The same, both sides together, seen from the thinner side.
    GlassOutside,
    /// Seen from the denser side.
    GlassInside,
}

/// Tables that were made, each lobe once.
#[derive(Debug, Default)]
pub(crate) struct Albedos {
    known: BTreeMap<(Lobe, u32, u32), Arc<Albedo>>,
}

/// Steps of `alpha` and of the index of refraction that share a table: finer than 8 bits show.
const ALPHA_STEPS: f32 = 1024.0;
const IOR_STEPS: f32 = 64.0;

impl Albedos {
    /// A lobe of one roughness, or of any if `None`; of an index of refraction of at least 1.
    pub(crate) fn rows(&mut self, lobe: Lobe, roughness: Option<f32>, ior: f32) -> Rows {
        match roughness {
            Some(roughness) => Rows(vec![self.table(lobe, roughness * roughness, ior)]),
            None => {
                let row = |i: usize| i as f32 / ROWS as f32;
                Rows((0..=ROWS).map(|i| self.table(lobe, row(i) * row(i), ior)).collect())
            }
        }
    }

    fn table(&mut self, lobe: Lobe, alpha: f32, ior: f32) -> Arc<Albedo> {
        let alphas = (alpha * ALPHA_STEPS).round();
        let iors = if lobe == Lobe::Mirror { 0.0 } else { (ior * IOR_STEPS).round() };
        let ggx = Ggx { alpha: (alphas / ALPHA_STEPS).max(ALPHA_MIN) };
        let ior = iors / IOR_STEPS;
        let made = self.known.entry((lobe, alphas as u32, iors as u32)).or_insert_with(|| {
            Arc::new(match lobe {
                Lobe::Mirror => Albedo::of(|wo, u| reflected(ggx, |_| 1.0, wo, u)),
                Lobe::Coat => {
                    Albedo::of(|wo, u| reflected(ggx, |cos| fresnel::dielectric(cos, ior), wo, u))
                }
                Lobe::GlassOutside => Albedo::of(|wo, u| through_and_back(ggx, ior, wo, u)),
                Lobe::GlassInside => Albedo::of(|wo, u| through_and_back(ggx, 1.0 / ior, wo, u)),
            })
        });
        Arc::clone(made)
    }
}

/// The weight of a sample of a rough mirror.
fn reflected(ggx: Ggx, reflectance: impl Fn(f32) -> f32, wo: [f32; 3], u: [f32; 2]) -> f32 {
    let wi = ggx.sample(wo, u);
    if wi[2] <= 0.0 {
        return 0.0;
    }
    let (value, pdf, cos) = ggx.eval(wo, wi);
    reflectance(cos) * value / pdf
}

/// The weight of a sample of rough glass, both choices together.
fn through_and_back(ggx: Ggx, eta: f32, wo: [f32; 3], u: [f32; 2]) -> f32 {
    let half = ggx.facet(wo, u);
    let share = fresnel::dielectric(vec3::dot(wo, half), eta);
    let back = reflected(ggx, |_| share, wo, u);
    let through = glass::refract(wo, half, eta).filter(|wi| wi[2] < 0.0);
    let through = through.and_then(|wi| ggx.eval_through(wo, wi, eta));
    back + through.map_or(0.0, |(value, pdf, _)| (1.0 - share) * value / pdf)
}

#[cfg(test)]
mod tests {
    use super::{Albedos, Lobe};
    use crate::bsdf::fresnel;

    #[test]
    fn smooth_lobes_reflect_like_fresnel() {
        let mut albedos = Albedos::default();
        let coat = albedos.rows(Lobe::Coat, Some(0.0), 1.5);
        for cos in [1.0, 0.7, 0.4, 0.2] {
            let want = fresnel::dielectric(cos, 1.5);
            let got = coat.at(0.0, cos);
            assert!((got - want).abs() < 0.01, "cos {cos}: {got} {want}");
        }
        assert!(albedos.rows(Lobe::Mirror, Some(0.0), 1.0).mean(0.0) > 0.99);
        assert!(
            albedos.rows(Lobe::Coat, Some(0.55), 1.0).mean(0.55) < 1e-9,
            "no boundary, no coat"
        );
        // Published for GGX of alpha 1 with height-correlated masking: a little over half is kept.
        let rough = albedos.rows(Lobe::Mirror, Some(1.0), 1.0).mean(1.0);
        assert!(rough > 0.4 && rough < 0.7, "{rough}");
        for side in [Lobe::GlassOutside, Lobe::GlassInside] {
            let smooth = albedos.rows(side, Some(0.04), 1.5).mean(0.04);
            assert!(smooth > 0.985 && smooth <= 1.0, "{side:?}: {smooth}");
        }
    }

    #[test]
    fn all_roughnesses_are_near_each_one() {
        let mut albedos = Albedos::default();
        let all = albedos.rows(Lobe::Mirror, None, 1.0);
        for roughness in [0.0, 0.22, 0.5, 0.73, 1.0] {
            let one = albedos.rows(Lobe::Mirror, Some(roughness), 1.0);
            for cos in [0.1, 0.5, 1.0] {
                let (a, b) = (all.at(roughness, cos), one.at(roughness, cos));
                assert!((a - b).abs() < 0.01, "roughness {roughness}, cos {cos}: {a} {b}");
            }
        }
    }
}

//! How much a GGX lobe reflects in all: tables by the cosine of the viewing angle.
//!
//! Two uses. A diffuse base gets exactly what its coat lets through on the way in and out, after
//! C. Kelemen, L. Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model with
//! Importance Sampling", EUROGRAPHICS 2001: `(1 - E(o)) (1 - E(i)) / (pi (1 - E_mean))`, which is
//! reciprocal and, over a white base, lossless. And a metal gets back what its facets lose in
//! multiple bounces, after E. Turquin, "Practical multiple scattering compensation for microfacet
//! models", 2019: the lobe times `1 + f0 (1 - E) / E`.
//!
//! A table takes about 0.3 ms; the same lobe is tabulated once.

use super::fresnel;
use super::ggx::{ALPHA_MIN, Ggx};
use crate::sampler::sobol;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Entries of a table, at cosines `(i / (NODES - 1))^2`: dense where the curve is steep.
const NODES: usize = 24;
/// Sample points an entry; Sobol points of a smooth integrand err by less than 0.2 %.
const POINTS: u32 = 256;
/// Steps of the integral over the table.
const STEPS: usize = 1024;
/// Entry 0 stands for grazing incidence; at exactly 0 nothing is visible.
const COS_MIN: f32 = 1e-3;

/// The directional albedo of a lobe.
#[derive(Clone, Debug)]
pub(crate) struct Albedo {
    nodes: [f32; NODES],
    /// The mean over the hemisphere, weighted by the cosine.
    pub(crate) mean: f32,
}

impl Albedo {
    /// Tabulates the lobe of width `alpha` under a reflectance by the cosine at the facet.
    fn of(alpha: f32, reflectance: impl Fn(f32) -> f32) -> Self {
        let ggx = Ggx { alpha };
        let nodes = core::array::from_fn(|i| {
            let s = i as f32 / (NODES - 1) as f32;
            let cos = (s * s).max(COS_MIN);
            let wo = [(1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos];
            let sum: f32 = (0..POINTS)
                .map(|point| {
                    let wi = ggx.sample(wo, sobol(point));
                    if wi[2] <= 0.0 {
                        return 0.0;
                    }
                    let (value, pdf, cos) = ggx.eval(wo, wi);
                    reflectance(cos) * value / pdf
                })
                .sum();
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

    /// The share that is reflected of light seen under `cos`, in `0 ..= 1`.
    #[inline]
    pub(crate) fn at(&self, cos: f32) -> f32 {
        let place = cos.clamp(0.0, 1.0).sqrt() * (NODES - 1) as f32;
        let node = (place as usize).min(NODES - 2);
        let rest = place - node as f32;
        self.nodes[node] + rest * (self.nodes[node + 1] - self.nodes[node])
    }
}

/// Tables that were made, each lobe once.
#[derive(Debug, Default)]
pub(crate) struct Albedos {
    known: BTreeMap<(u32, u32), Arc<Albedo>>,
}

/// Steps of `alpha` and of the index of refraction that share a table: finer than 8 bits show.
const ALPHA_STEPS: f32 = 256.0;
const IOR_STEPS: f32 = 64.0;

impl Albedos {
    /// The lobe under Fresnel's reflectance for an index of refraction of at least 1.
    pub(crate) fn coat(&mut self, alpha: f32, ior: f32) -> Arc<Albedo> {
        let steps = (ior * IOR_STEPS).round();
        let ior = steps / IOR_STEPS;
        self.table(alpha, steps as u32, |cos| fresnel::dielectric(cos, ior))
    }

    /// The lobe of a mirror that reflects everything.
    pub(crate) fn mirror(&mut self, alpha: f32) -> Arc<Albedo> {
        self.table(alpha, 0, |_| 1.0)
    }

    fn table(&mut self, alpha: f32, kind: u32, reflectance: impl Fn(f32) -> f32) -> Arc<Albedo> {
        let steps = (alpha * ALPHA_STEPS).round();
        let alpha = (steps / ALPHA_STEPS).max(ALPHA_MIN);
        let key = (steps as u32, kind);
        Arc::clone(
            self.known.entry(key).or_insert_with(|| Arc::new(Albedo::of(alpha, reflectance))),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::Albedos;
    use crate::bsdf::fresnel;

    #[test]
    fn smooth_lobes_reflect_like_fresnel() {
        let mut albedos = Albedos::default();
        let coat = albedos.coat(0.0, 1.5);
        for cos in [1.0, 0.7, 0.4, 0.2] {
            let want = fresnel::dielectric(cos, 1.5);
            assert!((coat.at(cos) - want).abs() < 0.01, "cos {cos}: {} {want}", coat.at(cos));
        }
        assert!(albedos.mirror(0.0).mean > 0.99);
        assert!(albedos.coat(0.3, 1.0).mean < 1e-9, "no boundary, no coat");
        // Published for GGX of alpha 1 with height-correlated masking: a little over half is kept.
        let rough = albedos.mirror(1.0).mean;
        assert!(rough > 0.4 && rough < 0.7, "{rough}");
    }
}

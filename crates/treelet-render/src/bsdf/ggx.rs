//! The rough mirror: microfacets with the GGX distribution, isotropic, in the frame of the normal.
//!
//! Sources: B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007
//! (the distribution); E. Heitz, "Understanding the Masking-Shadowing Function in
//! Microfacet-Based BRDFs", JCGT 3(2), 2014 (height-correlated masking and shadowing); J. Dupuy,
//! A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", CGF 42(8), 2023 (sampling).
//!
//! One bounce between facets only: what would bounce twice is lost here and given back by
//! [`super::albedo`].

use crate::frame::unit;
use core::f32::consts::{PI, TAU};
use treelet::math::vec3;

/// The least width: below it f32 directions do not resolve the lobe, about 3 minutes of arc wide.
pub(crate) const ALPHA_MIN: f32 = 1e-3;

/// A rough mirror of width `alpha`, in `ALPHA_MIN ..= 1`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    pub(crate) alpha: f32,
}

impl Ggx {
    /// The density of facet normals, `half` in the upper hemisphere.
    ///
    /// Written with the sine's components, so that nothing cancels near the normal.
    #[inline]
    fn density(self, half: [f32; 3]) -> f32 {
        let alpha2 = self.alpha * self.alpha;
        let s = (half[0] * half[0] + half[1] * half[1]) / alpha2 + half[2] * half[2];
        1.0 / (PI * alpha2 * s * s)
    }

    /// Smith's Lambda.
    #[inline]
    fn lambda(self, w: [f32; 3]) -> f32 {
        let alpha2 = self.alpha * self.alpha;
        let tan2 = (w[0] * w[0] + w[1] * w[1]) / (w[2] * w[2]);
        0.5 * ((1.0 + alpha2 * tan2).sqrt() - 1.0)
    }

    /// For a mirror of reflectance 1: value times the cosine of `wi`, density of sampling `wi`, and
    /// the cosine between `wo` and the facet. Both directions are in the upper hemisphere.
    #[inline]
    pub(crate) fn eval(self, wo: [f32; 3], wi: [f32; 3]) -> (f32, f32, f32) {
        let half = unit(vec3::add(wo, wi));
        let (lambda_o, lambda_i) = (self.lambda(wo), self.lambda(wi));
        let density = self.density(half) / (4.0 * wo[2]);
        let value = density / (1.0 + lambda_o + lambda_i);
        (value, density / (1.0 + lambda_o), vec3::dot(wo, half))
    }

    /// A direction drawn from the visible normals of `wo`; may lie below the surface.
    #[inline]
    pub(crate) fn sample(self, wo: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        // Stretch to the hemisphere, where the facets are a mirror ball.
        let ball = unit([self.alpha * wo[0], self.alpha * wo[1], wo[2]]);

        // Draw the reflected direction uniformly from a spherical cap around the normal.
        let (sin_phi, cos_phi) = libm::sincosf(TAU * u[0]);
        let z = (1.0 - u[1]) * (1.0 + ball[2]) - ball[2];
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let facet = vec3::add([sin * cos_phi, sin * sin_phi, z], ball);

        // Squeeze the facet normal back and reflect.
        let half = unit([self.alpha * facet[0], self.alpha * facet[1], facet[2].max(1e-9)]);
        vec3::sub(vec3::scale(half, 2.0 * vec3::dot(wo, half)), wo)
    }
}

#[cfg(test)]
mod tests {
    use super::Ggx;
    use crate::sampler::sobol;

    /// The sampling density integrates to 1 over the sphere less what goes below the horizon, and
    /// the mean of value / density agrees with the integral of the value over a uniform grid.
    #[test]
    fn sampling_agrees_with_evaluation() {
        for alpha in [0.15f32, 0.5, 1.0] {
            for cos in [0.1f32, 0.5, 1.0] {
                let ggx = Ggx { alpha };
                let wo = [(1.0 - cos * cos).sqrt(), 0.0, cos];
                let n = 1 << 16;
                let (mut by_grid, mut density, mut by_sampling, mut above) = (0.0, 0.0, 0.0, 0.0);
                for i in 0..n {
                    let u = sobol(i);
                    let z = u[0].max(1e-7);
                    let (sin, phi) = ((1.0 - z * z).sqrt(), core::f32::consts::TAU * u[1]);
                    let (value, pdf, _) =
                        ggx.eval(wo, [sin * libm::cosf(phi), sin * libm::sinf(phi), z]);
                    by_grid += f64::from(value * core::f32::consts::TAU);
                    density += f64::from(pdf * core::f32::consts::TAU);
                    let wi = ggx.sample(wo, u);
                    if wi[2] > 0.0 {
                        let (value, pdf, _) = ggx.eval(wo, wi);
                        by_sampling += f64::from(value / pdf);
                        above += 1.0;
                    }
                }
                let n = f64::from(n);
                let case = format!("alpha {alpha}, cos {cos}");
                assert!(((by_grid - by_sampling) / n).abs() < 4e-3, "{case}");
                assert!(((density - above) / n).abs() < 4e-3, "{case}");
            }
        }
    }
}

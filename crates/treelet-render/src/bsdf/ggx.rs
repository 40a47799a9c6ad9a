//! The rough boundary: microfacets with the GGX distribution, isotropic, in the frame of the normal,
//! that mirror or refract.
//!
//! Sources: B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007
//! (the distribution); E. Heitz, "Understanding the Masking-Shadowing Function in
//! Microfacet-Based BRDFs", JCGT 3(2), 2014 (height-correlated masking and shadowing; the separable
//! form where light passes through); J. Dupuy,
//! A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", CGF 42(8), 2023 (sampling).
//!
//! One bounce between facets only: what would bounce twice is lost here and given back by
//! [`super::albedo`].

use crate::frame::unit;
use crate::trig::sincos_of_turn;
use core::f32::consts::PI;
use treelet::math::vec3;

/// The least width: below it f32 directions do not resolve the lobe, about 3 minutes of arc wide.
pub(crate) const ALPHA_MIN: f32 = 1e-3;

/// A rough mirror of width `alpha`, in `ALPHA_MIN ..= 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ggx {
    pub(crate) alpha: f32,
}

impl Ggx {
    /// By perceptual roughness, the root of the width.
    #[inline]
    pub(crate) fn of_roughness(roughness: f32) -> Self {
        Self { alpha: (roughness * roughness).max(ALPHA_MIN) }
    }

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
    /// the cosine between `wo` and the facet. Both directions are of unit length, in the upper
    /// hemisphere.
    #[inline]
    pub(crate) fn eval(self, wo: [f32; 3], wi: [f32; 3]) -> (f32, f32, f32) {
        // The density of facets, without taking the root of the half vector's length.
        let alpha2 = self.alpha * self.alpha;
        let half = vec3::add(wo, wi);
        let length2 = vec3::dot(half, half);
        let s = half[0] * half[0] + half[1] * half[1] + alpha2 * half[2] * half[2];
        let density = alpha2 * (length2 * length2) / (2.0 * PI * s * s);

        // `1 + Lambda` is `(cos + reach) / (2 cos)`: the cosines cancel.
        let (reach_o, reach_i) = (self.reach(wo), self.reach(wi));
        let value = density * wi[2] / (reach_o * wi[2] + reach_i * wo[2]);
        (value, density / (wo[2] + reach_o), 0.5 * length2.sqrt())
    }

    /// The length of a direction, squeezed by the width along the surface.
    #[inline(always)]
    fn reach(self, w: [f32; 3]) -> f32 {
        let alpha2 = self.alpha * self.alpha;
        (w[2] * w[2] + alpha2 * (w[0] * w[0] + w[1] * w[1])).sqrt()
    }

    /// For facets that let everything through: value times the cosine of `wi` (of radiance divided
    /// by the squared index), density of sampling `wi`, and the cosine between `wo` and the facet.
    /// `wo` is in the upper hemisphere, `wi` in the lower; `eta` is the lower index over the upper.
    /// `None` where no facet leads from one to the other.
    #[inline]
    pub(crate) fn eval_through(
        self,
        wo: [f32; 3],
        wi: [f32; 3],
        eta: f32,
    ) -> Option<(f32, f32, f32)> {
        // Walter 2007, equations 16, 17 and 21; the facet normal points to the thinner side there.
        let along = vec3::add(wo, vec3::scale(wi, eta));
        let half = unit(if along[2] < 0.0 { vec3::scale(along, -1.0) } else { along });
        let (cos_o, cos_i) = (vec3::dot(wo, half), vec3::dot(wi, half));
        if !(cos_o > 0.0 && cos_i < 0.0) {
            return None;
        }
        let apart = cos_o + eta * cos_i;
        let jacobian = eta * eta * -cos_i / (apart * apart);
        let (lambda_o, lambda_i) = (self.lambda(wo), self.lambda(wi));
        let density = self.density(half) * cos_o / wo[2] * jacobian / (1.0 + lambda_o);
        density.is_finite().then_some((density / (1.0 + lambda_i), density, cos_o))
    }

    /// A direction drawn from the visible normals of `wo`; may lie below the surface.
    #[inline]
    pub(crate) fn sample(self, wo: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        let half = self.facet(wo, u);
        vec3::sub(vec3::scale(half, 2.0 * vec3::dot(wo, half)), wo)
    }

    /// A facet normal drawn from those visible from `wo`.
    #[inline]
    pub(crate) fn facet(self, wo: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        // Stretch to the hemisphere, where the facets are a mirror ball.
        let ball = unit([self.alpha * wo[0], self.alpha * wo[1], wo[2]]);

        // Draw the reflected direction uniformly from a spherical cap around the normal.
        let (sin_phi, cos_phi) = sincos_of_turn(u[0]);
        let z = (1.0 - u[1]) * (1.0 + ball[2]) - ball[2];
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let facet = vec3::add([sin * cos_phi, sin * sin_phi, z], ball);

        // Squeeze the facet normal back.
        unit([self.alpha * facet[0], self.alpha * facet[1], facet[2].max(1e-9)])
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

    /// Value over the cosine of `wi` is the same both ways, and the density is that of Walter 2007.
    #[test]
    fn is_reciprocal() {
        let direction = |i: u32| {
            let [z, phi] = sobol(i + 1);
            let radius = (1.0 - z * z).sqrt();
            [radius * libm::cosf(6.0 * phi), radius * libm::sinf(6.0 * phi), z]
        };
        for i in 0..200 {
            let (wo, wi) = (direction(i), direction(i + 200));
            let ggx = Ggx { alpha: 0.05 + 0.004 * i as f32 };
            let there = ggx.eval(wo, wi).0 / wi[2];
            let back = ggx.eval(wi, wo).0 / wo[2];
            assert!((there / back - 1.0).abs() < 1e-4, "{wo:?} {wi:?}: {there} {back}");
        }
        let tan2 = 0.25f32;
        let cos2 = 1.0 / (1.0 + tan2);
        let ggx = Ggx { alpha: 0.3 };
        let a2 = 0.09f32;
        let s = a2 + tan2;
        let want = a2 / (core::f32::consts::PI * cos2 * cos2 * s * s);
        let half = [(1.0 - cos2).sqrt(), 0.0, cos2.sqrt()];
        assert!((ggx.density(half) / want - 1.0).abs() < 1e-5);
    }
}

//! How much a smooth boundary reflects.

/// The cosine that stands for diffuse light where a single one must: its mean over the hemisphere,
/// weighted by itself.
pub(super) const COS_DIFFUSE: f32 = 2.0 / 3.0;

/// The share of unpolarised light that a boundary between dielectrics reflects: Fresnel's
/// equations, exact.
///
/// `cos` is that of the angle on the side the light comes from, in `0 ..= 1`; `eta` is the index of
/// refraction of the far side over that of the near side. 1 under total reflection; 0 for `eta` 1.
#[inline]
pub(crate) fn dielectric(cos: f32, eta: f32) -> f32 {
    // At exactly grazing incidence both quotients are 0 / 0 for `eta` 1.
    let cos = cos.clamp(1e-6, 1.0);
    // Written so that nothing cancels for `eta` 1, and one division is enough.
    let eta2 = eta * eta;
    let far2 = eta2 - 1.0 + cos * cos;
    if far2 <= 0.0 {
        return 1.0;
    }
    // `eta` times the cosine on the far side.
    let far = far2.sqrt();
    let near = eta2 * cos;
    let (p, q) = ((cos - far) * (near + far), (near - far) * (cos + far));
    let whole = (cos + far) * (near + far);
    0.5 * (p * p + q * q) / (whole * whole)
}

/// C. Schlick's rise to 1 at grazing angles, "An Inexpensive BRDF Model for Physically-based
/// Rendering", EUROGRAPHICS 1994: the reflectance is `f0 + (1 - f0) * schlick(cos)`.
#[inline(always)]
pub(crate) fn schlick(cos: f32) -> f32 {
    let rest = (1.0 - cos).clamp(0.0, 1.0);
    let square = rest * rest;
    square * square * rest
}

#[cfg(test)]
mod tests {
    use super::dielectric;

    #[test]
    fn known_values() {
        // Normal incidence: ((n - 1) / (n + 1))^2. Brewster: half of s-polarised light only.
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
        let brewster = libm::cosf(libm::atanf(1.5));
        assert!((dielectric(brewster, 1.5) - 0.073_964_5).abs() < 1e-5);
        assert_eq!(dielectric(0.5, 1.0 / 1.5), 1.0, "total reflection");
        assert!(dielectric(0.0, 1.5) > 0.999);
        for cos in [0.0, 1e-7, 0.3, 1.0] {
            assert!(dielectric(cos, 1.0) < 1e-6, "no boundary, no reflection");
        }
    }
}

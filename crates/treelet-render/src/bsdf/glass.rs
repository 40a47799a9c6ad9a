//! Glass: what a boundary between dielectrics, or a thin pane, reflects and lets through.
//!
//! Radiance is carried divided by the squared index of refraction, so that a path that enters and
//! leaves needs no factor. Smooth glass has one reflected and one refracted direction, chosen by
//! Fresnel's share. Rough glass has a GGX lobe on each side (`ggx.rs`), and gets back what facets
//! lose in multiple bounces as a diffuse lobe on each side, after C. Kulla, A. Conty, "Revisiting
//! Physically Based Shading at Imageworks", SIGGRAPH course, 2017: with `E` the albedo of the two
//! GGX lobes and a prime for the far side,
//!
//! ```text
//! back:     (1 - T) (1 - E(o)) (1 - E(i)) / (pi (1 - E_mean))
//! through:      T   (1 - E(o)) (1 - E'(i)) / (pi (1 - E'_mean))
//! ```
//!
//! which loses nothing for any `T`, and is reciprocal if
//! `T / (1 - E'_mean) = eta^2 T' / (1 - E_mean)`; see [`share_through`].
//!
//! A thin pane is two parallel boundaries: with all the bounces between them it reflects
//! `2 F / (1 + F)` and lets the rest through unbent; rough ones blur both lobes alike.

use super::fresnel;

/// A boundary whose index of refraction is nearer to 1 bends nothing to speak of, however rough it
/// is, and f32 cannot tell which facet light came through: it counts as smooth.
pub(crate) const BENDS_LEAST: f32 = 0.02;

/// What a smooth boundary does with light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Passage {
    /// Mirrored about the normal.
    Reflected([f32; 3]),
    /// Bent into the other side.
    Refracted([f32; 3]),
}

/// Picks a direction for `wo` in the upper hemisphere of the normal's frame, with the probability
/// that makes every weight 1. `eta` is the far side's index of refraction over the near side's;
/// `u` is in `0 .. 1`.
#[inline]
pub(crate) fn sample(wo: [f32; 3], eta: f32, u: f32) -> Passage {
    let reflected = fresnel::dielectric(wo[2], eta);
    if u < reflected {
        return Passage::Reflected([-wo[0], -wo[1], wo[2]]);
    }
    // Snell's law; Fresnel has returned 1 wherever the root would be negative.
    let sin2 = (1.0 - wo[2] * wo[2]).max(0.0) / (eta * eta);
    Passage::Refracted([-wo[0] / eta, -wo[1] / eta, -(1.0 - sin2).max(0.0).sqrt()])
}

/// The same for a pane of the index of refraction `ior`.
#[inline]
pub(crate) fn sample_thin(wo: [f32; 3], ior: f32, u: f32) -> Passage {
    if u < thin_reflectance(wo[2], ior) {
        return Passage::Reflected([-wo[0], -wo[1], wo[2]]);
    }
    Passage::Refracted([-wo[0], -wo[1], -wo[2]])
}

/// What a pane reflects in all: `F + (1 - F)^2 F (1 + F^2 + F^4 + ...)`.
#[inline]
pub(crate) fn thin_reflectance(cos: f32, ior: f32) -> f32 {
    let once = fresnel::dielectric(cos, ior);
    2.0 * once / (1.0 + once)
}

/// Snell's law at a facet: the direction on the far side, if there is one.
#[inline]
pub(crate) fn refract(wo: [f32; 3], half: [f32; 3], eta: f32) -> Option<[f32; 3]> {
    let cos = wo[0] * half[0] + wo[1] * half[1] + wo[2] * half[2];
    let cos2_far = 1.0 - (1.0 - cos * cos) / (eta * eta);
    if cos2_far <= 0.0 {
        return None;
    }
    let along = cos / eta - cos2_far.sqrt();
    Some(core::array::from_fn(|k| along * half[k] - wo[k] / eta))
}

/// The share of the multiple bounces that ends on the far side, from outside and from inside.
///
/// By `mean`, the mean albedos from either side, and `ior`. From outside about what a single
/// boundary lets through of diffuse light; from inside what reciprocity then leaves.
pub(crate) fn share_through(mean: [f32; 2], ior: f32) -> [f32; 2] {
    // The fit of E. d'Eon, G. Irving, "A Quantized-Diffusion Model for Rendering Translucent
    // Materials", SIGGRAPH 2011, for the mean reflectance, valid to an index of 3.
    let reflected = (ior - 1.0) / (4.085_67 + 1.000_71 * ior);
    // With both means near 1 there is next to nothing to share.
    let lost = mean.map(|mean| (1.0 - mean).max(1e-6));
    let bound = ior * ior * lost[1] / lost[0];
    let outside = (1.0 - reflected).clamp(0.0, 1.0).min(bound);
    [outside, (outside / bound).clamp(0.0, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::{Passage, refract, sample, thin_reflectance};

    #[test]
    fn snell() {
        let wo = [0.6, 0.0, 0.8];
        let Passage::Refracted(wi) = sample(wo, 1.5, 0.999) else { panic!("refracts") };
        assert!((wi[0] + 0.4).abs() < 1e-6 && wi[2] < 0.0);
        let length: f32 = wi.iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-6);
        assert_eq!(sample(wo, 1.0 / 1.9, 0.999), Passage::Reflected([-0.6, -0.0, 0.8]));

        let by_facet = refract(wo, [0.0, 0.0, 1.0], 1.5).unwrap();
        assert!((0..3).all(|k| (by_facet[k] - wi[k]).abs() < 1e-6), "{by_facet:?} {wi:?}");
        assert_eq!(refract(wo, [0.0, 0.0, 1.0], 1.0 / 1.9), None);
    }

    #[test]
    fn panes_reflect_nearly_twice() {
        assert!((thin_reflectance(1.0, 1.5) - 0.08 / 1.04).abs() < 1e-6);
        assert_eq!(thin_reflectance(1.0, 1.0), 0.0);
    }
}

//! Smooth glass: one reflected and one refracted direction, chosen by Fresnel's share.
//!
//! Radiance is carried divided by the squared index of refraction, so that a path that enters and
//! leaves needs no factor. Roughness does not widen the lobes yet.

use super::fresnel;

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

#[cfg(test)]
mod tests {
    use super::{Passage, sample};

    #[test]
    fn snell() {
        let wo = [0.6, 0.0, 0.8];
        let Passage::Refracted(wi) = sample(wo, 1.5, 0.999) else { panic!("refracts") };
        assert!((wi[0] + 0.4).abs() < 1e-6 && wi[2] < 0.0);
        let length: f32 = wi.iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-6);
        assert_eq!(sample(wo, 1.0 / 1.9, 0.999), Passage::Reflected([-0.6, -0.0, 0.8]));
    }
}

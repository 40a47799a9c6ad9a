//! From radiance to display values: exposure, a filmic curve, the sRGB transfer function.
//!
//! The curve is the photoreceptor response of K. Naka and W. Rushton, "S-potentials from colour
//! units in the retina of fish", J. Physiology 185, 1966, as E. Reinhard and K. Devlin use it in
//! "Dynamic Range Reduction Inspired by Photoreceptor Physiology", TVCG 11(1), 2005:
//! `x^n / (x^n + s^n)`, a sigmoid in log exposure. Differs from them: fixed, not adapted to the
//! picture, so that a picture does not flicker while it converges. A little of every channel leaks
//! into the others first, so that bright saturated lights go to white as they do on film.

use crate::color;

/// How radiance becomes a display value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneMap {
    /// Factor on radiance before the curve, above 0.
    pub exposure: f32,
}

impl Default for ToneMap {
    fn default() -> Self {
        Self { exposure: DAYLIGHT }
    }
}

/// White paper under [`treelet_model::Sky::clear`] has radiance 1.4; this keeps it off the curve's
/// shoulder.
const DAYLIGHT: f32 = 0.7;
/// Steepness of the curve in log exposure; 1 is Reinhard's, more has more contrast.
const CONTRAST: f32 = 1.4;
/// Scene value of a grey card, by convention.
const GREY: f32 = 0.18;
/// What a grey card becomes, linear: itself.
const GREY_SHOWN: f32 = 0.18;
/// How much of the mean of the channels each channel takes in.
const LEAK: f32 = 0.06;

impl ToneMap {
    /// The 8-bit sRGB value of a linear radiance. NaN and negative radiance are black.
    pub fn rgb8(&self, radiance: [f32; 3]) -> [u8; 3] {
        // What is not above 0 is black, NaN included.
        let shown = |c: f32| if c > 0.0 { c.min(f32::MAX) } else { 0.0 };
        let exposed = radiance.map(|c| shown(c * self.exposure));
        let mean = exposed[0] / 3.0 + exposed[1] / 3.0 + exposed[2] / 3.0;
        color::mix(exposed, [mean; 3], LEAK).map(|c| srgb8(filmic(c)))
    }
}

/// The curve: 0 to 0, [`GREY`] to [`GREY_SHOWN`], infinity to 1.
fn filmic(x: f32) -> f32 {
    const ODDS: f32 = 1.0 / GREY_SHOWN - 1.0;
    if x <= 0.0 {
        return 0.0;
    }
    1.0 / (1.0 + ODDS * libm::powf(GREY / x, CONTRAST))
}

/// The sRGB transfer function (IEC 61966-2-1), rounded to 8 bits.
pub fn srgb8(linear: f32) -> u8 {
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * libm::powf(linear, 1.0 / 2.4) - 0.055
    };
    (encoded.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// The linear value of an 8-bit sRGB code.
pub fn linear8(code: u8) -> f32 {
    let c = f32::from(code) / 255.0;
    if c <= 0.040_45 { c / 12.92 } else { libm::powf((c + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::{GREY, GREY_SHOWN, ToneMap, filmic, srgb8};

    #[test]
    fn curve_rises_from_black_to_white() {
        assert_eq!(filmic(0.0), 0.0);
        assert!((filmic(GREY) - GREY_SHOWN).abs() < 1e-6);
        assert!(filmic(1e6) > 0.999 && filmic(f32::MAX) <= 1.0);
        let steps: Vec<_> = (-40..40).map(|i| filmic(libm::exp2f(0.25 * i as f32))).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn srgb_is_the_standard() {
        // Pairs of the standard: 8-bit code 188 is 0.5 linear, 118 is close to 0.18.
        assert_eq!([0.0, 0.001, 0.18, 0.5, 1.0, 7.0].map(srgb8), [0, 3, 118, 188, 255, 255]);
        assert_eq!(srgb8(f32::NAN), 0);
        assert!((0..=255).all(|code| srgb8(super::linear8(code)) == code));
    }

    #[test]
    fn odd_radiance_is_shown_as_black_or_white() {
        let tone = ToneMap::default();
        assert_eq!(tone.rgb8([f32::NAN, -1.0, 0.0]), [0, 0, 0]);
        assert_eq!(tone.rgb8([f32::INFINITY; 3]), [255; 3]);
    }
}

//! Lambert's law, and how to draw directions by it.

use crate::trig::sincos_of_turn;
use core::f32::consts::FRAC_1_PI;

/// The density of [`sample`], and the value times cosine of a white diffuse surface.
#[inline(always)]
pub(crate) fn density(cos: f32) -> f32 {
    cos * FRAC_1_PI
}

/// A direction of the upper hemisphere with density `cos / pi` (Malley: a disc, lifted).
#[inline]
pub(crate) fn sample(u: [f32; 2]) -> [f32; 3] {
    let radius = u[0].sqrt();
    let (sin, cos) = sincos_of_turn(u[1]);
    [radius * cos, radius * sin, (1.0 - u[0]).max(0.0).sqrt()]
}

//! The light from outside: a gradient between ground, horizon and zenith, and the disc of the sun.
//!
//! Radiance depends on the height of the direction only, and by Archimedes' hat-box theorem equal
//! steps of height are equal solid angles: a table over the height, piecewise constant, samples the
//! gradient, and the disc is sampled as a cone. Both together are one mixture with one density.
//!
//! After a path has been scattered by a surface that is not smooth, smooth glass and mirrors show
//! it a wider, dimmer sun of the same irradiance: no other strategy could find the small disc
//! through glass, and a caustic of single bright pixels would be all there is. Source: A. Kaplanyan,
//! C. Dachsbacher, "Path Space Regularization for Holistic and Robust Light Transport", EUROGRAPHICS
//! 2013. Differs from it: the width is fixed.

use crate::color;
use crate::error::RenderError;
use crate::frame::{Frame, unit};
use crate::trig::sincos_of_turn;
use core::f32::consts::{FRAC_1_PI, PI, TAU};
use treelet::math::vec3;
use treelet_model::{Model, Sky, Sun};

/// The sky a model is shown under, if the caller names no other.
///
/// The model's own, if it has one. Otherwise a clear day, [`Sky::clear`]. But if something in the
/// model shines by itself, the sunless [`dusk`], dim enough that lamps rule: a closed room sees
/// none of it, and of an open scene what no lamp reaches is still there to be seen.
pub fn default_sky(model: &Model, up: usize) -> Sky {
    match model.sky {
        Some(sky) => sky,
        None if !model.lights.is_empty() => dusk(up),
        None if model.materials.iter().any(treelet_model::Material::is_emissive) => dusk(up),
        None => Sky::clear(up),
    }
}

/// The clear sky without its sun, at a tenth of its light.
pub fn dusk(up: usize) -> Sky {
    let clear = Sky::clear(up);
    let dim = |radiance: [f32; 3]| radiance.map(|c| 0.1 * c);
    Sky {
        zenith: dim(clear.zenith),
        horizon: dim(clear.horizon),
        ground: dim(clear.ground),
        sun: None,
        ..clear
    }
}

/// Steps of height in the sampling table.
const STEPS: usize = 64;
/// The ground begins softly, over this much height below the horizon.
const HAZE: f32 = 0.03;
/// The half angle of the sun as smooth surfaces show it to scattered light, radians.
const WIDE_SUN: f32 = 0.3;

/// A sky, prepared for sampling.
#[derive(Clone, Debug)]
pub(crate) struct SkyLight {
    sky: Sky,
    sun: Option<Disc>,
    wide_sun: Option<Disc>,
    /// The probability of sampling the sun rather than the gradient.
    p_sun: f32,
    /// Probability up to the end of each step of height.
    cumulative: [f32; STEPS],
    /// By the same share of 1 as a step's number is of all: the first step that may hold it.
    first: [u8; STEPS],
    /// Density over solid angle in each step.
    density: [f32; STEPS],
}

/// A disc at infinity.
#[derive(Clone, Copy, Debug)]
struct Disc {
    frame: Frame,
    direction: [f32; 3],
    radiance: [f32; 3],
    /// One minus the cosine of the half angle: the height of the cap, exact for small angles.
    cap: f32,
}

impl Disc {
    fn new(sun: &Sun, angular_radius: f32, dimmed: f32) -> Option<Self> {
        let direction = vec3::normalize(sun.direction)?;
        Some(Self {
            frame: Frame::around(direction),
            direction,
            radiance: vec3::scale(sun.radiance, dimmed),
            cap: cap_height(angular_radius),
        })
    }

    /// Whether a unit vector points into the disc: its chord to the middle is short enough. The
    /// square of the chord is twice the height of the cap.
    #[inline]
    fn holds(&self, direction: [f32; 3]) -> bool {
        let chord = vec3::sub(direction, self.direction);
        vec3::dot(chord, chord) <= 2.0 * self.cap
    }

    fn solid_angle(&self) -> f32 {
        TAU * self.cap
    }

    fn sample(&self, u: [f32; 2]) -> [f32; 3] {
        let height = u[0] * self.cap;
        let radius = (height * (2.0 - height)).sqrt();
        let (sin, cos) = sincos_of_turn(u[1]);
        unit(self.frame.to_world([radius * cos, radius * sin, 1.0 - height]))
    }
}

/// `1 - cos(angle)` without cancellation.
fn cap_height(angle: f32) -> f32 {
    let half = libm::sinf(0.5 * angle);
    2.0 * half * half
}

impl SkyLight {
    /// Checks and tabulates a sky.
    pub(crate) fn new(sky: &Sky, regularize: bool) -> Result<Self, RenderError> {
        check(sky)?;
        let sun = sky.sun.as_ref().and_then(|sun| Disc::new(sun, sun.angular_radius, 1.0));
        let wide_sun = sky.sun.as_ref().and_then(|sun| {
            let cap = cap_height(sun.angular_radius);
            let wide = cap_height(WIDE_SUN);
            if regularize && cap < wide { Disc::new(sun, WIDE_SUN, cap / wide) } else { None }
        });
        let mut out = Self {
            sky: *sky,
            sun,
            wide_sun: wide_sun.or(sun),
            p_sun: 0.0,
            cumulative: [1.0; STEPS],
            first: [0; STEPS],
            density: [0.25 * FRAC_1_PI; STEPS],
        };
        out.tabulate();
        Ok(out)
    }

    fn tabulate(&mut self) {
        // Weigh the steps by their luminance, in f64 so that no sum overflows.
        let weights: [f64; STEPS] = core::array::from_fn(|step| {
            let height = (step as f32 + 0.5) * (2.0 / STEPS as f32) - 1.0;
            f64::from(color::luminance(self.gradient(height)))
        });
        let total: f64 = weights.iter().sum();
        if total > 0.0 {
            let mut sum = 0.0;
            for step in 0..STEPS {
                sum += weights[step];
                self.cumulative[step] = (sum / total) as f32;
                // A step of height `2 / STEPS` spans `4 pi / STEPS` of solid angle.
                let share = weights[step] / total * STEPS as f64;
                self.density[step] = (share / (4.0 * core::f64::consts::PI)) as f32;
            }
            self.cumulative[STEPS - 1] = 1.0;
        }
        self.first = core::array::from_fn(|share| {
            let share = share as f32 / STEPS as f32;
            self.cumulative.partition_point(|&end| end <= share).min(STEPS - 1) as u8
        });

        // Sun and gradient share the samples as they share the flux, each at least a quarter.
        let sun = self.sun.map_or(0.0, |sun| {
            f64::from(color::luminance(sun.radiance)) * f64::from(sun.solid_angle())
        });
        let gradient = total / STEPS as f64 * core::f64::consts::PI;
        self.p_sun = if sun <= 0.0 {
            0.0
        } else if gradient <= 0.0 {
            1.0
        } else {
            ((sun / (sun + gradient)) as f32).clamp(0.25, 0.75)
        };
    }

    /// About the irradiance of a surface that sees half the sky; 0 if the sky is black.
    pub(crate) fn irradiance(&self) -> f64 {
        let steps = (0..STEPS).map(|step| {
            let height = (step as f32 + 0.5) * (2.0 / STEPS as f32) - 1.0;
            f64::from(color::luminance(self.gradient(height)))
        });
        let sun = self.sun.map_or(0.0, |sun| {
            f64::from(color::luminance(sun.radiance)) * f64::from(sun.solid_angle())
        });
        steps.sum::<f64>() / STEPS as f64 * core::f64::consts::PI + sun
    }

    /// Radiance from a unit direction. `wide` shows the sun widened, see the module head.
    #[inline]
    pub(crate) fn radiance(&self, direction: [f32; 3], wide: bool) -> [f32; 3] {
        let mut radiance = self.gradient(direction[self.sky.up]);
        let sun = if wide { &self.wide_sun } else { &self.sun };
        if let Some(sun) = sun
            && sun.holds(direction)
        {
            radiance = vec3::add(radiance, sun.radiance);
        }
        radiance
    }

    /// A direction, for a point of the unit square and a number that chooses.
    pub(crate) fn sample(&self, u_choice: f32, u: [f32; 2]) -> [f32; 3] {
        if let Some(sun) = &self.sun
            && u_choice < self.p_sun
        {
            return sun.sample(u);
        }
        // Find the step, and the place in it, for the first coordinate.
        let share = ((u[0] * STEPS as f32) as usize).min(STEPS - 1);
        let mut step = usize::from(self.first[share]);
        while step < STEPS - 1 && self.cumulative[step] <= u[0] {
            step += 1;
        }
        let start = if step == 0 { 0.0 } else { self.cumulative[step - 1] };
        let width = (self.cumulative[step] - start).max(f32::MIN_POSITIVE);
        let place = step as f32 + ((u[0] - start) / width).clamp(0.0, 1.0);
        let height = place * (2.0 / STEPS as f32) - 1.0;
        let radius = (1.0 - height * height).max(0.0).sqrt();
        let (sin, cos) = sincos_of_turn(u[1]);
        let mut direction = [0.0; 3];
        direction[self.sky.up] = height;
        direction[(self.sky.up + 1) % 3] = radius * cos;
        direction[(self.sky.up + 2) % 3] = radius * sin;
        direction
    }

    /// The density over solid angle with which [`SkyLight::sample`] draws a unit direction.
    #[inline]
    pub(crate) fn pdf(&self, direction: [f32; 3]) -> f32 {
        let place = (direction[self.sky.up] + 1.0) * (STEPS as f32 / 2.0);
        let gradient = self.density[(place as usize).min(STEPS - 1)];
        let sun = match &self.sun {
            Some(sun) if sun.holds(direction) => 1.0 / sun.solid_angle(),
            _ => 0.0,
        };
        self.p_sun * sun + (1.0 - self.p_sun) * gradient
    }

    /// Radiance at a height, the cosine of the angle to the zenith.
    #[inline]
    fn gradient(&self, height: f32) -> [f32; 3] {
        let sky = &self.sky;
        if height >= 0.0 {
            // The root keeps the bright band near the horizon, where the air is thick.
            return color::mix(sky.horizon, sky.zenith, height.min(1.0).sqrt());
        }
        color::mix(sky.horizon, sky.ground, (-height / HAZE).min(1.0))
    }
}

/// Names the first number of a sky that cannot be.
fn check(sky: &Sky) -> Result<(), RenderError> {
    if sky.up > 2 {
        return Err(RenderError::Up { axis: sky.up });
    }
    let mut colors = vec![("zenith", sky.zenith), ("horizon", sky.horizon), ("ground", sky.ground)];
    if let Some(sun) = &sky.sun {
        colors.push(("sun.radiance", sun.radiance));
        let value = sun.angular_radius;
        if !(value > 0.0 && value <= PI) {
            let remedy = "the angle in radians must be above 0 and at most pi";
            return Err(RenderError::Sky { factor: "sun.angular_radius", value, remedy });
        }
        if vec3::normalize(sun.direction).is_none() {
            let (value, remedy) = (sun.direction[0], "the direction must be finite and not zero");
            return Err(RenderError::Sky { factor: "sun.direction", value, remedy });
        }
    }
    for (factor, radiance) in colors {
        if let Some(value) = radiance.into_iter().find(|c| !(c.is_finite() && *c >= 0.0)) {
            let remedy = "radiance must be finite and not negative";
            return Err(RenderError::Sky { factor, value, remedy });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{SkyLight, dusk};
    use crate::sampler::sobol;
    use core::f32::consts::TAU;
    use treelet_model::{Sky, Sun};

    fn sphere(i: u32) -> [f32; 3] {
        let u = sobol(i);
        let z = 2.0 * u[0] - 1.0;
        let radius = (1.0 - z * z).sqrt();
        [radius * libm::cosf(TAU * u[1]), radius * libm::sinf(TAU * u[1]), z]
    }

    /// The density integrates to 1, and sampling and uniform directions agree on the flux.
    #[test]
    fn density_and_samples_agree() {
        let sun =
            Sun { direction: [0.48, 0.6, 0.64], angular_radius: 0.4, radiance: [20.0, 10.0, 5.0] };
        let skies = [
            Sky::uniform([1.0; 3]),
            dusk(2),
            Sky { sun: Some(sun), ..Sky::clear(1) },
            Sky { sun: Some(sun), ..Sky::uniform([0.0; 3]) },
        ];
        for sky in skies {
            let environment = SkyLight::new(&sky, false).unwrap();
            let n = 1 << 16;
            let (mut density, mut flux, mut sampled) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let direction = sphere(i);
                density += f64::from(environment.pdf(direction)) * f64::from(2.0 * TAU);
                flux += f64::from(environment.radiance(direction, false)[0] * 2.0 * TAU);
                let choice = (i as f32 * 0.618_034).fract();
                let direction = environment.sample(choice, sobol(i));
                let radiance = environment.radiance(direction, false)[0];
                sampled += f64::from(radiance / environment.pdf(direction));
            }
            let n = f64::from(n);
            assert!((density / n - 1.0).abs() < 0.01, "{sky:?}: {}", density / n);
            let (flux, sampled) = (flux / n, sampled / n);
            assert!((flux / sampled - 1.0).abs() < 0.01, "{sky:?}: {flux} {sampled}");
        }
    }

    #[test]
    fn wide_sun_has_the_same_irradiance() {
        let clear = SkyLight::new(&Sky::clear(1), true).unwrap();
        let (sun, wide) = (clear.sun.unwrap(), clear.wide_sun.unwrap());
        let flux = |disc: super::Disc| disc.radiance[1] * disc.solid_angle();
        assert!((flux(sun) / flux(wide) - 1.0).abs() < 1e-4);
        assert!(wide.radiance[1] < 0.05 * sun.radiance[1]);
    }

    #[test]
    fn small_suns_hold_their_own_samples() {
        let sun = Sun { direction: [0.6, 0.0, 0.8], angular_radius: 0.004_65, radiance: [1.0; 3] };
        let sky = Sky { sun: Some(sun), ..Sky::uniform([0.0; 3]) };
        let environment = SkyLight::new(&sky, false).unwrap();
        let held = (0..10_000)
            .filter(|&i| environment.sun.unwrap().holds(environment.sample(0.0, sobol(i))));
        assert!(held.count() > 9_990);
    }

    #[test]
    fn nonsense_is_refused() {
        let good = Sky::clear(1);
        let sun = good.sun.unwrap();
        let bad = [
            Sky { up: 3, ..good },
            Sky { ground: [0.0, f32::NAN, 0.0], ..good },
            Sky { zenith: [0.0, 0.0, -1.0], ..good },
            Sky { sun: Some(Sun { angular_radius: 0.0, ..sun }), ..good },
            Sky { sun: Some(Sun { direction: [0.0; 3], ..sun }), ..good },
            Sky { sun: Some(Sun { radiance: [f32::INFINITY; 3], ..sun }), ..good },
        ];
        for sky in bad {
            assert!(SkyLight::new(&sky, true).is_err(), "{sky:?}");
        }
    }
}

//! Everything that shines, and how to draw a direction toward it.
//!
//! One sample goes to what is far away (sky or environment, and directional lights) or to what is
//! somewhere (emissive triangles, points and spots), as their shares of the light at the point are
//! guessed. Among the latter, a tree chooses (`tree.rs`).

mod emitters;
mod tree;

use crate::color;
use crate::error::RenderError;
use crate::frame::direction_of;
use crate::material::Materials;
use crate::outside::Outside;
use crate::surface::{Place, Surface, Surfaces};
use emitters::{Emitter, Emitters};
use treelet::Ray;
use treelet::math::vec3;
use treelet_model::{Light, LightKind};

/// What is far and what is somewhere each get at least this share of the samples where there are
/// both, and so do sky and directional lights.
const SHARE_MIN: f32 = 0.1;

/// All lights of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Lights<'a> {
    pub(crate) outside: Outside<'a>,
    directional: Vec<Directional>,
    emitters: Option<Emitters>,
    /// What the sky and the directional lights bring to a surface, unoccluded.
    far_irradiance: f64,
    /// The probability of sampling the sky rather than a directional light.
    sky_share: f32,
}

#[derive(Clone, Copy, Debug)]
struct Directional {
    /// Toward the light.
    direction: [f32; 3],
    irradiance: [f32; 3],
    /// The probability up to and with this one, among them.
    cumulative: f32,
    probability: f32,
}

/// Light that may arrive at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Toward the light, of unit length.
    pub(crate) direction: [f32; 3],
    /// The ray that must be free.
    pub(crate) shadow: Ray,
    /// What arrives if it is.
    pub(crate) radiance: [f32; 3],
    /// Density over solid angle, above 0; of a light without a surface, the probability.
    pub(crate) pdf: f32,
    /// Whether nothing but light sampling finds this light.
    pub(crate) alone: bool,
}

/// The numbers that one light sample is drawn from, each in `0 .. 1`; `index` in units of `2^-32`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightNumbers<I> {
    pub(crate) kind: f32,
    /// Drawn only where there are lights to choose from.
    pub(crate) index: I,
    pub(crate) place: [f32; 2],
}

impl<'a> Lights<'a> {
    /// Collects the lights of a model under a sky.
    pub(crate) fn new(
        surfaces: &Surfaces<'_>,
        materials: &Materials<'_>,
        lights: &[Light],
        outside: Outside<'a>,
    ) -> Result<Self, RenderError> {
        lights.iter().enumerate().try_for_each(|(index, light)| check(index, light))?;
        let emitters = Emitters::new(surfaces, materials, lights)?;
        let (directional, brought) = directional(lights);
        let sky = outside.irradiance();
        let sky_share = match (sky > 0.0, brought > 0.0) {
            (_, false) => 1.0,
            (false, true) => 0.0,
            (true, true) => ((sky / (sky + brought)) as f32).clamp(SHARE_MIN, 1.0 - SHARE_MIN),
        };
        Ok(Self { outside, directional, emitters, far_irradiance: sky + brought, sky_share })
    }

    /// The probability of sampling a light that is somewhere, at a point: about its share of the
    /// irradiance there if nothing is in between. Neither is left out, as in truth something always
    /// is.
    #[inline]
    pub(crate) fn emitter_share(&self, point: [f32; 3]) -> f32 {
        let Some(emitters) = &self.emitters else { return 0.0 };
        if self.far_irradiance <= 0.0 {
            return 1.0;
        }
        let irradiance = emitters.tree.guess(point);
        let share = irradiance / (irradiance + self.far_irradiance);
        if share.is_finite() { (share as f32).clamp(SHARE_MIN, 1.0 - SHARE_MIN) } else { 0.5 }
    }

    /// Draws light that may reach a surface; `None` where there is none to draw. `share` is
    /// [`Lights::emitter_share`] of the point.
    pub(crate) fn sample(
        &self,
        surfaces: &Surfaces<'_>,
        materials: &Materials<'_>,
        from: &Surface,
        share: f32,
        u: LightNumbers<impl Fn() -> [u32; 2]>,
    ) -> Option<LightSample> {
        if let Some(emitters) = self.emitters.as_ref().filter(|_| u.kind < share) {
            let [high, low] = (u.index)();
            let index = (f64::from(high) + f64::from(low) / UNITS) / UNITS;
            let (light, probability) = emitters.tree.sample(from.point, index);
            let probability = share * probability as f32;
            return match &emitters.list[light as usize] {
                Emitter::Triangle(place) => {
                    triangle_sample(surfaces, materials, from, *place, probability, u.place)
                }
                Emitter::Point(light) => {
                    let apart = vec3::sub(light.position, from.point);
                    let direction = direction_of(apart)?;
                    let intensity = light.toward(vec3::scale(direction, -1.0));
                    // In f64, where squares of small distances do not vanish.
                    let distance_sq: f64 = apart.iter().map(|&c| f64::from(c) * f64::from(c)).sum();
                    let radiance = intensity.map(|c| (f64::from(c) / distance_sq) as f32);
                    let origin = from.leave(direction);
                    let shadow = Ray::new(origin, vec3::sub(light.position, origin)).up_to(1.0);
                    let pdf = probability;
                    Some(LightSample { direction, shadow, radiance, pdf, alone: true })
                }
            };
        }

        // What is left of `kind` chooses again.
        let choice = ((u.kind - share) / (1.0 - share)).clamp(0.0, 1.0 - f32::EPSILON);
        if choice < self.sky_share || self.directional.is_empty() {
            let direction = self.outside.sample(choice / self.sky_share, u.place);
            let pdf = self.outside_pdf(share, direction);
            let radiance = self.outside.radiance(direction, false);
            let shadow = Ray::new(from.leave(direction), direction);
            let alone = false;
            return (pdf > 0.0).then_some(LightSample { direction, shadow, radiance, pdf, alone });
        }
        let choice = (choice - self.sky_share) / (1.0 - self.sky_share);
        let last = self.directional.len() - 1;
        let at = self.directional.partition_point(|light| light.cumulative <= choice).min(last);
        let light = &self.directional[at];
        let (direction, radiance) = (light.direction, light.irradiance);
        let pdf = (1.0 - share) * (1.0 - self.sky_share) * light.probability;
        let shadow = Ray::new(from.leave(direction), direction);
        (pdf > 0.0).then_some(LightSample { direction, shadow, radiance, pdf, alone: true })
    }

    /// The density over solid angle with which a direction to the sky is drawn.
    #[inline]
    pub(crate) fn outside_pdf(&self, share: f32, direction: [f32; 3]) -> f32 {
        (1.0 - share) * self.sky_share * self.outside.pdf(direction)
    }

    /// The density over solid angle with which the point of an emissive triangle is drawn from
    /// `from`, by the squared distance and the cosine there. 0 for a triangle seen edge-on, which
    /// sampling gives up as well.
    pub(crate) fn emitter_pdf(
        &self,
        surfaces: &Surfaces<'_>,
        share: f32,
        from: [f32; 3],
        at: Place,
        distance_sq: f64,
        cos: f32,
    ) -> f32 {
        let Some(emitters) = &self.emitters else { return 0.0 };
        let probability =
            emitters.number(at).map_or(0.0, |number| emitters.tree.probability(number, from));
        share * probability as f32 * over_solid_angle(surfaces, at, distance_sq, cos)
    }
}

/// `2^32`.
const UNITS: f64 = 4_294_967_296.0;

/// Density over solid angle of points that are uniform over a triangle.
fn over_solid_angle(surfaces: &Surfaces<'_>, at: Place, distance_sq: f64, cos: f32) -> f32 {
    let cos = f64::from(cos.abs());
    match surfaces.area(at) {
        Some(area) if cos > 0.0 => (distance_sq / (cos * area)) as f32,
        _ => 0.0,
    }
}

/// A point of a triangle, uniform by area, from the root of one coordinate.
fn triangle_sample(
    surfaces: &Surfaces<'_>,
    materials: &Materials<'_>,
    from: &Surface,
    place: Place,
    probability: f32,
    u: [f32; 2],
) -> Option<LightSample> {
    let root = u[0].sqrt();
    let at = surfaces.at(place, root * (1.0 - u[1]), root * u[1], [0.0; 3])?;
    let apart = vec3::sub(at.point, from.point);
    let direction = direction_of(apart)?;
    let cos = vec3::dot(direction, at.geometric);
    // Holes do not shine.
    if materials.has_alpha(at.on.material) && !materials.is_there(surfaces, &at.on, || u[0]) {
        return None;
    }
    let radiance = materials.emission(surfaces, &at.on, cos < 0.0);
    let distance_sq: f64 = apart.iter().map(|&c| f64::from(c) * f64::from(c)).sum();
    let pdf = probability * over_solid_angle(surfaces, place, distance_sq, cos);

    // The shadow ray ends short of the light by the light's own error bound.
    let origin = from.leave(direction);
    let target = at.leave(vec3::scale(direction, -1.0));
    let shadow = Ray::new(origin, vec3::sub(target, origin)).up_to(1.0);
    let sample = LightSample { direction, shadow, radiance, pdf, alone: false };
    (pdf > 0.0 && pdf.is_finite()).then_some(sample)
}

/// The directional lights, and what they bring together.
fn directional(lights: &[Light]) -> (Vec<Directional>, f64) {
    let mut out = Vec::new();
    let mut total = 0.0;
    for light in lights {
        if let LightKind::Directional { direction, irradiance } = light.kind
            && let Some(along) = vec3::normalize(direction)
            && color::max(irradiance) > 0.0
        {
            let luminance = color::luminance(irradiance).max(f32::MIN_POSITIVE);
            total += f64::from(luminance);
            let direction = vec3::scale(along, -1.0);
            out.push(Directional {
                direction,
                irradiance,
                cumulative: 0.0,
                probability: luminance,
            });
        }
    }
    let mut sum = 0.0;
    for light in &mut out {
        let weight = f64::from(light.probability);
        sum += weight;
        light.cumulative = (sum / total) as f32;
        light.probability = (weight / total) as f32;
    }
    (out, total)
}

/// Names the first number of a light that cannot be.
fn check(index: usize, light: &Light) -> Result<(), RenderError> {
    let (strength, place, angles) = match light.kind {
        LightKind::Point { position, intensity } => (intensity, position, [0.0, 1.0]),
        LightKind::Spot { position, intensity, inner_angle, outer_angle, direction, .. } => {
            let place = if vec3::normalize(direction).is_some() { position } else { direction };
            let bad = vec3::normalize(direction).is_none();
            (intensity, if bad { [f32::NAN; 3] } else { place }, [inner_angle, outer_angle])
        }
        LightKind::Directional { direction, irradiance } => {
            let bad = vec3::normalize(direction).is_none();
            (irradiance, if bad { [f32::NAN; 3] } else { direction }, [0.0, 1.0])
        }
    };
    let bad = |factor, value| {
        let name = light.name.clone();
        Err(RenderError::Light { light: index, name, factor, value })
    };
    if let Some(value) = strength.into_iter().find(|c| !(c.is_finite() && *c >= 0.0)) {
        return bad("strength", value);
    }
    if let Some(value) = place.into_iter().find(|c| !c.is_finite()) {
        return bad("position or direction", value);
    }
    let [inner, outer] = angles;
    let fits = inner >= 0.0 && outer > 0.0 && outer <= core::f32::consts::PI + 1e-6;
    if fits { Ok(()) } else { bad("angle", if outer > 0.0 { inner } else { outer }) }
}

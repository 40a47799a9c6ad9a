//! Everything that shines, and how to draw a direction toward it.
//!
//! One sample goes to the sky (gradient and sun) or to one emissive triangle, as their shares of the
//! light at the point are guessed, and among the triangles by world area times luminance. As that
//! weight is the same per area for one material, the density of a point on any light needs no table:
//! luminance over the total. Triangles shine on both sides.

use crate::alias::AliasTable;
use crate::color;
use crate::error::RenderError;
use crate::sky::Environment;
use crate::surface::{Place, Surface, Surfaces};
use treelet::Ray;
use treelet::math::vec3;
use treelet_model::Material;

/// Sky and emissive triangles each get at least this share of the samples where there are both.
const SHARE_MIN: f32 = 0.1;
/// The least squared spread of the light, of its squared distance from the origin: a lamp of one
/// triangle has no spread.
const RADIUS_MIN: f64 = 1e-6;

/// All lights of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    pub(crate) environment: Environment,
    emitters: Option<Emitters>,
    /// What the sky brings to a surface, unoccluded.
    sky_irradiance: f64,
}

/// The emissive triangles.
#[derive(Clone, Debug)]
struct Emitters {
    places: Vec<Place>,
    table: AliasTable,
    /// The sum of area times luminance.
    total: f64,
    /// The middle of the light, and its mean squared distance from there.
    center: [f64; 3],
    radius_sq: f64,
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
    /// Density over solid angle, above 0.
    pub(crate) pdf: f32,
}

/// The numbers that one light sample is drawn from, each in `0 .. 1`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightNumbers {
    pub(crate) kind: f32,
    pub(crate) index: u32,
    pub(crate) coin: f32,
    pub(crate) place: [f32; 2],
}

impl Lights {
    /// Collects the lights of a model under a sky.
    pub(crate) fn new(
        surfaces: &Surfaces<'_>,
        materials: &[Material],
        environment: Environment,
    ) -> Result<Self, RenderError> {
        let emitters = Emitters::new(surfaces, materials)?;
        let sky_irradiance = environment.irradiance();
        Ok(Self { environment, emitters, sky_irradiance })
    }

    /// The probability of sampling an emissive triangle rather than the sky, at a point: about its
    /// share of the irradiance there if all triangles face the point and nothing is in between.
    /// Neither is left out, as in truth something always is.
    #[inline]
    pub(crate) fn emitter_share(&self, point: [f32; 3]) -> f32 {
        let Some(emitters) = &self.emitters else { return 0.0 };
        if self.sky_irradiance <= 0.0 {
            return 1.0;
        }
        let apart: [f64; 3] = core::array::from_fn(|c| f64::from(point[c]) - emitters.center[c]);
        let distance_sq = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
        let irradiance = emitters.total / (distance_sq + emitters.radius_sq);
        let share = irradiance / (irradiance + self.sky_irradiance);
        (share as f32).clamp(SHARE_MIN, 1.0 - SHARE_MIN)
    }

    /// Draws light that may reach a surface; `None` where there is none to draw. `share` is
    /// [`Lights::emitter_share`] of the point.
    pub(crate) fn sample(
        &self,
        surfaces: &Surfaces<'_>,
        materials: &[Material],
        from: &Surface,
        share: f32,
        u: LightNumbers,
    ) -> Option<LightSample> {
        let emitters = self.emitters.as_ref().filter(|_| u.kind < share);
        let Some(emitters) = emitters else {
            // What is left of `kind` chooses again.
            let choice = (u.kind - share) / (1.0 - share);
            let direction = self.environment.sample(choice, u.place);
            let pdf = self.environment_pdf(share, direction);
            let radiance = self.environment.radiance(direction, false);
            let shadow = Ray::new(from.leave(direction), direction);
            return (pdf > 0.0).then_some(LightSample { direction, shadow, radiance, pdf });
        };

        // A point of a triangle, uniform by area, from the root of one coordinate.
        let place = emitters.places[emitters.table.sample(u.index, u.coin) as usize];
        let root = u.place[0].sqrt();
        let at = surfaces.at(place, root * (1.0 - u.place[1]), root * u.place[1], [0.0; 3])?;
        let direction = vec3::normalize(vec3::sub(at.point, from.point))?;
        let radiance = materials[at.material as usize].emission;
        let apart = vec3::sub(at.point, from.point).map(f64::from);
        let distance_sq = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
        let pdf =
            self.emitter_pdf(share, radiance, distance_sq, vec3::dot(direction, at.geometric));

        // The shadow ray ends short of the light by the light's own error bound.
        let origin = from.leave(direction);
        let target = at.leave(vec3::scale(direction, -1.0));
        let shadow = Ray::new(origin, vec3::sub(target, origin)).up_to(1.0);
        (pdf > 0.0 && pdf.is_finite()).then_some(LightSample { direction, shadow, radiance, pdf })
    }

    /// The density over solid angle with which a direction to the sky is drawn.
    #[inline]
    pub(crate) fn environment_pdf(&self, share: f32, direction: [f32; 3]) -> f32 {
        (1.0 - share) * self.environment.pdf(direction)
    }

    /// The density over solid angle with which a point of an emissive triangle is drawn, by its
    /// emission, the squared distance and the cosine there. 0 for a triangle seen edge-on, which
    /// sampling gives up as well.
    #[inline]
    pub(crate) fn emitter_pdf(
        &self,
        share: f32,
        emission: [f32; 3],
        distance_sq: f64,
        cos: f32,
    ) -> f32 {
        let Some(emitters) = &self.emitters else { return 0.0 };
        let cos = f64::from(cos.abs());
        if cos <= 0.0 {
            return 0.0;
        }
        let by_area = f64::from(color::luminance(emission)) / emitters.total;
        share * (by_area * distance_sq / cos) as f32
    }
}

impl Emitters {
    fn new(surfaces: &Surfaces<'_>, materials: &[Material]) -> Result<Option<Self>, RenderError> {
        // All room at once: a lamp of many triangles that is placed often is refused, not begun.
        let emissive = |placement: usize| {
            let luminance = |m: u32| f64::from(color::luminance(materials[m as usize].emission));
            let parts = surfaces.materials(placement).map(luminance).enumerate();
            parts.filter(|&(_, luminance)| luminance > 0.0)
        };
        let count = (0..surfaces.placements())
            .flat_map(|placement| emissive(placement).map(move |(geom, _)| (placement, geom)))
            .map(|(placement, geom)| surfaces.triangles(placement, geom) as u64)
            .fold(0_u64, u64::saturating_add);
        let bytes = count.saturating_mul((size_of::<Place>() + size_of::<f64>()) as u64);
        let too_many = RenderError::OutOfMemory { bytes, what: "the list of lights" };
        let Ok(room) = u32::try_from(count) else { return Err(too_many) };
        let (mut places, mut weights) = (Vec::new(), Vec::new());
        let refused = |_| RenderError::OutOfMemory { bytes, what: "the list of lights" };
        places.try_reserve_exact(room as usize).map_err(refused)?;
        weights.try_reserve_exact(room as usize).map_err(refused)?;

        for placement in 0..surfaces.placements() {
            for (geom, luminance) in emissive(placement) {
                for prim in 0..surfaces.triangles(placement, geom) {
                    let (placement, geom, prim) = (placement as u32, geom as u32, prim as u32);
                    let place = Place { placement, geom, prim };
                    if let Some(area) = surfaces.area(place) {
                        places.push(place);
                        weights.push(area * luminance);
                    }
                }
            }
        }
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return Ok(None);
        }

        // Where the light is, as far as choosing lights goes: its middle and its spread.
        let (mut center, mut square) = ([0.0; 3], 0.0);
        for (place, weight) in places.iter().zip(&weights) {
            if let Some(at) = surfaces.at(*place, 1.0 / 3.0, 1.0 / 3.0, [0.0; 3]) {
                let p = at.point.map(f64::from);
                (0..3).for_each(|c| center[c] += weight / total * p[c]);
                square += weight / total * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
            }
        }
        let middle = center[0] * center[0] + center[1] * center[1] + center[2] * center[2];
        let radius_sq = (square - middle).max(RADIUS_MIN * square).max(f64::MIN_POSITIVE);
        Ok(Some(Self { places, table: AliasTable::new(&weights)?, total, center, radius_sq }))
    }
}

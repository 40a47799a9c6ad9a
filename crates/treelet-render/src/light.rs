//! Everything that shines, and how to draw a direction toward it.
//!
//! One sample goes to the sky (gradient and sun) or to one emissive triangle, drawn by world area
//! times luminance. As that weight is the same per area for one material, the density of a point on
//! any light needs no table: luminance over the total. Triangles shine on both sides.

use crate::alias::AliasTable;
use crate::color;
use crate::error::RenderError;
use crate::sky::Environment;
use crate::surface::{Place, Surface, Surfaces};
use treelet::Ray;
use treelet::math::vec3;
use treelet_model::Material;

/// All lights of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    pub(crate) environment: Environment,
    emitters: Option<Emitters>,
    /// The probability of an emissive triangle rather than the sky.
    p_emitters: f32,
}

/// The emissive triangles.
#[derive(Clone, Debug)]
struct Emitters {
    places: Vec<Place>,
    table: AliasTable,
    /// The sum of area times luminance.
    total: f64,
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
        // The sky is of no use in a closed room, nor are small lamps by day; nobody knows which of
        // the two it is.
        let p_emitters = match &emitters {
            None => 0.0,
            Some(_) if environment.irradiance() <= 0.0 => 1.0,
            Some(_) => 0.5,
        };
        Ok(Self { environment, emitters, p_emitters })
    }

    /// Draws light that may reach a surface; `None` where there is none to draw.
    pub(crate) fn sample(
        &self,
        surfaces: &Surfaces<'_>,
        materials: &[Material],
        from: &Surface,
        u: LightNumbers,
    ) -> Option<LightSample> {
        let emitters = self.emitters.as_ref().filter(|_| u.kind < self.p_emitters);
        let Some(emitters) = emitters else {
            // What is left of `kind` chooses again.
            let choice = (u.kind - self.p_emitters) / (1.0 - self.p_emitters);
            let direction = self.environment.sample(choice, u.place);
            let pdf = self.environment_pdf(direction);
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
        let pdf = self.emitter_pdf(radiance, distance_sq, vec3::dot(direction, at.geometric));

        // The shadow ray ends short of the light by the light's own error bound.
        let origin = from.leave(direction);
        let target = at.leave(vec3::scale(direction, -1.0));
        let shadow = Ray::new(origin, vec3::sub(target, origin)).up_to(1.0);
        (pdf > 0.0 && pdf.is_finite()).then_some(LightSample { direction, shadow, radiance, pdf })
    }

    /// The density over solid angle with which a direction to the sky is drawn.
    #[inline]
    pub(crate) fn environment_pdf(&self, direction: [f32; 3]) -> f32 {
        (1.0 - self.p_emitters) * self.environment.pdf(direction)
    }

    /// The density over solid angle with which a point of an emissive triangle is drawn, by its
    /// emission, the squared distance and the cosine there. 0 for a triangle seen edge-on, which
    /// sampling gives up as well.
    #[inline]
    pub(crate) fn emitter_pdf(&self, emission: [f32; 3], distance_sq: f64, cos: f32) -> f32 {
        let Some(emitters) = &self.emitters else { return 0.0 };
        let cos = f64::from(cos.abs());
        if cos <= 0.0 {
            return 0.0;
        }
        let by_area = f64::from(color::luminance(emission)) / emitters.total;
        self.p_emitters * (by_area * distance_sq / cos) as f32
    }
}

impl Emitters {
    fn new(surfaces: &Surfaces<'_>, materials: &[Material]) -> Result<Option<Self>, RenderError> {
        let (mut places, mut weights) = (Vec::new(), Vec::new());
        for placement in 0..surfaces.placements() {
            for (geom, material) in surfaces.materials(placement).enumerate() {
                let luminance = f64::from(color::luminance(materials[material as usize].emission));
                if luminance <= 0.0 {
                    continue;
                }
                let triangles = surfaces.triangles(placement, geom);
                let bytes = (triangles * (size_of::<Place>() + 8)) as u64;
                let refused = |_| RenderError::OutOfMemory { bytes, what: "the list of lights" };
                places.try_reserve(triangles).map_err(refused)?;
                weights.try_reserve(triangles).map_err(refused)?;
                for prim in 0..triangles {
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
        Ok(Some(Self { places, table: AliasTable::new(&weights)?, total }))
    }
}

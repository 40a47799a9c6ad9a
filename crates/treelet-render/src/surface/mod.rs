//! What a hit lies on: the point, its normals, its material and coordinates, and how far a ray must
//! step off it (`place.rs`).

mod attributes;
mod exact;
mod place;
#[cfg(test)]
mod tests;

use crate::error::RenderError;
use crate::frame::direction_of;
use exact::{apply, blended, cross, longest_side, unit};
use place::PlaceRecord;
use treelet::Hit;
use treelet::math::vec3;
use treelet_model::{Model, Part};

/// How far above the surface a bent mirror direction stays, as a cosine.
const HORIZON: f32 = 1e-3;

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// In the world.
    pub(crate) point: [f32; 3],
    /// How far a ray must start from `point` along the geometric normal.
    pub(crate) offset: f32,
    /// The unit normal of the triangle, on the side from which its corners turn left.
    pub(crate) geometric: [f32; 3],
    /// The unit normal that shading uses, on the same side.
    pub(crate) shading: [f32; 3],
    /// Where on its part.
    pub(crate) on: PartPoint,
}

/// A point of a triangle of a placed part.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PartPoint {
    pub(crate) at: Place,
    /// Weights of the second and the third vertex.
    pub(crate) weights: [f32; 2],
    /// Index of the material.
    pub(crate) material: u32,
    /// Whether vertices have colours.
    pub(crate) colored: bool,
}

/// A triangle in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) placement: u32,
    pub(crate) geom: u32,
    pub(crate) prim: u32,
}

impl Surface {
    /// Where a ray in this direction, or to a point in it, starts.
    #[inline]
    pub(crate) fn leave(&self, direction: [f32; 3]) -> [f32; 3] {
        let along = self.offset.copysign(vec3::dot(direction, self.geometric));
        vec3::add(self.point, vec3::scale(self.geometric, along))
    }

    /// The shading normal on the side of `wo`, bent so that its mirror image of `wo` stays above
    /// the surface and `wo` above the normal's horizon; `facing` is the geometric normal on that side.
    ///
    /// Source: A. Keller et al., "The Iray Light Transport Simulation and Rendering System", 2017,
    /// appendix A.3.
    #[inline]
    pub(crate) fn shading_toward(&self, wo: [f32; 3], facing: [f32; 3]) -> [f32; 3] {
        // For flat surfaces both are the same vector, and nothing can go wrong.
        if self.shading == self.geometric {
            return facing;
        }
        let toward = 1f32.copysign(vec3::dot(wo, self.geometric));
        let normal = vec3::scale(self.shading, toward);
        let mirrored = vec3::sub(vec3::scale(normal, 2.0 * vec3::dot(wo, normal)), wo);
        let height = vec3::dot(mirrored, facing);
        if height >= HORIZON && vec3::dot(wo, normal) > 0.0 {
            return normal;
        }
        let lifted = vec3::add(mirrored, vec3::scale(facing, (HORIZON - height).max(0.0)));
        vec3::normalize(lifted)
            .and_then(|lifted| vec3::normalize(vec3::add(wo, lifted)))
            .unwrap_or(facing)
    }
}

/// The arrays of a part.
#[derive(Clone, Copy, Debug)]
struct PartRecord<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
    normals: Option<&'a [[f32; 3]]>,
    material: u32,
    part: &'a Part,
}

/// All surfaces of a model.
#[derive(Clone, Debug)]
pub(crate) struct Surfaces<'a> {
    parts: Vec<PartRecord<'a>>,
    places: Vec<PlaceRecord>,
}

impl<'a> Surfaces<'a> {
    /// Checks the model's references and looks them all up once.
    pub(crate) fn new(model: &'a Model) -> Result<Self, RenderError> {
        let mut parts = Vec::new();
        let mut first_part = Vec::with_capacity(model.objects.len());
        for (object, data) in model.objects.iter().enumerate() {
            first_part.push(parts.len());
            for (part, data) in data.parts.iter().enumerate() {
                let (material, materials) = (data.material, model.materials.len());
                if material >= materials {
                    return Err(RenderError::NoSuchMaterial { object, part, material, materials });
                }
                attributes::check(object, part, data)?;
                parts.push(PartRecord {
                    positions: data.mesh.positions(),
                    triangles: data.mesh.triangles(),
                    normals: data.normals.as_deref(),
                    material: material as u32,
                    part: data,
                });
            }
        }
        let mut places = Vec::new();
        let bytes = (model.placements.len() * size_of::<PlaceRecord>()) as u64;
        places
            .try_reserve_exact(model.placements.len())
            .map_err(|_| RenderError::OutOfMemory { bytes, what: "the placements" })?;
        for (placement, data) in model.placements.iter().enumerate() {
            let (object, objects) = (data.object, model.objects.len());
            let Some(&first_part) = first_part.get(object) else {
                return Err(RenderError::NoSuchObject { placement, object, objects });
            };
            let parts = model.objects[object].parts.len();
            places.push(PlaceRecord::new(first_part, parts, data.world_from_object));
        }
        Ok(Self { parts, places })
    }

    /// How many placements there are.
    pub(crate) fn placements(&self) -> usize {
        self.places.len()
    }

    /// The materials of a placement's parts, in order.
    pub(crate) fn materials(&self, placement: usize) -> impl Iterator<Item = u32> + '_ {
        self.parts_of(placement).iter().map(|part| part.material)
    }

    /// How many triangles a placed part has.
    pub(crate) fn triangles(&self, placement: usize, geom: usize) -> usize {
        self.parts_of(placement).get(geom).map_or(0, |part| part.triangles.len())
    }

    fn parts_of(&self, placement: usize) -> &[PartRecord<'a>] {
        let place = &self.places[placement];
        &self.parts[place.first_part..place.first_part + place.parts]
    }

    fn part(&self, at: Place) -> Option<&PartRecord<'a>> {
        let place = self.places.get(at.placement as usize)?;
        let geom = at.geom as usize;
        if geom < place.parts { self.parts.get(place.first_part + geom) } else { None }
    }

    /// The corners of a triangle in the world.
    pub(crate) fn corners(&self, at: Place) -> Option<[[f64; 3]; 3]> {
        let place = self.places.get(at.placement as usize)?;
        let [a, b, c] = corners(self.part(at)?, at.prim)?;
        let map = &place.world_from_object;
        Some([apply(map, a), apply(map, b), apply(map, c)])
    }

    /// The area of a triangle in the world; `None` unless it is finite and above 0.
    pub(crate) fn area(&self, at: Place) -> Option<f64> {
        let [x, y, z] = cross(&self.corners(at)?);
        let area = 0.5 * (x * x + y * y + z * z).sqrt();
        (area > 0.0 && area.is_finite()).then_some(area)
    }

    /// Where on its part a hit lies.
    #[inline]
    pub(crate) fn part_point(&self, hit: &Hit, placement: usize) -> Option<PartPoint> {
        let at = Place { placement: placement as u32, geom: hit.geom, prim: hit.prim };
        let part = self.part(at)?;
        let (material, colored) = (part.material, part.part.colors.is_some());
        Some(PartPoint { at, weights: [hit.u, hit.v], material, colored })
    }

    /// Looks at the corners of what was hit, so that they are near when they are needed. Loads of this
    /// loop overlap; those between two shadings, thousands of instructions apart, do not.
    pub(crate) fn fetch(&self, places: impl Iterator<Item = Place> + Clone) {
        let mut sum = 0;
        for at in places.clone() {
            let triangle = self.part(at).and_then(|part| part.triangles.get(at.prim as usize));
            sum ^= triangle.map_or(0, |triangle| triangle[0]);
        }
        for at in places {
            let Some(part) = self.part(at) else { continue };
            let Some(triangle) = part.triangles.get(at.prim as usize) else { continue };
            for vertex in triangle {
                sum ^= part.positions.get(*vertex as usize).map_or(0, |p| p[0].to_bits());
            }
        }
        core::hint::black_box(sum);
    }

    /// The surface under a hit of a ray along `direction`.
    #[inline]
    pub(crate) fn under(
        &self,
        hit: &Hit,
        placement: usize,
        direction: [f32; 3],
    ) -> Option<Surface> {
        let at = Place { placement: placement as u32, geom: hit.geom, prim: hit.prim };
        self.at(at, hit.u, hit.v, direction)
    }

    /// The point of a triangle with weights `u`, `v` of its second and third vertex. A triangle
    /// without a normal faces against `direction`. `None` if there is no such triangle.
    pub(crate) fn at(&self, at: Place, u: f32, v: f32, direction: [f32; 3]) -> Option<Surface> {
        let place = self.places.get(at.placement as usize)?;
        let part = self.part(at)?;
        let corners = corners(part, at.prim)?;

        // The point, in f64 so that only the last rounding counts.
        let object = blended(&corners, [f64::from(u), f64::from(v)]);
        let world = if place.unmoved { object } else { apply(&place.world_from_object, object) };
        let point = [world[0] as f32, world[1] as f32, world[2] as f32];

        // The normals.
        let against = vec3::scale(direction, -1.0);
        let to_world = |n: [f32; 3]| direction_of(place.object_from_world.transposed_vector(n));
        let facet = unit(cross(&corners));
        let facet = if place.unmoved { facet } else { facet.and_then(to_world) };
        let geometric = facet.unwrap_or(against);
        let shading = match part.normals {
            None => geometric,
            Some(normals) => attributes::blend(normals, part.triangles, at.prim, [u, v])
                .and_then(to_world)
                .map_or(geometric, |n| {
                    // Whichever way a file's normals point, the triangle decides what is outside.
                    vec3::scale(n, 1f32.copysign(vec3::dot(n, geometric)))
                }),
        };

        let offset = place.offset(point, geometric, longest_side(&corners));
        let (material, colored) = (part.material, part.part.colors.is_some());
        let on = PartPoint { at, weights: [u, v], material, colored };
        Some(Surface { point, offset, geometric, shading, on })
    }
}

#[inline(always)]
fn corners(part: &PartRecord<'_>, prim: u32) -> Option<[[f64; 3]; 3]> {
    let [a, b, c] = *part.triangles.get(prim as usize)?;
    let corner = |vertex: u32| {
        let [x, y, z] = *part.positions.get(vertex as usize)?;
        Some([f64::from(x), f64::from(y), f64::from(z)])
    };
    Some([corner(a)?, corner(b)?, corner(c)?])
}

//! What a hit lies on: the point, its normals, its material, and how far a ray must step off it.
//!
//! # Leaving a surface
//!
//! In the spirit of M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", section 6.8, and
//! of C. Wächter, N. Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing
//! Gems, 2019, but derived for this tracer. Let `u = 2^-24`, `M p + b` the map of the placement,
//! `|.|` taken entry by entry, `e` the longest side of the triangle's box in object space.
//!
//! The hit point is `v0 + u (v1 - v0) + v (v2 - v0)`, through the map, in f64, rounded once. However
//! wrong `u` and `v` are, that is a point of the plane; so the world point is off it by `u |p|`.
//! What the next ray sees of that plane is less exact:
//!
//! - its origin goes through the inverse map, whose entries are rounded: three products, three
//!   sums, rounded entries, `5 u |M^-1| (|p| + |b|)`, which in the world is `|M|` times that;
//! - the triangle test moves and shears the corners, whose distance from the origin is about `e`:
//!   `6 u e` (see the library's triangle test), in the world `|M|` times that;
//! - adding the offset rounds once more: `u |p|`.
//!
//! With `A = |M| |M^-1|`, which is at least the identity, all of it is below
//! `7 u A (|p| + |b|) + 6 u |M| e`; `OFFSET` takes 16 for both. The offset along the normal `n` is
//! the part of that box of errors that `n` sees: the sum of `|n|` times it over the axes. At one
//! metre from the origin it is a micrometre.

use crate::error::RenderError;
use treelet::Hit;
use treelet::math::{Affine, vec3};
use treelet_model::Model;

/// The offset in units of `2^-24` of the sizes above; see the module head.
const OFFSET: f32 = 16.0 * (f32::EPSILON / 2.0);

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
    /// Index of the material.
    pub(crate) material: u32,
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
}

/// A placement and what it does to normals and errors.
#[derive(Clone, Copy, Debug)]
struct PlaceRecord {
    first_part: usize,
    parts: usize,
    world_from_object: Affine,
    object_from_world: Affine,
    /// `|M| |M^-1|`.
    spread: [[f32; 3]; 3],
}

/// All surfaces of a model.
#[derive(Clone, Debug)]
pub(crate) struct Surfaces<'a> {
    parts: Vec<PartRecord<'a>>,
    places: Vec<PlaceRecord>,
}

/// A triangle in the world, for lights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) placement: u32,
    pub(crate) geom: u32,
    pub(crate) prim: u32,
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
                let positions = data.mesh.positions();
                let normals = data.normals.as_deref();
                if let Some(normals) = normals
                    && normals.len() != positions.len()
                {
                    let (normals, vertices) = (normals.len(), positions.len());
                    return Err(RenderError::NormalCount { object, part, normals, vertices });
                }
                let triangles = data.mesh.triangles();
                let material = material as u32;
                parts.push(PartRecord { positions, triangles, normals, material });
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

    /// The area of a triangle in the world; `None` unless it is finite and above 0.
    pub(crate) fn area(&self, at: Place) -> Option<f64> {
        let place = &self.places[at.placement as usize];
        let part = self.parts_of(at.placement as usize).get(at.geom as usize)?;
        let corners = corners(part, at.prim)?.map(|p| apply(&place.world_from_object, p));
        let [x, y, z] = cross(&corners);
        let area = 0.5 * (x * x + y * y + z * z).sqrt();
        (area > 0.0 && area.is_finite()).then_some(area)
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
        let part = self.parts_of(at.placement as usize).get(at.geom as usize)?;
        let corners = corners(part, at.prim)?;
        let [a, b, c] = corners;

        // The point, in f64 so that only the last rounding counts.
        let (u64, v64) = (f64::from(u), f64::from(v));
        let object: [f64; 3] =
            core::array::from_fn(|k| a[k] + u64 * (b[k] - a[k]) + v64 * (c[k] - a[k]));
        let point = apply(&place.world_from_object, object).map(|x| x as f32);

        // The normals.
        let against = vec3::scale(direction, -1.0);
        let facet = unit_f64(cross(&corners));
        let to_world = |n: [f32; 3]| vec3::normalize(place.object_from_world.transposed_vector(n));
        let geometric = facet.and_then(to_world).unwrap_or(against);
        let shading = part
            .normals
            .and_then(|normals| interpolate(normals, part.triangles, at.prim, u, v))
            .and_then(to_world)
            .map_or(geometric, |n| {
                // Whichever way a file's normals point, the triangle decides what is outside.
                vec3::scale(n, 1f32.copysign(vec3::dot(n, geometric)))
            });

        let offset = place.offset(point, geometric, longest_side(&corners));
        Some(Surface { point, offset, geometric, shading, material: part.material })
    }
}

impl PlaceRecord {
    fn new(first_part: usize, parts: usize, world_from_object: Affine) -> Self {
        // A singular map places nothing that a ray could hit.
        let object_from_world = world_from_object.inverse().unwrap_or_default();
        let (m, inverse) = (world_from_object.0, object_from_world.0);
        let spread = core::array::from_fn(|row| {
            core::array::from_fn(|column| {
                (0..3).map(|k| m[row][k].abs() * inverse[k][column].abs()).sum()
            })
        });
        Self { first_part, parts, world_from_object, object_from_world, spread }
    }

    /// The distance that a ray must start from a point; derived in the module head.
    #[inline]
    fn offset(&self, point: [f32; 3], normal: [f32; 3], side: f32) -> f32 {
        let m = self.world_from_object.0;
        let mut sum = 0.0;
        for row in 0..3 {
            let mut error = (m[row][0].abs() + m[row][1].abs() + m[row][2].abs()) * side;
            for k in 0..3 {
                error += self.spread[row][k] * (point[k].abs() + m[k][3].abs());
            }
            sum += normal[row].abs() * error;
        }
        OFFSET * sum
    }
}

#[inline]
fn corners(part: &PartRecord<'_>, prim: u32) -> Option<[[f64; 3]; 3]> {
    let [a, b, c] = *part.triangles.get(prim as usize)?;
    let corner = |vertex: u32| part.positions.get(vertex as usize).map(|p| p.map(f64::from));
    Some([corner(a)?, corner(b)?, corner(c)?])
}

/// The affine map in f64.
#[inline]
fn apply(map: &Affine, p: [f64; 3]) -> [f64; 3] {
    map.0.map(|row| {
        let [a, b, c, d] = row.map(f64::from);
        a * p[0] + b * p[1] + c * p[2] + d
    })
}

/// Twice the area vector of a triangle.
#[inline]
fn cross(corners: &[[f64; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let e: [f64; 3] = core::array::from_fn(|k| b[k] - a[k]);
    let f: [f64; 3] = core::array::from_fn(|k| c[k] - a[k]);
    [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
}

#[inline]
fn unit_f64(v: [f64; 3]) -> Option<[f32; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|x| (x / length) as f32))
}

/// The longest side of the triangle's box.
#[inline]
fn longest_side(corners: &[[f64; 3]; 3]) -> f32 {
    let [a, b, c] = corners;
    let side = |k: usize| a[k].max(b[k]).max(c[k]) - a[k].min(b[k]).min(c[k]);
    side(0).max(side(1)).max(side(2)) as f32
}

#[inline]
fn interpolate(
    normals: &[[f32; 3]],
    triangles: &[[u32; 3]],
    prim: u32,
    u: f32,
    v: f32,
) -> Option<[f32; 3]> {
    let [a, b, c] = *triangles.get(prim as usize)?;
    let (a, b, c) = (normals.get(a as usize)?, normals.get(b as usize)?, normals.get(c as usize)?);
    let w = 1.0 - u - v;
    Some(core::array::from_fn(|k| w * a[k] + u * b[k] + v * c[k]))
}

#[cfg(test)]
mod tests {
    use super::Surfaces;
    use crate::frame::Frame;
    use crate::sampler::Sampler;
    use treelet::math::{Affine, vec3};
    use treelet::{BuildOptions, Mesh, Ray};
    use treelet_model::{Material, Model, PlacedModel};

    /// A closed convex body: rings of planar trapezoids on the unit sphere, and two caps.
    fn ball() -> Mesh {
        const RINGS: u32 = 12;
        const COLUMNS: u32 = 20;
        let mut corners = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
        for ring in 1..RINGS {
            let (sin, cos) =
                libm::sincos(core::f64::consts::PI * f64::from(ring) / f64::from(RINGS));
            for column in 0..COLUMNS {
                let turn = core::f64::consts::TAU * f64::from(column) / f64::from(COLUMNS);
                corners.push([sin * libm::cos(turn), sin * libm::sin(turn), cos].map(|c| c as f32));
            }
        }
        let at = |ring: u32, column: u32| 2 + (ring - 1) * COLUMNS + column % COLUMNS;
        let mut triangles = Vec::new();
        for column in 0..COLUMNS {
            triangles.push([0, at(1, column), at(1, column + 1)]);
            triangles.push([1, at(RINGS - 1, column + 1), at(RINGS - 1, column)]);
            for ring in 1..RINGS - 1 {
                let [a, b] = [at(ring, column), at(ring + 1, column)];
                let [c, d] = [at(ring + 1, column + 1), at(ring, column + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        Mesh::new(corners, triangles)
    }

    /// A direction of the hemisphere around a unit vector, grazing ones among them.
    fn hemisphere(around: [f32; 3], u: [f32; 2]) -> [f32; 3] {
        // A direction in the plane itself has no side.
        let height = (u[0] * u[0]).max(1e-6);
        let radius = (1.0 - height * height).sqrt();
        let phi = core::f32::consts::TAU * u[1];
        Frame::around(around).to_world([radius * libm::cosf(phi), radius * libm::sinf(phi), height])
    }

    /// Rays that leave a convex body outward meet nothing, rays that enter it meet it again: at
    /// every size, far away, turned, stretched and mirrored.
    #[test]
    fn no_acne_and_no_leaks() {
        let turn = Affine::rotation([1.0, -2.0, 0.5], 1.1);
        let stretch = Affine::scaling([-1.0, 3.0, 0.25]);
        let shape = turn.then_from(&stretch).then_from(&Affine::rotation([0.3, 1.0, 0.0], 0.4));
        for (bake, shape) in [(true, Affine::IDENTITY), (false, Affine::IDENTITY), (false, shape)] {
            for size in [1e-3f32, 1.0, 1e3, 1e6] {
                for at in [[0.0; 3], [1.0, -2.0, 3.0], [148_376.0, 1_234.0, -223_423.0]] {
                    // Where f32 has no room for the body, there is nothing to leave.
                    if vec3::max_abs(at) * 1e-4 > size {
                        continue;
                    }
                    let place = Affine::translation(at)
                        .then_from(&shape)
                        .then_from(&Affine::scaling([size; 3]));
                    attack(
                        &place,
                        bake,
                        &format!("size {size} at {at:?}, {shape:?}, baked {bake}"),
                    );
                }
            }
        }
    }

    fn attack(place: &Affine, bake: bool, case: &str) {
        let mut mesh = ball();
        if bake {
            let moved: Vec<_> = mesh.positions().iter().map(|&p| place.point(p)).collect();
            mesh = Mesh::new(moved, mesh.triangles().to_vec());
        }
        let mut model = Model::of_mesh("ball", mesh, Material::default());
        if !bake {
            model.placements[0].world_from_object = *place;
        }
        let placed = PlacedModel::build(&model, &BuildOptions::default()).unwrap();
        let surfaces = Surfaces::new(&model).unwrap();
        let center = placed.scene.bounds().center();
        for i in 0..4000 {
            let sampler = Sampler::new(11, 0, 0, i);
            let direction =
                hemisphere(if i % 2 == 0 { [0., 0., 1.] } else { [0., 0., -1.] }, sampler.pair(0));
            let ray = Ray::new(center, direction);
            let hit =
                placed.scene.closest(&ray).unwrap_or_else(|| panic!("{case}: {ray:?} escapes"));
            let placement = placed.placement_index(&hit).unwrap();
            let surface = surfaces.under(&hit, placement, direction).unwrap();
            assert!(vec3::dot(surface.geometric, direction) > 0.0, "{case}: normals point outward");
            for k in 1..5 {
                let outward = hemisphere(surface.geometric, sampler.pair(k));
                let out = Ray::new(surface.leave(outward), outward);
                let met = placed.scene.closest(&out);
                assert_eq!(met, None, "{case}: {out:?} from {hit:?}, {surface:?}");
                let inward = vec3::scale(outward, -1.0);
                let back = Ray::new(surface.leave(inward), inward);
                assert!(placed.scene.any(&back), "{case}: {back:?} leaks");
            }
        }
    }

    #[test]
    fn shading_normals_are_bent_above_the_surface() {
        let geometric = [0.0, 0.0, 1.0];
        for i in 0..5000 {
            let sampler = Sampler::new(5, 0, 0, i);
            let wo = hemisphere(geometric, sampler.pair(0));
            let surface = super::Surface {
                point: [0.0; 3],
                offset: 0.0,
                geometric,
                shading: hemisphere(geometric, sampler.pair(1)),
                material: 0,
            };
            let normal = surface.shading_toward(wo, geometric);
            let mirrored = vec3::sub(vec3::scale(normal, 2.0 * vec3::dot(wo, normal)), wo);
            assert!(vec3::dot(mirrored, geometric) > -1e-4, "{wo:?} {surface:?}");
            assert!(vec3::dot(wo, normal) > -1e-4, "{wo:?} {surface:?}");
            let below = vec3::scale(wo, -1.0);
            let other = surface.shading_toward(below, vec3::scale(geometric, -1.0));
            assert!(vec3::dot(other, geometric) < 0.0);
        }
    }
}

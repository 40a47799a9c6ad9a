//! What vertices carry beside their positions, blended over triangles.

use super::exact::apply;
use super::{PartPoint, Surface, Surfaces};
use crate::error::RenderError;
use treelet::math::vec3;
use treelet_model::Part;

/// Refuses arrays that have not one entry a vertex.
pub(super) fn check(object: usize, part: usize, data: &Part) -> Result<(), RenderError> {
    let vertices = data.mesh.positions().len();
    let arrays = [
        ("normals", data.normals.as_ref().map(|array| array.len())),
        ("tangents", data.tangents.as_ref().map(|array| array.len())),
        ("colours", data.colors.as_ref().map(|array| array.len())),
    ];
    let sets = data.uvs.iter().map(|set| ("texture coordinates", Some(set.len())));
    let mut all = arrays.into_iter().chain(sets);
    match all.find(|(_, count)| count.is_some_and(|count| count != vertices)) {
        Some((what, Some(count))) => {
            Err(RenderError::AttributeCount { object, part, what, count, vertices })
        }
        _ => Ok(()),
    }
}

impl Surfaces<'_> {
    /// The texture coordinates of a set; the origin where the part has no such set.
    #[inline]
    pub(crate) fn uv(&self, on: &PartPoint, set: usize) -> [f32; 2] {
        let found = self.part(on.at).and_then(|part| {
            let uvs = part.part.uvs.get(set)?;
            blend(uvs, part.triangles, on.at.prim, on.weights)
        });
        found.unwrap_or_default()
    }

    /// The vertices' colour and alpha; white where there is none.
    #[inline]
    pub(crate) fn color(&self, on: &PartPoint) -> [f32; 4] {
        let found = self.part(on.at).and_then(|part| {
            blend(part.part.colors.as_deref()?, part.triangles, on.at.prim, on.weights)
        });
        found.unwrap_or([1.0; 4])
    }

    /// Unit vectors of the world that a normal texture's red and green lie along: the file's
    /// tangents, or the directions in which the coordinates grow. Green points up in the picture,
    /// against v.
    pub(crate) fn tangents(&self, surface: &Surface, set: usize) -> Option<[[f32; 3]; 2]> {
        let on = &surface.on;
        let place = self.places.get(on.at.placement as usize)?;
        let part = self.part(on.at)?;
        let normal = surface.shading;
        let across =
            |v: [f32; 3]| vec3::normalize(vec3::sub(v, vec3::scale(normal, vec3::dot(v, normal))));
        let given = part
            .part
            .tangents
            .as_deref()
            .and_then(|tangents| blend(tangents, part.triangles, on.at.prim, on.weights));
        if let Some([x, y, z, sign]) = given
            && let Some(tangent) = across(place.world_from_object.vector([x, y, z]))
        {
            let mirrored = place.world_from_object.is_mirroring();
            let sign = if mirrored { -sign } else { sign };
            let bitangent = vec3::cross(normal, tangent);
            return Some([tangent, vec3::scale(bitangent, 1f32.copysign(sign))]);
        }

        // Solve for the directions along which one coordinate grows and the other stays.
        let [a, b, c] = *part.triangles.get(on.at.prim as usize)?;
        let uvs = part.part.uvs.get(set)?;
        let uv = |vertex: u32| uvs.get(vertex as usize).map(|uv| uv.map(f64::from));
        let (uv_a, uv_b, uv_c) = (uv(a)?, uv(b)?, uv(c)?);
        let position = |vertex: u32| {
            let position = part.positions.get(vertex as usize)?.map(f64::from);
            Some(apply(&place.world_from_object, position))
        };
        let (p_a, p_b, p_c) = (position(a)?, position(b)?, position(c)?);
        let [du1, dv1] = [uv_b[0] - uv_a[0], uv_b[1] - uv_a[1]];
        let [du2, dv2] = [uv_c[0] - uv_a[0], uv_c[1] - uv_a[1]];
        // Only directions count: the determinant gives its sign.
        let sign = (du1 * dv2 - du2 * dv1).signum();
        let along = |first: f64, second: f64| {
            let v: [f64; 3] = core::array::from_fn(|k| {
                sign * (first * (p_b[k] - p_a[k]) + second * (p_c[k] - p_a[k]))
            });
            let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            (length > 0.0).then(|| v.map(|x| (x / length) as f32))
        };
        Some([across(along(dv2, -dv1)?)?, across(along(du2, -du1)?)?])
    }
}

/// Entries of a triangle's vertices, blended.
#[inline]
pub(super) fn blend<const N: usize>(
    entries: &[[f32; N]],
    triangles: &[[u32; 3]],
    prim: u32,
    [u, v]: [f32; 2],
) -> Option<[f32; N]> {
    let [a, b, c] = *triangles.get(prim as usize)?;
    let (a, b, c) = (entries.get(a as usize)?, entries.get(b as usize)?, entries.get(c as usize)?);
    let w = 1.0 - u - v;
    Some(core::array::from_fn(|k| w * a[k] + u * b[k] + v * c[k]))
}

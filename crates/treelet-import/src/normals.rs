//! Vertex normals of a file, made fit: unit length, and never zero or NaN.

use treelet::Mesh;
use treelet::math::vec3;

use crate::error::counted;

/// Scales each normal to length 1. Where a file's normal is zero or not finite, that of a triangle
/// at the vertex takes its place, and +z where no triangle has one.
///
/// Returns how many were replaced. Expects as many normals as the mesh has positions.
pub(crate) fn repair(normals: &mut [[f32; 3]], mesh: &Mesh) -> usize {
    let mut bad = 0;
    for normal in normals.iter_mut() {
        *normal = vec3::normalize(*normal).unwrap_or_else(|| {
            bad += 1;
            MISSING
        });
    }
    if bad == 0 {
        return 0;
    }
    for (prim, triangle) in mesh.triangles().iter().enumerate() {
        let Some([a, b, c]) = mesh.corners(prim) else { continue };
        let Some(face) = vec3::normalize(vec3::cross(vec3::sub(b, a), vec3::sub(c, a))) else {
            continue;
        };
        for &vertex in triangle {
            if let Some(normal) = normals.get_mut(vertex as usize)
                && *normal == MISSING
            {
                *normal = face;
            }
        }
    }
    for normal in normals {
        if *normal == MISSING {
            *normal = [0.0, 0.0, 1.0];
        }
    }
    bad
}

/// Stands for a normal that is not known yet; no unit vector equals it.
const MISSING: [f32; 3] = [0.0; 3];

/// The warning about normals that were mended.
pub(crate) fn replaced(count: usize) -> String {
    let normals = counted(count as u64, "normal of no length was", "normals of no length were");
    format!("{normals} replaced.")
}

#[cfg(test)]
mod tests {
    use super::repair;
    use treelet::Mesh;

    #[test]
    fn bad_normals_come_from_the_triangles() {
        let mesh = Mesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [9.0; 3]],
            vec![[0, 1, 2], [0, 1, 77]],
        );
        let mut normals = vec![[0.0, 2.0, 0.0], [0.0; 3], [f32::NAN, 0.0, 0.0], [0.0; 3]];
        assert_eq!(repair(&mut normals, &mesh), 3);
        let down = [0.0, -1.0, 0.0];
        assert_eq!(normals, [[0.0, 1.0, 0.0], down, down, [0.0, 0.0, 1.0]]);
    }
}

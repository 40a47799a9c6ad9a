//! Where triangles are, for leaves that are written anew.

use crate::bounds::Aabb;
use crate::context::parallel;
use crate::geometry::mesh::COORDINATE_MAX;
use crate::geometry::{Mesh, Shape};
use crate::layout::lower::Packed;
use crate::memory::prefetch;
use crate::simd::f4::F4;
use crate::trace::structure::{Geometry, Structure};

/// Primitives whose box is found by one task.
const CHUNK: usize = 16_384;

/// Where triangles are now.
pub(super) struct Moved<'a> {
    pub(super) geometries: &'a [Geometry],
    /// Whose ids they are named by.
    pub(super) before: &'a Structure,
}

impl Moved<'_> {
    /// Asks for the numbers of corners that are needed soon.
    pub(super) fn expect(&self, ids: &[u32]) {
        if let [Geometry { shape: Shape::Mesh(mesh), .. }] = self.geometries {
            let triangles = mesh.triangles();
            ids.iter().for_each(|&id| prefetch(triangles, id as usize));
        }
    }

    /// Asks for corners that are needed soon.
    pub(super) fn expect_corners(&self, ids: &[u32]) {
        if let [Geometry { shape: Shape::Mesh(mesh), .. }] = self.geometries {
            let (positions, triangles) = (mesh.positions(), mesh.triangles());
            for &id in ids {
                for vertex in triangles[id as usize] {
                    prefetch(positions, vertex as usize);
                }
            }
        }
    }

    /// All numbers of vertices first, then all vertices: loads that do not wait for each other.
    /// Whether all triangles are fit for a scene.
    pub(super) fn fetch(&self, ids: &[u32], packed: &mut [Packed]) -> bool {
        if let [Geometry { shape: Shape::Mesh(mesh), .. }] = self.geometries {
            return fetch_of(mesh, ids, packed);
        }
        let mut fit = true;
        for (&id, packed) in ids.iter().zip(packed) {
            let (geom, prim) = self.before.name(id);
            let Shape::Mesh(mesh) = &self.geometries[geom as usize].shape else { return false };
            fit &= mesh.defect(prim as usize).is_none();
            *packed = Packed { corners: mesh.corners(prim as usize).unwrap_or_default(), id };
        }
        fit
    }
}

/// Triangles of the only mesh.
fn fetch_of(mesh: &Mesh, ids: &[u32], packed: &mut [Packed]) -> bool {
    let (positions, triangles) = (mesh.positions(), mesh.triangles());
    for (&id, packed) in ids.iter().zip(&mut *packed) {
        let [a, b, c] = triangles[id as usize];
        *packed = Packed { corners: [[0.0; 3]; 3], id };
        packed.corners[0] = [a, b, c].map(f32::from_bits);
    }
    const TOO_FAR: f32 = COORDINATE_MAX.next_up();
    const XYZ: usize = 0b111;
    let mut near = XYZ;
    for packed in packed {
        let [a, b, c] = packed.corners[0].map(f32::to_bits);
        let corner = |at: u32| positions.get(at as usize).copied().unwrap_or([f32::NAN; 3]);
        packed.corners = [corner(a), corner(b), corner(c)];
        for [x, y, z] in packed.corners {
            near &= F4::new(x, y, z, z).abs().less_bits(F4::splat(TOO_FAR));
        }
    }
    near == XYZ
}

/// Whether a primitive is not fit for a scene.
pub(super) fn has_defects(shape: &Shape) -> bool {
    let chunks = (0..shape.len()).step_by(CHUNK).collect();
    let found = parallel::map(chunks, |first: usize| {
        (first..shape.len().min(first + CHUNK)).any(|prim| shape.defect(prim).is_some())
    });
    found.contains(&true)
}

/// Around all primitives that are fit for a scene.
pub(super) fn bounds_of(geometries: &[Geometry]) -> Aabb {
    let mut all = Aabb::EMPTY;
    for Geometry { shape, .. } in geometries {
        let chunks = (0..shape.len()).step_by(CHUNK).collect();
        let chunks = parallel::map(chunks, |first: usize| {
            let chunk = first..shape.len().min(first + CHUNK);
            let sound = chunk.filter(|&prim| shape.defect(prim).is_none());
            sound.fold(Aabb::EMPTY, |all, prim| all.union(&shape.bounds(prim)))
        });
        all = chunks.iter().fold(all, |all, chunk| all.union(chunk));
    }
    all
}

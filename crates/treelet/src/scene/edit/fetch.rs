//! Where triangles, instances and other primitives are, for leaves that are written anew.

use crate::bounds::Aabb;
use crate::context::parallel;
use crate::geometry::mesh::COORDINATE_MAX;
use crate::geometry::{Mesh, Shape};
use crate::layout::lower::Packed;
use crate::layout::refit::{Content, Soon};
use crate::memory::prefetch;
use crate::simd::f4::F4;
use crate::trace::moving::MovingMesh;
use crate::trace::placements::Instances;
use crate::trace::structure::{Geometry, Structure, name};

/// Primitives whose box is found by one task.
const CHUNK: usize = 16_384;

/// Gives the triangles of some ids; see [`Content`].
pub(super) trait Fetch: Fn(&[u32], &mut [Packed]) -> bool + Sync {}

impl<F: Fn(&[u32], &mut [Packed]) -> bool + Sync> Fetch for F {}

/// Where everything of a level is.
pub(super) struct Places<'a> {
    pub(super) geometries: &'a [Geometry],
    /// For each geometry, the id of its first primitive.
    pub(super) first_ids: &'a [u32],
    /// In the order of their ids.
    pub(super) moving: &'a [MovingMesh],
    pub(super) instances: &'a Instances,
}

impl<'a> Places<'a> {
    /// Those of a scene as it is.
    pub(super) fn of(structure: &'a Structure) -> Self {
        let Structure { geometries, first_ids, moving, instances, .. } = structure;
        Self { geometries, first_ids, moving, instances }
    }

    /// The geometry of an id, and its ids.
    fn geometry(&self, id: u32) -> Option<(&Geometry, core::ops::Range<u32>)> {
        let (geom, prim) = name(self.first_ids, id);
        let geometry = self.geometries.get(geom as usize)?;
        let first = id - prim;
        Some((geometry, first..first + geometry.shape.len() as u32))
    }

    /// The box of an instance or, numbered after them, of a primitive that is no triangle, or a mesh that moves.
    pub(super) fn single(&self, number: usize) -> Aabb {
        let Some(id) = number.checked_sub(self.instances.entries()) else {
            return self.instances.bounds(number);
        };
        let id = id as u32;
        if let Ok(at) = self.moving.binary_search_by_key(&id, |mesh| mesh.first_id) {
            return self.moving[at].bounds;
        }
        self.geometry(id)
            .map_or(Aabb::EMPTY, |(geometry, ids)| geometry.shape.bounds((id - ids.start) as usize))
    }

    /// All of it, as trees that follow ask for it.
    pub(super) fn content(&self) -> Content<'_, impl Fetch, impl Fn(usize) -> Aabb + Sync> {
        Content {
            triangles: |ids: &[u32], packed: &mut [Packed]| self.fetch(ids, packed),
            ahead: self,
            instance: |number| self.single(number),
        }
    }

    /// The triangles of some ids; whether all are fit for a scene.
    fn fetch(&self, ids: &[u32], packed: &mut [Packed]) -> bool {
        let (mut ids, mut packed) = (ids, packed);
        let mut fit = true;
        // Mesh by mesh: neighbours are of the same one mostly.
        while let Some(&first) = ids.first() {
            let Some((Geometry { shape: Shape::Mesh(mesh), .. }, of_mesh)) = self.geometry(first)
            else {
                return false;
            };
            let run = ids.iter().position(|id| !of_mesh.contains(id)).unwrap_or(ids.len());
            let (these, others) = ids.split_at(run.max(1));
            let (places, after) = packed.split_at_mut(these.len());
            fit &= fetch_of(mesh, of_mesh.start, these, places);
            (ids, packed) = (others, after);
        }
        fit
    }
}

impl Soon for Places<'_> {
    fn expect(&self, ids: &[u32]) {
        let Some(&first) = ids.first() else { return };
        let Some((Geometry { shape: Shape::Mesh(mesh), .. }, of_mesh)) = self.geometry(first)
        else {
            return;
        };
        let triangles = mesh.triangles();
        ids.iter().for_each(|&id| prefetch(triangles, id.wrapping_sub(of_mesh.start) as usize));
    }

    fn expect_corners(&self, ids: &[u32]) {
        let Some(&first) = ids.first() else { return };
        let Some((Geometry { shape: Shape::Mesh(mesh), .. }, of_mesh)) = self.geometry(first)
        else {
            return;
        };
        let (positions, triangles) = (mesh.positions(), mesh.triangles());
        for &id in ids.iter().filter(|id| of_mesh.contains(id)) {
            for vertex in triangles[(id - of_mesh.start) as usize] {
                prefetch(positions, vertex as usize);
            }
        }
    }
}

/// Triangles of one mesh, whose first id is `first`: all numbers of vertices first, then all vertices: loads that do not wait
/// for each other. Whether all are fit for a scene.
fn fetch_of(mesh: &Mesh, first: u32, ids: &[u32], packed: &mut [Packed]) -> bool {
    let (positions, triangles) = (mesh.positions(), mesh.triangles());
    for (&id, packed) in ids.iter().zip(&mut *packed) {
        let [a, b, c] = triangles[(id - first) as usize];
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

/// Around all primitives that are fit for a scene, at all times.
pub(super) fn bounds_of(geometries: &[Geometry], moving: &[MovingMesh]) -> Aabb {
    let mut all = moving.iter().fold(Aabb::EMPTY, |all, mesh| all.union(&mesh.bounds));
    let still = |it: &&Geometry| it.mesh().is_none_or(|mesh| !mesh.is_moving());
    for Geometry { shape, .. } in geometries.iter().filter(still) {
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

//! Triangle meshes.

use crate::bounds::Aabb;
use crate::memory::Array;

/// Coordinates beyond `±2^62` (about 4.6e18) are treated like NaN: products of three differences
/// would leave f32.
pub const COORDINATE_MAX: f32 = 4_611_686_018_427_387_904.0;

/// A triangle mesh: vertex positions and, for each triangle, three indices into them.
///
/// Cheap to clone: the arrays are shared. Nothing is checked here; building a scene checks.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    positions: Array<[f32; 3]>,
    triangles: Array<[u32; 3]>,
}

impl Mesh {
    /// A mesh over the given arrays: a `Vec` moves in without a copy, an [`Array`] is shared.
    pub fn new(
        positions: impl Into<Array<[f32; 3]>>,
        triangles: impl Into<Array<[u32; 3]>>,
    ) -> Self {
        Self { positions: positions.into(), triangles: triangles.into() }
    }

    /// The same triangles over other positions, as of a mesh that bends: the indices are shared.
    #[must_use]
    pub fn with_positions(&self, positions: impl Into<Array<[f32; 3]>>) -> Self {
        Self { positions: positions.into(), triangles: self.triangles.clone() }
    }

    /// Vertex positions.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Vertex indices of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The three corners of triangle `prim`, or `None` if it or a vertex of it does not exist.
    pub fn corners(&self, prim: usize) -> Option<[[f32; 3]; 3]> {
        let [a, b, c] = *self.triangles.get(prim)?;
        let positions = self.positions();
        Some([
            *positions.get(a as usize)?,
            *positions.get(b as usize)?,
            *positions.get(c as usize)?,
        ])
    }

    /// Whether both are the same arrays in memory, not merely equal.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.positions.same(&other.positions) && self.triangles.same(&other.triangles)
    }

    /// What is wrong with triangle `prim`, if anything.
    pub fn defect(&self, prim: usize) -> Option<Defect> {
        self.triangles[prim].into_iter().find_map(|vertex| position_defect(&self.positions, vertex))
    }

    /// The box around the triangles that have no [`Mesh::defect`].
    pub fn bounds(&self) -> Aabb {
        (0..self.triangles.len())
            .filter(|&prim| self.defect(prim).is_none())
            .filter_map(|prim| self.corners(prim))
            .fold(Aabb::EMPTY, |bounds, corners| bounds.union(&Aabb::of_points(&corners)))
    }
}

/// What is wrong with a vertex, if anything.
pub(super) fn position_defect(positions: &[[f32; 3]], vertex: u32) -> Option<Defect> {
    let Some(&position) = positions.get(vertex as usize) else {
        return Some(Defect::IndexOutOfRange { vertex, vertices: positions.len() });
    };
    let near = position.iter().all(|x| x.abs() <= COORDINATE_MAX);
    (!near).then_some(Defect::BadVertex { vertex, position })
}

/// What makes a primitive unfit for a scene.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Defect {
    /// The primitive names a vertex that is not there.
    #[error("vertex index {vertex} is past the mesh's {vertices} vertices")]
    IndexOutOfRange {
        /// The index.
        vertex: u32,
        /// How many vertices the mesh has.
        vertices: usize,
    },
    /// A vertex is NaN, infinite or beyond [`COORDINATE_MAX`].
    #[error("vertex {vertex} at {position:?} is not finite or lies beyond ±2^62")]
    BadVertex {
        /// Index of the vertex.
        vertex: u32,
        /// Its position.
        position: [f32; 3],
    },
    /// A center or a radius is NaN or infinite, or the radius is negative.
    #[error("the ball at {center:?} with radius {radius} is not finite, or negative")]
    BadRadius {
        /// Its center.
        center: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// A normal is NaN, infinite or zero.
    #[error("the normal {normal:?} is zero or not finite")]
    BadNormal {
        /// The normal.
        normal: [f32; 3],
    },
    /// A box is NaN, ends before it begins, or reaches beyond [`COORDINATE_MAX`].
    #[error("the box {lo:?} .. {hi:?} is empty, not finite or lies partly beyond ±2^62")]
    BadBox {
        /// Its least corner.
        lo: [f32; 3],
        /// Its greatest corner.
        hi: [f32; 3],
    },
}

//! Quads: two triangles that share a diagonal, one primitive.

use super::mesh::{Defect, position_defect};
use super::shape::{Local, across};
use super::triangle::Meeting;
use crate::memory::Array;

/// Quads `v0 v1 v2 v3`: the triangles `v0 v1 v3` and `v2 v3 v1`, as watertight as those of a mesh, with one `prim`. `u` runs from
/// `v0` to `v1` and `v` from `v0` to `v3`; the second triangle's weights are counted from the far end. A ray that meets both
/// meets the quad once: at the lesser `t`, of the first triangle if both are the same.
#[derive(Clone, Debug, Default)]
pub struct Quads {
    positions: Array<[f32; 3]>,
    quads: Array<[u32; 4]>,
}

impl Quads {
    /// Over the given arrays: a `Vec` moves in without a copy, an [`Array`] is shared. Building a scene checks them.
    pub fn new(positions: impl Into<Array<[f32; 3]>>, quads: impl Into<Array<[u32; 4]>>) -> Self {
        Self { positions: positions.into(), quads: quads.into() }
    }

    /// Vertex positions.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Vertex indices of each quad.
    pub fn quads(&self) -> &[[u32; 4]] {
        &self.quads
    }

    /// The four corners of quad `prim`, or `None` if it or a vertex of it does not exist.
    pub fn corners(&self, prim: usize) -> Option<[[f32; 3]; 4]> {
        let [a, b, c, d] = *self.quads.get(prim)?;
        let corner = |vertex: u32| self.positions.get(vertex as usize).copied();
        Some([corner(a)?, corner(b)?, corner(c)?, corner(d)?])
    }

    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.positions.same(&other.positions) && self.quads.same(&other.quads)
    }

    pub(super) fn defect(&self, prim: usize) -> Option<Defect> {
        let vertices = self.quads.get(prim)?;
        vertices.iter().find_map(|&vertex| position_defect(&self.positions, vertex))
    }

    /// The triangles.
    fn halves(&self, prim: usize) -> Option<[[[f32; 3]; 3]; 2]> {
        let [a, b, c, d] = self.corners(prim)?;
        Some([[a, b, d], [c, d, b]])
    }

    pub(super) fn meet(&self, prim: usize, local: &Local<'_>) -> Option<Meeting> {
        let range = local.range();
        let [near, far] = self.halves(prim)?;
        let hit = |half| local.triangle.hit(&half, local.slab, local.clip, &range);
        let far = hit(far).map(|Meeting { t, u, v }| Meeting { t, u: 1.0 - u, v: 1.0 - v });
        match (hit(near), far) {
            (Some(near), Some(far)) => Some(if far.t < near.t { far } else { near }),
            (near, far) => near.or(far),
        }
    }

    pub(super) fn upright(&self, prim: usize, [u, v]: [f32; 2]) -> Option<[f64; 3]> {
        let [near, far] = self.halves(prim)?;
        Some(across(if u + v <= 1.0 { &near } else { &far }))
    }
}

//! The answer to a ray.

use core::cmp::Ordering;

/// Where a ray meets a triangle.
///
/// The point is `(1 - u - v) v0 + u v1 + v v2` of the triangle's three vertices, at
/// `origin + t * direction` of the ray.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Hit {
    /// Distance from the ray's origin in lengths of its direction.
    pub t: f32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub prim: u32,
    /// Index of the mesh in its scene: the scene that was instanced, if one was.
    pub geom: u32,
    /// The rank of the instance path in depth-first order; 0 is the scene itself.
    /// `Scene::path` gives its levels.
    pub inst: u64,
}

impl Hit {
    /// What a slice query writes for a ray that meets nothing: `t` infinite, every id all ones.
    pub const MISS: Self =
        Self { t: f32::INFINITY, u: 0.0, v: 0.0, prim: u32::MAX, geom: u32::MAX, inst: u64::MAX };

    /// Whether this is a hit and not [`Hit::MISS`].
    #[inline]
    pub fn is_hit(&self) -> bool {
        self.prim != u32::MAX
    }

    /// The `(inst, geom, prim)` that settles which of two hits at the same `t` is the answer.
    #[inline]
    pub fn id(&self) -> (u64, u32, u32) {
        (self.inst, self.geom, self.prim)
    }

    /// The order of answers: by `t`, then by id.
    #[inline]
    pub fn cmp_along_ray(&self, other: &Self) -> Ordering {
        // `t` is never NaN; -0 and 0 are the same place, so `total_cmp` would be wrong here.
        self.t
            .partial_cmp(&other.t)
            .unwrap_or(Ordering::Equal)
            .then_with(|| self.id().cmp(&other.id()))
    }
}

//! Spheres.
//!
//! In f64, about the point of the ray that is nearest to the center, so that what is left to solve has the size of
//! the sphere and not of the distance: E. Haines, J. Günther, T. Akenine-Möller, "Precision Improvements
//! for Ray/Sphere Intersection", Ray Tracing Gems, 2019, chapter 7.

use super::mesh::Defect;
use super::shape::{Local, Met, along, box_around, dot, minus, wide};
use super::triangle::Meeting;
use crate::bounds::Aabb;
use crate::memory::Array;

/// Spheres: each `x, y, z` of its center and its radius. A ray meets the surface, from outside or from inside: the first
/// meeting with `t >= t_min`. `u` and `v` of hits are 0.
#[derive(Clone, Debug, Default)]
pub struct Spheres(Array<[f32; 4]>);

impl Spheres {
    /// Over the given array: a `Vec` moves in without a copy, an [`Array`] is shared. Building a scene checks it.
    pub fn new(spheres: impl Into<Array<[f32; 4]>>) -> Self {
        Self(spheres.into())
    }

    /// `x, y, z` and radius of each.
    pub fn spheres(&self) -> &[[f32; 4]] {
        &self.0
    }

    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.0.same(&other.0)
    }

    pub(super) fn defect(&self, prim: usize) -> Option<Defect> {
        let &[x, y, z, radius] = self.0.get(prim)?;
        bad_radius([x, y, z], radius)
    }

    pub(super) fn bounds(&self, prim: usize) -> Option<Aabb> {
        let &[x, y, z, radius] = self.0.get(prim)?;
        Some(box_around([x, y, z], [f64::from(radius); 3]))
    }

    pub(super) fn meet(&self, prim: usize, local: &Local<'_>) -> Option<Meeting> {
        let &[x, y, z, radius] = self.0.get(prim)?;
        let (origin, direction) = (wide(local.ray.origin), wide(local.ray.direction));
        let roots = roots(minus(origin, wide([x, y, z])), direction, f64::from(radius))?;
        local.first(&roots.map(|t| Met { t, u: 0.0 }), &self.bounds(prim)?)
    }

    pub(super) fn upright(&self, prim: usize, point: [f64; 3]) -> Option<[f64; 3]> {
        let &[x, y, z, _] = self.0.get(prim)?;
        Some(minus(point, wide([x, y, z])))
    }
}

/// What is wrong with a ball.
pub(super) fn bad_radius(center: [f32; 3], radius: f32) -> Option<Defect> {
    let sound = center.iter().all(|x| x.is_finite()) && radius >= 0.0 && radius.is_finite();
    (!sound).then_some(Defect::BadRadius { center, radius })
}

/// Where a ray enters and leaves a ball, in lengths of its direction. `origin` is seen from the center.
pub(super) fn roots(origin: [f64; 3], direction: [f64; 3], radius: f64) -> Option<[f64; 2]> {
    let square = dot(direction, direction);
    let middle = -dot(origin, direction) / square;
    let nearest = along(origin, middle, direction);
    let rest = radius * radius - dot(nearest, nearest);
    if rest < 0.0 {
        return None;
    }
    let half = libm::sqrt(rest / square);
    Some([middle - half, middle + half])
}

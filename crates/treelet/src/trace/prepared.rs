//! A ray prepared for one level.

use super::structure::Structure;
use crate::bounds::{Interval, SlabRay};
use crate::geometry::TriangleRay;
use crate::math::{Affine, Ray};

/// Everything about a ray that does not change while it stays on a level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prepared {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    pub(crate) slab: SlabRay,
    pub(crate) triangle: TriangleRay,
    /// Where the instances on the way to this level allow a hit.
    pub(crate) clip: Interval,
}

impl Prepared {
    /// The ray on the outermost level.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, structure: &Structure) -> Self {
        Self::on_level(ray.origin, ray.direction, Interval::ALL, structure)
    }

    /// The ray as the inside of an instance sees it, with the same `t`.
    ///
    /// `None` if its direction leaves the range in which rays are answered (see [`Ray::is_valid`]).
    #[inline(always)]
    pub(crate) fn enter(
        &self,
        object_from_world: &Affine,
        clip: Interval,
        structure: &Structure,
    ) -> Option<Self> {
        let origin = object_from_world.point(self.origin);
        let direction = object_from_world.vector(self.direction);
        let valid = Ray::new(origin, direction).is_valid();
        valid.then(|| Self::on_level(origin, direction, clip, structure))
    }

    #[inline(always)]
    fn on_level(
        origin: [f32; 3],
        direction: [f32; 3],
        clip: Interval,
        structure: &Structure,
    ) -> Self {
        let slack = structure.slack.at(origin, &structure.reach);
        Self {
            origin,
            direction,
            slab: SlabRay::new(origin, direction, slack),
            triangle: TriangleRay::new(origin, direction),
            clip,
        }
    }
}

//! A ray prepared for one level.

use super::placements::Columns;
use super::structure::Structure;
use crate::bounds::{Interval, SlabRay};
use crate::geometry::shape::Local;
use crate::geometry::triangle::{Ordinary, TriangleRay};
use crate::math::{Ray, ray};
use crate::simd::{Floats, Four, Simd};

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
    /// The ray on the outermost level; `None` if it is not valid.
    #[inline(always)]
    pub(crate) fn new<S: Simd>(simd: S, ray: &Ray, structure: &Structure) -> Option<Self> {
        let ordered = (ray.t_min <= ray.t_max) & !ray.time.is_nan();
        let prepared = Self::on_level(simd, ray.origin, ray.direction, Interval::ALL, structure)?;
        ordered.then_some(prepared)
    }

    /// The ray as the inside of an instance sees it, with the same `t`.
    ///
    /// `None` if its direction leaves the range in which rays are answered (see [`Ray::is_valid`]).
    #[inline(always)]
    pub(crate) fn enter<S: Simd>(
        &self,
        simd: S,
        columns: &Columns,
        clip: Interval,
        structure: &Structure,
    ) -> Option<Self> {
        // As `Affine::point` and `Affine::vector` write it, a row a lane.
        let column = |at: usize| S::F4::load(simd, &columns[at]);
        let splat = |x: f32| S::F4::splat(simd, x);
        let (a, b, c) = (column(0), column(1), column(2));
        let through =
            |[x, y, z]: [f32; 3]| a.mul(splat(x)).add(b.mul(splat(y))).add(c.mul(splat(z)));
        let origin = through(self.origin).add(column(3));
        let direction = through(self.direction);
        let [x, y, z, _] = origin.lanes();
        let [along_x, along_y, along_z, _] = direction.lanes();
        let (o, d) = ((origin, [x, y, z]), (direction, [along_x, along_y, along_z]));
        Self::of_lanes(simd, o, d, clip, structure)
    }

    /// This ray, of which `ray` is what it was outside, for primitives that are no triangles.
    pub(crate) fn local(&self, ray: &Ray) -> Local<'_> {
        let Self { origin, direction, slab, triangle, clip } = self;
        Local { ray: Ray { origin: *origin, direction: *direction, ..*ray }, triangle, slab, clip }
    }

    /// Asks what [`Ray::is_valid`] asks of origin and direction, and prepares.
    #[inline(always)]
    fn on_level<S: Simd>(
        simd: S,
        origin: [f32; 3],
        direction: [f32; 3],
        clip: Interval,
        structure: &Structure,
    ) -> Option<Self> {
        let o = S::F4::load(simd, &[origin[0], origin[1], origin[2], 0.0]).xyzz();
        let d = S::F4::load(simd, &[direction[0], direction[1], direction[2], 0.0]).xyzz();
        Self::of_lanes(simd, (o, origin), (d, direction), clip, structure)
    }

    /// The same of origin and direction that are there as lanes, too: `x, y, z, z`.
    #[inline(always)]
    fn of_lanes<S: Simd>(
        simd: S,
        (o, origin): (S::F4, [f32; 3]),
        (d, direction): (S::F4, [f32; 3]),
        clip: Interval,
        structure: &Structure,
    ) -> Option<Self> {
        let usual = within(
            simd,
            o,
            d,
            [Ordinary::COORDINATE_MAX, Ordinary::LENGTH_MIN, Ordinary::LENGTH_MAX],
        );
        if !usual && !within(simd, o, d, [f32::MAX, ray::SHORTEST, ray::LONGEST]) {
            return None;
        }
        let [lo, hi] = &structure.reach_lanes;
        let to_lo = S::F4::load(simd, lo).sub(o).abs();
        let to_hi = S::F4::load(simd, hi).sub(o).abs();
        let slack = structure.slack.at(simd, to_lo.max(to_hi).max_lane());
        Some(Self {
            origin,
            direction,
            slab: SlabRay::of_lanes(simd, o, d, slack),
            triangle: TriangleRay::new(origin, direction).ordinary(usual & structure.ordinary),
            clip,
        })
    }
}

/// Whether no coordinate is beyond the first limit, no component of the direction beyond the last,
/// and some component not below the second; not for NaN.
#[inline(always)]
fn within<S: Simd>(simd: S, o: S::F4, d: S::F4, [origin, shortest, longest]: [f32; 3]) -> bool {
    let splat = |x: f32| S::F4::splat(simd, x);
    (o.abs().le(splat(origin)) == 0xF)
        & (d.abs().le(splat(longest)) == 0xF)
        & (splat(shortest).le(d.abs()) != 0)
}

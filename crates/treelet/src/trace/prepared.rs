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
    /// As `x, y, z, z`.
    origin: [f32; 4],
    direction: [f32; 4],
    pub(crate) slab: SlabRay,
    pub(crate) triangle: TriangleRay,
    /// Where the instances on the way to this level allow a hit.
    pub(crate) clip: Interval,
}

impl Prepared {
    /// No ray yet.
    pub(crate) const BLANK: Self = Self {
        origin: [0.0; 4],
        direction: [0.0; 4],
        slab: SlabRay::BLANK,
        triangle: TriangleRay::BLANK,
        clip: Interval::ALL,
    };

    /// The ray on the outermost level; `None` if it is not valid.
    #[inline(always)]
    pub(crate) fn new<S: Simd>(simd: S, ray: &Ray, structure: &Structure) -> Option<Self> {
        let ordered = (ray.t_min <= ray.t_max) & !ray.time.is_nan();
        let prepared = Self::on_level(simd, ray.origin, ray.direction, structure)?;
        ordered.then_some(prepared)
    }

    /// Makes `inside` the ray as the inside of an instance sees it, with the same `t`, allowed to hit anywhere.
    ///
    /// Says whether its direction stays in the range in which rays are answered (see [`Ray::is_valid`]).
    #[inline(always)]
    pub(crate) fn enter<S: Simd>(
        &self,
        simd: S,
        columns: &Columns,
        structure: &Structure,
        inside: &mut Self,
    ) -> bool {
        // As `Affine::point` and `Affine::vector` write it, a row a lane.
        let column = |at: usize| S::F4::load(simd, &columns[at]);
        let splat = |x: f32| S::F4::splat(simd, x);
        let (a, b, c) = (column(0), column(1), column(2));
        let through =
            |[x, y, z, _]: [f32; 4]| a.mul(splat(x)).add(b.mul(splat(y))).add(c.mul(splat(z)));
        let origin = through(self.origin).add(column(3));
        inside.set(simd, origin, through(self.direction), structure)
    }

    /// This ray, of which `ray` is what it was outside, for primitives that are no triangles.
    pub(crate) fn local(&self, ray: &Ray) -> Local<'_> {
        let Self { origin: [x, y, z, _], direction: [a, b, c, _], slab, triangle, clip } = self;
        let ray = Ray { origin: [*x, *y, *z], direction: [*a, *b, *c], ..*ray };
        Local { ray, triangle, slab, clip }
    }

    /// The ray whose parts, on the outermost level, are these.
    #[inline(always)]
    pub(crate) fn of_parts(ray: &Ray, slab: SlabRay, triangle: TriangleRay) -> Self {
        let lanes = |[x, y, z]: [f32; 3]| [x, y, z, z];
        let (origin, direction) = (lanes(ray.origin), lanes(ray.direction));
        Self { origin, direction, slab, triangle, clip: Interval::ALL }
    }

    /// Asks what [`Ray::is_valid`] asks of origin and direction, and prepares.
    #[inline(always)]
    fn on_level<S: Simd>(
        simd: S,
        origin: [f32; 3],
        direction: [f32; 3],
        structure: &Structure,
    ) -> Option<Self> {
        let o = S::F4::load(simd, &[origin[0], origin[1], origin[2], 0.0]).xyzz();
        let d = S::F4::load(simd, &[direction[0], direction[1], direction[2], 0.0]).xyzz();
        let mut prepared = Self::BLANK;
        prepared.set(simd, o, d, structure).then_some(prepared)
    }

    /// The same of lanes `x, y, z, z`, put where it stays.
    #[inline(always)]
    fn set<S: Simd>(&mut self, simd: S, o: S::F4, d: S::F4, structure: &Structure) -> bool {
        let usual = within(
            simd,
            o,
            d,
            [Ordinary::COORDINATE_MAX, Ordinary::LENGTH_MIN, Ordinary::LENGTH_MAX],
        );
        if !usual && !within(simd, o, d, [f32::MAX, ray::SHORTEST, ray::LONGEST]) {
            return false;
        }
        let [lo, hi] = &structure.reach_lanes;
        let to_lo = S::F4::load(simd, lo).sub(o).abs();
        let to_hi = S::F4::load(simd, hi).sub(o).abs();
        let slack = structure.slack.at(simd, to_lo.max(to_hi).max_lane());
        let along = (d, S::F4::splat(simd, 1.0).div(d));
        let triangle = TriangleRay::of_lanes(simd, o, along);
        self.origin = o.lanes();
        self.direction = d.lanes();
        self.slab = SlabRay::of_lanes(simd, o, along, slack);
        self.triangle = triangle.ordinary(usual & structure.ordinary);
        self.clip = Interval::ALL;
        true
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

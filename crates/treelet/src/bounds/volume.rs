//! What every bounding volume can do, so that tables and tests can loop over them.
//!
//! # What a ray test promises
//!
//! A volume is the exact set that its stored numbers say. The ray is the exact line of its f32
//! origin and direction. *[`Volume::interval`] contains every `t` at which that line is in that
//! set* (within the smallest f32 above 0), whatever rounding does: a volume counts as slightly wider, by a slack that each ray brings
//! with it, so that it costs nothing per volume. How much is derived in each volume's file, in terms
//! of
//!
//! - `u = 2^-24`, the relative error of one f32 rounding;
//! - `R`, the largest distance, per axis, between the ray's origin and a point of the box `reach` that
//!   contains all volumes which the ray will be tested against. While the line is in it, it has moved
//!   at most `R` along each axis.
//!
//! For the axis-aligned box: `super::slab` measures a plane within `3.1 u R` (a difference, a
//! reciprocal, a product), beyond what it makes up for itself; `4 u R` is enough.

use super::{Aabb, Interval, SlabRay};
use crate::math::{Affine, affine, rounding};

/// A convex set around things.
pub trait Volume: Copy + Sync {
    /// As tables name it.
    const NAME: &'static str;

    /// The volume of nothing, which any union forgets and no ray enters.
    const EMPTY: Self;

    /// A ray prepared for many volumes.
    type Ray: Copy;

    /// A volume around some points, none of them NaN or beyond `2^62`: it contains the exact points,
    /// and so whatever they span.
    fn of_points(points: &[[f32; 3]]) -> Self;

    /// A volume around both.
    #[must_use]
    fn union(&self, other: &Self) -> Self;

    /// A volume around what the map makes of this one.
    #[must_use]
    fn image(&self, map: &Affine) -> Self;

    /// A box around it.
    fn bounds(&self) -> Aabb;

    /// Half the surface area, to about six digits; 0 if empty.
    fn half_area(&self) -> f64;

    /// How far a point is outside: at most 0 for points inside, a lower bound of the distance for
    /// others; infinite for the volume of nothing.
    fn excess(&self, point: [f64; 3]) -> f64;

    /// Prepares `origin + t * direction` for volumes whose [`Volume::bounds`] lie in `reach`. The ray
    /// is valid ([`crate::math::Ray::is_valid`]), and its origin not beyond `2^100`.
    fn ray(origin: [f32; 3], direction: [f32; 3], reach: &Aabb) -> Self::Ray;

    /// Where the ray is in the volume: every such `t`, and perhaps a few more.
    fn interval(&self, ray: &Self::Ray) -> Interval;
}

/// Half an ulp of 1, in f64 for what is derived.
pub(super) const UNIT_ROUNDOFF: f64 = f32::EPSILON as f64 / 2.0;

/// `roundings * u * R`, rounded up, and a little for what underflow takes.
pub(super) fn slack(roundings: f64, origin: [f32; 3], reach: &Aabb) -> f32 {
    let farthest = (0..3).map(|axis| {
        let at = |side: [f32; 3]| (f64::from(side[axis]) - f64::from(origin[axis])).abs();
        at(reach.lo).max(at(reach.hi))
    });
    let farthest = if reach.is_empty() { 0.0 } else { farthest.fold(0.0, f64::max) };
    rounding::up(roundings * UNIT_ROUNDOFF * farthest + f64::from(f32::MIN_POSITIVE))
}

/// Roundings of `R` that a box counts as wider by. Derived above.
const SLACK: f64 = 4.0;

impl Volume for Aabb {
    const NAME: &'static str = "aabb";
    const EMPTY: Self = Self::EMPTY;
    type Ray = SlabRay;

    fn of_points(points: &[[f32; 3]]) -> Self {
        Self::of_points(points)
    }

    fn union(&self, other: &Self) -> Self {
        self.union(other)
    }

    fn image(&self, map: &Affine) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let (lo, hi) = affine::box_image(&map.0.map(|row| row.map(f64::from)), self.lo, self.hi);
        Self { lo, hi }
    }

    fn bounds(&self) -> Aabb {
        *self
    }

    fn half_area(&self) -> f64 {
        self.half_area()
    }

    fn excess(&self, point: [f64; 3]) -> f64 {
        let beyond = |axis: usize| {
            (f64::from(self.lo[axis]) - point[axis]).max(point[axis] - f64::from(self.hi[axis]))
        };
        beyond(0).max(beyond(1)).max(beyond(2))
    }

    fn ray(origin: [f32; 3], direction: [f32; 3], reach: &Aabb) -> SlabRay {
        SlabRay::new(origin, direction, slack(SLACK, origin, reach))
    }

    #[inline]
    fn interval(&self, ray: &SlabRay) -> Interval {
        ray.interval(self)
    }
}

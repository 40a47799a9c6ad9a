//! How much wider than they are the boxes of a level count, so that instances leak no more than
//! their vertices do.
//!
//! A level of triangles needs `16 u R(o)`: derived in [`crate::geometry::triangle`], with
//! `u = 2^-24`, `o` the ray's origin and `R(o)` the largest distance per axis from `o` to a corner
//! of the level's `reach` (the box around all of it). In general the widening is
//!
//! `slack(o) = u (a R(o) + b |o| + c)`, all norms being the largest absolute component.
//!
//! For a level with instances, let `A p + b0` be `object_from_world` as the walk applies it,
//! `m = |A|`, `n = |A^-1|` (largest absolute row sums), `W` the largest absolute coordinate of the
//! level's reach, and `(a', b', c')` the constants of the level inside.
//!
//! - A hit in there is accepted within `slack'(o')` of a box in there, plus what the slab test
//!   rounds: `s' = u ((a' + 4) R' + (b' + 4) |o'| + c')`.
//! - `o' = A o + b0` and `d' = A d` are rounded: `|e1| <= 4 u (m |o| + |b0|)`,
//!   `|e2| <= 3 u m |d|`. At a hit `t |d| <= |p| + |o| <= W + |o|`. So the world point is off by at
//!   most `n (|e1| + t |e2|) <= 4 u n (2 m |o| + m W + |b0|)`.
//! - Seen from outside, `n s'` with `R' <= m R(o)` (the reach contains the images of the corners
//!   of the reach inside) and `|o'| <= m |o| + |b0|`.
//! - The level's own slab test rounds `3 u R(o)`; 4 are taken.
//!
//! The sum, collected by `R(o)`, `|o|` and the rest, is what [`Slack::through`] computes. A level
//! takes the largest constants of all its instances, so one badly conditioned matrix makes boxes
//! of its level less tight, never wrong.

use crate::bounds::Aabb;
use crate::geometry::triangle::{SLACK, UNIT_ROUNDOFF};
use crate::math::{Affine, vec3};

/// The constants `(a, b, c)` of a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slack {
    reach_share: f64,
    origin_share: f64,
    fixed: f64,
}

impl Slack {
    /// Of a level of triangles.
    pub(crate) const TRIANGLES: Self =
        Self { reach_share: SLACK as f64, origin_share: 0.0, fixed: 0.0 };

    /// Of a level that sees a level with this slack through `object_from_world`, whose inverse has
    /// the linear part `world_from_object`; `coordinate_max` is `W`.
    pub(crate) fn through(
        &self,
        object_from_world: &Affine,
        world_from_object: &[[f64; 4]; 3],
        coordinate_max: f64,
    ) -> Self {
        let m = row_sum(&object_from_world.0.map(|row| row.map(f64::from)));
        let n = row_sum(world_from_object);
        let b0 = object_from_world.0.iter().map(|row| f64::from(row[3].abs())).fold(0.0, f64::max);
        Self {
            reach_share: n * m * (self.reach_share + 4.0) + 4.0,
            origin_share: n * m * (self.origin_share + 4.0 + 8.0),
            fixed: n * ((self.origin_share + 4.0) * b0 + self.fixed)
                + 4.0 * n * (m * coordinate_max + b0),
        }
    }

    /// What serves both.
    pub(crate) fn max(&self, other: &Self) -> Self {
        Self {
            reach_share: self.reach_share.max(other.reach_share),
            origin_share: self.origin_share.max(other.origin_share),
            fixed: self.fixed.max(other.fixed),
        }
    }

    /// As the walk uses it.
    pub(crate) fn rounded(&self) -> SlackF32 {
        let u = f64::from(UNIT_ROUNDOFF);
        let up = |x: f64| crate::math::rounding::up(x * u);
        SlackF32 {
            reach_share: up(self.reach_share),
            origin_share: up(self.origin_share),
            fixed: up(self.fixed),
        }
    }
}

/// The largest absolute row sum of the linear part.
fn row_sum(map: &[[f64; 4]; 3]) -> f64 {
    map.iter().map(|[a, b, c, _]| a.abs() + b.abs() + c.abs()).fold(0.0, f64::max)
}

/// `u` times the constants, rounded up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SlackF32 {
    reach_share: f32,
    origin_share: f32,
    fixed: f32,
}

impl SlackF32 {
    /// The widening for rays from `origin`. The few roundings here are far below the margin that
    /// the derivation leaves (16 taken where 9 are needed).
    #[inline]
    pub(crate) fn at(&self, origin: [f32; 3], reach: &Aabb) -> f32 {
        let to_lo = vec3::max_abs(vec3::sub(reach.lo, origin));
        let to_hi = vec3::max_abs(vec3::sub(reach.hi, origin));
        self.reach_share * to_lo.max(to_hi) + self.origin_share * vec3::max_abs(origin) + self.fixed
    }
}

//! How much wider than they are boxes count, so that instances leak no more than their vertices do.
//!
//! # Triangles
//!
//! A level of triangles needs `16 u R(o)`: derived in [`crate::geometry::triangle`], with
//! `u = 2^-24`, `o` the ray's origin and `R(o)` the largest distance per axis from `o` to a corner
//! of the level's `reach` (the box around all of it).
//!
//! # Instances
//!
//! Let `A p + b` be `object_from_world` as the walk applies it, `m = |A|`, `n = |A^-1|` (largest
//! absolute row sums), `K` that of the product of absolute values `|A^-1| |A|`, `v` the largest
//! component of `|A^-1| |b|`, and `W` the largest absolute coordinate of the outer level's reach, so
//! that `|o| <= W + R`. Primes are the inner level's.
//!
//! - A hit inside is accepted within `s'` of a box inside: that level's own slack, and what its slab
//!   test rounds, `u (4 R' + 4 |o'|)`.
//! - `o' = A o + b` and `d' = A d` are rounded: `|e1| <= 4 u (|A| |o| + |b|)`, `|e2| <= 3 u |A| |d|`
//!   per component. At a hit `t |d| <= |p| + |o|`. So the point seen from outside is off by at most
//!   `|A^-1| (|e1| + t |e2|) <= 4 u (K (2 |o| + W) + v) <= 4 u (K (2 R + 3 W) + v)`. `K` is small for
//!   any rotation and scaling, however uneven.
//! - Seen from outside, `s'` is at most `n s'`, with `R' <= m R` (the reach contains the images of
//!   the corners of the reach inside).
//!
//! - Maps that move (`trace::motion`) have bounds on `m`, `n`, `K` and `v` instead, over all times: see [`Stretch`].
//!
//! So a hit inside lies, seen from outside, in the widened box of the instance, and the level's own `16 u R` is there
//! for what the slab test of that box rounds: the interval of the box admits every `t` that is accepted inside. Clamping `t` into
//! it changes nothing where the terms hold as they stand (`Ordinary` in [`crate::geometry::triangle`], inside and outside); walks
//! skip it there, brute force never does.
//!
//! # Where the widening goes
//!
//! The sum grows with `R(o)`, by a factor `n m` that an uneven scaling makes large: 1000 for a board
//! a thousandth as thick as wide. If all boxes of the level took that, one board would switch
//! culling off for the whole level (measured: 596 nodes a ray instead of 7). So each *instance's own
//! box* is widened when the scene is built, by what near rays need; only what rays from farther away
//! need on top is added for the level as a whole, while a ray is prepared: [`Slack::at`].
//!
//! Near is what starts within `NEAR_REACHES` times the level's size. But a level with instances has
//! its own idea of near, which the level outside keeps, or the far share of every level would go
//! into the boxes of the next: a chain of 100,000 translated levels grew without bound that way.

use crate::bounds::Aabb;
use crate::geometry::triangle::{SLACK, UNIT_ROUNDOFF};
use crate::math::{Affine, vec3};
use crate::simd::{Floats, Simd};

/// Rays from within this many times the longest edge of a level's box are near.
const NEAR_REACHES: f64 = 4.0;

/// What a slab test rounds, in units of `u` times the reach and times the origin. Derived above.
const SLAB_ROUNDING: f64 = 4.0;

/// Static widenings take this much more, for the roundings of the sums themselves.
const MARGIN: f64 = 1.01;

/// The largest `R(o)` that is near, and the largest absolute coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Near {
    reach: f64,
    coordinate_max: f64,
}

impl Near {
    /// Of a level with this reach, whose instances are not looked at yet.
    pub(crate) fn of(reach: &Aabb) -> Self {
        Self {
            reach: NEAR_REACHES * f64::from(vec3::max_abs(reach.extent())),
            coordinate_max: f64::from(reach.max_abs()),
        }
    }

    /// The largest `R(o)` that is near to a level inside, seen from outside; infinite where that
    /// level has no idea of its own.
    pub(crate) fn limit(inner: &Slack, object_from_world: &Affine) -> f64 {
        Self::limit_of(inner, row_sum(&object_from_world.0.map(|row| row.map(f64::from))))
    }

    /// The same for a map whose `m` is no larger.
    pub(crate) fn limit_of(inner: &Slack, m: f64) -> f64 {
        if inner.far_share == 0.0 { f64::INFINITY } else { inner.near.reach / m }
    }

    /// Keeps the ideas of near of the levels inside.
    #[must_use]
    pub(crate) fn at_most(self, limit: f64) -> Self {
        Self { reach: self.reach.min(limit), ..self }
    }

    /// By how much the box of an instance of a level with slack `inner` is to be widened; and what
    /// rays from far away need on top, for [`Slack::new`].
    pub(crate) fn widening(
        &self,
        inner: &Slack,
        object_from_world: &Affine,
        world_from_object: &[[f64; 4]; 3],
    ) -> (f32, f64) {
        self.widening_of(inner, norms(object_from_world, world_from_object))
    }

    /// The same for a map that moves, of which only bounds are known, on `m`, `n`, `K` and `v` in this order. It is
    /// rounded once more, where a ray enters: by `u (|A| |o| + |b|)` for the origin, `u |A|` for the direction, which is
    /// a quarter and a third of `e1` and `e2`. Twice as much is taken.
    pub(crate) fn widening_moving(&self, inner: &Slack, [m, n, k, v]: Norms) -> (f32, f64) {
        self.widening_of(inner, [m, n, 2.0 * k, 2.0 * v])
    }

    /// The same, of what is known of a map.
    pub(crate) fn widening_of(&self, inner: &Slack, [m, n, k, v]: Norms) -> (f32, f64) {
        let Self { reach, coordinate_max } = *self;

        let inside = n * inner.accepted_within(m * reach);
        let moving = 4.0 * (k * (2.0 * reach + 3.0 * coordinate_max) + v);
        let far_share =
            n * m * (f64::from(SLACK) + 2.0 * SLAB_ROUNDING + inner.far_share) + 8.0 * k;
        let by = MARGIN * f64::from(UNIT_ROUNDOFF) * (inside + moving);
        (crate::math::rounding::up(by), far_share)
    }
}

/// `m`, `n`, `K` and `v` of a map.
pub(crate) type Norms = [f64; 4];

/// Those of a map that rays go through, and of its exact inverse.
pub(crate) fn norms(object_from_world: &Affine, world_from_object: &[[f64; 4]; 3]) -> Norms {
    let a = object_from_world.0.map(|row| row.map(f64::from));
    let [m, n] = [row_sum(&a), row_sum(world_from_object)];
    let (k, v) = absolute_products(world_from_object, &a);
    [m, n, k, v]
}

/// What is known of a map that moves, `p -> R S p + T` with a rotation `R`, at any time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// No direction is lengthened more, nor less.
    pub(crate) most: f64,
    pub(crate) least: f64,
    /// The largest coordinate of `T`.
    pub(crate) far: f64,
}

impl Stretch {
    /// Bounds on `m`, `n`, `K` and `v`: row sums are at most the root of 3 times the Euclidean norm; `K <= n m`;
    /// `b = -A T`, so `v <= n m |T|`.
    pub(crate) fn bounds(&self) -> Norms {
        let root = libm::sqrt(3.0);
        let [m, n] = [root / self.least, root * self.most];
        [m, n, n * m, n * m * self.far]
    }
}

/// How much wider boxes of a level count, in units of `u`: `SLACK R`, and `far_share` times what
/// `R` exceeds the near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slack {
    near: Near,
    far_share: f64,
}

impl Slack {
    /// Of a level whose instances ask for no more than `far_share`; 0 if it has none.
    pub(crate) fn new(near: Near, far_share: f64) -> Self {
        Self { near, far_share }
    }

    /// Whether [`Slack::at`] is `UNIT_ROUNDOFF * SLACK` times the distance, and no more.
    pub(crate) fn is_of_triangles(&self) -> bool {
        self.far_share == 0.0
    }

    /// How far outside its box, in units of `u`, a hit of this level may be accepted.
    fn accepted_within(&self, reach: f64) -> f64 {
        f64::from(SLACK) * reach
            + SLAB_ROUNDING * (2.0 * reach + self.near.coordinate_max)
            + self.far_share * (reach - self.near.reach).max(0.0)
    }

    /// The widening of the level's boxes for rays that start `distance` from the farthest corner of
    /// its reach, largest component; both in every lane. The few roundings here are far below the
    /// margin that the derivation leaves (16 taken where 10 are needed).
    #[inline(always)]
    pub(crate) fn at<S: Simd>(&self, simd: S, distance: S::F4) -> S::F4 {
        let near = distance.mul(S::F4::splat(simd, UNIT_ROUNDOFF * SLACK));
        let [distance, ..] = distance.lanes();
        // Asked as a question, not computed as a maximum with zero, so that nobody waits for the answer.
        if self.far_share == 0.0 || f64::from(distance) <= self.near.reach {
            return near;
        }
        near.add(S::F4::splat(simd, self.beyond(distance)))
    }

    /// What rays from far away need on top.
    #[cold]
    #[inline(never)]
    fn beyond(&self, distance: f32) -> f32 {
        let beyond = (f64::from(distance) - self.near.reach).max(0.0);
        crate::math::rounding::up(f64::from(UNIT_ROUNDOFF) * self.far_share * beyond)
    }
}

/// The largest absolute row sum of the linear part.
fn row_sum(map: &[[f64; 4]; 3]) -> f64 {
    map.iter().map(|[a, b, c, _]| a.abs() + b.abs() + c.abs()).fold(0.0, f64::max)
}

/// `K` and `v` of the module's head: the largest row sum of `|back| |there|`, and the largest
/// component of `|back|` times the absolute offset of `there`.
fn absolute_products(back: &[[f64; 4]; 3], there: &[[f64; 4]; 3]) -> (f64, f64) {
    let (mut k, mut v) = (0.0_f64, 0.0_f64);
    for row in back {
        let through = |column: usize| -> f64 {
            (0..3).map(|middle| row[middle].abs() * there[middle][column].abs()).sum()
        };
        k = k.max(through(0) + through(1) + through(2));
        v = v.max(through(3));
    }
    (k, v)
}

//! The sphere.
//!
//! Sources: J. Ritter, "An Efficient Bounding Sphere", Graphics Gems, 1990; M. Badoiu and K. Clarkson,
//! "Smaller Core-Sets for Balls", SODA 2003 (steps toward the farthest point, each shorter than the
//! one before); E. Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing
//! Gems, 2019 (the distance of line and center is measured from the foot point, not from a
//! discriminant). Differs from them: centers are only tried; once one is rounded to f32, the radius
//! is measured from it to the farthest point and rounded up.
//!
//! The test is done in f64, so that it has no range to leave and next to no error. What remains is
//! rounding the ends of the interval to f32, one `u` of a distance of at most `sqrt(3) R`. A sphere
//! that counts as wider by `e` has a half chord that is longer by at least `e` (for a line at
//! distance `l` from the center, `(r + e)^2 - l^2 >= (sqrt(r^2 - l^2) + e)^2`), so `2 u R` are enough;
//! `SLACK` takes twice that. An f32 test would need `44 u R`.

use super::double::{Double, add, diagonalize, dot, length, scale, sub, wide};
use super::volume::{Volume, slack};
use super::{Aabb, Interval};
use crate::math::{Affine, rounding};

/// A ball: the points no farther than `radius` from `center`. Empty if `radius` is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The middle.
    pub center: [f32; 3],
    /// The distance of the surface from it.
    pub radius: f32,
}

/// Steps toward the smallest sphere. They come within 1 or 2 % of it.
const STEPS: u32 = 32;

/// Roundings of `R` that a sphere counts as wider by. Derived above.
const SLACK: f64 = 4.0;

/// Distances are computed within this share of themselves: f64 makes about five roundings.
const MARGIN: f64 = 1.0 + 16.0 * f64::EPSILON;

/// A ray prepared for many spheres.
#[derive(Clone, Copy, Debug)]
pub struct SphereRay {
    origin: Double,
    /// Of length 1.
    direction: Double,
    /// `t` for each unit of length.
    per_length: f64,
    slack: f64,
}

impl Sphere {
    /// The sphere about a center, rounded, of the radius that `farthest` says for it.
    fn about(center: Double, farthest: impl Fn(Double) -> f64) -> Self {
        let center = center.map(|c| c as f32);
        Self { center, radius: rounding::up(farthest(wide(center)) * MARGIN) }
    }

    fn is_empty(&self) -> bool {
        self.radius < 0.0
    }
}

/// The point that is farthest from another.
fn farthest(points: &[[f32; 3]], from: Double) -> (f64, Double) {
    let mut best = (-1.0, from);
    for &point in points {
        let away = sub(wide(point), from);
        let square = dot(away, away);
        if square > best.0 {
            best = (square, wide(point));
        }
    }
    (libm::sqrt(best.0.max(0.0)), best.1)
}

/// Ritter's center: that of a long chord, moved toward whatever lies outside.
fn ritter(points: &[[f32; 3]], first: [f32; 3]) -> Double {
    let (_, one) = farthest(points, wide(first));
    let (chord, other) = farthest(points, one);
    let (mut center, mut radius) = (scale(add(one, other), 0.5), 0.5 * chord);
    for &point in points {
        let away = sub(wide(point), center);
        let distance = length(away);
        if distance > radius {
            radius = 0.5 * (radius + distance);
            center = add(center, scale(away, (distance - radius) / distance));
        }
    }
    center
}

impl Volume for Sphere {
    const NAME: &'static str = "sphere";
    const EMPTY: Self = Self { center: [0.0; 3], radius: -1.0 };
    type Ray = SphereRay;

    fn of_points(points: &[[f32; 3]]) -> Self {
        let Some(&first) = points.first() else { return Self::EMPTY };
        let about = |center: Double| Self::about(center, |center| farthest(points, center).0);
        let mut center = ritter(points, first);
        let mut best = about(center);
        for step in 1..=STEPS {
            let (_, away) = farthest(points, center);
            center = add(center, scale(sub(away, center), 1.0 / f64::from(step + 1)));
        }
        for center in [center, wide(Aabb::of_points(points).center())] {
            let other = about(center);
            if other.radius < best.radius {
                best = other;
            }
        }
        best
    }

    fn union(&self, other: &Self) -> Self {
        let (a, b) = (wide(self.center), wide(other.center));
        let (r, s) = (f64::from(self.radius), f64::from(other.radius));
        let between = sub(b, a);
        let distance = length(between);
        if other.is_empty() || distance * MARGIN + s <= r {
            return *self;
        }
        if self.is_empty() || distance * MARGIN + r <= s {
            return *other;
        }
        // Neither holds the other, so their centers differ.
        let radius = 0.5 * (distance + r + s);
        let center = add(a, scale(between, (radius - r) / distance));
        Self::about(center, |center| (length(sub(a, center)) + r).max(length(sub(b, center)) + s))
    }

    fn image(&self, map: &Affine) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let rows = map.0.map(|row| row.map(f64::from));
        let linear = rows.map(|[a, b, c, _]| [a, b, c]);
        let columns = [0, 1, 2].map(|i: usize| linear.map(|row| row[i]));
        // The longest axis of the image of a ball: the root of an eigenvalue of `M^T M`.
        let (_, squares) = diagonalize(columns.map(|a| columns.map(|b| dot(a, b))));
        let stretch = libm::sqrt(squares.into_iter().fold(0.0, f64::max)) * STRETCH_MARGIN;
        let center = rows.map(|[a, b, c, d]| dot([a, b, c], wide(self.center)) + d);
        let size = rows.map(|[a, b, c, d]| {
            dot([a.abs(), b.abs(), c.abs()], wide(self.center).map(f64::abs)) + d.abs()
        });
        let radius = f64::from(self.radius) * stretch + CENTER_MARGIN * length(size);
        Self::about(center, |rounded| length(sub(center, rounded)) + radius)
    }

    fn bounds(&self) -> Aabb {
        if self.is_empty() {
            return Aabb::EMPTY;
        }
        let (center, radius) = (wide(self.center), f64::from(self.radius));
        // A sum of two f32 may have one f64 rounding.
        let by = radius * MARGIN;
        Aabb {
            lo: center.map(|c| rounding::down(c - by - CENTER_MARGIN * c.abs())),
            hi: center.map(|c| rounding::up(c + by + CENTER_MARGIN * c.abs())),
        }
    }

    fn half_area(&self) -> f64 {
        let radius = f64::from(self.radius).max(0.0);
        2.0 * core::f64::consts::PI * radius * radius
    }

    fn excess(&self, point: [f64; 3]) -> f64 {
        if self.is_empty() {
            return f64::INFINITY;
        }
        length(sub(point, wide(self.center))) - f64::from(self.radius)
    }

    fn ray(origin: [f32; 3], direction: [f32; 3], reach: &Aabb) -> SphereRay {
        let per_length = 1.0 / length(wide(direction));
        SphereRay {
            origin: wide(origin),
            direction: scale(wide(direction), per_length),
            per_length,
            slack: f64::from(slack(SLACK, origin, reach)),
        }
    }

    #[inline]
    fn interval(&self, ray: &SphereRay) -> Interval {
        let to_center = sub(wide(self.center), ray.origin);
        let foot = dot(to_center, ray.direction);
        let off = sub(to_center, scale(ray.direction, foot));
        let radius = f64::from(self.radius) + ray.slack;
        let square = radius * radius - dot(off, off);
        if square < 0.0 || self.is_empty() {
            return Interval { entry: f32::INFINITY, exit: f32::NEG_INFINITY };
        }
        let half = libm::sqrt(square);
        Interval {
            entry: ((foot - half) * ray.per_length) as f32,
            exit: ((foot + half) * ray.per_length) as f32,
        }
    }
}

/// Eigenvalues are good to some ten roundings of the largest.
const STRETCH_MARGIN: f64 = 1.0 + 1e-12;
/// A mapped center is good to four roundings of what is summed up.
const CENTER_MARGIN: f64 = 4.0 * f64::EPSILON;

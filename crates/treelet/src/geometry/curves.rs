//! Round curves: hair, wires, streamlines.
//!
//! A segment is all the balls whose center and radius go linearly from one point to the next: a cone between two
//! balls, convex. So what a ray is inside of is one interval, from the least to the greatest `t` at which it meets a ball
//! or the cone.
//!
//! The cone: with `m` from the first point to one of space, `b` from the first point to the second, `k` what the radius
//! grows by and `r` the first radius, the ball that touches a point of the cone from inside is the one at
//! `s = (b.m + k r) / g`, `g = b.b - k k`, and the point is on the cone where `m.m - r r = g s s`. Along a ray that is a
//! quadratic. Own derivation, from the envelope of the balls; the kind is Embree's round linear curve.

use super::mesh::Defect;
use super::shape::{Local, Met, along, dot, minus, wide};
use super::spheres::{bad_radius, roots};
use super::triangle::Meeting;
use crate::bounds::Aabb;
use crate::memory::Array;

/// Segments of round curves whose radius is linear between two points.
///
/// A segment is named by its first point; the next one is its second, so that a curve of five points is four
/// segments. `u` of a hit says how far along its segment it is, from 0 to 1 (0 and 1 on the round ends); `v` is 0.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    points: Array<[f32; 4]>,
    segments: Array<u32>,
}

/// A segment in f64.
struct Segment {
    /// Its ends.
    ends: [[f64; 3]; 2],
    radii: [f64; 2],
}

impl Curves {
    /// Points (`x, y, z` and radius), and the first point of each segment: a `Vec` moves in without a copy, an [`Array`] is
    /// shared. Building a scene checks them.
    pub fn new(points: impl Into<Array<[f32; 4]>>, segments: impl Into<Array<u32>>) -> Self {
        Self { points: points.into(), segments: segments.into() }
    }

    /// `x, y, z` and radius of each point.
    pub fn points(&self) -> &[[f32; 4]] {
        &self.points
    }

    /// The first point of each segment.
    pub fn segments(&self) -> &[u32] {
        &self.segments
    }

    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.points.same(&other.points) && self.segments.same(&other.segments)
    }

    /// The points of a segment.
    fn ends(&self, prim: usize) -> Option<[[f32; 4]; 2]> {
        let first = *self.segments.get(prim)? as usize;
        Some([*self.points.get(first)?, *self.points.get(first.checked_add(1)?)?])
    }

    pub(super) fn defect(&self, prim: usize) -> Option<Defect> {
        let first = *self.segments.get(prim)?;
        let Some(ends) = self.ends(prim) else {
            let vertex = first.saturating_add(u32::from((first as usize) < self.points.len()));
            return Some(Defect::IndexOutOfRange { vertex, vertices: self.points.len() });
        };
        ends.iter().find_map(|&[x, y, z, radius]| bad_radius([x, y, z], radius))
    }

    pub(super) fn bounds(&self, prim: usize) -> Option<Aabb> {
        let [a, b] = self
            .ends(prim)?
            .map(|[x, y, z, radius]| super::shape::box_around([x, y, z], [f64::from(radius); 3]));
        Some(a.union(&b))
    }

    fn segment(&self, prim: usize) -> Option<Segment> {
        let ends = self.ends(prim)?;
        let radii = ends.map(|end| f64::from(end[3]));
        Some(Segment { ends: ends.map(|[x, y, z, _]| wide([x, y, z])), radii })
    }

    pub(super) fn meet(&self, prim: usize, local: &Local<'_>) -> Option<Meeting> {
        let segment = self.segment(prim)?;
        let met = segment.meets(wide(local.ray.origin), wide(local.ray.direction))?;
        local.first(&met, &self.bounds(prim)?)
    }

    pub(super) fn upright(&self, prim: usize, u: f32, point: [f64; 3]) -> Option<[f64; 3]> {
        let [a, b] = self.segment(prim)?.ends;
        Some(minus(point, along(a, f64::from(u), minus(b, a))))
    }
}

impl Segment {
    /// Where a ray enters and leaves.
    fn meets(&self, origin: [f64; 3], direction: [f64; 3]) -> Option<[Met; 2]> {
        let mut span: Option<[Met; 2]> = None;
        let mut add = |met: Met| {
            let [entry, exit] = span.get_or_insert([met, met]);
            if met.t < entry.t {
                *entry = met;
            }
            if met.t > exit.t {
                *exit = met;
            }
        };
        // The balls at the ends.
        for ((center, radius), u) in self.ends.into_iter().zip(self.radii).zip([0.0, 1.0]) {
            let found = roots(minus(origin, center), direction, radius);
            found.into_iter().flatten().for_each(|t| add(Met { t, u }));
        }
        self.cone(origin, direction).into_iter().flatten().for_each(add);
        span
    }

    /// Where the ray meets the cone between the circles at which it touches the balls.
    fn cone(&self, origin: [f64; 3], direction: [f64; 3]) -> [Option<Met>; 2] {
        let ([a, b], [radius, far]) = (self.ends, self.radii);
        let (axis, growth) = (minus(b, a), far - radius);
        let g = dot(axis, axis) - growth * growth;
        // One ball contains the other.
        if g <= 0.0 {
            return [None; 2];
        }
        // About the point of the ray that is nearest to the middle of the axis: small numbers.
        let square = dot(direction, direction);
        let middle = dot(minus(along(a, 0.5, axis), origin), direction) / square;
        let from = minus(along(origin, middle, direction), a);
        let (rise, start) = (dot(axis, direction), dot(axis, from) + growth * radius);
        let p = square - rise * rise / g;
        let q = dot(from, direction) - start * rise / g;
        let r = dot(from, from) - radius * radius - start * start / g;
        let rest = q * q - p * r;
        if rest < 0.0 {
            return [None; 2];
        }
        // The root without cancellation, and the other one from their product.
        let sum = -(q + libm::copysign(libm::sqrt(rest), q));
        [sum / p, r / sum].map(|t| {
            let s = (start + t * rise) / g;
            (0.0..=1.0).contains(&s).then_some(Met { t: middle + t, u: s as f32 })
        })
    }
}

//! The oriented box.
//!
//! Sources: S. Gottschalk, M. Lin, D. Manocha, "OBBTree", SIGGRAPH 1996 (axes from the points'
//! covariance); T. Larsson and L. Kallberg, "Fast Computation of Tight-Fitting Oriented Bounding
//! Boxes", Game Engine Gems 2, 2011 (DiTO-14: axes from the edges and faces of two tetrahedra over
//! points that are extreme along seven directions). Differs from them: all those axes and the axes of
//! space are candidates; the one with the least surface area wins, so an oriented box is never larger
//! than the axis-aligned one but for rounding.
//!
//! The set is `|a_i . (p - center)| <= half_i` for the f32 axes as they are stored: nearly, not quite
//! at right angles. What contains it is computed with a margin for that (`ORTHO`).
//!
//! # The slack
//!
//! With `rho = sqrt(3) R`, the longest way, and axes of length `1 + 2 u` at most:
//!
//! - moving the center to the origin costs `u rho`, its product with the axis `3 u rho` more;
//! - the direction's product with the axis is off by `3 u` of its length, which over the way to the
//!   plane is `3 u rho`;
//! - adding and taking away the half extent costs `u rho`, widening it by the slack `u rho`;
//! - the reciprocal and the product cost `2 u rho`.
//!
//! That makes `11.1 u rho`, less than `20 u R`; `SLACK` takes 24.
//!
//! # As a node's bound
//!
//! Measured on hair (2,500 neighbouring strands of a fur, 60,000 triangles; diffuse rays through the
//! binary tree, boxes near the root alike): oriented boxes make a ray test 75.7 nodes instead of
//! 88.5, and 7.3 triangles instead of 20.3. But one test takes 30 ns, of which an axis-aligned box
//! takes 5.6: 2.3 us a ray for what costs 0.5 us, to save 13 triangles. It does not pay, so no layout
//! has them. (14-DOPs: 70.3 nodes, 13.0 triangles, 4.4 ns.) `treelet inspect --bounds` measures it.

use super::double::{
    Double, UNIT, add, cross, diagonalize, dot, frame, length, scale, sub, taxicab, wide,
};
use super::volume::{UNIT_ROUNDOFF, Volume, slack};
use super::{Aabb, Interval};
use crate::math::{Affine, rounding, vec3};
use alloc::vec::Vec;

/// A box with axes of its own. Empty if a half extent is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obb {
    /// Of length 1 and at right angles, but for rounding.
    pub axes: [[f32; 3]; 3],
    /// The middle.
    pub center: [f32; 3],
    /// Half the lengths of the edges.
    pub half: [f32; 3],
}

/// Roundings of `R` that a box counts as wider by. Derived above.
const SLACK: f64 = 24.0;

/// What rounding makes of right angles: components are off by `u` of themselves, so products of two
/// axes by `2 u`; three of them and what that does in the second order are below this.
const ORTHO: f64 = 16.0 * UNIT_ROUNDOFF;

/// Sums of three products in f64 are good to this share of their terms.
const MARGIN: f64 = 8.0 * f64::EPSILON;

/// The directions along which DiTO-14 looks for extreme points.
const DITO: [Double; 7] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];

/// A ray prepared for many oriented boxes.
#[derive(Clone, Copy, Debug)]
pub struct ObbRay {
    origin: [f32; 3],
    direction: [f32; 3],
    slack: f32,
}

impl Obb {
    /// The box with these axes around something whose extent along any vector is known.
    fn along(axes: &[Double; 3], extent: &dyn Fn(Double) -> [f64; 2]) -> Self {
        let axes = axes.map(|axis| axis.map(|c| c as f32));
        let extents = axes.map(|axis| extent(wide(axis)));
        let middle = |[lo, hi]: [f64; 2]| 0.5 * lo + 0.5 * hi;
        let center = (0..3)
            .fold([0.0; 3], |center, i| add(center, scale(wide(axes[i]), middle(extents[i]))));
        let center = center.map(|c| c as f32);
        let half = [0, 1, 2].map(|i: usize| {
            let ([lo, hi], at) = (extents[i], dot(wide(axes[i]), wide(center)));
            let margin = MARGIN * (lo.abs() + hi.abs() + taxicab(wide(center)));
            rounding::up((hi - at).max(at - lo) + margin)
        });
        Self { axes, center, half }
    }

    /// The smallest of the boxes with these axes.
    fn smallest(candidates: &[[Double; 3]], extent: &dyn Fn(Double) -> [f64; 2]) -> Self {
        let boxes = candidates.iter().map(|axes| Self::along(axes, extent));
        let best = boxes.min_by(|a, b| a.half_area().total_cmp(&b.half_area()));
        best.unwrap_or(Self::EMPTY)
    }

    /// Between which values `v . p` lies for the points of the box.
    fn extent(&self, v: Double) -> [f64; 2] {
        let middle = dot(v, wide(self.center));
        let spread: f64 = (0..3)
            .map(|i| {
                let share = dot(v, wide(self.axes[i])).abs() + ORTHO * length(v);
                f64::from(self.half[i]) * share
            })
            .sum();
        let by = spread + MARGIN * (spread + length(v) * taxicab(wide(self.center)));
        [middle - by, middle + by]
    }

    /// The corners, nearly.
    fn corners(&self) -> [Double; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: usize| {
            (0..3).fold(wide(self.center), |point, i| {
                let sign = if corner >> i & 1 == 1 { 1.0 } else { -1.0 };
                add(point, scale(wide(self.axes[i]), sign * f64::from(self.half[i])))
            })
        })
    }

    fn is_empty(&self) -> bool {
        self.half[0] < 0.0
    }
}

/// Between which values `v . p` lies for some points.
fn extent(points: &[Double], v: Double) -> [f64; 2] {
    let (mut lo, mut hi, mut size) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for &point in points {
        let along = dot(v, point);
        lo = lo.min(along);
        hi = hi.max(along);
        size = size.max(taxicab(point));
    }
    [lo - MARGIN * size, hi + MARGIN * size]
}

/// Axes that are worth a try for these points.
fn candidates(points: &[Double]) -> Vec<[Double; 3]> {
    let mut found = alloc::vec![UNIT];
    let extremes = extremes(points);
    found.push(principal(points));
    let of_extremes = |v: Double| extent(&extremes, v);
    let area = |axes: &[Double; 3]| Obb::along(axes, &of_extremes).half_area();
    let dito = dito(&extremes);
    found.extend(dito.into_iter().min_by(|a, b| area(a).total_cmp(&area(b))));
    found
}

/// The axes of the points' covariance.
fn principal(points: &[Double]) -> [Double; 3] {
    let share = 1.0 / points.len().max(1) as f64;
    let mean = points.iter().fold([0.0; 3], |mean, &point| add(mean, scale(point, share)));
    let mut covariance = [[0.0; 3]; 3];
    for &point in points {
        let away = sub(point, mean);
        for i in 0..3 {
            (0..3).for_each(|j| covariance[i][j] += away[i] * away[j] * share);
        }
    }
    let (axes, _) = diagonalize(covariance);
    frame(axes[0], axes[1])
}

/// The points that are extreme along DiTO's directions, two for each.
fn extremes(points: &[Double]) -> Vec<Double> {
    let mut found = Vec::with_capacity(2 * DITO.len());
    for direction in DITO {
        let along = |point: &&Double| dot(direction, **point);
        found.extend(points.iter().min_by(|a, b| along(a).total_cmp(&along(b))));
        found.extend(points.iter().max_by(|a, b| along(a).total_cmp(&along(b))));
    }
    found
}

/// DiTO's candidates: axes along the edges of the largest triangle of extreme points, and of the
/// tetrahedra above and below it.
fn dito(extremes: &[Double]) -> Vec<[Double; 3]> {
    let pairs = extremes.chunks_exact(2).map(|pair| (pair[0], pair[1]));
    let distance = |&(a, b): &(Double, Double)| length(sub(a, b));
    let Some((a, b)) = pairs.max_by(|p, q| distance(p).total_cmp(&distance(q))) else {
        return Vec::new();
    };
    let off_line = |point: &Double| length(cross(sub(b, a), sub(*point, a)));
    let far = extremes.iter().copied().max_by(|p, q| off_line(p).total_cmp(&off_line(q)));
    let c = far.unwrap_or(a);
    let normal = cross(sub(b, a), sub(c, a));
    let along = |point: &Double| dot(normal, sub(*point, a));
    let below = extremes.iter().copied().min_by(|p, q| along(p).total_cmp(&along(q)));
    let above = extremes.iter().copied().max_by(|p, q| along(p).total_cmp(&along(q)));

    let mut triangles = alloc::vec![[a, b, c]];
    for tip in below.into_iter().chain(above) {
        triangles.extend([[a, b, tip], [b, c, tip], [c, a, tip]]);
    }
    let mut found = Vec::with_capacity(3 * triangles.len());
    for [a, b, c] in triangles {
        for (edge, other) in
            [(sub(b, a), sub(c, a)), (sub(c, b), sub(a, b)), (sub(a, c), sub(b, c))]
        {
            found.push(frame(edge, other));
        }
    }
    found
}

impl Volume for Obb {
    const NAME: &'static str = "obb";
    const EMPTY: Self = Self {
        axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        center: [0.0; 3],
        half: [f32::NEG_INFINITY; 3],
    };
    type Ray = ObbRay;

    fn of_points(points: &[[f32; 3]]) -> Self {
        if points.is_empty() {
            return Self::EMPTY;
        }
        let points: Vec<Double> = points.iter().map(|&point| wide(point)).collect();
        Self::smallest(&candidates(&points), &|v| extent(&points, v))
    }

    fn union(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if self.is_empty() { *other } else { *self };
        }
        let corners = [self.corners(), other.corners()].concat();
        let mut candidates = candidates(&corners);
        candidates.extend([self, other].map(|each| each.axes.map(wide)));
        Self::smallest(&candidates, &|v| {
            let ([a, b], [c, d]) = (self.extent(v), other.extent(v));
            [a.min(c), b.max(d)]
        })
    }

    fn image(&self, map: &Affine) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let rows = map.0.map(|row| row.map(f64::from));
        let linear = rows.map(|[a, b, c, _]| [a, b, c]);
        let offset = rows.map(|row| row[3]);
        let columns = [0, 1, 2].map(|i: usize| linear.map(|row| row[i]));
        // The images of the edges, the longest first, are the best hint at axes.
        let mut edges = [0, 1, 2].map(|i: usize| {
            scale(linear.map(|row| dot(row, wide(self.axes[i]))), f64::from(self.half[i]))
        });
        edges.sort_unstable_by(|a, b| length(*b).total_cmp(&length(*a)));
        let [a, b, c] = edges;
        let candidates = [frame(a, b), frame(a, c), frame(b, c), UNIT];
        let size =
            taxicab(wide(self.center)) + self.half.iter().map(|&h| f64::from(h)).sum::<f64>();
        Self::smallest(&candidates, &|v| {
            let back = columns.map(|column| dot(column, v));
            let ([lo, hi], moved) = (self.extent(back), dot(v, offset));
            let sizes = columns.iter().map(|&column| taxicab(column)).sum::<f64>();
            let margin = MARGIN * (sizes * size + taxicab(offset));
            [lo + moved - margin, hi + moved + margin]
        })
    }

    fn bounds(&self) -> Aabb {
        if self.is_empty() {
            return Aabb::EMPTY;
        }
        let extents = UNIT.map(|axis| self.extent(axis));
        Aabb {
            lo: extents.map(|[lo, _]| rounding::down(lo)),
            hi: extents.map(|[_, hi]| rounding::up(hi)),
        }
    }

    fn half_area(&self) -> f64 {
        let [x, y, z] = self.half.map(|half| 2.0 * f64::from(half.max(0.0)));
        x * y + y * z + z * x
    }

    fn excess(&self, point: [f64; 3]) -> f64 {
        let away = sub(point, wide(self.center));
        let beyond = |i: usize| dot(wide(self.axes[i]), away).abs() - f64::from(self.half[i]);
        beyond(0).max(beyond(1)).max(beyond(2))
    }

    fn ray(origin: [f32; 3], direction: [f32; 3], reach: &Aabb) -> ObbRay {
        ObbRay { origin, direction, slack: slack(SLACK, origin, reach) }
    }

    #[inline]
    fn interval(&self, ray: &ObbRay) -> Interval {
        let to_center = vec3::sub(self.center, ray.origin);
        let mut inside = Interval::ALL;
        for i in 0..3 {
            let axis = self.axes[i];
            let (middle, half) = (vec3::dot(axis, to_center), self.half[i] + ray.slack);
            let reciprocal = 1.0 / vec3::dot(axis, ray.direction);
            let reciprocal = if reciprocal > f32::MAX { f32::MAX } else { reciprocal };
            let reciprocal = if reciprocal < f32::MIN { f32::MIN } else { reciprocal };
            let lower = (middle - half) * reciprocal;
            let upper = (middle + half) * reciprocal;
            let (near, far) = if reciprocal < 0.0 { (upper, lower) } else { (lower, upper) };
            inside.entry = if near > inside.entry { near } else { inside.entry };
            inside.exit = if far < inside.exit { far } else { inside.exit };
        }
        inside
    }
}

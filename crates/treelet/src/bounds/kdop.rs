//! Discrete oriented polytopes: slabs along fixed directions, as many as one likes.
//!
//! Sources: T. Kay and J. Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986; J. Klosowski et al.,
//! "Efficient Collision Detection Using Bounding Volume Hierarchies of k-DOPs", IEEE TVCG 4(1), 1998
//! (the sets of 14, 18 and 26 half-spaces). Differs from them: directions are not normalised, so
//! that their components are -1, 0 and 1 and sums need no products; slabs stand four side by side.
//!
//! # The slack
//!
//! Along a direction `n`, with `|n|` the number of its components that are not 0: what the origin and
//! the direction of the ray are worth along `n` is summed up in f64. For the origin that is good to
//! `2^-51 |o|`, which is added to the slack. For the direction it may be wrong by `2^-51` of its
//! components' sum, all of a small value; over the way through `reach` that moves the plane by
//! `2^-51 |n| R`. Then a plane is measured like that of a box: a difference, a reciprocal, a product,
//! `3.1 u |n| R`. A reciprocal that f32 does not hold is taken as the largest, as in `super::slab`,
//! which moves the ray by `u R / 16`. `4 u |n| R` is enough.

use super::double::{Double, add, cross, dot, frame, length, scale, sub, taxicab, wide};
use super::volume::{Volume, slack};
use super::{Aabb, Interval};
use crate::math::{Affine, rounding};
use alloc::vec::Vec;

/// Slabs along the directions of [`KDop::directions`], four at a time; those past the last one hold
/// everything. Empty if `lo > hi` somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KDop<const QUADS: usize> {
    /// Lower planes.
    lo: [[f32; 4]; QUADS],
    /// Upper planes.
    hi: [[f32; 4]; QUADS],
}

/// A cube without its corners: axes and diagonals of space.
pub type Dop14 = KDop<2>;
/// A cube without its edges: axes and diagonals of faces.
pub type Dop18 = KDop<3>;
/// A cube without either.
pub type Dop26 = KDop<4>;

const DIRECTIONS_14: [Double; 7] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
];

const DIRECTIONS_18: [Double; 9] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
];

const DIRECTIONS_26: [Double; 13] = {
    let mut all = [[0.0; 3]; 13];
    let mut i = 0;
    while i < 13 {
        all[i] = if i < 7 { DIRECTIONS_14[i] } else { DIRECTIONS_18[i - 4] };
        i += 1;
    }
    all
};

/// Roundings of `|n| R` that a slab counts as wider by. Derived above.
const SLACK: f64 = 4.0;

/// Sums of three f32 in f64, and differences from them, are good to this share of their terms.
const MARGIN: f64 = 4.0 * f64::EPSILON;

/// Corners of the polytope are good to this share of its size and place, and cuts leave that much.
const TOLERANCE: f64 = 1.0 / (1_u64 << 42) as f64;

/// A ray prepared for many polytopes.
#[derive(Clone, Copy, Debug)]
pub struct DopRay<const QUADS: usize> {
    /// What lower planes are measured from.
    lower: [[f32; 4]; QUADS],
    /// What upper planes are measured from.
    upper: [[f32; 4]; QUADS],
    /// `1 / direction`, along each direction.
    reciprocal: [[f32; 4]; QUADS],
}

impl<const QUADS: usize> KDop<QUADS> {
    /// The directions of the slabs; the first three are the axes.
    pub fn directions() -> &'static [[f64; 3]] {
        match QUADS {
            0..=2 => &DIRECTIONS_14,
            3 => &DIRECTIONS_18,
            _ => &DIRECTIONS_26,
        }
    }

    /// The slabs that `extent` says, rounded outward.
    fn of_extents(extent: impl Fn(Double) -> [f64; 2]) -> Self {
        let mut dop = Self { lo: [[f32::NEG_INFINITY; 4]; QUADS], hi: [[f32::INFINITY; 4]; QUADS] };
        for (at, &direction) in Self::directions().iter().enumerate() {
            let [lo, hi] = extent(direction);
            dop.lo[at / 4][at % 4] = rounding::down(lo);
            dop.hi[at / 4][at % 4] = rounding::up(hi);
        }
        dop
    }

    /// The slab along direction `at`.
    fn slab(&self, at: usize) -> [f64; 2] {
        [self.lo, self.hi].map(|side| f64::from(side[at / 4][at % 4]))
    }

    fn is_empty(&self) -> bool {
        self.lo[0][0] > self.hi[0][0]
    }

    /// The faces, as polygons: of each plane what all other half-spaces leave of a large square.
    /// Flat polytopes have two faces in one place.
    fn faces(&self) -> Vec<Vec<Double>> {
        let directions = Self::directions();
        // Work around the middle, where numbers are small.
        let bounds = self.bounds();
        let (middle, size) = (wide(bounds.center()), bounds.diagonal());
        let tolerance = TOLERANCE * (size + taxicab(middle));
        let half_space = |side: usize| -> (Double, f64) {
            let (at, sign) = (side / 2, [-1.0, 1.0][side % 2]);
            let normal = scale(directions[at], sign);
            (normal, sign * self.slab(at)[side % 2] - dot(normal, middle))
        };
        let mut faces = Vec::new();
        for side in 0..2 * directions.len() {
            let (normal, limit) = half_space(side);
            let foot = scale(normal, limit / dot(normal, normal));
            let [_, u, v] = frame(normal, [0.0; 3]);
            let corner =
                |a: f64, b: f64| add(foot, add(scale(u, 4.0 * a * size), scale(v, 4.0 * b * size)));
            let mut face = alloc::vec![
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0)
            ];
            for other in (0..2 * directions.len()).filter(|&other| other != side) {
                let (normal, limit) = half_space(other);
                face = cut(&face, normal, limit + tolerance);
            }
            faces.push(face.into_iter().map(|corner| add(corner, middle)).collect());
        }
        faces
    }
}

/// The part of a polygon with `normal . p <= limit`.
fn cut(face: &[Double], normal: Double, limit: f64) -> Vec<Double> {
    let mut out = Vec::with_capacity(face.len() + 1);
    for (at, &to) in face.iter().enumerate() {
        let from = face[(at + face.len() - 1) % face.len()];
        let beyond = [from, to].map(|corner| dot(normal, corner) - limit);
        if (beyond[0] > 0.0) != (beyond[1] > 0.0) {
            out.push(add(from, scale(sub(to, from), beyond[0] / (beyond[0] - beyond[1]))));
        }
        if beyond[1] <= 0.0 {
            out.push(to);
        }
    }
    out
}

impl<const QUADS: usize> Volume for KDop<QUADS> {
    const NAME: &'static str = match QUADS {
        0..=2 => "14-dop",
        3 => "18-dop",
        _ => "26-dop",
    };
    const EMPTY: Self =
        Self { lo: [[f32::INFINITY; 4]; QUADS], hi: [[f32::NEG_INFINITY; 4]; QUADS] };
    type Ray = DopRay<QUADS>;

    fn of_points(points: &[[f32; 3]]) -> Self {
        if points.is_empty() {
            return Self::EMPTY;
        }
        let margin = MARGIN * 3.0 * f64::from(Aabb::of_points(points).max_abs());
        Self::of_extents(|direction| {
            let along = points.iter().map(|&point| dot(direction, wide(point)));
            let ends = [f64::INFINITY, f64::NEG_INFINITY];
            let [lo, hi] = along.fold(ends, |[lo, hi], x| [lo.min(x), hi.max(x)]);
            // One coordinate alone is exact.
            let margin = if taxicab(direction) > 1.0 { margin } else { 0.0 };
            [lo - margin, hi + margin]
        })
    }

    fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for quad in 0..QUADS {
            for lane in 0..4 {
                out.lo[quad][lane] = out.lo[quad][lane].min(other.lo[quad][lane]);
                out.hi[quad][lane] = out.hi[quad][lane].max(other.hi[quad][lane]);
            }
        }
        out
    }

    fn image(&self, map: &Affine) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let mut corners: Vec<Double> = self.faces().into_iter().flatten().collect();
        if corners.is_empty() {
            // Rounding left no face of something tiny: its box will do.
            let sides = [self.bounds().lo, self.bounds().hi].map(wide);
            corners.extend((0..8).map(|c| [0, 1, 2].map(|axis: usize| sides[c >> axis & 1][axis])));
        }
        let rows = map.0.map(|row| row.map(f64::from));
        let size = corners.iter().map(|&corner| taxicab(corner)).fold(0.0, f64::max);
        let reach = rows.map(|[a, b, c, d]| taxicab([a, b, c]) * size + d.abs());
        let margin = 8.0 * TOLERANCE * taxicab(reach);
        let mapped: Vec<Double> = corners
            .iter()
            .map(|&corner| rows.map(|[a, b, c, d]| dot([a, b, c], corner) + d))
            .collect();
        Self::of_extents(|direction| {
            let along = mapped.iter().map(|&point| dot(direction, point));
            let ends = [f64::INFINITY, f64::NEG_INFINITY];
            let [lo, hi] = along.fold(ends, |[lo, hi], x| [lo.min(x), hi.max(x)]);
            [lo - margin, hi + margin]
        })
    }

    fn bounds(&self) -> Aabb {
        let side = |side: &[[f32; 4]; QUADS]| [side[0][0], side[0][1], side[0][2]];
        Aabb { lo: side(&self.lo), hi: side(&self.hi) }
    }

    fn half_area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let doubled = |face: &Vec<Double>| {
            let edges = face
                .windows(2)
                .skip(1)
                .map(|pair| length(cross(sub(pair[0], face[0]), sub(pair[1], face[0]))));
            edges.sum::<f64>()
        };
        0.25 * self.faces().iter().map(doubled).sum::<f64>()
    }

    fn excess(&self, point: [f64; 3]) -> f64 {
        if self.is_empty() {
            return f64::INFINITY;
        }
        let beyond = Self::directions().iter().enumerate().map(|(at, &direction)| {
            let ([lo, hi], along) = (self.slab(at), dot(direction, point));
            (lo - along).max(along - hi) / length(direction)
        });
        beyond.fold(f64::NEG_INFINITY, f64::max)
    }

    fn ray(origin: [f32; 3], direction: [f32; 3], reach: &Aabb) -> DopRay<QUADS> {
        let (origin_wide, direction) = (wide(origin), wide(direction));
        let by = f64::from(slack(SLACK, origin, reach));
        let sum_error = MARGIN * taxicab(origin_wide);
        let mut ray = DopRay {
            lower: [[0.0; 4]; QUADS],
            upper: [[0.0; 4]; QUADS],
            reciprocal: [[1.0; 4]; QUADS],
        };
        for (at, &normal) in Self::directions().iter().enumerate() {
            let (along, by) = (dot(normal, origin_wide), by * taxicab(normal) + sum_error);
            ray.lower[at / 4][at % 4] = rounding::up(along + by);
            ray.upper[at / 4][at % 4] = rounding::down(along - by);
            let reciprocal = (1.0 / dot(normal, direction)) as f32;
            ray.reciprocal[at / 4][at % 4] = reciprocal.clamp(f32::MIN, f32::MAX);
        }
        ray
    }

    #[inline]
    fn interval(&self, ray: &DopRay<QUADS>) -> Interval {
        let (mut entry, mut exit) = ([f32::NEG_INFINITY; 4], [f32::INFINITY; 4]);
        for quad in 0..QUADS {
            for lane in 0..4 {
                let reciprocal = ray.reciprocal[quad][lane];
                let lower = (self.lo[quad][lane] - ray.lower[quad][lane]) * reciprocal;
                let upper = (self.hi[quad][lane] - ray.upper[quad][lane]) * reciprocal;
                let (near, far) = if reciprocal < 0.0 { (upper, lower) } else { (lower, upper) };
                entry[lane] = if near > entry[lane] { near } else { entry[lane] };
                exit[lane] = if far < exit[lane] { far } else { exit[lane] };
            }
        }
        let last = |a: f32, b: f32| if b > a { b } else { a };
        let first = |a: f32, b: f32| if b < a { b } else { a };
        Interval {
            entry: last(last(entry[0], entry[1]), last(entry[2], entry[3])),
            exit: first(first(exit[0], exit[1]), first(exit[2], exit[3])),
        }
    }
}

//! The box around the part of a triangle that lies in a region.
//!
//! Source: I. E. Sutherland and G. W. Hodgman, "Reentrant Polygon Clipping", Communications of the
//! ACM 17(1), 1974: the polygon is cut by one plane of the region after the other. Differs from it:
//! the box that comes out is certain to contain the part, although corners of the polygon are
//! rounded.
//!
//! # Why it contains the part
//!
//! In f64, with `m` the largest absolute coordinate of the triangle, a corner that a cut makes lies
//! within `2^-50 m` of the edge that it should lie on and of the plane that it should lie in, however
//! flat the angle between the two: it is a point between the edge's ends, rounded. Of every point of
//! the exact part, six cuts lose at most six times that much, if each plane is moved outward by more
//! than what has been lost before. Planes are moved, and the resulting box is widened, by `2^-44 m`,
//! ten times as much as that sum; then it is rounded outward, and cut to the region and to the
//! triangle's own box, which both contain the part.
//!
//! Neighbouring regions share a plane, closed on both sides, so the boxes of the parts of a triangle
//! in regions that cover it contain the whole triangle together.

use crate::bounds::Aabb;
use crate::math::rounding;

/// Planes are moved outward by this share of the largest coordinate. Derived above.
const MARGIN: f64 = 1.0 / (1_u64 << 44) as f64;

/// A triangle cut by six planes has at most this many corners.
const CORNERS_MAX: usize = 9;

/// A convex polygon.
#[derive(Clone, Copy)]
pub(super) struct Polygon {
    corners: [[f64; 3]; CORNERS_MAX],
    len: usize,
}

/// The box around the part of the triangle inside `region`; empty if there is certainly none.
/// Corners are finite and within [`super::mesh::COORDINATE_MAX`].
pub fn clipped_bounds(corners: &[[f32; 3]; 3], region: &Aabb) -> Aabb {
    let own = Aabb::of_points(corners);
    if region.contains(&own) {
        return own;
    }
    let margin = MARGIN * f64::from(own.max_abs());
    let mut polygon = Polygon::new(corners);
    for axis in 0..3 {
        // Planes that leave the triangle whole need no cut.
        if region.lo[axis] > own.lo[axis] {
            polygon = polygon.cut(axis, -1.0, margin - f64::from(region.lo[axis]));
        }
        if region.hi[axis] < own.hi[axis] {
            polygon = polygon.cut(axis, 1.0, margin + f64::from(region.hi[axis]));
        }
    }
    let mut bounds = Aabb::EMPTY;
    // A line that rounding bends may cross a plane more than twice: then take all there can be.
    if polygon.len > CORNERS_MAX {
        return own.intersection(region);
    }
    for corner in &polygon.corners[..polygon.len] {
        let around = Aabb {
            lo: corner.map(|x| rounding::down(x - margin)),
            hi: corner.map(|x| rounding::up(x + margin)),
        };
        bounds = bounds.union(&around);
    }
    bounds.intersection(&own).intersection(region)
}

/// Half the surface area that boxes around ever smaller parts of the triangle come to: half the
/// area of its shadows along the three axes, twice over.
pub fn least_half_area([a, b, c]: &[[f32; 3]; 3]) -> f64 {
    let edge = |to: &[f32; 3], axis: usize| f64::from(to[axis]) - f64::from(a[axis]);
    let shadow = |i: usize, j: usize| (edge(b, i) * edge(c, j) - edge(b, j) * edge(c, i)).abs();
    0.5 * (shadow(0, 1) + shadow(1, 2) + shadow(2, 0))
}

impl Polygon {
    /// A triangle.
    pub(super) fn new(corners: &[[f32; 3]; 3]) -> Self {
        let mut polygon = Self { corners: [[0.0; 3]; CORNERS_MAX], len: 3 };
        for (to, from) in polygon.corners.iter_mut().zip(corners) {
            *to = from.map(f64::from);
        }
        polygon
    }

    /// Its corners, in order; nine of them at most, should rounding have bent a line.
    pub(super) fn corners(&self) -> &[[f64; 3]] {
        &self.corners[..self.len.min(CORNERS_MAX)]
    }

    /// The part with `sign * coordinate <= limit` along an axis.
    pub(super) fn cut(&self, axis: usize, sign: f64, limit: f64) -> Self {
        if self.len > CORNERS_MAX {
            return *self;
        }
        let mut out = Self { corners: [[0.0; 3]; CORNERS_MAX], len: 0 };
        let corners = &self.corners[..self.len];
        for (at, to) in corners.iter().enumerate() {
            let from = &corners[(at + self.len - 1) % self.len];
            let beyond = [from, to].map(|corner| sign * corner[axis] - limit);
            if (beyond[0] > 0.0) != (beyond[1] > 0.0) {
                let share = beyond[0] / (beyond[0] - beyond[1]);
                out.push(core::array::from_fn(|i| from[i] + share * (to[i] - from[i])));
            }
            if beyond[1] <= 0.0 {
                out.push(*to);
            }
        }
        out
    }

    fn push(&mut self, corner: [f64; 3]) {
        if let Some(place) = self.corners.get_mut(self.len) {
            *place = corner;
        }
        self.len += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::Random;
    use alloc::vec::Vec;

    /// Cells of a grid that covers the triangle: their boxes contain each point of it that f64 can
    /// name, and none reaches out of its cell.
    #[test]
    fn parts_in_the_cells_of_a_grid_cover_the_triangle() {
        let mut random = Random::new(0xC119);
        let (mut points, mut tight) = (0, 0);
        for round in 0..2_000 {
            let size = 2.0_f32.powi([0, 0, -60, 55, 10][random.below(5) as usize]);
            let at =
                [(); 3].map(|()| random.between(-3.0, 3.0) * [1.0, 1e5][random.below(2) as usize]);
            let mut corner = || -> [f32; 3] {
                core::array::from_fn(|i| (random.between(-1.0, 1.0) + at[i]) * size)
            };
            let mut corners = [corner(), corner(), corner()];
            match random.below(4) {
                // In a plane that is a face of cells, a needle, a line.
                0 => (0..3).for_each(|i| corners[i][0] = corners[0][0]),
                1 => corners[2] = corners[1].map(f32::next_up),
                2 => corners[2] = corners[1],
                _ => {}
            }
            let own = Aabb::of_points(&corners);
            // Planes: anywhere, at a corner, or next to it.
            let planes: [[f32; 4]; 3] = core::array::from_fn(|axis| {
                let mut inner = [0; 2].map(|_| match random.below(3) {
                    0 => corners[random.below(3) as usize][axis],
                    1 => corners[random.below(3) as usize][axis].next_up(),
                    _ => random.between(own.lo[axis], own.hi[axis]),
                });
                inner.sort_unstable_by(f32::total_cmp);
                [own.lo[axis], inner[0], inner[1], own.hi[axis].max(inner[1])]
            });
            let mut parts = Vec::new();
            for cell in 0..27_usize {
                let place = [cell % 3, cell / 3 % 3, cell / 9];
                let region = Aabb {
                    lo: core::array::from_fn(|axis| planes[axis][place[axis]]),
                    hi: core::array::from_fn(|axis| planes[axis][place[axis] + 1]),
                };
                let part = clipped_bounds(&corners, &region);
                assert!(region.contains(&part) && own.contains(&part), "round {round}: {part:?}");
                tight += usize::from(!part.is_empty() && part != region);
                parts.push(part);
            }
            let slop = MARGIN / 64.0 * f64::from(own.max_abs());
            for _ in 0..20 {
                let (mut v, mut w) = (f64::from(random.unit()), f64::from(random.unit()));
                if v + w > 1.0 {
                    (v, w) = (1.0 - v, 1.0 - w);
                }
                let [a, b, c] = corners.map(|corner| corner.map(f64::from));
                let p: [f64; 3] =
                    core::array::from_fn(|i| a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]));
                let inside = |part: &Aabb| {
                    (0..3).all(|i| {
                        f64::from(part.lo[i]) <= p[i] + slop && p[i] - slop <= f64::from(part.hi[i])
                    })
                };
                assert!(parts.iter().any(inside), "round {round}: {p:?} of {corners:?} is lost");
                points += 1;
            }
        }
        assert!(points == 40_000 && tight > 5_000, "{points} {tight}");
    }

    #[test]
    fn a_diagonal_is_cut_tightly() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0]];
        let region = Aabb { lo: [0.0; 3], hi: [0.5, 1.0, 1.0] };
        let part = clipped_bounds(&corners, &region);
        assert!((0..3).all(|i| part.lo[i] == 0.0 && (part.hi[i] - 0.5).abs() < 1e-6), "{part:?}");
        let beside = Aabb { lo: [0.0, 0.6, 0.0], hi: [0.5, 1.0, 1.0] };
        assert!(clipped_bounds(&corners, &beside).is_empty());
    }
}

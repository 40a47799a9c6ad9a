//! Areas of triangles, whole and inside a box.
//!
//! The polygon that Sutherland and Hodgman's cuts leave (see [`super::clip`]) is a fan of triangles.
//! In f64, good to about `2^-48` of the triangle's own area: this is for measuring trees, where
//! nothing depends on the last bits.

use super::clip::Polygon;
use crate::bounds::Aabb;

/// The area of a triangle. Extents up to `2^63` square without overflow.
pub fn area(corners: &[[f32; 3]; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    0.5 * doubled(a, b, c)
}

/// The area of the part of a triangle inside the closed `region`: a triangle in the plane of a face
/// is inside.
pub fn area_inside(corners: &[[f32; 3]; 3], region: &Aabb) -> f64 {
    let own = Aabb::of_points(corners);
    if region.contains(&own) {
        return area(corners);
    }
    if region.intersection(&own).is_empty() {
        return 0.0;
    }
    let mut polygon = Polygon::new(corners);
    for axis in 0..3 {
        // Planes that leave the triangle whole need no cut.
        if region.lo[axis] > own.lo[axis] {
            polygon = polygon.cut(axis, -1.0, -f64::from(region.lo[axis]));
        }
        if region.hi[axis] < own.hi[axis] {
            polygon = polygon.cut(axis, 1.0, f64::from(region.hi[axis]));
        }
    }
    let corners = polygon.corners();
    let fan = corners.windows(2).skip(1).map(|pair| doubled(corners[0], pair[0], pair[1]));
    0.5 * fan.sum::<f64>()
}

/// Twice the area of a triangle.
fn doubled(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    let (u, v) = ([0, 1, 2].map(|i: usize| b[i] - a[i]), [0, 1, 2].map(|i: usize| c[i] - a[i]));
    let [x, y, z] =
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    libm::sqrt(x * x + y * y + z * z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::Random;

    #[test]
    fn a_square_of_two_triangles_is_cut_to_what_lies_inside() {
        let halves = [
            [[0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [2.0, 2.0, 0.5]],
            [[0.0, 0.0, 0.5], [2.0, 2.0, 0.5], [0.0, 2.0, 0.5]],
        ];
        let inside = |lo: [f32; 3], hi: [f32; 3]| -> f64 {
            halves.iter().map(|half| area_inside(half, &Aabb { lo, hi })).sum()
        };
        assert_eq!(halves.iter().map(area).sum::<f64>(), 4.0);
        assert_eq!(inside([0.5, 0.25, 0.0], [1.5, 1.0, 1.0]), 0.75);
        // In the plane of a face; of no thickness; beside.
        assert_eq!(inside([0.0, 0.0, 0.5], [1.0, 1.0, 0.75]), 1.0);
        assert_eq!(inside([0.0, 0.0, 0.5], [1.0, 1.0, 0.5]), 1.0);
        assert_eq!(inside([0.0, 0.0, 0.6], [1.0, 1.0, 0.75]), 0.0);
    }

    /// The parts in the cells of a grid add up to the whole.
    #[test]
    fn parts_add_up() {
        let mut random = Random::new(0xA2EA);
        for round in 0..500 {
            let size = [1.0, 1e-30, 1e15][random.below(3) as usize];
            let mut corner = || [(); 3].map(|()| size * random.between(-1.0, 1.0));
            let corners = [corner(), corner(), corner()];
            let own = Aabb::of_points(&corners);
            let middle: [f32; 3] =
                [0, 1, 2].map(|axis: usize| random.between(own.lo[axis], own.hi[axis]));
            let parts = (0..8_usize).map(|cell| {
                let high = |axis: usize| cell >> axis & 1 == 1;
                let side = |axis: usize| {
                    if high(axis) {
                        (middle[axis], own.hi[axis])
                    } else {
                        (own.lo[axis], middle[axis])
                    }
                };
                let sides = [side(0), side(1), side(2)];
                area_inside(&corners, &Aabb { lo: sides.map(|s| s.0), hi: sides.map(|s| s.1) })
            });
            let (sum, whole) = (parts.sum::<f64>(), area(&corners));
            assert!(
                (sum - whole).abs() <= 1e-12 * whole + 1e-14 * own.half_area(),
                "{round}: {sum} {whole}"
            );
        }
    }
}

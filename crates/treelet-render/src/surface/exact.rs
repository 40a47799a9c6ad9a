//! Arithmetic in f64, where only the last rounding may count.

use treelet::math::Affine;

/// The affine map in f64.
#[inline]
pub(super) fn apply(map: &Affine, p: [f64; 3]) -> [f64; 3] {
    let row = |[a, b, c, d]: [f32; 4]| {
        f64::from(a) * p[0] + f64::from(b) * p[1] + f64::from(c) * p[2] + f64::from(d)
    };
    [row(map.0[0]), row(map.0[1]), row(map.0[2])]
}

/// The point of a triangle with weights `u`, `v` of its second and third corner.
#[inline(always)]
pub(super) fn blended(corners: &[[f64; 3]; 3], [u, v]: [f64; 2]) -> [f64; 3] {
    let [a, b, c] = corners;
    let along = |k: usize| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]);
    [along(0), along(1), along(2)]
}

/// Twice the area vector of a triangle.
#[inline]
pub(super) fn cross(corners: &[[f64; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let e = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let f = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
}

#[inline]
pub(super) fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    // One division: the second rounding is far below that to f32. A length whose reciprocal is
    // infinite is 0 for f32 anyway.
    let scale = 1.0 / length;
    Some([(v[0] * scale) as f32, (v[1] * scale) as f32, (v[2] * scale) as f32])
}

/// The longest side of the triangle's box.
#[inline]
pub(super) fn longest_side(corners: &[[f64; 3]; 3]) -> f32 {
    // Comparisons: `f64::max` costs four instructions for its rule about NaN.
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    let smaller = |a: f64, b: f64| if a < b { a } else { b };
    let [a, b, c] = corners;
    let side = |k: usize| larger(larger(a[k], b[k]), c[k]) - smaller(smaller(a[k], b[k]), c[k]);
    larger(larger(side(0), side(1)), side(2)) as f32
}

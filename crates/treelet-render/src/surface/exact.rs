//! Arithmetic in f64, where only the last rounding may count.

use treelet::math::Affine;

/// The affine map in f64.
#[inline]
pub(super) fn apply(map: &Affine, p: [f64; 3]) -> [f64; 3] {
    map.0.map(|row| {
        let [a, b, c, d] = row.map(f64::from);
        a * p[0] + b * p[1] + c * p[2] + d
    })
}

/// Twice the area vector of a triangle.
#[inline]
pub(super) fn cross(corners: &[[f64; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let e: [f64; 3] = core::array::from_fn(|k| b[k] - a[k]);
    let f: [f64; 3] = core::array::from_fn(|k| c[k] - a[k]);
    [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
}

#[inline]
pub(super) fn unit(v: [f64; 3]) -> Option<[f32; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|x| (x / length) as f32))
}

/// The longest side of the triangle's box.
#[inline]
pub(super) fn longest_side(corners: &[[f64; 3]; 3]) -> f32 {
    let [a, b, c] = corners;
    let side = |k: usize| a[k].max(b[k]).max(c[k]) - a[k].min(b[k]).min(c[k]);
    side(0).max(side(1)).max(side(2)) as f32
}

//! Three-component vectors as `[f32; 3]`: the handful of operations the library needs.

/// `a - b`, component by component.
#[inline(always)]
pub fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + b`, component by component.
#[inline(always)]
pub fn add(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a * s`.
#[inline(always)]
pub fn scale(a: [f32; 3], s: f32) -> [f32; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `(a0 b0 + a1 b1) + a2 b2`.
#[inline(always)]
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b`.
#[inline(always)]
pub fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a` scaled to length 1, or `None` if its length is zero or not finite.
pub fn normalize(a: [f32; 3]) -> Option<[f32; 3]> {
    // In f64 neither the squares of tiny nor of huge components leave the range.
    let [x, y, z] = a.map(f64::from);
    let length = libm::sqrt(x * x + y * y + z * z);
    (length > 0.0 && length.is_finite()).then(|| [x, y, z].map(|c| (c / length) as f32))
}

/// The largest absolute component, of components that are not NaN.
#[inline(always)]
pub fn max_abs(a: [f32; 3]) -> f32 {
    // Comparisons: `f32::max` costs four instructions for its rule about NaN.
    let [x, y, z] = [a[0].abs(), a[1].abs(), a[2].abs()];
    let xy = if x > y { x } else { y };
    if z > xy { z } else { xy }
}

/// Whether no component is NaN or infinite.
#[inline(always)]
pub fn is_finite(a: [f32; 3]) -> bool {
    a[0].is_finite() && a[1].is_finite() && a[2].is_finite()
}

/// The index of the largest component; the lowest index wins a tie.
#[inline(always)]
pub fn largest_axis(a: [f32; 3]) -> usize {
    let xy = if a[1] > a[0] { 1 } else { 0 };
    if a[2] > a[xy] { 2 } else { xy }
}

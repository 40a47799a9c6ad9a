//! The grid of a node: one axis of it.

/// The number of the last plane.
const LAST: i64 = u16::MAX as i64;

/// Where the grid begins is at most this many steps from zero, so that every plane, and `start` less
/// every plane, is an f32 (less than `2^24` steps).
const FARTHEST: f64 = (1 << 22) as f64;

/// `start` is this many steps.
const START_STEPS: i32 = 23;

/// The least exponent of a step: `start` is not subnormal.
const EXPONENT_MIN: i32 = f32::MIN_EXP - 1 - START_STEPS;

/// Steps of `2^exponent`, from the one numbered `first`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    exponent: i32,
    first: i64,
}

impl Grid {
    /// The finest grid from `lo` to `hi`, finite and far from the end of f32's range.
    ///
    /// Divisions by powers of two are exact in f64, and so are floor and ceiling: no plane is ever
    /// inside what it is to contain.
    pub(super) fn new(lo: f32, hi: f32) -> Self {
        let farthest = f64::from(lo.abs().max(hi.abs()));
        // Steps that are too fine are soon left: a step of extent / 65536 is too fine by two at most.
        let least = (farthest / FARTHEST).max((f64::from(hi) - f64::from(lo)) / (LAST + 1) as f64);
        let mut exponent = exponent_of(least).max(EXPONENT_MIN);
        loop {
            let grid = Self { exponent, first: floor(lo, exponent) };
            let fits = ceil(hi, exponent) - grid.first <= LAST;
            if fits && grid.first.unsigned_abs() as f64 <= FARTHEST {
                return grid;
            }
            exponent += 1;
        }
    }

    /// The numbers of the planes around `lo ..= hi`, which is inside the grid.
    pub(super) fn around(self, lo: f32, hi: f32) -> [u16; 2] {
        let number = |step: i64| (step - self.first).clamp(0, LAST) as u16;
        [number(floor(lo, self.exponent)), number(ceil(hi, self.exponent))]
    }

    /// `start` and `shift` of the node.
    pub(super) fn words(self) -> [f32; 2] {
        let start = power(self.exponent + START_STEPS);
        let begin = self.first as f64 * power(self.exponent);
        [start as f32, (start - begin) as f32]
    }
}

/// The greatest `e` with `2^e <= x`, for `x >= 0`.
fn exponent_of(x: f64) -> i32 {
    // Zero counts as the least number: its steps are as fine as can be.
    ((x.to_bits() >> (f64::MANTISSA_DIGITS - 1)) as i32) - (f64::MAX_EXP - 1)
}

/// `2^exponent`, far from the end of f64's range.
fn power(exponent: i32) -> f64 {
    f64::from_bits(((exponent + f64::MAX_EXP - 1) as u64) << (f64::MANTISSA_DIGITS - 1))
}

fn floor(x: f32, exponent: i32) -> i64 {
    libm::floor(f64::from(x) / power(exponent)) as i64
}

fn ceil(x: f32, exponent: i32) -> i64 {
    libm::ceil(f64::from(x) / power(exponent)) as i64
}

#[cfg(test)]
mod tests {
    use super::{FARTHEST, Grid};
    use crate::geometry::mesh::COORDINATE_MAX;

    /// Grid, words, planes: for intervals of every size at every distance.
    #[test]
    fn planes_are_exact_and_contain() {
        let sizes = [0.0, 1e-45, 1e-38, 1e-20, 0.3, 7.0, 1e4, 3e11, COORDINATE_MAX];
        let mut tested = 0;
        for &size in &sizes {
            for &at in &sizes {
                for lo in [at, -at] {
                    for hi in [lo, lo.next_up(), lo + size] {
                        if hi.abs() > COORDINATE_MAX || hi < lo {
                            continue;
                        }
                        let grid = Grid::new(lo, hi);
                        let [start, shift] = grid.words();
                        assert_eq!(start.to_bits() & 0xFFFF, 0);
                        let step = f64::from(start) / 8_388_608.0;
                        // The decoded planes are the exact ones, and the finest that there are.
                        for number in (0..=65_535_u32).step_by(255) {
                            let plane = f32::from_bits(start.to_bits() | number) - shift;
                            let exact = (grid.first as f64 + f64::from(number)) * step;
                            assert_eq!(f64::from(plane), exact, "{lo} {hi} {number}");
                        }
                        let [first, last] = grid.around(lo, hi);
                        let plane = |number: u16| {
                            f32::from_bits(start.to_bits() | u32::from(number)) - shift
                        };
                        assert!(plane(first) <= lo && hi <= plane(last), "{lo} {hi}");
                        let extent = f64::from(hi) - f64::from(lo);
                        let farthest = f64::from(lo.abs().max(hi.abs()));
                        let allowed = (extent / 16_384.0).max(2.0 * farthest / FARTHEST).max(3e-45);
                        assert!(step <= allowed, "{lo} {hi}: step {step:e}");
                        tested += 1;
                    }
                }
            }
        }
        assert!(tested > 200);
    }
}

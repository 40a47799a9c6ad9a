//! Vectors of f64, for volumes that are made and not yet traced.

pub(super) type Double = [f64; 3];

/// The axes of space.
pub(super) const UNIT: [Double; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(super) fn wide(a: [f32; 3]) -> Double {
    a.map(f64::from)
}

pub(super) fn sub(a: Double, b: Double) -> Double {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn add(a: Double, b: Double) -> Double {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn scale(a: Double, s: f64) -> Double {
    a.map(|c| c * s)
}

pub(super) fn dot(a: Double, b: Double) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Double, b: Double) -> Double {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn length(a: Double) -> f64 {
    libm::sqrt(dot(a, a))
}

/// The sum of the components' magnitudes.
pub(super) fn taxicab(a: Double) -> f64 {
    a[0].abs() + a[1].abs() + a[2].abs()
}

/// Scaled to length 1; `None` for a vector that has none to speak of.
pub(super) fn unit(a: Double) -> Option<Double> {
    let length = length(a);
    (length > 0.0 && length.is_finite()).then(|| scale(a, 1.0 / length))
}

/// Three axes at right angles: the first along `a`, the second in the plane of `a` and `b`. Vectors
/// that vanish, or nearly point alike, are replaced by what is at hand.
pub(super) fn frame(a: Double, b: Double) -> [Double; 3] {
    /// Sine of the angle below which two vectors point alike.
    const ALIKE: f64 = 1e-6;
    let first = unit(a).or_else(|| unit(b)).unwrap_or(UNIT[0]);
    let across = |b: Double| {
        let b = unit(b)?;
        let rest = sub(b, scale(first, dot(first, b)));
        if length(rest) < ALIKE {
            return None;
        }
        // Once more: what the first time left over may be large beside a small rest.
        unit(sub(rest, scale(first, dot(first, rest))))
    };
    let least = if first[0].abs() < 0.6 { UNIT[0] } else { UNIT[1] };
    // One of the axes of space is always far from `first`.
    let second = across(b).or_else(|| across(least)).unwrap_or(UNIT[1]);
    [first, second, cross(first, second)]
}

/// The orthonormal axes in which a symmetric matrix is diagonal, and its diagonal there.
///
/// Source: C. G. J. Jacobi's rotations, as in G. H. Golub and C. F. Van Loan, "Matrix Computations",
/// section 8.5. Each sweep squares the error; eight are more than f64 can show.
pub(super) fn diagonalize(mut m: [Double; 3]) -> ([Double; 3], Double) {
    const SWEEPS: usize = 8;
    let mut axes = UNIT;
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if m[p][q] == 0.0 {
                continue;
            }
            let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
            let sign = if theta < 0.0 { -1.0 } else { 1.0 };
            let tan = sign / (theta.abs() + libm::sqrt(theta * theta + 1.0));
            let cos = 1.0 / libm::sqrt(tan * tan + 1.0);
            let sin = tan * cos;
            let turn = |a: f64, b: f64| (cos * a - sin * b, sin * a + cos * b);
            // Columns, rows, and the axes, which are rows.
            for row in &mut m {
                (row[p], row[q]) = turn(row[p], row[q]);
            }
            for i in 0..3 {
                (m[p][i], m[q][i]) = turn(m[p][i], m[q][i]);
                (axes[p][i], axes[q][i]) = turn(axes[p][i], axes[q][i]);
            }
        }
    }
    (axes, [m[0][0], m[1][1], m[2][2]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_diagonal_is_found_again() {
        let axes = frame([1.0, 2.0, -0.5], [0.0, 1.0, 1.0]);
        let values = [5.0, 0.25, 0.0];
        let mut m = [[0.0; 3]; 3];
        for (axis, value) in axes.iter().zip(values) {
            for i in 0..3 {
                (0..3).for_each(|j| m[i][j] += value * axis[i] * axis[j]);
            }
        }
        let (found, mut diagonal) = diagonalize(m);
        for (axis, value) in found.iter().zip(diagonal) {
            let image = m.map(|row| dot(row, *axis));
            assert!(length(sub(image, scale(*axis, value))) < 1e-12, "{found:?} {diagonal:?}");
        }
        diagonal.sort_unstable_by(f64::total_cmp);
        assert!((diagonal[2] - 5.0).abs() < 1e-12 && diagonal[0].abs() < 1e-12, "{diagonal:?}");
    }

    #[test]
    fn frames_have_right_angles() {
        let nearly = [1.0, 1e-7, 0.0];
        for (a, b) in
            [([0.0; 3], [0.0; 3]), (UNIT[1], UNIT[1]), (UNIT[0], nearly), ([0.0; 3], UNIT[2])]
        {
            let frame = frame(a, b);
            for i in 0..3 {
                for j in 0..3 {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((dot(frame[i], frame[j]) - expected).abs() < 1e-14, "{frame:?}");
                }
            }
        }
    }
}

//! Medians, spreads, and intervals that hold without assuming a distribution.

/// The median; NaN of nothing.
pub fn median(values: &[f64]) -> f64 {
    let sorted = sorted(values);
    let n = sorted.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => sorted[n / 2],
        _ => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

/// Largest less smallest, of the median.
pub fn spread(values: &[f64]) -> f64 {
    let sorted = sorted(values);
    match (sorted.first(), sorted.last()) {
        (Some(least), Some(most)) => (most - least) / median(values),
        _ => f64::NAN,
    }
}

/// A ratio with the interval that holds its true median with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// The median.
    pub median: f64,
    /// The interval's lower end; with fewer than 6 pairs no interval reaches 95 %, and it is that of
    /// all of them.
    pub low: f64,
    /// The interval's upper end.
    pub high: f64,
}

impl Ratio {
    /// The ratio of values taken in pairs.
    pub fn of_pairs(above: &[f64], below: &[f64]) -> Self {
        let ratios: Vec<f64> = above.iter().zip(below).map(|(a, b)| a / b).collect();
        let sorted = sorted(&ratios);
        let Some(last) = sorted.len().checked_sub(1) else {
            return Self { median: f64::NAN, low: f64::NAN, high: f64::NAN };
        };
        let trim = trimmed(sorted.len());
        Self { median: median(&ratios), low: sorted[trim], high: sorted[last - trim] }
    }

    /// The geometric mean of ratios that vary independently: their logarithms' half widths add up
    /// like errors do. The two sides are treated apart.
    pub fn geometric_mean(ratios: &[Self]) -> Self {
        let n = ratios.len() as f64;
        let mean = ratios.iter().map(|ratio| ratio.median.ln()).sum::<f64>() / n;
        let width = |end: fn(&Self) -> f64| {
            let square = |ratio: &Self| (end(ratio).ln() - ratio.median.ln()).powi(2);
            ratios.iter().map(square).sum::<f64>().sqrt() / n
        };
        Self {
            median: mean.exp(),
            low: (mean - width(|ratio| ratio.low)).exp(),
            high: (mean + width(|ratio| ratio.high)).exp(),
        }
    }
}

/// How many values may be left out at either end of `n`, so that the rest still holds the median of
/// whatever they were drawn from with 95 % confidence: the median is as likely above a value as
/// below, so the count below is binomial.
fn trimmed(n: usize) -> usize {
    let mut tail = 0.0;
    let mut ways = 0.5_f64.powi(i32::try_from(n).unwrap_or(i32::MAX));
    let mut left_out = 0;
    for k in 0..n / 2 {
        tail += ways;
        if 2.0 * tail > 0.05 {
            break;
        }
        left_out = k;
        ways *= (n - k) as f64 / (k + 1) as f64;
    }
    left_out
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::{Ratio, median, spread, trimmed};

    #[test]
    fn medians_and_spreads() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&[]).is_nan());
        assert_eq!(spread(&[8.0, 10.0, 12.0]), 0.4);
    }

    #[test]
    fn intervals_are_those_of_the_tables() {
        // Ranks of the sign test's interval, from any table of nonparametric statistics: the k-th
        // from either end, k = trimmed + 1.
        for (n, rank) in [(6, 1), (7, 1), (8, 1), (9, 2), (10, 2), (11, 2), (12, 3), (20, 6)] {
            assert_eq!(trimmed(n) + 1, rank, "{n}");
        }
        for n in 0..6 {
            assert_eq!(trimmed(n), 0, "{n}");
        }
    }

    #[test]
    fn ratios_are_paired() {
        let ratio = Ratio::of_pairs(&[2.0, 20.0, 4.0], &[1.0, 10.0, 2.0]);
        assert_eq!((ratio.median, ratio.low, ratio.high), (2.0, 2.0, 2.0));
        let mean = Ratio::geometric_mean(&[
            Ratio { median: 2.0, low: 1.0, high: 2.0 },
            Ratio { median: 8.0, low: 8.0, high: 8.0 },
        ]);
        assert!((mean.median - 4.0).abs() < 1e-12, "{mean:?}");
        // One side is as wide as one factor of 2 shared among two scenes.
        assert!((mean.low - 4.0 / 2f64.sqrt()).abs() < 1e-12, "{mean:?}");
        assert!((mean.high - 4.0).abs() < 1e-12, "{mean:?}");
    }
}

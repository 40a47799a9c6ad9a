//! The pixel filter, by importance sampling: a sample's place in the picture is drawn from the
//! filter itself, so that every sample counts alike and for one pixel only.
//!
//! Source: M. Ernst, M. Stamminger, G. Greiner, "Filter Importance Sampling", IEEE Symposium on
//! Interactive Ray Tracing, 2006. The filter is the four-term window of F. Harris, "On the Use of
//! Windows for Harmonic Analysis with the Discrete Fourier Transform", Proc. IEEE 66(1), 1978,
//! stretched over three pixels: positive everywhere, so that no weight is ever negative.
//!
//! One table of 513 numbers, filled once by bisection; two lookups a sample.

use core::f64::consts::TAU;

/// How far the filter reaches from the middle of the pixel, in pixels.
pub const RADIUS: f64 = 1.5;

/// Coefficients of the window (Harris 1978, table 1, the row of -92 dB).
const A: [f64; 4] = [0.35875, 0.48829, 0.14128, 0.01168];

/// Cells of the table.
const CELLS: usize = 512;

/// Draws offsets from the pixel filter.
#[derive(Clone, Debug)]
pub struct Filter {
    quantiles: Vec<f32>,
}

impl Default for Filter {
    fn default() -> Self {
        Self::new()
    }
}

impl Filter {
    /// The Blackman-Harris filter of [`RADIUS`].
    pub fn new() -> Self {
        let quantiles = (0..=CELLS).map(|i| quantile(i as f64 / CELLS as f64) as f32).collect();
        Self { quantiles }
    }

    /// The offset from the middle of the pixel, in pixels, for a point of the unit square.
    #[inline]
    pub fn offset(&self, u: [f32; 2]) -> [f32; 2] {
        u.map(|u| {
            let place = u * CELLS as f32;
            let cell = (place as usize).min(CELLS - 1);
            let (lo, hi) = (self.quantiles[cell], self.quantiles[cell + 1]);
            lo + (place - cell as f32) * (hi - lo)
        })
    }
}

/// The filter's density along one axis, `x` pixels from the middle.
pub fn density(x: f64) -> f64 {
    if x.abs() > RADIUS {
        return 0.0;
    }
    let phase = TAU * (x / (2.0 * RADIUS) + 0.5);
    let cosines =
        A[1] * libm::cos(phase) - A[2] * libm::cos(2.0 * phase) + A[3] * libm::cos(3.0 * phase);
    (A[0] - cosines) / (A[0] * 2.0 * RADIUS)
}

/// The integral of [`density`] up to `x`.
pub fn distribution(x: f64) -> f64 {
    let place = (x / (2.0 * RADIUS) + 0.5).clamp(0.0, 1.0);
    let phase = TAU * place;
    let sines = A[1] * libm::sin(phase) - A[2] * libm::sin(2.0 * phase) / 2.0
        + A[3] * libm::sin(3.0 * phase) / 3.0;
    place - sines / (A[0] * TAU)
}

/// Where [`distribution`] reaches `p`, by bisection.
fn quantile(p: f64) -> f64 {
    let (mut lo, mut hi) = (-RADIUS, RADIUS);
    // Sixty halvings of three pixels reach the spacing of f64.
    for _ in 0..60 {
        let middle = 0.5 * (lo + hi);
        if distribution(middle) < p {
            lo = middle;
        } else {
            hi = middle;
        }
    }
    0.5 * (lo + hi)
}

#[cfg(test)]
mod tests {
    use super::{Filter, RADIUS, density, distribution};

    #[test]
    fn integrates_to_one() {
        let steps = 10_000;
        let width = 2.0 * RADIUS / f64::from(steps);
        let mut sum = 0.0;
        for i in 0..steps {
            let x = -RADIUS + (f64::from(i) + 0.5) * width;
            assert!(density(x) >= 0.0, "at {x}");
            sum += density(x) * width;
            let so_far = distribution(x + 0.5 * width);
            assert!((sum - so_far).abs() < 1e-6, "at {x}: {sum} against {so_far}");
        }
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }

    #[test]
    fn samples_follow_the_density() {
        let filter = Filter::new();
        let (n, bins) = (100_000u32, 30);
        let mut counts = vec![0u32; bins];
        for i in 0..n {
            let [x, y] = filter.offset([(i as f32 + 0.5) / n as f32, 0.5]);
            assert!(y.abs() < 1e-6 && f64::from(x.abs()) <= RADIUS);
            let bin = (f64::from(x) + RADIUS) / (2.0 * RADIUS) * bins as f64;
            counts[(bin as usize).min(bins - 1)] += 1;
        }
        for (bin, &count) in counts.iter().enumerate() {
            let edge = |i: usize| -RADIUS + 2.0 * RADIUS * i as f64 / bins as f64;
            let want = distribution(edge(bin + 1)) - distribution(edge(bin));
            let got = f64::from(count) / f64::from(n);
            // Linear interpolation moves at most one cell's share.
            assert!((got - want).abs() < 1.0 / 512.0, "bin {bin}: {got} against {want}");
        }
    }
}

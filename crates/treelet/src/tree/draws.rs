//! Random numbers for measuring: a stream for each sample, so that samples can be taken in any order.
//!
//! Source: S. Vigna's `splitmix64`, as in `verify::Random`, which this folder does not know.

/// The numbers of one sample.
pub(super) struct Draws(u64);

impl Draws {
    /// Those of sample `index` of the measurement that `seed` stands for.
    pub(super) fn new(seed: u64, index: u64) -> Self {
        let mut draws = Self(seed);
        draws.0 = draws.bits() ^ index.wrapping_mul(0xD134_2543_DE82_EF95);
        draws.bits();
        draws
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Uniform in `0 .. 1`, 53 bits.
    pub(super) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A point of the unit disk, uniform.
    pub(super) fn disk(&mut self) -> [f64; 2] {
        loop {
            let point = [2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0];
            if point[0] * point[0] + point[1] * point[1] <= 1.0 {
                return point;
            }
        }
    }
}

/// A mean, and how far it may be off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The mean of the samples, or the exact value.
    pub value: f64,
    /// Its standard error; 0 for an exact value. The truth is within twice that 19 times of 20.
    pub error: f64,
}

/// Sums of samples, in a fixed order.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Sums {
    pub(super) fn add(&mut self, sample: f64) {
        self.count += 1.0;
        self.sum += sample;
        self.squares += sample * sample;
    }

    pub(super) fn join(mut self, other: Self) -> Self {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
        self
    }

    pub(super) fn mean(&self) -> Estimate {
        let error = if self.count > 0.0 { self.deviation() / libm::sqrt(self.count) } else { 0.0 };
        Estimate { value: self.sum / self.count.max(1.0), error }
    }

    /// The standard deviation of the samples.
    pub(super) fn deviation(&self) -> f64 {
        let count = self.count.max(1.0);
        let mean = self.sum / count;
        libm::sqrt((self.squares / count - mean * mean).max(0.0))
    }
}

//! Pseudo-random numbers that are the same everywhere, for tests and samples.
//!
//! Source: S. Vigna's `splitmix64`, after G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable
//! Pseudorandom Number Generators", OOPSLA 2014.

/// A generator; equal seeds give equal streams on every machine.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The stream of a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Uniform in `0 .. n`; 0 if `n` is 0. The bias, below `n / 2^64`, does not matter to tests.
    pub fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.bits()) * u128::from(n)) >> 64) as u64
    }

    /// Uniform in `0 .. 1`, 24 bits.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 16_777_216.0
    }

    /// Uniform in `lo ..= hi`.
    pub fn between(&mut self, lo: f32, hi: f32) -> f32 {
        // Weighted, not `lo + u * (hi - lo)`: the difference may overflow.
        let u = self.unit();
        lo * (1.0 - u) + hi * u
    }

    /// A direction, uniform on the sphere, of length between about 0.1 and 1.
    pub fn direction(&mut self) -> [f32; 3] {
        loop {
            let d = core::array::from_fn(|_| self.between(-1.0, 1.0));
            let length_sq: f32 = crate::math::vec3::dot(d, d);
            if (0.01..=1.0).contains(&length_sq) {
                return d;
            }
        }
    }
}

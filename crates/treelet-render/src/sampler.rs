//! Sample points: a padded, Owen-scrambled Sobol sequence that is a pure function of
//! (seed, pixel, sample, pair).
//!
//! Source: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020. Every pair of
//! dimensions is the two-dimensional Sobol sequence, its order shuffled and its digits scrambled
//! by hashes of the pixel and the pair, so that pairs and pixels are independent of each other.
//! Differs from it: the permutation is the one of N. Vegdahl, "Building a Better LK Hash", 2021,
//! which scrambles more evenly; and the second Sobol dimension needs no table: its generator
//! matrix is Pascal's triangle mod 2, in which by Lucas' theorem `C(i, j)` is odd exactly if the
//! binary digits of `j` are among those of `i`. The product is therefore a sum over supersets,
//! five shifts and masks.
//!
//! About 10 ns a pair; no state but a key and a counter.

/// The points of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    key: u64,
    /// The number of the sample, its lowest digit first.
    reversed: u32,
}

impl Sampler {
    /// The points of sample number `sample` of the pixel at column `x`, row `y`.
    pub fn new(seed: u64, x: u32, y: u32, sample: u32) -> Self {
        let pixel = u64::from(y) << 32 | u64::from(x);
        let reversed = sample.reverse_bits();
        Self { key: mix(mix(seed.wrapping_add(GOLDEN)) ^ pixel), reversed }
    }

    /// Pair number `pair` in the unit square, 1 excluded, as two 32-bit fractions.
    ///
    /// The first `2^k` samples of a pixel put one point in each elementary interval of area `2^-k`.
    #[inline]
    pub fn pair_bits(&self, pair: u32) -> [u32; 2] {
        let first = mix(self.key.wrapping_add(u64::from(pair).wrapping_mul(GOLDEN)));
        let second = mix(first ^ GOLDEN);
        let index = permute(self.reversed, first as u32).reverse_bits();
        let x = permute(index, (first >> 32) as u32);
        let y = permute(pascal(index), second as u32);
        // Both are turned around at once: that is most of the work.
        let both = (u64::from(y) << 32 | u64::from(x)).reverse_bits();
        [(both >> 32) as u32, both as u32]
    }

    /// Pair number `pair` in the unit square, 1 excluded.
    #[inline]
    pub fn pair(&self, pair: u32) -> [f32; 2] {
        let [x, y] = self.pair_bits(pair);
        [fraction(x), fraction(y)]
    }
}

/// Point `index` of the Sobol sequence itself, neither shuffled nor scrambled.
pub(crate) fn sobol(index: u32) -> [f32; 2] {
    [fraction(index.reverse_bits()), fraction(pascal(index).reverse_bits())]
}

/// 2^64 over the golden ratio, odd: steps that visit all 64-bit values evenly.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// A number in `0 .. 1` that follows from two others and from nothing else.
#[inline]
pub(crate) fn hashed(names: u64, key: u32) -> f32 {
    fraction((mix(mix(names ^ GOLDEN) ^ u64::from(key)) >> 32) as u32)
}

/// The upper 24 bits as a fraction below 1: all that an f32 holds.
#[inline(always)]
pub(crate) fn fraction(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The product of Pascal's triangle mod 2 with the digits of `i`, the lowest first.
#[inline(always)]
fn pascal(i: u32) -> u32 {
    let i = i ^ (i >> 1 & 0x5555_5555);
    let i = i ^ (i >> 2 & 0x3333_3333);
    let i = i ^ (i >> 4 & 0x0F0F_0F0F);
    let i = i ^ (i >> 8 & 0x00FF_00FF);
    i ^ (i >> 16 & 0x0000_FFFF)
}

/// A permutation in which each bit depends on the bits below it only: Owen scrambling of a number
/// whose most significant digit is the lowest bit. Constants: Vegdahl 2021.
#[inline(always)]
fn permute(x: u32, seed: u32) -> u32 {
    let x = x ^ x.wrapping_mul(0x3D20_ADEA);
    let x = x.wrapping_add(seed);
    let x = x.wrapping_mul(seed >> 16 | 1);
    let x = x ^ x.wrapping_mul(0x0552_6C56);
    x ^ x.wrapping_mul(0x53A2_2864)
}

/// A 64-bit mixer. Source: D. Stafford's variant 13 of the MurmurHash3 finaliser, 2011, as used by
/// G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
#[inline(always)]
fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::{Sampler, pascal, sobol};

    /// Every elementary interval of `2^k` points holds exactly one of them.
    #[test]
    fn is_stratified() {
        for seed in 0..8u64 {
            for pair in [0, 1, 7, 100] {
                for k in [4u32, 8] {
                    let points: Vec<_> = (0..1u32 << k)
                        .map(|sample| Sampler::new(seed, 3, 5, sample).pair_bits(pair))
                        .collect();
                    for columns in 0..=k {
                        let rows = k - columns;
                        let mut seen = vec![0u32; 1 << k];
                        for &[x, y] in &points {
                            let column = u64::from(x) >> (32 - columns);
                            let row = u64::from(y) >> (32 - rows);
                            seen[(row << columns | column) as usize] += 1;
                        }
                        let case = format!("seed {seed}, pair {pair}, 2^{columns} x 2^{rows}");
                        assert!(seen.iter().all(|&n| n == 1), "{case}: {seen:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn pascal_is_the_triangle() {
        // Direction numbers of the polynomial x + 1: v' = v ^ v / 2, by the definition of Sobol.
        let mut direction = 1u32 << 31;
        for i in 0..32 {
            assert_eq!(pascal(1 << i).reverse_bits(), direction, "column {i}");
            direction ^= direction >> 1;
        }
        assert_eq!(sobol(3), [0.75, 0.25]);
    }

    /// Points of different pairs, pixels, seeds do not go together: correlation of the first
    /// coordinates is that of independent numbers, within five standard errors.
    #[test]
    fn pairs_pixels_and_seeds_are_uncorrelated() {
        const N: u32 = 4096;
        let correlation = |a: &dyn Fn(u32) -> f32, b: &dyn Fn(u32) -> f32| {
            let product = |i| f64::from(a(i) - 0.5) * f64::from(b(i) - 0.5);
            12.0 * (0..N).map(product).sum::<f64>() / f64::from(N)
        };
        let bound = 5.0 / f64::from(N).sqrt();
        let one = |i: u32| Sampler::new(1, 10, 20, i).pair(0)[0];
        let others: [(&str, &dyn Fn(u32) -> f32); 4] = [
            ("pair", &|i| Sampler::new(1, 10, 20, i).pair(1)[0]),
            ("pixel", &|i| Sampler::new(1, 11, 20, i).pair(0)[0]),
            ("row", &|i| Sampler::new(1, 10, 21, i).pair(0)[0]),
            ("seed", &|i| Sampler::new(2, 10, 20, i).pair(0)[0]),
        ];
        for (name, other) in others {
            let r = correlation(&one, other);
            assert!(r.abs() < bound, "{name}: {r}");
        }
        assert!(correlation(&one, &one) > 0.99);
    }
}

//! Awkward scenes, as plain arrays: what builders and walks get wrong first.
//!
//! Not published; it depends on nothing of ours, so that the library can use it in its own tests.

pub mod awkward;
pub mod closed;

use std::sync::OnceLock;

/// How often a test does something: `full` times, or one `TREELET_TEST_SHARE`-th of that, for
/// programs that run in an emulator. What a test demands to have seen shrinks along.
///
/// # Panics
///
/// If `TREELET_TEST_SHARE` is set to anything but a number from 1 on.
pub fn rounds(full: usize) -> usize {
    static SHARE: OnceLock<usize> = OnceLock::new();
    let share = SHARE.get_or_init(|| match std::env::var("TREELET_TEST_SHARE") {
        Err(_) => 1,
        Ok(word) => match word.parse() {
            Ok(share @ 1..) => share,
            _ => panic!("TREELET_TEST_SHARE is '{word}'; it must be a number from 1 on"),
        },
    });
    full.div_ceil(*share)
}

/// Vertex positions and triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Triangles that share no vertex.
    pub fn soup(triangles: &[[[f32; 3]; 3]]) -> Self {
        Self {
            positions: triangles.iter().flatten().copied().collect(),
            triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        }
    }

    /// The same shape with every vertex moved.
    #[must_use]
    pub fn mapped(mut self, map: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        self.positions.iter_mut().for_each(|p| *p = map(*p));
        self
    }
}

/// A stream of pseudo-random numbers in `0 .. 1`: a 64-bit linear congruential generator (Knuth's
/// MMIX constants), of which the high bits are used.
#[derive(Clone, Debug)]
pub struct Noise(u64);

impl Noise {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        let mut noise = Self(seed);
        noise.unit();
        noise
    }

    /// The next number.
    pub fn unit(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    /// The next number, stretched to `lo .. hi`.
    pub fn between(&mut self, lo: f32, hi: f32) -> f32 {
        lo + self.unit() * (hi - lo)
    }

    /// The next three numbers.
    pub fn point(&mut self, lo: f32, hi: f32) -> [f32; 3] {
        [self.between(lo, hi), self.between(lo, hi), self.between(lo, hi)]
    }
}

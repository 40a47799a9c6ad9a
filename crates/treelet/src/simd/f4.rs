//! Four lanes of f32 at the level that every processor of its kind has: what builders compute with.
//!
//! On x86-64 these are SSE2 registers; elsewhere arrays. Lane by lane both compute the same bits, so
//! trees do not depend on the machine.
//!
//! Arrays everywhere, left to the compiler's own vectorisation, lost on x86-64: it clamps by
//! branches and shuffles parts of vectors.

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use portable::F4;
#[cfg(target_arch = "x86_64")]
pub(crate) use sse2::F4;

#[cfg(target_arch = "x86_64")]
mod sse2 {
    use core::arch::x86_64::*;

    macro_rules! sse2 {
        ($expression:expr) => {
            // SAFETY: the intrinsics in it need SSE2, which is part of x86-64, and nothing else.
            unsafe { $expression }
        };
    }

    /// Four f32: x, y, z and one more.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub(crate) struct F4(__m128);

    impl F4 {
        #[inline(always)]
        pub(crate) fn new(x: f32, y: f32, z: f32, w: f32) -> Self {
            Self(sse2!(_mm_set_ps(w, z, y, x)))
        }
        #[inline(always)]
        pub(crate) fn splat(x: f32) -> Self {
            Self(sse2!(_mm_set1_ps(x)))
        }
        /// The smaller one; the second one where they do not compare.
        #[inline(always)]
        pub(crate) fn min(self, other: Self) -> Self {
            Self(sse2!(_mm_min_ps(self.0, other.0)))
        }
        /// The larger one; the second one where they do not compare.
        #[inline(always)]
        pub(crate) fn max(self, other: Self) -> Self {
            Self(sse2!(_mm_max_ps(self.0, other.0)))
        }
        #[inline(always)]
        pub(crate) fn add(self, other: Self) -> Self {
            Self(sse2!(_mm_add_ps(self.0, other.0)))
        }
        #[inline(always)]
        pub(crate) fn sub(self, other: Self) -> Self {
            Self(sse2!(_mm_sub_ps(self.0, other.0)))
        }
        #[inline(always)]
        pub(crate) fn mul(self, other: Self) -> Self {
            Self(sse2!(_mm_mul_ps(self.0, other.0)))
        }
        #[inline(always)]
        pub(crate) fn neg(self) -> Self {
            Self(sse2!(_mm_xor_ps(self.0, _mm_set1_ps(-0.0))))
        }
        #[inline(always)]
        pub(crate) fn abs(self) -> Self {
            Self(sse2!(_mm_andnot_ps(_mm_set1_ps(-0.0), self.0)))
        }
        /// The lanes y, z, x, w.
        #[inline(always)]
        pub(crate) fn yzxw(self) -> Self {
            Self(sse2!(_mm_shuffle_ps::<0b11_00_10_01>(self.0, self.0)))
        }
        /// The same with zero in the fourth lane.
        #[inline(always)]
        pub(crate) fn xyz(self) -> Self {
            Self(sse2!(_mm_and_ps(self.0, _mm_castsi128_ps(_mm_set_epi32(0, -1, -1, -1)))))
        }
        /// `if self < other { a } else { b }`
        #[inline(always)]
        pub(crate) fn less_pick(self, other: Self, a: Self, b: Self) -> Self {
            let less = sse2!(_mm_cmplt_ps(self.0, other.0));
            Self(sse2!(_mm_or_ps(_mm_and_ps(less, a.0), _mm_andnot_ps(less, b.0))))
        }
        /// Bit i: whether lane i is less.
        #[inline(always)]
        pub(crate) fn less_bits(self, other: Self) -> usize {
            sse2!(_mm_movemask_ps(_mm_cmplt_ps(self.0, other.0))) as usize
        }
        /// Rounded toward zero; for numbers in `0 .. 2^31`.
        #[inline(always)]
        pub(crate) fn trunc(self) -> Self {
            Self(sse2!(_mm_cvtepi32_ps(_mm_cvttps_epi32(self.0))))
        }
        /// The first three lanes rounded toward zero; for numbers in `0 .. 2^15`.
        #[inline(always)]
        pub(crate) fn to_indices(self) -> [usize; 3] {
            let int = sse2!(_mm_cvttps_epi32(self.0));
            let index = |bits: i32| bits as usize;
            [
                index(sse2!(_mm_extract_epi16::<0>(int))),
                index(sse2!(_mm_extract_epi16::<2>(int))),
                index(sse2!(_mm_extract_epi16::<4>(int))),
            ]
        }
        #[inline(always)]
        pub(crate) fn to_array(self) -> [f32; 4] {
            let v = self.0;
            [
                sse2!(_mm_cvtss_f32(v)),
                sse2!(_mm_cvtss_f32(_mm_shuffle_ps::<0b01_01_01_01>(v, v))),
                sse2!(_mm_cvtss_f32(_mm_shuffle_ps::<0b10_10_10_10>(v, v))),
                sse2!(_mm_cvtss_f32(_mm_shuffle_ps::<0b11_11_11_11>(v, v))),
            ]
        }
        /// From integers below `2^24`.
        #[inline(always)]
        pub(crate) fn from_counts(counts: &[u32; 4]) -> Self {
            let [x, y, z, w] = counts.map(u32::cast_signed);
            Self(sse2!(_mm_cvtepi32_ps(_mm_set_epi32(w, z, y, x))))
        }
        /// `xy + yz + zx` of three triples, as lanes.
        #[inline(always)]
        pub(crate) fn half_areas([a, b, c]: [Self; 3]) -> Self {
            let products =
                |v: Self| sse2!(_mm_mul_ps(v.0, _mm_shuffle_ps::<0b11_00_10_01>(v.0, v.0)));
            let (a, b, c) = (products(a), products(b), products(c));
            // Transpose: each lane its own triple.
            let ab = sse2!(_mm_unpacklo_ps(a, b));
            let x = sse2!(_mm_movelh_ps(ab, c));
            let y = sse2!(_mm_shuffle_ps::<0b00_01_11_10>(ab, c));
            let z = sse2!(_mm_shuffle_ps::<0b00_10_01_00>(_mm_unpackhi_ps(a, b), c));
            Self(sse2!(_mm_add_ps(_mm_add_ps(x, y), z)))
        }
    }
}

#[cfg(any(test, not(target_arch = "x86_64")))]
mod portable {
    /// Four f32: x, y, z and one more.
    #[derive(Clone, Copy, Debug)]
    #[repr(C, align(16))]
    pub(crate) struct F4([f32; 4]);

    impl F4 {
        #[inline(always)]
        fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
            let (a, b) = (self.0, other.0);
            Self([f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])])
        }
        #[inline(always)]
        pub(crate) fn new(x: f32, y: f32, z: f32, w: f32) -> Self {
            Self([x, y, z, w])
        }
        #[inline(always)]
        pub(crate) fn splat(x: f32) -> Self {
            Self([x; 4])
        }
        /// The smaller one; the second one where they do not compare.
        #[inline(always)]
        pub(crate) fn min(self, other: Self) -> Self {
            self.zip(other, |a, b| if a < b { a } else { b })
        }
        /// The larger one; the second one where they do not compare.
        #[inline(always)]
        pub(crate) fn max(self, other: Self) -> Self {
            self.zip(other, |a, b| if a > b { a } else { b })
        }
        #[inline(always)]
        pub(crate) fn add(self, other: Self) -> Self {
            self.zip(other, |a, b| a + b)
        }
        #[inline(always)]
        pub(crate) fn sub(self, other: Self) -> Self {
            self.zip(other, |a, b| a - b)
        }
        #[inline(always)]
        pub(crate) fn mul(self, other: Self) -> Self {
            self.zip(other, |a, b| a * b)
        }
        #[inline(always)]
        pub(crate) fn neg(self) -> Self {
            self.zip(self, |a, _| -a)
        }
        #[inline(always)]
        pub(crate) fn abs(self) -> Self {
            self.zip(self, |a, _| a.abs())
        }
        /// The lanes y, z, x, w.
        #[inline(always)]
        pub(crate) fn yzxw(self) -> Self {
            Self([self.0[1], self.0[2], self.0[0], self.0[3]])
        }
        /// The same with zero in the fourth lane.
        #[inline(always)]
        pub(crate) fn xyz(self) -> Self {
            Self([self.0[0], self.0[1], self.0[2], 0.0])
        }
        /// `if self < other { a } else { b }`
        #[inline(always)]
        pub(crate) fn less_pick(self, other: Self, a: Self, b: Self) -> Self {
            let pick = |i: usize| if self.0[i] < other.0[i] { a.0[i] } else { b.0[i] };
            Self([pick(0), pick(1), pick(2), pick(3)])
        }
        /// Bit i: whether lane i is less.
        #[inline(always)]
        pub(crate) fn less_bits(self, other: Self) -> usize {
            let bit = |i: usize| usize::from(self.0[i] < other.0[i]) << i;
            bit(0) | bit(1) | bit(2) | bit(3)
        }
        /// Rounded toward zero; for numbers in `0 .. 2^31`.
        #[inline(always)]
        pub(crate) fn trunc(self) -> Self {
            self.zip(self, |a, _| (a as i32) as f32)
        }
        /// The first three lanes rounded toward zero; for numbers in `0 .. 2^15`.
        #[inline(always)]
        pub(crate) fn to_indices(self) -> [usize; 3] {
            [self.0[0] as usize, self.0[1] as usize, self.0[2] as usize]
        }
        #[inline(always)]
        pub(crate) fn to_array(self) -> [f32; 4] {
            self.0
        }
        /// From integers below `2^24`.
        #[inline(always)]
        pub(crate) fn from_counts(counts: &[u32; 4]) -> Self {
            let [x, y, z, w] = *counts;
            Self([x as f32, y as f32, z as f32, w as f32])
        }
        /// `xy + yz + zx` of three triples, as lanes.
        #[inline(always)]
        pub(crate) fn half_areas([a, b, c]: [Self; 3]) -> Self {
            let area = |v: Self| v.0[0] * v.0[1] + v.0[1] * v.0[2] + v.0[2] * v.0[0];
            Self([area(a), area(b), area(c), 0.0])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::F4;
    use super::portable::F4 as Portable;
    use alloc::vec::Vec;

    /// Every operation of both kinds of lanes gives the same bits, NaN and infinities included.
    #[test]
    fn lanes_are_the_same_everywhere() {
        let odd = [0.0, -0.0, 1.5, -3.0, 7.25, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e-40];
        let at = |i: usize| odd[i % odd.len()];
        for i in 0..odd.len() * odd.len() {
            let (j, k) = (i / odd.len(), i % odd.len());
            let a = [at(j), at(j + 1), at(j + 2), at(j + 3)];
            let b = [at(k), at(k + 2), at(k + 4), at(k + 6)];
            assert_eq!(sse_or_portable(a, b), portable_only(a, b), "{a:?} {b:?}");
        }
    }

    macro_rules! answers {
        ($name:ident, $lanes:ty) => {
            fn $name(a: [f32; 4], b: [f32; 4]) -> Vec<u32> {
                let load = |[x, y, z, w]: [f32; 4]| <$lanes>::new(x, y, z, w);
                let (x, y) = (load(a), load(b));
                let whole = load(a.map(|x| if x.abs() < 100.0 { x.abs() } else { 3.5 }));
                let all = [
                    x.min(y),
                    x.max(y),
                    x.add(y),
                    x.sub(y),
                    x.mul(y),
                    x.neg(),
                    x.abs(),
                    x.yzxw(),
                    x.xyz(),
                    x.less_pick(y, x, whole),
                    whole.trunc(),
                    <$lanes>::half_areas([whole, x, y]).xyz(),
                    <$lanes>::from_counts(&[0, 1, 77, 32_768]),
                    <$lanes>::splat(2.0),
                ];
                let bits = |x: f32| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() };
                let mut out: Vec<u32> =
                    all.iter().flat_map(|lanes| lanes.to_array()).map(bits).collect();
                out.push(x.less_bits(y) as u32);
                out.extend(whole.to_indices().map(|index| index as u32));
                out
            }
        };
    }
    answers!(sse_or_portable, F4);
    answers!(portable_only, Portable);
}

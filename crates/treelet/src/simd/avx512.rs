//! AVX-512 (F, VL, BW, DQ): x86-64 server processors since 2017. Vectors of 16 f32; comparisons give
//! bits at once; `vpcompressd` moves the lanes that matter to the front.

use super::x86::four;
use super::{Doubles, Floats, Four, RayColumns, Shuffle, Simd};
use crate::math::Ray;
use core::arch::x86_64::*;
use core::mem::offset_of;

token! {
    /// Exists only where these parts of AVX-512 do.
    Avx512, "avx512f,avx512vl,avx512bw,avx512dq,bmi1,bmi2,lzcnt,popcnt"
}

impl Simd for Avx512 {
    type F4 = F4;
    type F8 = F8;
    type F16 = F16;
    type D4 = D4;

    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        // SAFETY: a hint; any address will do.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }

    const WIDE_DOUBLES: bool = true;
    const COMPRESSES: bool = true;

    #[inline(always)]
    fn compress<const W: usize>(self, mask: u32, items: &[u32; W]) -> [u32; W] {
        const { assert!(W == 8 || W == 16) }
        let mut out = [0; W];
        // SAFETY: the token shows that the processor has the instructions; `W` lanes are readable
        // and writable.
        unsafe {
            if W == 16 {
                let packed = _mm512_maskz_compress_epi32(
                    mask as __mmask16,
                    _mm512_loadu_epi32(items.as_ptr().cast()),
                );
                _mm512_storeu_epi32(out.as_mut_ptr().cast(), packed);
            } else {
                let packed = _mm256_maskz_compress_epi32(
                    mask as __mmask8,
                    _mm256_loadu_epi32(items.as_ptr().cast()),
                );
                _mm256_storeu_epi32(out.as_mut_ptr().cast(), packed);
            }
        }
        out
    }

    /// The words wanted stand at the beginning of each ray, so that half a vector loads them. Three
    /// steps of 8 shuffles: pairs, quads, then quarters.
    #[inline(always)]
    fn rays(self, rays: &[&Ray; 16]) -> RayColumns {
        const {
            assert!(offset_of!(Ray, origin) == 0 && offset_of!(Ray, t_min) == 12);
            assert!(offset_of!(Ray, direction) == 16 && offset_of!(Ray, t_max) == 28);
        }
        let mut columns = [[0.0; 16]; 8];
        // SAFETY: the token shows that the processor has the instructions; every ray has 8 words to
        // be read, as is asserted above, and every column room for 16.
        unsafe {
            let mut quads = [_mm512_setzero_ps(); 8];
            for (half, first) in [0, 8].into_iter().enumerate() {
                // Rays `first .. first + 4` below, `first + 4 .. first + 8` above.
                let mut pairs = [_mm512_setzero_ps(); 4];
                for i in [0, 1, 2, 3] {
                    let lower = _mm256_loadu_ps(core::ptr::from_ref(rays[first + i]).cast());
                    let upper = _mm256_loadu_ps(core::ptr::from_ref(rays[first + 4 + i]).cast());
                    pairs[i] = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(lower), upper);
                }
                let [a, b, c, d] = pairs;
                let ab = [_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b)];
                let cd = [_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d)];
                for odd in [0, 1] {
                    let (ab, cd) = (_mm512_castps_pd(ab[odd]), _mm512_castps_pd(cd[odd]));
                    let (lower, upper) = (_mm512_unpacklo_pd(ab, cd), _mm512_unpackhi_pd(ab, cd));
                    quads[4 * half + 2 * odd] = _mm512_castpd_ps(lower);
                    quads[4 * half + 2 * odd + 1] = _mm512_castpd_ps(upper);
                }
            }
            // Quarters 0 and 2 of `quads[k]` hold word `k` of 8 rays, quarters 1 and 3 word `4 + k`.
            for k in [0, 1, 2, 3] {
                let (a, b) = (quads[k], quads[4 + k]);
                let (even, odd) =
                    (_mm512_shuffle_f32x4::<0x88>(a, b), _mm512_shuffle_f32x4::<0xDD>(a, b));
                _mm512_storeu_ps(columns[k].as_mut_ptr(), even);
                _mm512_storeu_ps(columns[4 + k].as_mut_ptr(), odd);
            }
        }
        columns
    }

    /// Four steps of 16 shuffles: pairs, quads, then whole quarters twice.
    #[inline(always)]
    fn transpose(self, rows: &[&[f32; 16]; 16], columns: &mut [[f32; 16]; 16]) {
        // SAFETY: the token shows that the processor has the instructions; every row and
        // every column has 16 lanes.
        unsafe {
            let mut quads = [_mm512_setzero_ps(); 16];
            for first in [0, 4, 8, 12] {
                let a = _mm512_loadu_ps(rows[first].as_ptr());
                let b = _mm512_loadu_ps(rows[first + 1].as_ptr());
                let c = _mm512_loadu_ps(rows[first + 2].as_ptr());
                let d = _mm512_loadu_ps(rows[first + 3].as_ptr());
                let ab = [_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b)];
                let cd = [_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d)];
                for half in [0, 1] {
                    let (ab, cd) = (_mm512_castps_pd(ab[half]), _mm512_castps_pd(cd[half]));
                    let (lower, upper) = (_mm512_unpacklo_pd(ab, cd), _mm512_unpackhi_pd(ab, cd));
                    quads[first + 2 * half] = _mm512_castpd_ps(lower);
                    quads[first + 2 * half + 1] = _mm512_castpd_ps(upper);
                }
            }
            // A quarter `q` of `quads[4 g + k]` now holds column `4 q + k` of rows `4 g ..`.
            for k in [0, 1, 2, 3] {
                let (a, b, c, d) = (quads[k], quads[4 + k], quads[8 + k], quads[12 + k]);
                let even_ab = _mm512_shuffle_f32x4::<0x88>(a, b);
                let even_cd = _mm512_shuffle_f32x4::<0x88>(c, d);
                let odd_ab = _mm512_shuffle_f32x4::<0xDD>(a, b);
                let odd_cd = _mm512_shuffle_f32x4::<0xDD>(c, d);
                let whole = [
                    _mm512_shuffle_f32x4::<0x88>(even_ab, even_cd),
                    _mm512_shuffle_f32x4::<0x88>(odd_ab, odd_cd),
                    _mm512_shuffle_f32x4::<0xDD>(even_ab, even_cd),
                    _mm512_shuffle_f32x4::<0xDD>(odd_ab, odd_cd),
                ];
                for quarter in [0, 1, 2, 3] {
                    _mm512_storeu_ps(columns[4 * quarter + k].as_mut_ptr(), whole[quarter]);
                }
            }
        }
    }

    #[inline(always)]
    fn select(self, bits: u32, masks: &[u32; 16], items: &[u32; 16]) -> ([u32; 16], usize) {
        let mut out = [0; 16];
        // SAFETY: the token shows that the processor has the instructions; 16 lanes are readable
        // and writable.
        let chosen = unsafe {
            let bits = _mm512_set1_epi32(bits as i32);
            let chosen = _mm512_test_epi32_mask(_mm512_loadu_epi32(masks.as_ptr().cast()), bits);
            let items = _mm512_loadu_epi32(items.as_ptr().cast());
            let packed = _mm512_maskz_compress_epi32(chosen, items);
            _mm512_storeu_epi32(out.as_mut_ptr().cast(), packed);
            chosen
        };
        (out, chosen.count_ones() as usize)
    }
}

/// 4 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F4(__m128);

/// 8 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F8(__m256);

/// 16 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F16(__m512);

/// 4 x f64.
#[derive(Clone, Copy)]
pub(crate) struct D4(__m256d);

macro_rules! lanewise {
    ($($name:ident $intrinsic:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            // SAFETY: `self` exists, so a token did, so the processor has the instruction.
            Self(unsafe { $intrinsic(self.0, other.0) })
        })*
    };
}

macro_rules! compare {
    ($($name:ident $compare:ident $predicate:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> u32 {
            // SAFETY: `self` exists, so a token did, so the processor has the instruction.
            u32::from(unsafe { $compare::<$predicate>(self.0, other.0) })
        })*
    };
}

macro_rules! memory {
    ($lanes:literal $splat:ident $load:ident $store:ident) => {
        type Token = Avx512;

        #[inline(always)]
        fn splat(_: Avx512, x: f32) -> Self {
            // SAFETY: the token shows that the processor has the instruction.
            Self(unsafe { $splat(x) })
        }

        #[inline(always)]
        fn load(_: Avx512, lanes: &[f32; $lanes]) -> Self {
            // SAFETY: the token shows that the processor has the instruction; all lanes are
            // readable.
            Self(unsafe { $load(lanes.as_ptr()) })
        }

        #[inline(always)]
        fn lanes(self) -> [f32; $lanes] {
            let mut lanes = [0.0; $lanes];
            // SAFETY: the processor has the instruction; all lanes are writable.
            unsafe { $store(lanes.as_mut_ptr(), self.0) };
            lanes
        }
    };
}

impl Floats<4> for F4 {
    memory! { 4 _mm_set1_ps _mm_loadu_ps _mm_storeu_ps }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instruction.
        Self(unsafe { _mm_mask_min_ps(other.0, bits as __mmask8, self.0, other.0) })
    }

    lanewise! { add _mm_add_ps sub _mm_sub_ps mul _mm_mul_ps div _mm_div_ps min _mm_min_ps max _mm_max_ps }
    compare! { le _mm_cmp_ps_mask _CMP_LE_OQ lt _mm_cmp_ps_mask _CMP_LT_OQ }

    #[inline(always)]
    fn or_halves(self, halves: &[u16; 4]) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instructions; 8 bytes are
        // readable.
        Self(unsafe {
            let words = _mm_cvtepu16_epi32(_mm_loadu_si64(halves.as_ptr().cast()));
            _mm_or_ps(self.0, _mm_castsi128_ps(words))
        })
    }
}

four! {}

impl Floats<8> for F8 {
    memory! { 8 _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instruction.
        Self(unsafe { _mm256_mask_min_ps(other.0, bits as __mmask8, self.0, other.0) })
    }

    lanewise! {
        add _mm256_add_ps sub _mm256_sub_ps mul _mm256_mul_ps div _mm256_div_ps
        min _mm256_min_ps max _mm256_max_ps
    }
    compare! { le _mm256_cmp_ps_mask _CMP_LE_OQ lt _mm256_cmp_ps_mask _CMP_LT_OQ }

    #[inline(always)]
    fn or_halves(self, halves: &[u16; 8]) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instructions; 16 bytes are
        // readable.
        Self(unsafe {
            let words = _mm256_cvtepu16_epi32(_mm_loadu_si128(halves.as_ptr().cast()));
            _mm256_or_ps(self.0, _mm256_castsi256_ps(words))
        })
    }
}

impl Floats<16> for F16 {
    memory! { 16 _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instruction.
        Self(unsafe { _mm512_mask_min_ps(other.0, bits as __mmask16, self.0, other.0) })
    }

    lanewise! {
        add _mm512_add_ps sub _mm512_sub_ps mul _mm512_mul_ps div _mm512_div_ps
        min _mm512_min_ps max _mm512_max_ps
    }
    compare! { le _mm512_cmp_ps_mask _CMP_LE_OQ lt _mm512_cmp_ps_mask _CMP_LT_OQ }

    #[inline(always)]
    fn or_halves(self, halves: &[u16; 16]) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instructions; 32 bytes are
        // readable.
        Self(unsafe {
            let words = _mm512_cvtepu16_epi32(_mm256_loadu_si256(halves.as_ptr().cast()));
            _mm512_or_ps(self.0, _mm512_castsi512_ps(words))
        })
    }
}

impl Doubles for D4 {
    type Token = Avx512;
    type Narrow = F4;

    #[inline(always)]
    fn splat(_: Avx512, x: f64) -> Self {
        // SAFETY: the token shows that the processor has the instruction.
        Self(unsafe { _mm256_set1_pd(x) })
    }

    #[inline(always)]
    fn widen(narrow: F4) -> Self {
        // SAFETY: `narrow` exists, so a token did, so the processor has the instruction.
        Self(unsafe { _mm256_cvtps_pd(narrow.0) })
    }

    #[inline(always)]
    fn narrow(self) -> F4 {
        // SAFETY: `self` exists, so a token did, so the processor has the instruction.
        F4(unsafe { _mm256_cvtpd_ps(self.0) })
    }

    lanewise! {
        add _mm256_add_pd sub _mm256_sub_pd mul _mm256_mul_pd div _mm256_div_pd
        min _mm256_min_pd max _mm256_max_pd
    }
    compare! { lt _mm256_cmp_pd_mask _CMP_LT_OQ }
}

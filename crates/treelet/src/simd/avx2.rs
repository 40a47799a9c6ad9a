//! AVX2: x86-64 processors since 2013. Vectors of 8 f32 or 4 f64.
//!
//! FMA is not enabled: nothing here may fuse, and the compiler never fuses by itself.

use super::two::Two;
use super::x86::four;
use super::{Doubles, Floats, Four, Shuffle, Simd};
use core::arch::x86_64::*;

token! {
    /// Exists only where AVX2 does.
    Avx2, "avx2,bmi1,bmi2,lzcnt,popcnt"
}

impl Simd for Avx2 {
    type F4 = F4;
    type F8 = F8;
    type F16 = Two<F8>;
    type D4 = D4;

    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        // SAFETY: a hint; any address will do.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }

    const WIDE_DOUBLES: bool = true;
}

/// 4 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F4(__m128);

/// 8 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F8(__m256);

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
    ($($name:ident $compare:ident $predicate:ident $movemask:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> u32 {
            // SAFETY: `self` exists, so a token did, so the processor has the instruction.
            unsafe { $movemask($compare::<$predicate>(self.0, other.0)) as u32 }
        })*
    };
}

macro_rules! memory {
    ($lanes:literal $token:ident $splat:ident $load:ident $store:ident) => {
        type Token = $token;

        #[inline(always)]
        fn splat(_: $token, x: f32) -> Self {
            // SAFETY: the token shows that the processor has the instruction.
            Self(unsafe { $splat(x) })
        }

        #[inline(always)]
        fn load(_: $token, lanes: &[f32; $lanes]) -> Self {
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
    memory! { 4 Avx2 _mm_set1_ps _mm_loadu_ps _mm_storeu_ps }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instructions.
        Self(unsafe {
            let lanes = _mm_setr_epi32(1, 2, 4, 8);
            let chosen = _mm_and_si128(_mm_set1_epi32(bits as i32), lanes);
            let chosen = _mm_castsi128_ps(_mm_cmpeq_epi32(chosen, lanes));
            _mm_blendv_ps(other.0, _mm_min_ps(self.0, other.0), chosen)
        })
    }

    lanewise! { add _mm_add_ps sub _mm_sub_ps mul _mm_mul_ps div _mm_div_ps min _mm_min_ps max _mm_max_ps }
    compare! {
        le _mm_cmp_ps _CMP_LE_OQ _mm_movemask_ps
        lt _mm_cmp_ps _CMP_LT_OQ _mm_movemask_ps
    }

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
    memory! { 8 Avx2 _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instructions.
        Self(unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let chosen = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            let chosen = _mm256_castsi256_ps(_mm256_cmpeq_epi32(chosen, lanes));
            _mm256_blendv_ps(other.0, _mm256_min_ps(self.0, other.0), chosen)
        })
    }

    lanewise! {
        add _mm256_add_ps sub _mm256_sub_ps mul _mm256_mul_ps div _mm256_div_ps
        min _mm256_min_ps max _mm256_max_ps
    }
    compare! {
        le _mm256_cmp_ps _CMP_LE_OQ _mm256_movemask_ps
        lt _mm256_cmp_ps _CMP_LT_OQ _mm256_movemask_ps
    }

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

impl Doubles for D4 {
    type Token = Avx2;
    type Narrow = F4;

    #[inline(always)]
    fn splat(_: Avx2, x: f64) -> Self {
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
    compare! { lt _mm256_cmp_pd _CMP_LT_OQ _mm256_movemask_pd }
}

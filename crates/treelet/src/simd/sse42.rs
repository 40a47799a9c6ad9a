//! SSE4.2: x86-64 processors since 2009. Vectors of 4 f32 or 2 f64.

use super::two::{Two, TwoDoubles};
use super::x86::four;
use super::{Floats, Four, Shuffle, Simd};
use core::arch::x86_64::*;

token! {
    /// Exists only where SSE4.2 does.
    Sse42, "sse4.2,popcnt"
}

impl Simd for Sse42 {
    type F4 = F4;
    type F8 = Two<F4>;
    type F16 = Two<Two<F4>>;
    type D4 = Two<D2>;

    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        // SAFETY: a hint; any address will do.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }

    const WIDE_DOUBLES: bool = false;
}

/// 4 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F4(__m128);

/// 2 x f64.
#[derive(Clone, Copy)]
pub(crate) struct D2(__m128d);

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
    ($($name:ident $compare:ident $movemask:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> u32 {
            // SAFETY: `self` exists, so a token did, so the processor has the instruction.
            unsafe { $movemask($compare(self.0, other.0)) as u32 }
        })*
    };
}

impl Floats<4> for F4 {
    type Token = Sse42;

    #[inline(always)]
    fn splat(_: Sse42, x: f32) -> Self {
        // SAFETY: the token shows that the processor has the instruction.
        Self(unsafe { _mm_set1_ps(x) })
    }

    #[inline(always)]
    fn load(_: Sse42, lanes: &[f32; 4]) -> Self {
        // SAFETY: the token shows that the processor has the instruction; 16 bytes are readable.
        Self(unsafe { _mm_loadu_ps(lanes.as_ptr()) })
    }

    #[inline(always)]
    fn lanes(self) -> [f32; 4] {
        let mut lanes = [0.0; 4];
        // SAFETY: the processor has the instruction; 16 bytes are writable.
        unsafe { _mm_storeu_ps(lanes.as_mut_ptr(), self.0) };
        lanes
    }

    lanewise! { add _mm_add_ps sub _mm_sub_ps mul _mm_mul_ps div _mm_div_ps min _mm_min_ps max _mm_max_ps }

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

    compare! { le _mm_cmple_ps _mm_movemask_ps lt _mm_cmplt_ps _mm_movemask_ps }

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

impl TwoDoubles for D2 {
    type Token = Sse42;
    type Narrow = F4;

    #[inline(always)]
    fn splat(_: Sse42, x: f64) -> Self {
        // SAFETY: the token shows that the processor has the instruction.
        Self(unsafe { _mm_set1_pd(x) })
    }

    #[inline(always)]
    fn widen(narrow: F4) -> [Self; 2] {
        // SAFETY: `narrow` exists, so a token did, so the processor has the instructions.
        unsafe {
            let upper = _mm_movehl_ps(narrow.0, narrow.0);
            [Self(_mm_cvtps_pd(narrow.0)), Self(_mm_cvtps_pd(upper))]
        }
    }

    #[inline(always)]
    fn narrow([lower, upper]: [Self; 2]) -> F4 {
        // SAFETY: vectors exist, so a token did, so the processor has the instructions.
        F4(unsafe { _mm_movelh_ps(_mm_cvtpd_ps(lower.0), _mm_cvtpd_ps(upper.0)) })
    }

    lanewise! {
        add _mm_add_pd sub _mm_sub_pd mul _mm_mul_pd div _mm_div_pd
        min _mm_min_pd max _mm_max_pd
    }
    compare! { lt _mm_cmplt_pd _mm_movemask_pd }
}

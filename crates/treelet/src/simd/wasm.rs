//! WebAssembly's `simd128`. Vectors of 4 f32 or 2 f64.
//!
//! An engine without these instructions refuses a module that has them anywhere, so nothing can be
//! asked at run time: the level is there where the program is compiled with
//! `-C target-feature=+simd128`, and then its instructions are safe to call.
//!
//! `pmin(a, b)` is `b < a ? b : a` and `pmax(a, b)` is `a < b ? b : a`: ours with the operands
//! exchanged. The relaxed instructions, which may fuse or pick another minimum, are not used.

use super::two::{Two, TwoDoubles};
use super::{Floats, Four, Shuffle, Simd};
use core::arch::wasm32::*;

token! {
    /// Exists only where `simd128` does.
    Simd128
}

impl Simd for Simd128 {
    type F4 = F4;
    type F8 = Two<F4>;
    type F16 = Two<Two<F4>>;
    type D4 = Two<D2>;

    /// There is no such instruction.
    const WIDE_DOUBLES: bool = false;
}

/// 4 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F4(v128);

/// 2 x f64.
#[derive(Clone, Copy)]
pub(crate) struct D2(v128);

macro_rules! lanewise {
    ($($name:ident $intrinsic:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            Self($intrinsic(self.0, other.0))
        })*
    };
}

macro_rules! exchanged {
    ($($name:ident $intrinsic:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            Self($intrinsic(other.0, self.0))
        })*
    };
}

macro_rules! compare {
    ($($name:ident $compare:ident $bits:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> u32 {
            u32::from($bits($compare(self.0, other.0)))
        })*
    };
}

impl Floats<4> for F4 {
    type Token = Simd128;

    #[inline(always)]
    fn splat(_: Simd128, x: f32) -> Self {
        Self(f32x4_splat(x))
    }

    #[inline(always)]
    fn load(_: Simd128, lanes: &[f32; 4]) -> Self {
        // SAFETY: 16 bytes are readable; they need not be aligned.
        Self(unsafe { v128_load(lanes.as_ptr().cast()) })
    }

    #[inline(always)]
    fn lanes(self) -> [f32; 4] {
        let mut lanes = [0.0_f32; 4];
        // SAFETY: 16 bytes are writable; they need not be aligned.
        unsafe { v128_store(lanes.as_mut_ptr().cast(), self.0) };
        lanes
    }

    lanewise! { add f32x4_add sub f32x4_sub mul f32x4_mul div f32x4_div }
    exchanged! { min f32x4_pmin max f32x4_pmax }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        let own = u32x4(1, 2, 4, 8);
        let chosen = u32x4_ne(v128_and(u32x4_splat(bits), own), u32x4_splat(0));
        Self(v128_bitselect(self.min(other).0, other.0, chosen))
    }

    compare! { le f32x4_le i32x4_bitmask lt f32x4_lt i32x4_bitmask }

    #[inline(always)]
    fn or_halves(self, halves: &[u16; 4]) -> Self {
        // SAFETY: 8 bytes are readable; they need not be aligned.
        let words = unsafe { u32x4_load_extend_u16x4(halves.as_ptr()) };
        Self(v128_or(self.0, words))
    }
}

impl Four for F4 {
    #[inline(always)]
    fn xyzz(self) -> Self {
        Self(i32x4_shuffle::<0, 1, 2, 2>(self.0, self.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(f32x4_abs(self.0))
    }

    #[inline(always)]
    fn yzxx(self) -> Self {
        Self(i32x4_shuffle::<1, 2, 0, 0>(self.0, self.0))
    }

    #[inline(always)]
    fn reordered(self, order: &Shuffle) -> Self {
        // SAFETY: 16 bytes are readable; they need not be aligned.
        let order = unsafe { v128_load(order.as_ptr().cast()) };
        Self(u8x16_swizzle(self.0, order))
    }

    #[inline(always)]
    fn max_lane(self) -> Self {
        let pairs = self.max(Self(i32x4_shuffle::<2, 3, 0, 1>(self.0, self.0)));
        pairs.max(Self(i32x4_shuffle::<1, 0, 3, 2>(pairs.0, pairs.0)))
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        u32::from(i32x4_bitmask(self.0))
    }

    /// The instruction takes every byte from beyond the table as zero.
    #[inline(always)]
    fn add_bytes(self, bytes: &[u8; 16], shuffle: &Shuffle) -> Self {
        // SAFETY: 16 bytes are readable twice; they need not be aligned.
        let (bytes, shuffle) =
            unsafe { (v128_load(bytes.as_ptr().cast()), v128_load(shuffle.as_ptr().cast())) };
        Self(i32x4_add(self.0, u8x16_swizzle(bytes, shuffle)))
    }

    #[inline(always)]
    fn columns([a, b, c, d]: [Self; 4]) -> [Self; 3] {
        let (ab, cd) =
            (i32x4_shuffle::<0, 4, 1, 5>(a.0, b.0), i32x4_shuffle::<0, 4, 1, 5>(c.0, d.0));
        let (ab_z, cd_z) =
            (i32x4_shuffle::<2, 6, 2, 6>(a.0, b.0), i32x4_shuffle::<2, 6, 2, 6>(c.0, d.0));
        [
            Self(i32x4_shuffle::<0, 1, 4, 5>(ab, cd)),
            Self(i32x4_shuffle::<2, 3, 6, 7>(ab, cd)),
            Self(i32x4_shuffle::<0, 1, 4, 5>(ab_z, cd_z)),
        ]
    }
}

impl TwoDoubles for D2 {
    type Token = Simd128;
    type Narrow = F4;

    #[inline(always)]
    fn splat(_: Simd128, x: f64) -> Self {
        Self(f64x2_splat(x))
    }

    #[inline(always)]
    fn widen(narrow: F4) -> [Self; 2] {
        let upper = i32x4_shuffle::<2, 3, 2, 3>(narrow.0, narrow.0);
        [Self(f64x2_promote_low_f32x4(narrow.0)), Self(f64x2_promote_low_f32x4(upper))]
    }

    #[inline(always)]
    fn narrow([lower, upper]: [Self; 2]) -> F4 {
        let [lower, upper] = [f32x4_demote_f64x2_zero(lower.0), f32x4_demote_f64x2_zero(upper.0)];
        F4(i32x4_shuffle::<0, 1, 4, 5>(lower, upper))
    }

    lanewise! { add f64x2_add sub f64x2_sub mul f64x2_mul div f64x2_div }
    exchanged! { min f64x2_pmin max f64x2_pmax }
    compare! { lt f64x2_lt i64x2_bitmask }
}

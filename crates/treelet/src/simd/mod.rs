//! The wall: vectors of floats at every instruction set, behind traits that kernels are generic in.
//!
//! A kernel is written once, over `Simd`, and compiled once a level: `Checked::run` enters a
//! function that is compiled for the level's instructions, and everything that is inlined into it is
//! too. So kernels and all they call are `#[inline(always)]`.
//!
//! Safety: a level's token (`Simd` implementations) exists only inside that function, and no
//! vector is made without a token; so whoever holds a vector may use the instructions it needs.
//!
//! Exactness: every operation below is one correctly rounded IEEE operation a lane, or a comparison;
//! nothing fuses, nothing approximates. Minimum and maximum are written out as comparisons, so that
//! NaN and signed zeros come out alike at every level. Kernels therefore give the same bits at all
//! of them.

#![allow(unsafe_code, reason = "the wall: vendor intrinsics")]

/// A level's token, and how the level is entered: by functions that are compiled for its features.
macro_rules! token {
    ($(#[$doc:meta])* $name:ident $(, $features:literal)?) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $name(());

        impl $name {
            /// # Safety
            ///
            /// The processor has the level's instructions.
            #[inline(always)]
            pub(super) unsafe fn assume() -> Self {
                Self(())
            }
        }

        impl crate::simd::Enter for $name {
            #[inline(always)]
            fn call<K: crate::simd::Kernel>(self, kernel: K) -> K::Output {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                fn call<K: crate::simd::Kernel>(kernel: K) -> K::Output {
                    kernel.run($name(()))
                }
                token!(@ $($features)? => call(kernel))
            }

            #[inline(always)]
            fn apply<F: crate::simd::Function>(
                self,
                a: F::A,
                b: F::B,
                c: F::C,
                d: F::D,
            ) -> F::Output {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                fn apply<F: crate::simd::Function>(
                    a: F::A,
                    b: F::B,
                    c: F::C,
                    d: F::D,
                ) -> F::Output {
                    F::run($name(()), a, b, c, d)
                }
                token!(@ $($features)? => apply::<F>(a, b, c, d))
            }
        }
    };
    (@ => $call:expr) => {
        $call
    };
    (@ $features:literal => $call:expr) => {
        // SAFETY: the token shows that the processor has the instructions.
        unsafe { $call }
    };
}

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
pub(crate) mod f4;
mod level;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
mod neon;
mod scalar;
#[cfg(target_arch = "x86_64")]
mod sse42;
mod two;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

use crate::math::Ray;
pub use level::Level;
pub(crate) use level::{Checked, Kernel};
pub(crate) use scalar::Scalar;

/// `N` lanes of f32.
pub(crate) trait Floats<const N: usize>: Copy {
    /// What shows that the instructions may be used.
    type Token: Copy;

    /// `x` in every lane.
    fn splat(token: Self::Token, x: f32) -> Self;
    /// The lanes in order.
    fn load(token: Self::Token, lanes: &[f32; N]) -> Self;
    /// The lanes in order.
    fn lanes(self) -> [f32; N];

    /// Sums.
    fn add(self, other: Self) -> Self;
    /// Differences.
    fn sub(self, other: Self) -> Self;
    /// Products.
    fn mul(self, other: Self) -> Self;
    /// Quotients.
    fn div(self, other: Self) -> Self;
    /// `self < other ? self : other`.
    fn min(self, other: Self) -> Self;
    /// `self > other ? self : other`.
    fn max(self, other: Self) -> Self;

    /// [`Floats::min`] in the lanes whose bits are set, `other` in the others.
    fn min_where(self, bits: u32, other: Self) -> Self;

    /// Bit `i` is set where `self <= other` in lane `i`; not for NaN.
    fn le(self, other: Self) -> u32;
    /// Bit `i` is set where `self < other` in lane `i`; not for NaN.
    fn lt(self, other: Self) -> u32;

    /// The bits of each lane, or those of a half word.
    fn or_halves(self, halves: &[u16; N]) -> Self;
}

/// What [`Simd::rays`] gives.
pub(crate) type RayColumns = [[f32; 16]; 8];

/// Which of 16 bytes become the bytes of four lanes; [`NO_BYTE`] for zero.
pub(crate) type Shuffle = [u8; 16];

/// See [`Shuffle`].
pub(crate) const NO_BYTE: u8 = 0x80;

/// What is done with four lanes only: where a ray's coordinates are.
pub(crate) trait Four: Floats<4> {
    /// The first three lanes, the third of them twice: no stray value in a lane that nobody reads.
    fn xyzz(self) -> Self;
    /// Absolute values.
    fn abs(self) -> Self;
    /// The lanes y, z, x, x.
    fn yzxx(self) -> Self;
    /// Lanes in another order, each perhaps more than once: whole lanes are moved.
    fn reordered(self, order: &Shuffle) -> Self;
    /// The largest lane, in every lane; none may be NaN.
    fn max_lane(self) -> Self;
    /// Bit `i` is the sign of lane `i`.
    fn signs(self) -> u32;
    /// The bits of each lane plus those of four lanes shuffled together from `bytes`, modulo 2^32.
    fn add_bytes(self, bytes: &[u8; 16], shuffle: &Shuffle) -> Self;
    /// The first three columns of four rows.
    fn columns(rows: [Self; 4]) -> [Self; 3];
}

/// Four lanes of f64.
pub(crate) trait Doubles: Copy {
    /// What shows that the instructions may be used.
    type Token: Copy;
    /// As many lanes of f32.
    type Narrow: Floats<4, Token = Self::Token>;

    /// `x` in every lane.
    fn splat(token: Self::Token, x: f64) -> Self;
    /// Exact.
    fn widen(narrow: Self::Narrow) -> Self;
    /// Rounded to the nearest f32, ties to even.
    fn narrow(self) -> Self::Narrow;

    /// Sums.
    fn add(self, other: Self) -> Self;
    /// Differences.
    fn sub(self, other: Self) -> Self;
    /// Products.
    fn mul(self, other: Self) -> Self;
    /// Quotients.
    fn div(self, other: Self) -> Self;
    /// `self < other ? self : other`.
    fn min(self, other: Self) -> Self;
    /// `self > other ? self : other`.
    fn max(self, other: Self) -> Self;

    /// Bit `i` is set where `self < other` in lane `i`; not for NaN.
    fn lt(self, other: Self) -> u32;
}

/// A function that is generic in the instruction set: see [`Enter::apply`]. Each argument should be at
/// most two words.
pub(crate) trait Function {
    type A;
    type B;
    type C;
    type D;
    type Output;

    /// Does the work. To be `#[inline(always)]`.
    fn run<S: Simd>(simd: S, a: Self::A, b: Self::B, c: Self::C, d: Self::D) -> Self::Output;
}

/// How code of a level is entered.
pub(crate) trait Enter: Copy {
    /// Runs a kernel in a function of its own: what is rarer than its caller's loop, and would cost
    /// that loop its registers.
    fn call<K: Kernel>(self, kernel: K) -> K::Output;

    /// Calls a function of its own with arguments in registers: for what is called so often that a
    /// kernel handed over in memory would be waited for. (A kernel's fields are stored one by one
    /// and loaded in pairs, which processors do not forward: 6 of the 17 ns of a ray that meets
    /// nothing.)
    fn apply<F: Function>(self, a: F::A, b: F::B, c: F::C, d: F::D) -> F::Output;
}

/// An instruction set, as a token that shows that this processor has it.
pub(crate) trait Simd: Enter {
    /// 4 lanes of f32.
    type F4: Four<Token = Self>;
    /// 8 lanes of f32.
    type F8: Floats<8, Token = Self>;
    /// 16 lanes of f32.
    type F16: Floats<16, Token = Self>;
    /// 4 lanes of f64.
    type D4: Doubles<Token = Self, Narrow = Self::F4>;

    /// Whether four f64 are one vector.
    const WIDE_DOUBLES: bool;

    /// Asks for the cache line of `address`, which need not be valid.
    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        let _ = address;
    }

    /// Whether `compress` is an instruction.
    const COMPRESSES: bool = false;

    /// The items whose bits are set in `mask`, in order, then others.
    #[inline(always)]
    fn compress<const W: usize>(self, mask: u32, items: &[u32; W]) -> [u32; W] {
        compress_by_bits(mask, items)
    }

    /// Of 16 rays, a ray a lane: origins, `t_min`, directions, `t_max`.
    #[inline(always)]
    fn rays(self, rays: &[&Ray; 16]) -> RayColumns {
        let mut columns = [[0.0; 16]; 8];
        for (lane, &&Ray { origin, t_min, direction, t_max, .. }) in rays.iter().enumerate() {
            let ([a, b, c], [x, y, z]) = (origin, direction);
            for (column, word) in columns.iter_mut().zip([a, b, c, t_min, x, y, z, t_max]) {
                column[lane] = word;
            }
        }
        columns
    }

    /// The columns of 16 rows.
    #[inline(always)]
    fn transpose(self, rows: &[&[f32; 16]; 16], columns: &mut [[f32; 16]; 16]) {
        for (row, lanes) in rows.iter().enumerate() {
            for (column, lane) in columns.iter_mut().zip(lanes.iter()) {
                column[row] = *lane;
            }
        }
    }

    /// The items whose mask shares a bit with `bits`, in order, then others; and how many.
    #[inline(always)]
    fn select(self, bits: u32, masks: &[u32; 16], items: &[u32; 16]) -> ([u32; 16], usize) {
        let (mut out, mut len) = ([0; 16], 0);
        for i in 0..16 {
            out[len % 16] = items[i];
            len += usize::from(masks[i] & bits != 0);
        }
        (out, len)
    }
}

/// The vector of `W` lanes of a level: what makes a kernel generic in its width.
pub(crate) trait Wide<const W: usize>: Simd {
    /// `W` lanes of f32.
    type F: Floats<W, Token = Self>;
}

impl<S: Simd> Wide<8> for S {
    type F = S::F8;
}

impl<S: Simd> Wide<16> for S {
    type F = S::F16;
}

/// [`Simd::compress`] without instructions for it.
#[inline(always)]
fn compress_by_bits<const W: usize>(mut mask: u32, items: &[u32; W]) -> [u32; W] {
    let mut out = [0; W];
    for place in &mut out {
        if mask == 0 {
            break;
        }
        *place = items[mask.trailing_zeros() as usize % W];
        mask &= mask - 1;
    }
    out
}

#[cfg(test)]
mod tests;

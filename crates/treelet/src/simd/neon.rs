//! NEON: every 64-bit ARM processor with floating point. Vectors of 4 f32 or 2 f64.
//!
//! `FMIN` and `FMAX` return NaN for one NaN and order the zeros, so minimum and maximum are a
//! comparison and a selection; nothing fuses (`FMLA`). There is no instruction that gathers sign
//! bits: lanes are masked to a bit of their own each and summed.

use super::two::{Two, TwoDoubles};
use super::{Floats, Four, Shuffle, Simd};
use core::arch::aarch64::*;

token! {
    /// Exists only where NEON does.
    Neon, "neon"
}

impl Simd for Neon {
    type F4 = F4;
    type F8 = Two<F4>;
    type F16 = Two<Two<F4>>;
    type D4 = Two<D2>;

    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        // SAFETY: a hint, which faults for no address and changes nothing that can be read.
        unsafe {
            core::arch::asm!(
                "prfm pldl1keep, [{address}]",
                address = in(reg) address,
                options(readonly, nostack, preserves_flags)
            );
        }
    }

    const WIDE_DOUBLES: bool = false;
}

/// 4 x f32.
#[derive(Clone, Copy)]
pub(crate) struct F4(float32x4_t);

/// 2 x f64.
#[derive(Clone, Copy)]
pub(crate) struct D2(float64x2_t);

macro_rules! lanewise {
    ($($name:ident $intrinsic:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            // SAFETY: `self` exists, so a token did, so the processor has the instruction.
            Self(unsafe { $intrinsic(self.0, other.0) })
        })*
    };
}

macro_rules! select {
    ($($name:ident $compare:ident $select:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            // SAFETY: `self` exists, so a token did, so the processor has the instructions.
            Self(unsafe { $select($compare(self.0, other.0), self.0, other.0) })
        })*
    };
}

macro_rules! compare {
    ($($name:ident $compare:ident $bits:ident)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> u32 {
            // SAFETY: `self` exists, so a token did, so the processor has the instructions.
            unsafe { $bits($compare(self.0, other.0)) }
        })*
    };
}

/// The bit that stands for each of four lanes.
const OWN: [u32; 4] = [1, 2, 4, 8];

/// Bit `i` of the result is bit `i` of lane `i`.
///
/// # Safety
///
/// The processor has NEON.
#[inline(always)]
unsafe fn bits_4(lanes: uint32x4_t) -> u32 {
    // SAFETY: as the caller promises; 16 bytes are readable.
    unsafe { vaddvq_u32(vandq_u32(lanes, vld1q_u32(OWN.as_ptr()))) }
}

/// The same for two lanes.
///
/// # Safety
///
/// The processor has NEON.
#[inline(always)]
unsafe fn bits_2(lanes: uint64x2_t) -> u32 {
    const OWN_2: [u64; 2] = [1, 2];
    // SAFETY: as the caller promises; 16 bytes are readable.
    unsafe { vaddvq_u64(vandq_u64(lanes, vld1q_u64(OWN_2.as_ptr()))) as u32 }
}

impl Floats<4> for F4 {
    type Token = Neon;

    #[inline(always)]
    fn splat(_: Neon, x: f32) -> Self {
        // SAFETY: the token shows that the processor has the instruction.
        Self(unsafe { vdupq_n_f32(x) })
    }

    #[inline(always)]
    fn load(_: Neon, lanes: &[f32; 4]) -> Self {
        // SAFETY: the token shows that the processor has the instruction; 16 bytes are readable.
        Self(unsafe { vld1q_f32(lanes.as_ptr()) })
    }

    #[inline(always)]
    fn lanes(self) -> [f32; 4] {
        let mut lanes = [0.0; 4];
        // SAFETY: the processor has the instruction; 16 bytes are writable.
        unsafe { vst1q_f32(lanes.as_mut_ptr(), self.0) };
        lanes
    }

    lanewise! { add vaddq_f32 sub vsubq_f32 mul vmulq_f32 div vdivq_f32 }
    select! { min vcltq_f32 vbslq_f32 max vcgtq_f32 vbslq_f32 }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        let smaller = self.min(other);
        // SAFETY: `self` exists, so a token did, so the processor has the instructions; 16 bytes
        // are readable.
        Self(unsafe {
            let chosen = vtstq_u32(vdupq_n_u32(bits), vld1q_u32(OWN.as_ptr()));
            vbslq_f32(chosen, smaller.0, other.0)
        })
    }

    compare! { le vcleq_f32 bits_4 lt vcltq_f32 bits_4 }

    #[inline(always)]
    fn or_halves(self, halves: &[u16; 4]) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instructions; 8 bytes are
        // readable.
        Self(unsafe {
            let words = vmovl_u16(vld1_u16(halves.as_ptr()));
            vreinterpretq_f32_u32(vorrq_u32(vreinterpretq_u32_f32(self.0), words))
        })
    }
}

impl Four for F4 {
    #[inline(always)]
    fn xyzz(self) -> Self {
        // SAFETY: `self` exists, so a token did, so the processor has the instruction.
        Self(unsafe { vcopyq_laneq_f32::<3, 2>(self.0, self.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: as above.
        Self(unsafe { vabsq_f32(self.0) })
    }

    #[inline(always)]
    fn yzxx(self) -> Self {
        // SAFETY: as above.
        Self(unsafe {
            let yzwx = vextq_f32::<1>(self.0, self.0);
            vcopyq_laneq_f32::<2, 3>(yzwx, yzwx)
        })
    }

    #[inline(always)]
    fn reordered(self, order: &Shuffle) -> Self {
        // SAFETY: as above; 16 bytes are readable.
        Self(unsafe {
            let bytes = vqtbl1q_u8(vreinterpretq_u8_f32(self.0), vld1q_u8(order.as_ptr()));
            vreinterpretq_f32_u8(bytes)
        })
    }

    #[inline(always)]
    fn max_lane(self) -> Self {
        // SAFETY: as above.
        let halves_swapped = Self(unsafe { vextq_f32::<2>(self.0, self.0) });
        let pairs = self.max(halves_swapped);
        // SAFETY: as above.
        pairs.max(Self(unsafe { vrev64q_f32(pairs.0) }))
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        // SAFETY: as above.
        unsafe { bits_4(vcltzq_s32(vreinterpretq_s32_f32(self.0))) }
    }

    /// The instruction takes every byte from beyond the table as zero.
    #[inline(always)]
    fn add_bytes(self, bytes: &[u8; 16], shuffle: &Shuffle) -> Self {
        // SAFETY: as above; 16 bytes are readable twice.
        Self(unsafe {
            let addend = vqtbl1q_u8(vld1q_u8(bytes.as_ptr()), vld1q_u8(shuffle.as_ptr()));
            let sum = vaddq_u32(vreinterpretq_u32_f32(self.0), vreinterpretq_u32_u8(addend));
            vreinterpretq_f32_u32(sum)
        })
    }

    #[inline(always)]
    fn columns([a, b, c, d]: [Self; 4]) -> [Self; 3] {
        // SAFETY: as above.
        unsafe {
            let (ac, bd) = (vzip1q_f32(a.0, c.0), vzip1q_f32(b.0, d.0));
            let (ac_z, bd_z) = (vzip2q_f32(a.0, c.0), vzip2q_f32(b.0, d.0));
            [Self(vzip1q_f32(ac, bd)), Self(vzip2q_f32(ac, bd)), Self(vzip1q_f32(ac_z, bd_z))]
        }
    }
}

impl TwoDoubles for D2 {
    type Token = Neon;
    type Narrow = F4;

    #[inline(always)]
    fn splat(_: Neon, x: f64) -> Self {
        // SAFETY: the token shows that the processor has the instruction.
        Self(unsafe { vdupq_n_f64(x) })
    }

    #[inline(always)]
    fn widen(narrow: F4) -> [Self; 2] {
        // SAFETY: `narrow` exists, so a token did, so the processor has the instructions.
        unsafe { [Self(vcvt_f64_f32(vget_low_f32(narrow.0))), Self(vcvt_high_f64_f32(narrow.0))] }
    }

    #[inline(always)]
    fn narrow([lower, upper]: [Self; 2]) -> F4 {
        // SAFETY: vectors exist, so a token did, so the processor has the instructions.
        F4(unsafe { vcvt_high_f32_f64(vcvt_f32_f64(lower.0), upper.0) })
    }

    lanewise! { add vaddq_f64 sub vsubq_f64 mul vmulq_f64 div vdivq_f64 }
    select! { min vcltq_f64 vbslq_f64 max vcgtq_f64 vbslq_f64 }
    compare! { lt vcltq_f64 bits_2 }
}

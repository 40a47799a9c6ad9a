//! Every processor: arrays, one lane after the other. What the other levels are held against.

use super::two::Two;
use super::{Doubles, Enter, Floats, Four, Function, Kernel, NO_BYTE, Shuffle, Simd};

/// Needs nothing.
#[derive(Clone, Copy)]
pub(crate) struct Scalar;

impl Enter for Scalar {
    #[inline(never)]
    fn call<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }

    #[inline(never)]
    fn apply<F: Function>(self, a: F::A, b: F::B, c: F::C, d: F::D) -> F::Output {
        F::run(self, a, b, c, d)
    }
}

impl Simd for Scalar {
    type F4 = Lanes;
    type F8 = Two<Lanes>;
    type F16 = Two<Two<Lanes>>;
    type D4 = DoubleLanes;

    const WIDE_DOUBLES: bool = false;
}

/// 4 x f32.
#[derive(Clone, Copy)]
pub(crate) struct Lanes([f32; 4]);

/// 4 x f64.
#[derive(Clone, Copy)]
pub(crate) struct DoubleLanes([f64; 4]);

macro_rules! lanewise {
    ($($name:ident: $a:ident, $b:ident => $result:expr;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> Self {
            let lane = |i: usize| {
                let ($a, $b) = (self.0[i], other.0[i]);
                $result
            };
            Self([lane(0), lane(1), lane(2), lane(3)])
        })*
    };
}

macro_rules! compare {
    ($($name:ident $operator:tt;)*) => {
        $(#[inline(always)]
        fn $name(self, other: Self) -> u32 {
            let bit = |i: usize| u32::from(self.0[i] $operator other.0[i]) << i;
            bit(0) | bit(1) | bit(2) | bit(3)
        })*
    };
}

impl Floats<4> for Lanes {
    type Token = Scalar;

    #[inline(always)]
    fn splat(_: Scalar, x: f32) -> Self {
        Self([x; 4])
    }

    #[inline(always)]
    fn load(_: Scalar, lanes: &[f32; 4]) -> Self {
        Self(*lanes)
    }

    #[inline(always)]
    fn lanes(self) -> [f32; 4] {
        self.0
    }

    lanewise! {
        add: a, b => a + b;
        sub: a, b => a - b;
        mul: a, b => a * b;
        div: a, b => a / b;
        min: a, b => if a < b { a } else { b };
        max: a, b => if a > b { a } else { b };
    }

    #[inline(always)]
    fn min_where(self, bits: u32, other: Self) -> Self {
        let lane = |i: usize| {
            let (a, b) = (self.0[i], other.0[i]);
            if bits >> i & 1 == 1 && a < b { a } else { b }
        };
        Self([lane(0), lane(1), lane(2), lane(3)])
    }

    compare! { le <=; lt <; }

    #[inline(always)]
    fn or_halves(self, halves: &[u16; 4]) -> Self {
        let lane = |i: usize| f32::from_bits(self.0[i].to_bits() | u32::from(halves[i]));
        Self([lane(0), lane(1), lane(2), lane(3)])
    }
}

impl Four for Lanes {
    #[inline(always)]
    fn xyzz(self) -> Self {
        let [x, y, z, _] = self.0;
        Self([x, y, z, z])
    }

    #[inline(always)]
    fn abs(self) -> Self {
        let [x, y, z, w] = self.0;
        Self([x.abs(), y.abs(), z.abs(), w.abs()])
    }

    #[inline(always)]
    fn yzxx(self) -> Self {
        let [x, y, z, _] = self.0;
        Self([y, z, x, x])
    }

    #[inline(always)]
    fn reordered(self, order: &Shuffle) -> Self {
        let lane = |i: usize| self.0[usize::from(order[4 * i] / 4) % 4];
        Self([lane(0), lane(1), lane(2), lane(3)])
    }

    #[inline(always)]
    fn max_lane(self) -> Self {
        let [x, y, z, w] = self.0;
        let xy = if x > y { x } else { y };
        let zw = if z > w { z } else { w };
        Self([if xy > zw { xy } else { zw }; 4])
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        let bit = |i: usize| self.0[i].to_bits() >> 31 << i;
        bit(0) | bit(1) | bit(2) | bit(3)
    }

    #[inline(always)]
    fn add_bytes(self, bytes: &[u8; 16], shuffle: &Shuffle) -> Self {
        let byte = |i: usize| match shuffle[i] {
            NO_BYTE => 0,
            from => bytes[usize::from(from) % 16],
        };
        let lane = |i: usize| {
            let i = 4 * i;
            let addend = u32::from_le_bytes([byte(i), byte(i + 1), byte(i + 2), byte(i + 3)]);
            f32::from_bits(self.lanes()[i / 4].to_bits().wrapping_add(addend))
        };
        Self([lane(0), lane(1), lane(2), lane(3)])
    }

    #[inline(always)]
    fn columns([a, b, c, d]: [Self; 4]) -> [Self; 3] {
        let column = |i: usize| Self([a.0[i], b.0[i], c.0[i], d.0[i]]);
        [column(0), column(1), column(2)]
    }
}

impl Doubles for DoubleLanes {
    type Token = Scalar;
    type Narrow = Lanes;

    #[inline(always)]
    fn splat(_: Scalar, x: f64) -> Self {
        Self([x; 4])
    }

    #[inline(always)]
    fn widen(Lanes([a, b, c, d]): Lanes) -> Self {
        Self([f64::from(a), f64::from(b), f64::from(c), f64::from(d)])
    }

    #[inline(always)]
    fn narrow(self) -> Lanes {
        let [a, b, c, d] = self.0;
        Lanes([a as f32, b as f32, c as f32, d as f32])
    }

    lanewise! {
        add: a, b => a + b;
        sub: a, b => a - b;
        mul: a, b => a * b;
        div: a, b => a / b;
        min: a, b => if a < b { a } else { b };
        max: a, b => if a > b { a } else { b };
    }

    compare! { lt <; }
}

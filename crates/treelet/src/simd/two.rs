//! Two vectors that count as one of twice the lanes.

use super::{Doubles, Floats};

/// The lower and the upper lanes.
#[derive(Clone, Copy)]
pub(crate) struct Two<V>(V, V);

macro_rules! each {
    ($($operation:ident)*) => {
        $(#[inline(always)]
        fn $operation(self, other: Self) -> Self {
            Self(self.0.$operation(other.0), self.1.$operation(other.1))
        })*
    };
}

macro_rules! doubled {
    ($half:literal $whole:literal) => {
        impl<V: Floats<$half>> Floats<$whole> for Two<V> {
            type Token = V::Token;

            #[inline(always)]
            fn splat(token: V::Token, x: f32) -> Self {
                Self(V::splat(token, x), V::splat(token, x))
            }

            #[inline(always)]
            fn load(token: V::Token, lanes: &[f32; $whole]) -> Self {
                let (lower, upper) = halves::<f32, $half>(lanes);
                Self(V::load(token, lower), V::load(token, upper))
            }

            #[inline(always)]
            fn lanes(self) -> [f32; $whole] {
                let mut lanes = [0.0; $whole];
                lanes[..$half].copy_from_slice(&self.0.lanes());
                lanes[$half..].copy_from_slice(&self.1.lanes());
                lanes
            }

            each! { add sub mul div min max }

            #[inline(always)]
            fn min_where(self, bits: u32, other: Self) -> Self {
                Self(self.0.min_where(bits, other.0), self.1.min_where(bits >> $half, other.1))
            }

            #[inline(always)]
            fn le(self, other: Self) -> u32 {
                self.0.le(other.0) | self.1.le(other.1) << $half
            }

            #[inline(always)]
            fn lt(self, other: Self) -> u32 {
                self.0.lt(other.0) | self.1.lt(other.1) << $half
            }

            #[inline(always)]
            fn or_halves(self, words: &[u16; $whole]) -> Self {
                let (lower, upper) = halves::<u16, $half>(words);
                Self(self.0.or_halves(lower), self.1.or_halves(upper))
            }
        }
    };
}

doubled! { 4 8 }
doubled! { 8 16 }

/// Splits an array of `2 N` lanes.
#[inline(always)]
fn halves<T, const N: usize>(lanes: &[T]) -> (&[T; N], &[T; N]) {
    let (lower, upper) = lanes.split_at(N);
    match (lower.first_chunk(), upper.first_chunk()) {
        (Some(lower), Some(upper)) => (lower, upper),
        _ => unreachable!("the macro above pairs N with 2 N"),
    }
}

/// Two f64 lanes: what [`Two`] makes four of.
pub(crate) trait TwoDoubles: Copy {
    type Token: Copy;
    type Narrow: Floats<4, Token = Self::Token>;
    fn splat(token: Self::Token, x: f64) -> Self;
    fn widen(narrow: Self::Narrow) -> [Self; 2];
    fn narrow(halves: [Self; 2]) -> Self::Narrow;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn lt(self, other: Self) -> u32;
}

impl<V: TwoDoubles> Doubles for Two<V> {
    type Token = V::Token;
    type Narrow = V::Narrow;

    #[inline(always)]
    fn splat(token: V::Token, x: f64) -> Self {
        Self(V::splat(token, x), V::splat(token, x))
    }

    #[inline(always)]
    fn widen(narrow: V::Narrow) -> Self {
        let [lower, upper] = V::widen(narrow);
        Self(lower, upper)
    }

    #[inline(always)]
    fn narrow(self) -> V::Narrow {
        V::narrow([self.0, self.1])
    }

    each! { add sub mul div min max }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.0.lt(other.0) | self.1.lt(other.1) << 2
    }
}

//! Questions, one a file: what a visitor makes of the hits of a walk.

pub(crate) mod all;
pub(crate) mod any;
pub(crate) mod closest;
pub(crate) mod count;
pub(crate) mod filtered;
pub(crate) mod many;

use crate::layout::compact::Compact;
use crate::layout::packing::Packing;
use crate::layout::wide::Plain;
use crate::math::Ray;
use crate::simd::{Checked, Function, Simd};
use crate::trace::counters::Count;
use crate::trace::structure::{Get, Layout, Structure};
use crate::trace::walk::{Visitor, walk};
use core::marker::PhantomData;

/// A question about one ray: the visitor that finds out, made where the walk is, so that what it
/// knows need not be in memory.
pub(crate) trait Question<'a>: Visitor<'a> {
    /// What it needs to begin with, besides the ray; small.
    type Seed;
    type Answer;

    /// Nothing found yet.
    fn begin(ray: &Ray, seed: Self::Seed) -> Self;
    /// What the hits amount to.
    fn answer(self) -> Self::Answer;
}

/// The answer for a ray, that of no hits if it is not valid, with the structure's own instructions.
#[inline(always)]
fn ask<'a, Q: Question<'a>>(structure: &'a Structure, ray: &Ray, seed: Q::Seed) -> Q::Answer {
    ask_at::<Q, ()>(structure.level, structure, ray, seed, &mut ())
}

/// The same with the simplest instructions: compiled once for all rarer questions, and able to
/// count. The answers are the same.
#[inline(always)]
fn ask_simply<'a, Q: Question<'a>, C: Count>(
    structure: &'a Structure,
    ray: &Ray,
    seed: Q::Seed,
    counters: &mut C,
) -> Q::Answer {
    ask_at::<Q, C>(Checked::SCALAR, structure, ray, seed, counters)
}

#[inline(always)]
fn ask_at<'a, Q: Question<'a>, C: Count>(
    level: Checked,
    structure: &'a Structure,
    ray: &Ray,
    seed: Q::Seed,
    counters: &mut C,
) -> Q::Answer {
    match structure.layout {
        Layout::Wide8(_) => {
            level.apply::<Ask<'_, '_, Plain, Q, C, 8>>(structure, ray, seed, counters)
        }
        Layout::Wide16(_) => {
            level.apply::<Ask<'_, '_, Plain, Q, C, 16>>(structure, ray, seed, counters)
        }
        Layout::Compact(_) => {
            level.apply::<Ask<'_, '_, Compact, Q, C, 16>>(structure, ray, seed, counters)
        }
    }
}

/// A walk through nodes of `W` children.
struct Ask<'a, 'r, K, Q, C, const W: usize>(PhantomData<(&'a (), K, Q, &'r C)>);

macro_rules! widths {
    ($($width:literal)*) => {
        $(impl<'a, 'r, K, Q, C> Function for Ask<'a, 'r, K, Q, C, $width>
        where
            K: Packing<$width>,
            Q: Question<'a>,
            C: Count,
            Layout: Get<K, $width>,
        {
            type A = &'a Structure;
            type B = &'r Ray;
            type C = Q::Seed;
            type D = &'r mut C;
            type Output = Q::Answer;

            #[inline(always)]
            fn run<S: Simd>(
                simd: S,
                structure: &'a Structure,
                ray: &'r Ray,
                seed: Q::Seed,
                counters: &'r mut C,
            ) -> Q::Answer {
                let mut visitor = Q::begin(ray, seed);
                walk::<K, S, Q, C, $width>(simd, structure, ray, &mut visitor, counters);
                visitor.answer()
            }
        })*
    };
}

widths! { 8 16 }

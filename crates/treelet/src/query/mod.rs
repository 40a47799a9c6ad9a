//! Questions, one a file: what a visitor makes of the hits of a walk.

pub(crate) mod all;
pub(crate) mod any;
pub(crate) mod closest;
pub(crate) mod count;
pub(crate) mod many;

use crate::math::Ray;
use crate::simd::{Checked, Kernel, Simd};
use crate::trace::counters::Count;
use crate::trace::structure::{Layout, Structure};
use crate::trace::walk::{Visitor, walk};

/// Shows `visitor` the hits of a ray, none if it is not valid, with the structure's own instructions.
#[inline]
fn ask<'a, V: Visitor<'a>>(structure: &'a Structure, ray: &Ray, visitor: &mut V) {
    ask_at(structure.level, structure, ray, visitor, &mut ());
}

/// The same with the simplest instructions: compiled once for all rarer questions, and able to
/// count. The answers are the same.
#[inline]
fn ask_simply<'a, V: Visitor<'a>, C: Count>(
    structure: &'a Structure,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) {
    ask_at(Checked::SCALAR, structure, ray, visitor, counters);
}

#[inline(always)]
fn ask_at<'a, V: Visitor<'a>, C: Count>(
    level: Checked,
    structure: &'a Structure,
    ray: &Ray,
    visitor: &mut V,
    counters: &mut C,
) {
    match structure.layout {
        Layout::Wide8(_) => level.run(Ask::<V, C, 8> { structure, ray, visitor, counters }),
        Layout::Wide16(_) => level.run(Ask::<V, C, 16> { structure, ray, visitor, counters }),
    }
}

/// A walk through nodes of `W` children.
struct Ask<'a, 'v, V, C, const W: usize> {
    structure: &'a Structure,
    ray: &'v Ray,
    visitor: &'v mut V,
    counters: &'v mut C,
}

macro_rules! widths {
    ($($width:literal)*) => {
        $(impl<'a, V: Visitor<'a>, C: Count> Kernel for Ask<'a, '_, V, C, $width> {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, ray, visitor, counters } = self;
                walk::<S, V, C, $width>(simd, structure, ray, visitor, counters);
            }
        })*
    };
}

widths! { 8 16 }

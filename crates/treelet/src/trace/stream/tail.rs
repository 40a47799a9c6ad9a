//! A single ray below a child: how the last few rays of a list or a packet go on.

use crate::layout::wide::Child;
use crate::math::Ray;
use crate::simd::{Kernel, Simd};
use crate::trace::record::{Class, Record, Rest, prepared};
use crate::trace::structure::Structure;
use crate::trace::walk::{Visitor, walk_from};

/// Walks one ray through what is below a child.
pub(crate) struct Tail<'a, 'r, 'v, V, const W: usize> {
    pub(crate) structure: &'a Structure,
    pub(crate) record: &'r Record,
    pub(crate) rest: &'r Rest,
    pub(crate) class: Class,
    pub(crate) ray: &'r Ray,
    pub(crate) child: Child,
    pub(crate) visitor: &'v mut V,
}

macro_rules! tails {
    ($($width:literal)*) => {
        $(impl<'a, V: Visitor<'a>> Kernel for Tail<'a, '_, '_, V, $width> {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, record, rest, class, ray, child, visitor } = self;
                let prepared = prepared(record, rest, class, ray);
                walk_from::<S, V, (), $width>(
                    simd, structure, prepared, child, ray, visitor, &mut (),
                );
            }
        })*
    };
}

tails! { 8 16 }

//! A single ray below a child: how the last few rays of a list or a packet go on.

use crate::layout::packing::Packing;
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::simd::{Kernel, Simd};
use crate::trace::record::{Class, Record, Rest, prepared};
use crate::trace::structure::{Get, Layout, Structure};
use crate::trace::walk::{Visitor, walk_from};
use core::marker::PhantomData;

/// Walks one ray through what is below a child.
pub(crate) struct Tail<'a, 'r, 'v, K, V, const W: usize> {
    pub(crate) packing: PhantomData<K>,
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
        $(impl<'a, K: Packing<$width>, V: Visitor<'a>> Kernel for Tail<'a, '_, '_, K, V, $width>
        where
            Layout: Get<K, $width>,
        {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, record, rest, class, ray, child, visitor, .. } = self;
                let prepared = prepared(record, rest, class, ray, structure);
                walk_from::<K, S, V, (), $width>(
                    simd, structure, prepared, child, ray, visitor, &mut (),
                );
            }
        })*
    };
}

tails! { 8 16 }

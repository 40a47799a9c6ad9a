//! Boxes as builders touch them most: eight lanes, so that one instruction serves all planes where
//! vectors are that long.
//!
//! `hi` is kept negated: growing a box is then one minimum.

use crate::bounds::Aabb;
use crate::memory::zeroed;
use crate::simd::f4::F4;
use crate::simd::{Floats, Simd};

/// A box in memory: `lo`, then `-hi`. The fourth lane of each half means nothing.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Box4([f32; 8]);

zeroed! { Box4 []: [f32; 8] }

/// A box in registers.
#[derive(Clone, Copy)]
pub(super) struct Around<S: Simd>(S::F8);

impl<S: Simd> Around<S> {
    /// Of nothing.
    #[inline(always)]
    pub(super) fn empty(simd: S) -> Self {
        Self(S::F8::splat(simd, f32::INFINITY))
    }

    #[inline(always)]
    pub(super) fn load(simd: S, bounds: &Box4) -> Self {
        Self(S::F8::load(simd, &bounds.0))
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }

    #[inline(always)]
    pub(super) fn store(self) -> Box4 {
        Box4(self.0.lanes())
    }
}

impl Box4 {
    pub(super) const EMPTY: Self = Self([f32::INFINITY; 8]);

    #[inline(always)]
    fn lo(&self) -> F4 {
        F4::new(self.0[0], self.0[1], self.0[2], self.0[3])
    }

    #[inline(always)]
    fn neg_hi(&self) -> F4 {
        F4::new(self.0[4], self.0[5], self.0[6], self.0[7])
    }

    /// The lengths of the edges; 0 on every axis for the empty box.
    #[inline(always)]
    pub(super) fn edges(self) -> F4 {
        self.neg_hi().neg().sub(self.lo()).max(F4::splat(0.0))
    }

    /// Half the surface area of the box with its edges scaled by `scale`.
    #[inline(always)]
    pub(super) fn half_area(self, scale: F4) -> f32 {
        let edges = self.edges().mul(scale);
        let [area, ..] = F4::half_areas([edges; 3]).to_array();
        area
    }

    #[inline(always)]
    pub(super) fn to_aabb(self) -> Aabb {
        let ([x, y, z, _], [a, b, c, _]) = (self.lo().to_array(), self.neg_hi().neg().to_array());
        Aabb { lo: [x, y, z], hi: [a, b, c] }
    }
}

/// A primitive's box, its number in the lane that means nothing: 32 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ref(Box4);

impl Ref {
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self(Box4([0.0; 8]))
    }

    #[inline(always)]
    pub(super) fn new(bounds: &Aabb, prim: u32) -> Self {
        let Aabb { lo, hi } = bounds;
        // The number is never computed with, only moved, so its bits stay.
        let prim = f32::from_bits(prim);
        Self(Box4([lo[0], lo[1], lo[2], prim, -hi[0], -hi[1], -hi[2], 0.0]))
    }

    #[inline(always)]
    pub(super) fn prim(&self) -> u32 {
        self.0.0[3].to_bits()
    }

    /// The box; what its fourth lanes hold means nothing.
    #[inline(always)]
    pub(super) fn bounds(&self) -> &Box4 {
        &self.0
    }

    /// Twice the center: what is compared, never what is stored. The fourth lane is zero:
    /// computing with the number would be slow, since it looks like a denormal.
    #[inline(always)]
    pub(super) fn center2(&self) -> F4 {
        self.0.lo().sub(self.0.neg_hi()).xyz()
    }
}

zeroed! { Ref []: Box4 }

/// The two boxes that decide a split.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent4 {
    /// Around the primitives.
    pub(super) bounds: Box4,
    /// The least and the greatest of twice their centers.
    pub(super) centers: [F4; 2],
}

impl Extent4 {
    /// The extent of some references.
    #[inline(always)]
    pub(super) fn of<'a, S: Simd>(simd: S, refs: impl Iterator<Item = &'a Ref>) -> Self {
        let (mut bounds, least) = (Around::empty(simd), F4::splat(f32::INFINITY));
        let (mut low, mut high) = (least, least.neg());
        for item in refs {
            let center = item.center2();
            bounds = bounds.union(Around::load(simd, item.bounds()));
            low = low.min(center);
            high = high.max(center);
        }
        Self { bounds: bounds.store(), centers: [low, high] }
    }
}

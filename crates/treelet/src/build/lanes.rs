//! Boxes as builders touch them most: four lanes, so that one instruction serves all axes.
//!
//! `hi` is kept negated: growing a box is then two minima.

use crate::bounds::Aabb;
use crate::simd::f4::F4;

/// A box in eight lanes. The fourth lane of each half means nothing.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Box4 {
    pub(super) lo: F4,
    pub(super) neg_hi: F4,
}

impl Box4 {
    #[inline(always)]
    pub(super) fn empty() -> Self {
        Self { lo: F4::splat(f32::INFINITY), neg_hi: F4::splat(f32::INFINITY) }
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), neg_hi: self.neg_hi.min(other.neg_hi) }
    }

    /// The lengths of the edges; 0 on every axis for the empty box.
    #[inline(always)]
    pub(super) fn edges(self) -> F4 {
        self.neg_hi.neg().sub(self.lo).max(F4::splat(0.0))
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
        let ([x, y, z, _], [a, b, c, _]) = (self.lo.to_array(), self.neg_hi.neg().to_array());
        Aabb { lo: [x, y, z], hi: [a, b, c] }
    }
}

/// A primitive's box, its number in the lane that means nothing: 32 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ref(Box4);

impl Ref {
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self(Box4 { lo: F4::splat(0.0), neg_hi: F4::splat(0.0) })
    }

    #[inline(always)]
    pub(super) fn new(bounds: &Aabb, prim: u32) -> Self {
        let Aabb { lo, hi } = bounds;
        // The number is never computed with, only moved, so its bits stay.
        Self(Box4 {
            lo: F4::new(lo[0], lo[1], lo[2], f32::from_bits(prim)),
            neg_hi: F4::new(hi[0], hi[1], hi[2], 0.0).neg(),
        })
    }

    #[inline(always)]
    pub(super) fn prim(&self) -> u32 {
        self.0.lo.to_array()[3].to_bits()
    }

    /// The box; what its fourth lane holds means nothing.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Box4 {
        self.0
    }

    /// Twice the center: what is compared, never what is stored. The fourth lane is zero:
    /// computing with the number would be slow, since it looks like a denormal.
    #[inline(always)]
    pub(super) fn center2(&self) -> F4 {
        self.0.lo.sub(self.0.neg_hi).xyz()
    }
}

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
    pub(super) fn of<'a>(refs: impl Iterator<Item = &'a Ref>) -> Self {
        let (mut bounds, least) = (Box4::empty(), F4::splat(f32::INFINITY));
        let (mut low, mut high) = (least, least.neg());
        for item in refs {
            let center = item.center2();
            bounds = bounds.union(item.bounds());
            low = low.min(center);
            high = high.max(center);
        }
        Self { bounds, centers: [low, high] }
    }
}

//! Boxes as builders touch them most: four lanes, so that one instruction serves all axes.
//!
//! `hi` is kept negated: growing a box is then one minimum over eight lanes. Written so that the
//! compiler finds the vectors by itself on every machine; lane by lane the results are those of
//! scalar code.

use crate::bounds::Aabb;

/// Four lanes: x, y, z and one that is anything.
pub(super) type Lanes = [f32; 4];

/// Lane by lane, the smaller one; the second one where they do not compare.
#[inline(always)]
pub(super) fn min(a: Lanes, b: Lanes) -> Lanes {
    let pick = |i: usize| if a[i] < b[i] { a[i] } else { b[i] };
    [pick(0), pick(1), pick(2), pick(3)]
}

/// Lane by lane, the larger one; the second one where they do not compare.
#[inline(always)]
pub(super) fn max(a: Lanes, b: Lanes) -> Lanes {
    let pick = |i: usize| if a[i] > b[i] { a[i] } else { b[i] };
    [pick(0), pick(1), pick(2), pick(3)]
}

/// `a - b`, lane by lane.
#[inline(always)]
pub(super) fn sub(a: Lanes, b: Lanes) -> Lanes {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

/// `a * b`, lane by lane.
#[inline(always)]
pub(super) fn mul(a: Lanes, b: Lanes) -> Lanes {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}

/// A box in eight lanes. The fourth lane of each half means nothing.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Box4 {
    pub(super) lo: Lanes,
    pub(super) neg_hi: Lanes,
}

impl Box4 {
    pub(super) const EMPTY: Self = Self { lo: [f32::INFINITY; 4], neg_hi: [f32::INFINITY; 4] };

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        Self { lo: min(self.lo, other.lo), neg_hi: min(self.neg_hi, other.neg_hi) }
    }

    /// Twice the center: what is compared, never what is stored.
    #[inline(always)]
    pub(super) fn center2(self) -> Lanes {
        sub(self.lo, self.neg_hi)
    }

    /// The lengths of the edges; 0 on every axis for the empty box.
    #[inline(always)]
    pub(super) fn extent(self) -> Lanes {
        let hi = [-self.neg_hi[0], -self.neg_hi[1], -self.neg_hi[2], -self.neg_hi[3]];
        max(sub(hi, self.lo), [0.0; 4])
    }

    /// Half the surface area of the box with its edges scaled by `scale`.
    #[inline(always)]
    pub(super) fn half_area(self, scale: Lanes) -> f32 {
        let [x, y, z, _] = mul(self.extent(), scale);
        x * y + y * z + z * x
    }

    #[inline(always)]
    pub(super) fn to_aabb(self) -> Aabb {
        let Self { lo, neg_hi } = self;
        Aabb { lo: [lo[0], lo[1], lo[2]], hi: [-neg_hi[0], -neg_hi[1], -neg_hi[2]] }
    }
}

/// A primitive's box, its number in the lane that means nothing: 32 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ref(Box4);

impl Ref {
    pub(super) const NONE: Self = Self(Box4 { lo: [0.0; 4], neg_hi: [0.0; 4] });

    #[inline(always)]
    pub(super) fn new(bounds: &Aabb, prim: u32) -> Self {
        let Aabb { lo, hi } = bounds;
        // The number is never computed with, only moved, so its bits stay.
        Self(Box4 {
            lo: [lo[0], lo[1], lo[2], f32::from_bits(prim)],
            neg_hi: [-hi[0], -hi[1], -hi[2], 0.0],
        })
    }

    pub(super) fn prim(&self) -> u32 {
        self.0.lo[3].to_bits()
    }

    /// The box, with the number masked out: computing with it would be slow (it looks like a
    /// denormal) and can mean nothing.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Box4 {
        let lo = self.0.lo;
        let keep = |i: usize, mask: u32| f32::from_bits(lo[i].to_bits() & mask);
        let lo = [keep(0, !0), keep(1, !0), keep(2, !0), keep(3, 0)];
        Box4 { lo, neg_hi: self.0.neg_hi }
    }

    /// Twice the center along one axis.
    #[inline(always)]
    pub(super) fn center2(&self, axis: usize) -> f32 {
        self.0.lo[axis] - self.0.neg_hi[axis]
    }
}

/// The two boxes that decide a split.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent4 {
    /// Around the primitives.
    pub(super) bounds: Box4,
    /// Around twice their centers.
    pub(super) centers: Box4,
}

impl Extent4 {
    pub(super) const EMPTY: Self = Self { bounds: Box4::EMPTY, centers: Box4::EMPTY };

    #[inline(always)]
    pub(super) fn add(&mut self, item: &Ref) {
        let bounds = item.bounds();
        let center = bounds.center2();
        let negated = [-center[0], -center[1], -center[2], -center[3]];
        self.bounds = self.bounds.union(bounds);
        self.centers = self.centers.union(Box4 { lo: center, neg_hi: negated });
    }
}

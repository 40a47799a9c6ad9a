//! The axis-aligned box.

use crate::memory::zeroed;

/// An axis-aligned box, closed: the points with `lo <= p <= hi` on every axis.
///
/// Empty when `lo > hi` on an axis; [`Aabb::EMPTY`] is the empty box that any union forgets.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Aabb {
    /// The least corner.
    pub lo: [f32; 3],
    /// The greatest corner.
    pub hi: [f32; 3],
}

zeroed! { Aabb []: [f32; 3] }

impl Aabb {
    /// The box of nothing.
    pub const EMPTY: Self = Self { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    /// The box around some points, none of them NaN.
    #[inline]
    pub fn of_points(points: &[[f32; 3]]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, &p| bounds.union(&Self { lo: p, hi: p }))
    }

    /// Whether the box holds no point.
    #[inline]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.lo[axis] > self.hi[axis])
    }

    /// The smallest box around both.
    #[inline(always)]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for axis in 0..3 {
            // Written as comparisons: one instruction each, and no NaN reaches this place.
            if other.lo[axis] < out.lo[axis] {
                out.lo[axis] = other.lo[axis];
            }
            if other.hi[axis] > out.hi[axis] {
                out.hi[axis] = other.hi[axis];
            }
        }
        out
    }

    /// What lies in both; [`Aabb::EMPTY`] if nothing does.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let lo = core::array::from_fn(|axis| self.lo[axis].max(other.lo[axis]));
        let hi = core::array::from_fn(|axis| self.hi[axis].min(other.hi[axis]));
        let both = Self { lo, hi };
        if both.is_empty() { Self::EMPTY } else { both }
    }

    /// Whether `other` lies inside, faces included. An empty box lies inside every box.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty()
            || (0..3).all(|axis| self.lo[axis] <= other.lo[axis] && other.hi[axis] <= self.hi[axis])
    }

    /// The lengths of the edges; zero on every axis for an empty box.
    #[inline]
    pub fn extent(&self) -> [f32; 3] {
        core::array::from_fn(|axis| (self.hi[axis] - self.lo[axis]).max(0.0))
    }

    /// The middle, `lo / 2 + hi / 2`, so that it cannot overflow.
    #[inline(always)]
    pub fn center(&self) -> [f32; 3] {
        core::array::from_fn(|axis| 0.5 * self.lo[axis] + 0.5 * self.hi[axis])
    }

    /// Half the surface area, in f64: extents up to `2^63` square without overflow. 0 if empty.
    #[inline]
    pub fn half_area(&self) -> f64 {
        let [x, y, z] = self.extent().map(f64::from);
        x * y + y * z + z * x
    }

    /// The largest absolute coordinate; 0 if empty.
    pub fn max_abs(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let far = |axis: usize| self.lo[axis].abs().max(self.hi[axis].abs());
        far(0).max(far(1)).max(far(2))
    }

    /// The box with every face moved outward by `by >= 0`, rounded outward; an empty one stays so.
    #[must_use]
    pub fn widened(&self, by: f32) -> Self {
        if self.is_empty() {
            return *self;
        }
        let (lo, hi) = (|x: f32| (x - by).next_down(), |x: f32| (x + by).next_up());
        let [a, b, c] = self.lo;
        let [x, y, z] = self.hi;
        Self { lo: [lo(a), lo(b), lo(c)], hi: [hi(x), hi(y), hi(z)] }
    }

    /// The length of the diagonal; 0 if empty.
    pub fn diagonal(&self) -> f64 {
        let [x, y, z] = self.extent().map(f64::from);
        libm::sqrt(x * x + y * y + z * z)
    }
}

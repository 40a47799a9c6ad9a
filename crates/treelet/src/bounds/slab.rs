//! A ray against an axis-aligned box: three intervals of `t`, one an axis, intersected.
//!
//! Sources: T. Kay and J. Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986 (slabs);
//! A. Williams et al., "An Efficient and Robust Ray-Box Intersection Algorithm", JGT 10(1), 2005
//! (IEEE rules for parallel rays); T. Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013 (rounding).
//! Differs from them: the box is widened in space, by `slack`, through the two origins that the
//! planes are measured from, instead of widening `t`. That costs nothing per box, treats zero
//! direction components like any other, and makes the test *monotone*:
//!
//! **If box A lies inside box B, the interval of A lies inside the interval of B, bit for bit.**
//! Each bound is a chain `(plane - origin) * reciprocal` of correctly rounded, monotone steps, and
//! the maximum or minimum of three such bounds; wide nodes make the same steps, a child a lane. The traversal's promise that no tree shape changes
//! an answer rests on this property and on nothing else; see `geometry::triangle`.
//!
//! Zero directions: the reciprocal of a component that is zero, or so short that f32 has none, is
//! taken as the largest f32. Products are then finite or infinite, never NaN, and the ray is in
//! such a slab for `|t| <= 2^128 slack` at least: longer than any hit of a valid ray takes, whose
//! direction is at least `2^-100` long where slack is `2^-20` of the reach.

use super::Aabb;
use crate::simd::{Floats, Four, Scalar, Simd};

/// The part of a ray, as a closed interval of `t`, that lies in a volume. Empty if
/// `entry > exit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Where the ray enters; negative infinity if it comes from inside without end.
    pub entry: f32,
    /// Where it leaves.
    pub exit: f32,
}

impl Interval {
    /// Every `t` there is.
    pub const ALL: Self = Self { entry: f32::NEG_INFINITY, exit: f32::INFINITY };

    /// Whether no `t` lies in the interval.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.entry > self.exit
    }

    /// What lies in both.
    #[inline(always)]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            entry: if other.entry > self.entry { other.entry } else { self.entry },
            exit: if other.exit < self.exit { other.exit } else { self.exit },
        }
    }

    /// The `t` of the interval (not empty) that is nearest to `t`.
    #[inline(always)]
    pub fn clamp(&self, t: f32) -> f32 {
        if t < self.entry {
            self.entry
        } else if t > self.exit {
            self.exit
        } else {
            t
        }
    }
}

/// A ray prepared for many boxes.
///
/// Moving the lower planes back by `slack` is measuring them from an origin that is moved forward
/// by it, and the other way round for the upper planes: whichever of the two the ray meets first.
#[derive(Clone, Copy, Debug)]
pub struct SlabRay {
    /// What lower planes are measured from, then what upper planes are; the last lane is unused.
    sides: [[f32; 4]; 2],
    /// `1 / direction`, and an unused lane.
    reciprocal: [f32; 4],
    /// Bit `axis`: whether the ray meets the upper plane first.
    backward: u32,
}

impl SlabRay {
    /// No ray yet.
    pub(crate) const BLANK: Self = Self { sides: [[0.0; 4]; 2], reciprocal: [0.0; 4], backward: 0 };

    /// Prepares `origin + t * direction` for boxes that count as wider by at least `slack >= 0`
    /// on every side.
    pub fn new(origin: [f32; 3], direction: [f32; 3], slack: f32) -> Self {
        let lanes = |[x, y, z]: [f32; 3]| Floats::load(Scalar, &[x, y, z, z]);
        let slack = Floats::splat(Scalar, slack);
        let direction: <Scalar as Simd>::F4 = lanes(direction);
        let reciprocal = <Scalar as Simd>::F4::splat(Scalar, 1.0).div(direction);
        Self::of_lanes(Scalar, lanes(origin), (direction, reciprocal), slack)
    }

    /// The same of vectors, and of `1 / direction` as it is; `slack` in every lane.
    #[inline(always)]
    pub(crate) fn of_lanes<S: Simd>(
        simd: S,
        origin: S::F4,
        (direction, reciprocal): (S::F4, S::F4),
        slack: S::F4,
    ) -> Self {
        let splat = |x: f32| S::F4::splat(simd, x);
        // The sums below round by half an ulp of the origin; this much more makes that outward,
        // even for a slack below the origin's own precision.
        let ulp = origin.abs().mul(splat(WIDER * f32::EPSILON));
        let by = slack.mul(splat(WIDER)).add(splat(f32::MIN_POSITIVE)).add(ulp);
        let reciprocal = splat(f32::MAX).min(splat(f32::MIN).max(reciprocal));
        Self {
            sides: [origin.add(by).lanes(), origin.sub(by).lanes()],
            reciprocal: reciprocal.lanes(),
            backward: direction.signs(),
        }
    }

    /// The ray whose parts are these, by axis: what planes that are met first and last are measured
    /// from, reciprocals, and 1 where the upper plane is met first.
    #[inline(always)]
    pub(crate) fn of_parts(
        near: [f32; 3],
        far: [f32; 3],
        reciprocal: [f32; 3],
        backward: [u8; 3],
    ) -> Self {
        let side = |side: u8| {
            let pick = |axis: usize| if backward[axis] == side { near[axis] } else { far[axis] };
            [pick(0), pick(1), pick(2), pick(2)]
        };
        let [x, y, z] = backward.map(u32::from);
        let reciprocal = [reciprocal[0], reciprocal[1], reciprocal[2], reciprocal[2]];
        Self { sides: [side(0), side(1)], reciprocal, backward: x | y << 1 | z << 2 }
    }

    /// By axis: 1 if the ray meets the upper plane first, else 0.
    #[inline(always)]
    pub(crate) fn backward(&self, axis: usize) -> usize {
        (self.backward >> axis & 1) as usize
    }

    /// What the lower (0) or the upper (1) plane of an axis is measured from.
    #[inline(always)]
    pub(crate) fn side(&self, side: usize, axis: usize) -> f32 {
        self.sides[side][axis]
    }

    /// What the difference of a plane and its side is multiplied with.
    #[inline(always)]
    pub(crate) fn reciprocal(&self, axis: usize) -> f32 {
        self.reciprocal[axis]
    }

    /// Where the ray is in the widened box.
    #[inline(always)]
    pub fn interval(&self, bounds: &Aabb) -> Interval {
        let mut inside = Interval::ALL;
        for axis in 0..3 {
            let planes = [bounds.lo[axis], bounds.hi[axis]];
            let t = |side: usize| (planes[side] - self.sides[side][axis]) * self.reciprocal[axis];
            let backward = self.backward(axis);
            let (entry, exit) = (t(backward), t(backward ^ 1));
            inside.entry = if entry > inside.entry { entry } else { inside.entry };
            inside.exit = if exit < inside.exit { exit } else { inside.exit };
        }
        inside
    }
}

/// `(1 + WIDER's excess)` covers the roundings of the sum and the product that it is part of.
pub(crate) const WIDER: f32 = 1.0 + 4.0 * f32::EPSILON;

#[cfg(test)]
mod tests {
    use super::{Aabb, SlabRay};

    const UNIT: Aabb = Aabb { lo: [0.0; 3], hi: [1.0; 3] };

    fn interval(origin: [f32; 3], direction: [f32; 3]) -> super::Interval {
        SlabRay::new(origin, direction, 0.0).interval(&UNIT)
    }

    #[test]
    fn through_behind_inside_beside() {
        let through = interval([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0]);
        assert!((through.entry - 1.0).abs() < 1e-6 && (through.exit - 2.0).abs() < 1e-6);
        let behind = interval([3.0, 0.5, 0.5], [1.0, 0.0, -0.0]);
        assert!(!behind.is_empty() && behind.exit < 0.0, "behind the eye: {behind:?}");
        let inside = interval([0.5, 0.5, 0.5], [0.0, 0.0, -2.0]);
        assert!(inside.entry < 0.0 && inside.exit > 0.0);
        assert!(interval([-1.0, 1.5, 0.5], [1.0, 0.0, 0.0]).is_empty());
        assert!(interval([-1.0, 1.5, 0.5], [1.0, -0.0, 0.0]).is_empty());
    }

    #[test]
    fn a_ray_in_a_face_plane_enters_for_zeros_of_either_sign() {
        for zero in [0.0, -0.0] {
            for plane in [0.0, -0.0, 1.0] {
                let along = interval([-1.0, plane, 0.5], [1.0, zero, zero]);
                assert!(!along.is_empty(), "plane {plane}, zero {zero}: {along:?}");
            }
        }
    }

    #[test]
    fn the_empty_box_is_never_entered() {
        for direction in [[1.0, 2.0, 3.0], [-1.0, 0.0, -0.0], [0.0, -0.0, 1.0]] {
            let ray = SlabRay::new([0.3, 0.0, -7.0], direction, 1.0);
            assert!(ray.interval(&Aabb::EMPTY).is_empty());
        }
    }
}

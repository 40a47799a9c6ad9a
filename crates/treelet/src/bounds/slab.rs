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
//! the maximum or minimum of three such bounds. The traversal's promise that no tree shape changes
//! an answer rests on this property and on nothing else; see `geometry::triangle`.
//!
//! Zero directions: the reciprocal is infinite, a plane gives an infinite `t` on the right side, or
//! `0 * inf = NaN` exactly on the plane. The comparisons below let NaN leave the interval as it is,
//! so a ray inside a face plane enters the box; monotone too, since the next larger box gives
//! an unbounded slab there.

use super::Aabb;

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

/// Two boxes side by side: for each axis `lo` and `lo`, then `hi` and `hi`, of both.
pub type BoxPair = [[f32; 4]; 3];

/// A ray prepared for many boxes.
///
/// Moving the lower planes back by `slack` is measuring them from an origin that is moved forward
/// by it, and the other way round for the upper planes: whichever of the two the ray meets first.
#[derive(Clone, Copy, Debug)]
pub struct SlabRay {
    /// By axis: what the planes met first are measured from, twice; then those met last.
    origins: [[f32; 4]; 3],
    /// By axis: `1 / direction`, twice; then its negative, so that exits are maxima too.
    reciprocals: [[f32; 4]; 3],
    /// Whether the ray meets the upper plane first.
    backward: [bool; 3],
}

impl SlabRay {
    /// Prepares `origin + t * direction` for boxes that count as wider by at least `slack >= 0`
    /// on every side.
    #[inline]
    pub fn new(origin: [f32; 3], direction: [f32; 3], slack: f32) -> Self {
        let mut ray =
            Self { origins: [[0.0; 4]; 3], reciprocals: [[0.0; 4]; 3], backward: [false; 3] };
        for axis in 0..3 {
            // Rounded outward, so that even a slack below the origin's own precision is kept.
            let above = (origin[axis] + slack).next_up();
            let below = (origin[axis] - slack).next_down();
            let backward = direction[axis].is_sign_negative();
            let (first, last) = if backward { (below, above) } else { (above, below) };
            let reciprocal = 1.0 / direction[axis];
            ray.origins[axis] = [first, first, last, last];
            ray.reciprocals[axis] = [reciprocal, reciprocal, -reciprocal, -reciprocal];
            ray.backward[axis] = backward;
        }
        ray
    }

    /// Where the ray is in the widened box.
    #[inline]
    pub fn interval(&self, bounds: &Aabb) -> Interval {
        self.intervals(&pair(bounds, bounds))[0]
    }

    /// Where the ray is in each of two widened boxes.
    ///
    /// Four lanes in step, which compilers turn into one instruction each: two entries, and two
    /// exits negated.
    #[inline(always)]
    pub fn intervals(&self, boxes: &BoxPair) -> [Interval; 2] {
        let mut latest = [f32::NEG_INFINITY; 4];
        for axis in 0..3 {
            let [a, b, c, d] = boxes[axis];
            let planes = if self.backward[axis] { [c, d, a, b] } else { [a, b, c, d] };
            for lane in 0..4 {
                let t = (planes[lane] - self.origins[axis][lane]) * self.reciprocals[axis][lane];
                // A comparison that is false for NaN keeps what there is: see the module's head.
                latest[lane] = if t > latest[lane] { t } else { latest[lane] };
            }
        }
        let [left, right, left_exit, right_exit] = latest;
        [Interval { entry: left, exit: -left_exit }, Interval { entry: right, exit: -right_exit }]
    }
}

/// Two boxes, side by side.
pub fn pair(left: &Aabb, right: &Aabb) -> BoxPair {
    core::array::from_fn(|axis| [left.lo[axis], right.lo[axis], left.hi[axis], right.hi[axis]])
}

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

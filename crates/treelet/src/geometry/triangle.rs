//! The triangle test: which rays hit a triangle, where, and why no tree can tell otherwise.
//!
//! Source: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.
//! The triangle is moved to the ray's origin and sheared so that the ray becomes the z axis; three
//! 2D edge functions of the sheared corners decide. Corners that two triangles share are sheared
//! alike, and an edge function changes only its sign with the direction of its edge, so what one
//! neighbour rejects the other accepts.
//!
//! # Exactness
//!
//! An edge function is `c.x * b.y - c.y * b.x` of f32 values, two roundings and a subtraction.
//! Rounding is monotone, so the f32 sign is right or the result is zero. What f32 does not reject is
//! computed again in f64, where the products are exact and the sign is exactly that of the sheared
//! triangle. Edges and corners belong to the triangle (closed rule); [`EdgeRule`] is the place for
//! a half-open one.
//!
//! The weights and `t` come from f64, too. In f32 their error grows with the ratio of the sheared
//! size to the sheared area, and `t` of a ray inside a thin beam then falls behind the origin: with
//! f32 for areas above 2^-12 of the squared size, one ray in 200,000 left a beam 2500 times longer
//! than thick, 700 roundings below its face. Convex weights good to f64 keep the point within the
//! `7 u R` of the derivation below, however thin the triangle.
//!
//! # The culling lemma
//!
//! *What is accepted at `t` is admitted at `t` by every box around the triangle.* The accepted `t`
//! is clamped into the interval in which the ray is inside the triangle's own box, computed by the
//! same monotone slab test as every box of every tree ([`crate::bounds::slab`]), intersected with
//! those of the instances on the way (`clip`). A box of a tree contains the triangle's box, so its
//! interval contains that interval, bit for bit, and so `t`. No error analysis is involved, and
//! brute force, which visits no box at all, gives the same bits.
//!
//! What does need analysis is that clamping never empties the interval of a ray that the edge
//! functions accept: that would be a leak. With `u = 2^-24` and `R` the largest distance, per axis,
//! between the origin and a corner of the scene's box:
//!
//! - moving to the origin costs `u R`, the shear (a rounded reciprocal and product, a product, a
//!   difference) at most `6 u R` more: each sheared corner is within `7 u R` of where it should be;
//! - so a ray that is inside the sheared triangle passes within `7 u R` of the true one, at the
//!   depth of a point of it;
//! - the slab test measures a plane within `3 u R`.
//!
//! `10 u R` is enough; `SLACK` takes 16. Levels with instances add what transforming the ray costs:
//! see `trace::slack`. `tests/watertight.rs` attacks all of it.

use crate::bounds::{Aabb, Interval, SlabRay};
use crate::simd::{Floats, Four, Scalar, Shuffle, Simd};

/// Half a unit in the last place of 1: the largest relative error of one f32 rounding.
pub(crate) const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;

/// The widening of boxes, in units of `UNIT_ROUNDOFF` times the reach of the scene. Derived above.
pub(crate) const SLACK: f32 = 16.0;

/// A ray prepared for many triangles of one level.
#[derive(Clone, Copy, Debug)]
pub struct TriangleRay {
    /// The axes that become x, y and z; z is where the direction is longest.
    pub(super) axes: [u8; 3],
    /// The origin's coordinates on those axes, and a lane that nobody reads.
    pub(super) origin: [f32; 4],
    /// What x and y change along z: `direction[x] (1 / direction[z])`, and of y. Two more lanes.
    pub(super) shear: [f32; 4],
    /// `1 / direction[z]`.
    pub(super) reciprocal_z: f64,
    /// Whether nothing about ray and level comes near overflow or underflow: see [`Ordinary`].
    pub(super) ordinary: bool,
}

/// The sizes for which clamping `t` is known to change nothing, so that it need not be done.
///
/// Let level and ray be such that the level's reach has an extent of at least `EXTENT_MIN`, no
/// coordinate of it or of the origin is beyond `COORDINATE_MAX`, and the direction's longest component is in
/// `LENGTH_MIN ..= LENGTH_MAX`. Then `R >= 2^-61`, no product below overflows, and what underflow
/// takes (`2^-150` each time) is far below `u R`, also when seen in lengths of the direction. So the
/// terms of the module's head hold as they stand: the point at `t` is within `7.1 u R` of a point of
/// the triangle on every axis, and the slab test, whose sides are `16 u R` out and whose own
/// roundings take `3.1 u R` of that, admits it. (A reciprocal that was clamped belongs to a component of
/// less than `2^-128`: over `t <= R / LENGTH_MIN` it moves the ray by less than `u R`.)
/// `tests/matrix.rs` and `tests/lemma.rs` compare with brute force, which always clamps.
pub(crate) struct Ordinary;

impl Ordinary {
    pub(crate) const EXTENT_MIN: f32 = power_of_two(-60);
    pub(crate) const COORDINATE_MAX: f32 = power_of_two(90);
    pub(crate) const LENGTH_MIN: f32 = power_of_two(-30);
    pub(crate) const LENGTH_MAX: f32 = power_of_two(30);

    /// Whether a level with this reach allows it.
    pub(crate) fn level(reach: &Aabb) -> bool {
        let extent = reach.extent();
        let extent = extent[0].max(extent[1]).max(extent[2]);
        extent >= Self::EXTENT_MIN && reach.max_abs() <= Self::COORDINATE_MAX
    }

    /// Whether a ray from `origin` allows it whose direction along its longest axis is `along`.
    #[inline(always)]
    pub(crate) fn ray(origin: [f32; 3], along: f32) -> bool {
        let [x, y, z] = [origin[0].abs(), origin[1].abs(), origin[2].abs()];
        (x <= Self::COORDINATE_MAX)
            & (y <= Self::COORDINATE_MAX)
            & (z <= Self::COORDINATE_MAX)
            & (Self::LENGTH_MIN <= along.abs())
            & (along.abs() <= Self::LENGTH_MAX)
    }
}

/// An exact power.
const fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((127 + exponent) as u32) << 23)
}

/// Where the ray meets the triangle's plane, as weights of the corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Distance in lengths of the direction.
    pub t: f32,
    /// Weight of the second corner.
    pub u: f32,
    /// Weight of the third corner.
    pub v: f32,
}

/// Which triangle an edge belongs to.
///
/// Given the exact signs (-1, 0, 1) of the three edge functions, says whether the ray hits.
pub trait EdgeRule {
    /// Whether a ray with these edge signs is inside.
    fn covers(signs: [i32; 3]) -> bool;
}

/// Edges and corners belong to every triangle that has them: no ray slips through.
#[derive(Clone, Copy, Debug)]
pub struct Closed;

impl EdgeRule for Closed {
    #[inline(always)]
    fn covers(signs: [i32; 3]) -> bool {
        let low = signs[0].min(signs[1]).min(signs[2]);
        let high = signs[0].max(signs[1]).max(signs[2]);
        low >= 0 || high <= 0
    }
}

/// The two axes after each; one more to spare a check.
pub(crate) const NEXT: [[u8; 2]; 4] = [[1, 2], [2, 0], [0, 1], [0, 1]];

/// How coordinates become those that triangles are tested on.
struct Turn {
    /// As lanes, the last of them twice.
    order: Shuffle,
    axes: [u8; 3],
}

/// By which components are shorter than the next, cyclically: bit 0, x than y; bit 1, y than z; bit 2, z than x.
static TURNS: [Turn; 8] = {
    let mut turns = [const { Turn { order: [0; 16], axes: [0; 3] } }; 8];
    let mut less = 0;
    while less < turns.len() {
        // As `longest_axis` has it.
        let z = if less & 0b110 == 0b010 { 2 } else { less & 1 };
        let [x, y] = NEXT[z];
        turns[less].axes = [x, y, z as u8];
        let mut byte = 0;
        while byte < 16 {
            let lane = if byte < 12 { byte / 4 } else { 2 };
            turns[less].order[byte] = 4 * turns[less].axes[lane] + (byte % 4) as u8;
            byte += 1;
        }
        less += 1;
    }
    turns
};

/// A corner after the shear: the ray is the z axis.
type Sheared = [f32; 3];

/// The axis along which the direction is longest.
#[inline(always)]
pub(crate) fn longest_axis(direction: [f32; 3]) -> usize {
    let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
    let z_longest = (z >= x) & (z > y);
    if z_longest { 2 } else { usize::from(x < y) }
}

impl TriangleRay {
    /// No ray yet.
    pub(crate) const BLANK: Self = Self {
        axes: [0; 3],
        origin: [0.0; 4],
        shear: [0.0; 4],
        reciprocal_z: 0.0,
        ordinary: false,
    };

    /// Prepares a ray whose direction is finite and not zero.
    #[inline(always)]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let lanes = |[x, y, z]: [f32; 3]| Floats::load(Scalar, &[x, y, z, z]);
        let direction: <Scalar as Simd>::F4 = lanes(direction);
        let reciprocal = <Scalar as Simd>::F4::splat(Scalar, 1.0).div(direction);
        Self::of_lanes(Scalar, lanes(origin), (direction, reciprocal))
    }

    /// The same of lanes `x, y, z, z`, and of `1 / direction`.
    #[inline(always)]
    pub(crate) fn of_lanes<S: Simd>(
        simd: S,
        origin: S::F4,
        (direction, reciprocal): (S::F4, S::F4),
    ) -> Self {
        let size = direction.abs();
        let Turn { order, axes } = &TURNS[size.lt(size.yzxx()) as usize % TURNS.len()];
        let direction = direction.reordered(order);
        let [.., reciprocal, _] = reciprocal.reordered(order).lanes();
        let [.., along, _] = direction.lanes();
        Self {
            axes: *axes,
            origin: origin.reordered(order).lanes(),
            shear: direction.mul(S::F4::splat(simd, reciprocal)).lanes(),
            reciprocal_z: 1.0 / f64::from(along),
            ordinary: false,
        }
    }

    /// The same ray; says whether it is [`Ordinary`].
    #[inline(always)]
    pub(crate) fn ordinary(self, ordinary: bool) -> Self {
        Self { ordinary, ..self }
    }

    /// Whether it is.
    #[inline(always)]
    pub(crate) fn is_ordinary(&self) -> bool {
        self.ordinary
    }

    /// The ray whose axes, origin and shear on them, and direction along the last one are these.
    #[inline(always)]
    pub(crate) fn of_parts(axes: [u8; 3], origin: [f32; 3], shear: [f32; 2], along: f32) -> Self {
        let ([a, b, c], [x, y]) = (origin, shear);
        let (origin, shear) = ([a, b, c, c], [x, y, y, y]);
        Self { axes, origin, shear, reciprocal_z: 1.0 / f64::from(along), ordinary: false }
    }

    /// The hit with the triangle under the closed edge rule, if its `t` is in `t_min ..= t_max`.
    ///
    /// `slab` is the same ray prepared for boxes, `clip` the interval that the instances on the way
    /// allow. This function *is* the answer to a ray: walks only choose for which triangles to
    /// call it.
    #[inline(always)]
    pub fn hit(
        &self,
        corners: &[[f32; 3]; 3],
        slab: &SlabRay,
        clip: &Interval,
        range: &Interval,
    ) -> Option<Meeting> {
        let [a, b, c] = corners;
        let sheared = [self.shear(*a), self.shear(*b), self.shear(*c)];
        let [u, v, w] = edge_functions(&sheared);
        // Strictly mixed signs are certain even in f32. NaN, from overflow, is not rejected here.
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        self.settle::<Closed>(corners, &sheared, slab, clip, range)
    }

    /// What happens to the few rays that f32 did not reject. Out of line: a ray that hits comes
    /// here about once.
    #[inline(never)]
    fn settle<E: EdgeRule>(
        &self,
        corners: &[[f32; 3]; 3],
        sheared: &[Sheared; 3],
        slab: &SlabRay,
        clip: &Interval,
        range: &Interval,
    ) -> Option<Meeting> {
        let mut meeting = self.meet::<E>(sheared)?;
        // The culling lemma: `t` lies where the triangle's own box is.
        let inside = slab.interval(&Aabb::of_points(corners)).intersection(clip);
        if inside.is_empty() || !meeting.t.is_finite() {
            return None;
        }
        meeting.t = inside.clamp(meeting.t);
        (range.entry <= meeting.t && meeting.t <= range.exit).then_some(meeting)
    }

    /// The axes, the origin on them, and the shear: what a test of many triangles side by side needs.
    pub(crate) fn parts(&self) -> ([usize; 3], [f32; 3], [f32; 2]) {
        let ([a, b, c, _], [x, y, ..]) = (self.origin, self.shear);
        (self.axes.map(usize::from), [a, b, c], [x, y])
    }

    #[inline(always)]
    fn shear(&self, corner: [f32; 3]) -> Sheared {
        let moved = |i: usize| corner[usize::from(self.axes[i])] - self.origin[i];
        let [x, y, z] = [moved(0), moved(1), moved(2)];
        [x - self.shear[0] * z, y - self.shear[1] * z, z]
    }

    /// Exact signs, then weights and `t`, in f64. Depth is the first corner's plus shares of the
    /// differences, so that a triangle that faces the ray squarely is met at exactly its depth.
    fn meet<E: EdgeRule>(&self, sheared: &[Sheared; 3]) -> Option<Meeting> {
        let [a, b, c] = sheared.map(|corner| corner.map(f64::from));
        let [u, v, w] =
            [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]];
        if !E::covers([u, v, w].map(sign)) {
            return None;
        }
        let det = u + v + w;
        // Seen exactly from the side: its neighbours answer for its edges. NaN: beyond f64, never.
        if det == 0.0 || !det.is_finite() {
            return None;
        }
        let share = 1.0 / det;
        let (v, w) = (v * share, w * share);
        let z = a[2] + (v * (b[2] - a[2]) + w * (c[2] - a[2]));
        let t = (z * self.reciprocal_z) as f32;
        Some(Meeting { t, u: v as f32, v: w as f32 })
    }
}

/// The signed double areas of the triangles between the ray and each edge: opposite the first,
/// second and third corner.
#[inline(always)]
fn edge_functions([a, b, c]: &[Sheared; 3]) -> [f32; 3] {
    [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]]
}

fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

/// Whether the triangle's exact corners are collinear or coincide, decided by exact predicates:
/// J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
/// Predicates", Discrete & Computational Geometry 18, 1997.
pub fn is_degenerate(corners: &[[f32; 3]; 3]) -> bool {
    // Collinear in space means collinear in all three axis-parallel projections.
    (0..3).all(|axis| {
        let project = |p: [f32; 3]| robust::Coord {
            x: f64::from(p[(axis + 1) % 3]),
            y: f64::from(p[(axis + 2) % 3]),
        };
        let [a, b, c] = corners.map(project);
        robust::orient2d(a, b, c) == 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::{Interval, SlabRay, TriangleRay, is_degenerate};

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [0.0, 4.0, 5.0]];

    fn hit(origin: [f32; 3], direction: [f32; 3]) -> Option<super::Meeting> {
        let slab = SlabRay::new(origin, direction, 1e-5);
        let ray = TriangleRay::new(origin, direction);
        ray.hit(&CORNERS, &slab, &Interval::ALL, &Interval { entry: 0.0, exit: 1e30 })
    }

    #[test]
    fn weights_name_the_corners() {
        let meeting = hit([1.0, 2.0, 0.0], [0.0, 0.0, 2.0]).unwrap();
        assert_eq!((meeting.t, meeting.u, meeting.v), (2.5, 0.25, 0.5));
        // The same from behind, and not at all behind the origin.
        assert_eq!(hit([1.0, 2.0, 6.0], [0.0, 0.0, -0.5]).unwrap().t, 2.0);
        assert_eq!(hit([1.0, 2.0, 6.0], [0.0, 0.0, 0.5]), None);
    }

    #[test]
    fn edges_and_corners_belong_to_it() {
        for target in [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]] {
            let [x, y] = target;
            assert!(hit([x, y, 0.0], [0.0, -0.0, 1.0]).is_some(), "{target:?}");
        }
        for target in [[-1e-6, 0.0], [4.000_001, 0.0], [2.000_001, 2.0]] {
            let [x, y] = target;
            assert_eq!(hit([x, y, 0.0], [0.0, 0.0, 1.0]), None, "{target:?}");
        }
    }

    #[test]
    fn seen_exactly_from_the_side_it_is_missed() {
        assert_eq!(hit([-1.0, 1.0, 5.0], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn degenerate_means_exactly_collinear() {
        assert!(is_degenerate(&[[1.0; 3], [1.0; 3], [2.0, 0.0, 0.0]]));
        assert!(is_degenerate(&[[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0]]));
        assert!(!is_degenerate(&[[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.000_000_5]]));
        assert!(!is_degenerate(&[[0.0; 3], [1e-30, 0.0, 0.0], [0.0, 1e-30, 0.0]]));
    }
}

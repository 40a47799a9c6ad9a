//! Up to four triangles against a ray at once: the test of [`super::triangle`], step by step, a
//! triangle a lane. The same bits as there; `tests/matrix.rs` holds them against each other.
//!
//! Exact signs, weights and `t` are computed in f64, of all lanes: a division in four lanes takes as
//! long as one. Where vectors hold fewer than four f64, f32 edge functions come first, and reject
//! most leaves that the ray misses.
//!
//! `t` is clamped only where that is not known to change nothing (`Ordinary` in [`super::triangle`]): that is
//! worth 3 to 10 % of a ray. What exactness costs: a test in f32 throughout, without the clamp, made rays 7
//! to 9 % faster in a house, 4 to 23 % in a car, 15 to 25 % in a coffee maker.

use super::triangle::TriangleRay;
use crate::bounds::{Interval, SlabRay};
use crate::simd::{Doubles, Floats, Function, Simd};
use core::marker::PhantomData;

/// Lanes of a block.
pub(crate) const LANES: usize = 4;

/// The hits of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockHits {
    /// Bit `i`: triangle `i` is hit.
    pub(crate) mask: u32,
    pub(crate) t: [f32; LANES],
    pub(crate) u: [f32; LANES],
    pub(crate) v: [f32; LANES],
}

impl BlockHits {
    const NONE: Self = Self { mask: 0, t: [0.0; LANES], u: [0.0; LANES], v: [0.0; LANES] };
}

/// Which of the first `count` lanes of a block are hit, as [`TriangleRay::hit`] says for one.
///
/// Its arguments: the rows and `count`, where `rows[k * count + i]` is, of triangle `i`, axis `k % 3`
/// of corner `k / 3`, and beyond the last row, anything; the ray, for triangles and for boxes; where
/// the instances on the way allow a hit; the least and the greatest `t`.
pub(crate) struct BlockTest<'a, const N: usize>(PhantomData<&'a ()>);

impl<'a, const N: usize> Function for BlockTest<'a, N> {
    type A = (&'a [f32; N], usize);
    type B = (&'a TriangleRay, &'a SlabRay);
    type C = &'a Interval;
    type D = (f32, f32);
    type Output = BlockHits;

    #[inline(always)]
    fn run<S: Simd>(
        simd: S,
        (rows, count): (&'a [f32; N], usize),
        (ray, slab): (&'a TriangleRay, &'a SlabRay),
        clip: &'a Interval,
        range: (f32, f32),
    ) -> BlockHits {
        let count = (count - 1) % LANES + 1;
        hit(simd, Rows { rows, count }, count, ray, slab, clip, range)
    }
}

/// Where the corners of up to four triangles come from.
pub(crate) trait Corners: Copy {
    /// A corner of each: its coordinates along three axes, one after the other in the order of
    /// `x, y, z`, from any of them on.
    fn corner<S: Simd>(&self, simd: S, corner: usize, axes: [u8; 3]) -> [S::F4; 3];
}

/// Rows of `count` words, a triangle a lane.
#[derive(Clone, Copy)]
struct Rows<'a, const N: usize> {
    rows: &'a [f32; N],
    count: usize,
}

impl<const N: usize> Corners for Rows<'_, N> {
    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, corner: usize, [x, y, z]: [u8; 3]) -> [S::F4; 3] {
        const { assert!(N >= LANES * 9 + LANES + LANES) }
        [
            S::F4::load(simd, self.row(corner, x)),
            S::F4::load(simd, self.row(corner, y)),
            S::F4::load(simd, self.row(corner, z)),
        ]
    }
}

impl<const N: usize> Rows<'_, N> {
    #[inline(always)]
    fn row(&self, corner: usize, axis: u8) -> &[f32; LANES] {
        let start = (3 * corner + usize::from(axis & 3)) * self.count;
        let lanes = self.rows.get(start..start + LANES);
        lanes.and_then(<[f32]>::first_chunk).unwrap_or(&[0.0; LANES])
    }
}

/// [`BlockTest`] for triangles that move: the rows of two time steps, the part of the way between them that has passed, and
/// how many there are.
pub(crate) struct MovingTest<'a, const N: usize>(PhantomData<&'a ()>);

impl<'a, const N: usize> Function for MovingTest<'a, N> {
    type A = (&'a [&'a [f32; N]; 2], usize);
    type B = (&'a TriangleRay, &'a SlabRay);
    type C = &'a Interval;
    type D = (f32, f32, f32);
    type Output = BlockHits;

    #[inline(always)]
    fn run<S: Simd>(
        simd: S,
        ([before, then], count): (&'a [&'a [f32; N]; 2], usize),
        (ray, slab): (&'a TriangleRay, &'a SlabRay),
        clip: &'a Interval,
        (t_min, t_max, along): (f32, f32, f32),
    ) -> BlockHits {
        let count = (count - 1) % LANES + 1;
        let steps = [Rows { rows: before, count }, Rows { rows: then, count }];
        hit(simd, Moving { steps, along }, count, ray, slab, clip, (t_min, t_max))
    }
}

/// Rows that move from one place to another.
#[derive(Clone, Copy)]
struct Moving<'a, const N: usize> {
    steps: [Rows<'a, N>; 2],
    along: f32,
}

impl<const N: usize> Corners for Moving<'_, N> {
    /// As [`crate::math::pose::between`] writes it.
    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, corner: usize, axes: [u8; 3]) -> [S::F4; 3] {
        let [a, b, c] = self.steps[0].corner(simd, corner, axes);
        let [p, q, r] = self.steps[1].corner(simd, corner, axes);
        let along = S::F4::splat(simd, self.along);
        [a.add(along.mul(p.sub(a))), b.add(along.mul(q.sub(b))), c.add(along.mul(r.sub(c)))]
    }
}

/// What [`BlockTest`] says, of the first `count` triangles.
#[inline(always)]
pub(crate) fn hit<S: Simd>(
    simd: S,
    corners: impl Corners,
    count: usize,
    ray: &TriangleRay,
    slab: &SlabRay,
    clip: &Interval,
    range: (f32, f32),
) -> BlockHits {
    let splat = |x: f32| S::F4::splat(simd, x);

    // Move to the origin and shear.
    let origin = [splat(ray.origin[0]), splat(ray.origin[1]), splat(ray.origin[2])];
    let shear = [splat(ray.shear[0]), splat(ray.shear[1])];
    let a = sheared::<S>(corners.corner(simd, 0, ray.axes), origin, shear);
    let b = sheared::<S>(corners.corner(simd, 1, ray.axes), origin, shear);
    let c = sheared::<S>(corners.corner(simd, 2, ray.axes), origin, shear);

    // Strictly mixed signs are certain even in f32: worth asking first where f64 takes twice the
    // instructions (where it does not, most leaves that are reached are hit, and this cost 3 to 6 %).
    let mut mask = (1 << count) - 1;
    if !S::WIDE_DOUBLES {
        let zero = splat(0.0);
        let u = c[0].mul(b[1]).sub(c[1].mul(b[0]));
        let v = a[0].mul(c[1]).sub(a[1].mul(c[0]));
        let w = b[0].mul(a[1]).sub(b[1].mul(a[0]));
        let negative = u.lt(zero) | v.lt(zero) | w.lt(zero);
        let positive = zero.lt(u) | zero.lt(v) | zero.lt(w);
        mask &= !(negative & positive);
        if mask == 0 {
            return BlockHits::NONE;
        }
    }

    // Exact signs, then weights and `t`.
    let wide = |[x, y, z]: [S::F4; 3]| [S::D4::widen(x), S::D4::widen(y), S::D4::widen(z)];
    let (a, b, c) = (wide(a), wide(b), wide(c));
    let zero = S::D4::splat(simd, 0.0);
    let u = c[0].mul(b[1]).sub(c[1].mul(b[0]));
    let v = a[0].mul(c[1]).sub(a[1].mul(c[0]));
    let w = b[0].mul(a[1]).sub(b[1].mul(a[0]));
    mask &= !(u.min(v).min(w).lt(zero) & zero.lt(u.max(v).max(w)));
    if mask == 0 {
        return BlockHits::NONE;
    }
    let det = u.add(v).add(w);
    let share = S::D4::splat(simd, 1.0).div(det);
    let (v, w) = (v.mul(share), w.mul(share));
    let depth = a[2].add(v.mul(b[2].sub(a[2])).add(w.mul(c[2].sub(a[2]))));
    let mut t = depth.mul(S::D4::splat(simd, ray.reciprocal_z)).narrow();

    // The culling lemma: `t` lies where the triangle's own box is, and where the instances' are.
    let outside = !(splat(clip.entry).le(t) & t.le(splat(clip.exit)));
    if !ray.ordinary || outside & mask != 0 {
        // A determinant of zero makes `t` no number, and comparisons below say no.
        let infinite = S::D4::splat(simd, f64::INFINITY);
        let (met, inside) = clamped(simd, corners, slab, clip, t);
        mask &= met & det.lt(infinite) & S::D4::splat(simd, f64::NEG_INFINITY).lt(det);
        t = inside;
    }
    mask &= splat(range.0).le(t) & t.le(splat(range.1));
    BlockHits { mask, t: t.lanes(), u: v.narrow().lanes(), v: w.narrow().lanes() }
}

/// Corners moved to the origin and sheared. (A function, since closures in kernels may end up
/// outside of them.)
#[inline(always)]
fn sheared<S: Simd>([x, y, z]: [S::F4; 3], origin: [S::F4; 3], shear: [S::F4; 2]) -> [S::F4; 3] {
    let depth = z.sub(origin[2]);
    [x.sub(origin[0]).sub(shear[0].mul(depth)), y.sub(origin[1]).sub(shear[1].mul(depth)), depth]
}

/// `t` of each lane, clamped into the interval of the triangle's own box and of `clip`, and where
/// that is possible.
#[inline(always)]
fn clamped<S: Simd>(
    simd: S,
    corners: impl Corners,
    slab: &SlabRay,
    clip: &Interval,
    t: S::F4,
) -> (u32, S::F4) {
    let splat = |x: f32| S::F4::splat(simd, x);
    let a = corners.corner(simd, 0, [0, 1, 2]);
    let b = corners.corner(simd, 1, [0, 1, 2]);
    let c = corners.corner(simd, 2, [0, 1, 2]);
    let (mut entry, mut exit) = (splat(f32::NEG_INFINITY), splat(f32::INFINITY));
    for axis in 0..3 {
        let (lo, hi) = (c[axis].min(b[axis].min(a[axis])), c[axis].max(b[axis].max(a[axis])));
        let reciprocal = splat(slab.reciprocal(axis));
        let lower = lo.sub(splat(slab.side(0, axis))).mul(reciprocal);
        let upper = hi.sub(splat(slab.side(1, axis))).mul(reciprocal);
        // The lower side is not below the upper one, so the plane met first has the lesser `t`.
        entry = lower.min(upper).max(entry);
        exit = lower.max(upper).min(exit);
    }
    let entry = splat(clip.entry).max(entry);
    let exit = splat(clip.exit).min(exit);
    let finite = t.lt(splat(f32::INFINITY)) & splat(f32::NEG_INFINITY).lt(t);
    (entry.le(exit) & finite, exit.min(entry.max(t)))
}

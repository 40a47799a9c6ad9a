//! Up to four triangles against a ray at once: the test of [`super::triangle`], step by step, a
//! triangle a lane. The same bits as there; `tests/matrix.rs` holds them against each other.
//!
//! Exact signs, weights and `t` are computed in f64, of all lanes: a division in four lanes takes as
//! long as one. Where vectors hold fewer than four f64, f32 edge functions come first, and reject
//! most leaves that the ray misses.

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
        (entry, exit): (f32, f32),
    ) -> BlockHits {
        hit(simd, rows, count, ray, slab, clip, &Interval { entry, exit })
    }
}

#[inline(always)]
fn hit<S: Simd, const N: usize>(
    simd: S,
    rows: &[f32; N],
    count: usize,
    ray: &TriangleRay,
    slab: &SlabRay,
    clip: &Interval,
    range: &Interval,
) -> BlockHits {
    const { assert!(N >= LANES * 9 + LANES + LANES) }
    let count = (count - 1) % LANES + 1;
    let splat = |x: f32| S::F4::splat(simd, x);
    let row =
        |corner: usize, start: usize| S::F4::load(simd, row(rows, 3 * corner * count + start));

    // Move to the origin and shear.
    let [x, y, z] = ray.axes;
    let [x, y, z] = [usize::from(x & 3), usize::from(y & 3), usize::from(z & 3)];
    let [x, y, z] = [x * count, y * count, z * count];
    let origin = [splat(ray.origin[0]), splat(ray.origin[1]), splat(ray.origin[2])];
    let shear = [splat(ray.shear[0]), splat(ray.shear[1])];
    let sheared = |corner: usize| {
        let depth = row(corner, z).sub(origin[2]);
        [
            row(corner, x).sub(origin[0]).sub(shear[0].mul(depth)),
            row(corner, y).sub(origin[1]).sub(shear[1].mul(depth)),
            depth,
        ]
    };
    let (a, b, c) = (sheared(0), sheared(1), sheared(2));

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
        let (met, inside) = clamped(simd, rows, count, slab, clip, t);
        mask &= met & det.lt(infinite) & S::D4::splat(simd, f64::NEG_INFINITY).lt(det);
        t = inside;
    }
    mask &= splat(range.entry).le(t) & t.le(splat(range.exit));
    BlockHits { mask, t: t.lanes(), u: v.narrow().lanes(), v: w.narrow().lanes() }
}

/// `t` of each lane, clamped into the interval of the triangle's own box and of `clip`, and where
/// that is possible.
#[inline(always)]
fn clamped<S: Simd, const N: usize>(
    simd: S,
    rows: &[f32; N],
    count: usize,
    slab: &SlabRay,
    clip: &Interval,
    t: S::F4,
) -> (u32, S::F4) {
    let splat = |x: f32| S::F4::splat(simd, x);
    let row = |k: usize| S::F4::load(simd, row(rows, k * count));
    let (mut entry, mut exit) = (splat(f32::NEG_INFINITY), splat(f32::INFINITY));
    for axis in 0..3 {
        let (a, b, c) = (row(axis), row(3 + axis), row(6 + axis));
        let (lo, hi) = (c.min(b.min(a)), c.max(b.max(a)));
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

/// The lanes from a word on; nothing beyond the block.
#[inline(always)]
fn row<const N: usize>(rows: &[f32; N], start: usize) -> &[f32; LANES] {
    rows.get(start..start + LANES).and_then(<[f32]>::first_chunk).unwrap_or(&[0.0; LANES])
}

//! Rays of a stream or a packet: what a walk needs of each in one cache line, made for 16 of them at once.
//!
//! The same steps as [`SlabRay::new`], [`TriangleRay::new`] and `Slack::at`, a ray a lane, and the
//! same bits. Rays of a class share the signs of their directions and their longest axis, so that no
//! lane chooses anything.

use super::prepared::Prepared;
use super::slack::Slack;
use super::structure::Structure;
use crate::bounds::{Aabb, SlabRay, slab};
use crate::geometry::bundle::Bundle;
use crate::geometry::triangle::{NEXT, Ordinary, SLACK, TriangleRay, UNIT_ROUNDOFF, longest_axis};
use crate::math::Ray;
use crate::simd::{Floats, RayColumns, Scalar, Simd};

/// Rays that are prepared, and that triangles are tested against, at once.
pub(crate) const RAYS: usize = 16;

/// Classes of rays: the signs of three components, and which is the longest.
pub(crate) const CLASSES: usize = 8 * 3;

/// The signs of a direction's components, and the axis along which it is longest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Class(u8);

impl Class {
    /// Of a valid ray.
    #[inline(always)]
    pub(crate) fn of(ray: &Ray) -> Self {
        let sign = |axis: usize| (ray.direction[axis].to_bits() >> 31) as u8;
        let longest = longest_axis(ray.direction) as u8;
        Self(sign(0) | sign(1) << 1 | sign(2) << 2 | longest << 3)
    }

    /// `0 .. CLASSES`.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        usize::from(self.0) % CLASSES
    }

    /// By axis: 1 if rays meet the upper plane first.
    #[inline(always)]
    pub(crate) fn backward(self) -> [u8; 3] {
        [self.0 & 1, self.0 >> 1 & 1, self.0 >> 2 & 1]
    }

    /// What [`TriangleRay`] takes for x, y and z.
    #[inline(always)]
    pub(crate) fn axes(self) -> [u8; 3] {
        let z = self.0 >> 3;
        let [x, y] = NEXT[usize::from(z & 3)];
        [x, y, z]
    }
}

// The words of a record.
pub(crate) const NEAR: usize = 0;
pub(crate) const FAR: usize = 3;
pub(crate) const RECIPROCAL: usize = 6;
pub(crate) const T_MIN: usize = 9;
/// The greatest `t` that matters by now.
pub(crate) const T_MAX: usize = 10;
/// On the axes that triangles are tested on.
pub(crate) const ORIGIN: usize = 11;
pub(crate) const SHEAR: usize = 14;

/// What every step of a walk needs.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Record(pub(crate) [f32; 16]);

impl Record {
    #[inline(always)]
    pub(crate) fn triple(&self, first: usize) -> [f32; 3] {
        [self.0[first], self.0[first + 1], self.0[first + 2]]
    }
}

/// What few steps need.
#[derive(Clone, Copy)]
pub(crate) struct Rest {
    /// Where the ray is in the slice.
    pub(crate) slot: u32,
    /// The direction along the longest axis.
    pub(crate) along: f32,
}

/// The ray as single walks want it.
#[inline(always)]
pub(crate) fn prepared(
    record: &Record,
    rest: &Rest,
    class: Class,
    ray: &Ray,
    structure: &Structure,
) -> Prepared {
    let ordinary = structure.ordinary & Ordinary::ray(ray.origin, rest.along);
    let shear = [record.0[SHEAR], record.0[SHEAR + 1]];
    let slab = SlabRay::of_parts(
        record.triple(NEAR),
        record.triple(FAR),
        record.triple(RECIPROCAL),
        class.backward(),
    );
    let triangle = TriangleRay::of_parts(class.axes(), record.triple(ORIGIN), shear, rest.along);
    Prepared::of_parts(ray, slab, triangle.ordinary(ordinary))
}

/// The words of 16 records, a ray a lane.
pub(crate) type Columns = [[f32; RAYS]; 16];

/// The rays of columns as a bundle; `along` as [`Rest`] has it.
#[inline(always)]
pub(crate) fn bundle<'a>(class: Class, c: &'a Columns, along: &'a [f32; RAYS]) -> Bundle<'a> {
    Bundle {
        axes: class.axes(),
        backward: class.backward(),
        origin: [&c[ORIGIN], &c[ORIGIN + 1], &c[ORIGIN + 2]],
        shear: [&c[SHEAR], &c[SHEAR + 1]],
        along,
        near: [&c[NEAR], &c[NEAR + 1], &c[NEAR + 2]],
        far: [&c[FAR], &c[FAR + 1], &c[FAR + 2]],
        reciprocal: [&c[RECIPROCAL], &c[RECIPROCAL + 1], &c[RECIPROCAL + 2]],
        t_min: &c[T_MIN],
    }
}

/// Makes the records of up to 16 rays of a class; lanes beyond repeat the last ray.
#[inline(always)]
pub(crate) fn records<S: Simd>(
    simd: S,
    structure: &Structure,
    class: Class,
    rays: &[Ray],
    slots: &[u32],
    out: &mut [Record; RAYS],
) {
    let mut words = [[0.0; RAYS]; 16];
    columns(simd, structure, class, &gather(simd, rays, slots), &mut words);
    let mut rows = [[0.0; 16]; RAYS];
    transpose(simd, &words, &mut rows);
    for lane in 0..RAYS {
        out[lane].0 = rows[lane];
    }
}

/// Up to 16 rays side by side; lanes beyond repeat the last.
#[inline(always)]
pub(crate) fn gather<S: Simd>(simd: S, rays: &[Ray], slots: &[u32]) -> RayColumns {
    let mut borrowed = [&rays[slots[0] as usize]; RAYS];
    for lane in 1..RAYS {
        borrowed[lane] = &rays[slots[lane.min(slots.len() - 1)] as usize];
    }
    simd.rays(&borrowed)
}

/// The same as columns, of rays side by side; returns the directions along the longest axis.
#[inline(always)]
pub(crate) fn columns<S: Simd>(
    simd: S,
    structure: &Structure,
    class: Class,
    rays: &RayColumns,
    words: &mut Columns,
) -> [f32; RAYS] {
    let column = |i: usize| S::F16::load(simd, &rays[i]);
    let origin = [column(0), column(1), column(2)];
    let direction = [column(4), column(5), column(6)];

    // Widen.
    let splat = |x: f32| S::F16::splat(simd, x);
    let distance = distance(simd, &origin, &structure.reach);
    let slack = if structure.slack.is_of_triangles() {
        distance.mul(splat(UNIT_ROUNDOFF * SLACK))
    } else {
        S::F16::load(simd, &slacks(&distance.lanes(), &structure.slack))
    };

    // Prepare for boxes.
    let backward = class.backward();
    for axis in 0..3 {
        let ulp = abs(simd, origin[axis]).mul(splat(slab::WIDER * f32::EPSILON));
        let by = slack.mul(splat(slab::WIDER)).add(splat(f32::MIN_POSITIVE)).add(ulp);
        let (above, below) = (origin[axis].add(by), origin[axis].sub(by));
        let (near, far) = if backward[axis] == 1 { (below, above) } else { (above, below) };
        let reciprocal = splat(1.0).div(direction[axis]);
        let reciprocal = splat(f32::MAX).min(splat(f32::MIN).max(reciprocal));
        words[NEAR + axis] = near.lanes();
        words[FAR + axis] = far.lanes();
        words[RECIPROCAL + axis] = reciprocal.lanes();
    }
    words[T_MIN] = rays[3];
    words[T_MAX] = rays[7];

    // Prepare for triangles.
    let [x, y, z] = class.axes().map(|axis| usize::from(axis.min(2)));
    words[ORIGIN] = origin[x].lanes();
    words[ORIGIN + 1] = origin[y].lanes();
    words[ORIGIN + 2] = origin[z].lanes();
    let reciprocal = splat(1.0).div(direction[z]);
    words[SHEAR] = direction[x].mul(reciprocal).lanes();
    words[SHEAR + 1] = direction[y].mul(reciprocal).lanes();
    direction[z].lanes()
}

/// Rows to columns.
#[inline(always)]
fn transpose<S: Simd>(simd: S, rows: &[[f32; 16]; 16], columns: &mut [[f32; 16]; 16]) {
    let mut borrowed = [&rows[0]; 16];
    for i in 0..16 {
        borrowed[i] = &rows[i];
    }
    simd.transpose(&borrowed, columns);
}

/// The largest distance, per axis, from the origin to a corner of the reach.
#[inline(always)]
fn distance<S: Simd>(simd: S, origin: &[S::F16; 3], reach: &Aabb) -> S::F16 {
    let mut distance = S::F16::splat(simd, 0.0);
    for axis in 0..3 {
        let to_lo = S::F16::splat(simd, reach.lo[axis]).sub(origin[axis]);
        let to_hi = S::F16::splat(simd, reach.hi[axis]).sub(origin[axis]);
        distance = abs(simd, to_lo).max(abs(simd, to_hi).max(distance));
    }
    distance
}

/// Without the sign; that of zero is lost on nobody here.
#[inline(always)]
fn abs<S: Simd>(simd: S, x: S::F16) -> S::F16 {
    S::F16::splat(simd, 0.0).sub(x).max(x)
}

/// `Slack::at` for levels with instances.
#[cold]
#[inline(never)]
fn slacks(distances: &[f32; RAYS], slack: &Slack) -> [f32; RAYS] {
    let slack = |distance: f32| slack.at(Scalar, Floats::splat(Scalar, distance)).lanes()[0];
    distances.map(slack)
}

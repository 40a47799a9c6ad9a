//! One triangle against 16 rays at once: the test of [`super::triangle`], step by step, a ray a
//! lane. The same bits as there; `tests/slices.rs` holds them against each other.
//!
//! The rays of a bundle share the axes that become x, y and z, so that a corner is the same three
//! broadcast numbers for all of them.

use crate::bounds::Aabb;
use crate::simd::{Doubles, Floats, Simd};

/// Rays of a bundle.
pub(crate) const RAYS: usize = 16;

/// Lanes of the exact stage.
const QUAD: usize = 4;

/// 16 rays, as [`super::TriangleRay`] and `SlabRay` prepare them. Borrowed, not owned: a kilobyte
/// that moves costs more than a triangle.
#[derive(Clone, Copy)]
pub(crate) struct Bundle<'a> {
    /// Of all of them: the axes that become x, y and z.
    pub(crate) axes: [u8; 3],
    /// Of all of them: by axis, 1 if the upper plane is met first.
    pub(crate) backward: [u8; 3],
    pub(crate) origin: [&'a Lanes; 3],
    pub(crate) shear: [&'a Lanes; 2],
    /// Directions along the last of the axes.
    pub(crate) along: &'a Lanes,
    pub(crate) near: [&'a Lanes; 3],
    pub(crate) far: [&'a Lanes; 3],
    pub(crate) reciprocal: [&'a Lanes; 3],
    pub(crate) t_min: &'a Lanes,
}

/// A number of each ray.
pub(crate) type Lanes = [f32; RAYS];

/// Where rays hit a triangle.
pub(crate) struct Meetings {
    /// Bit `i`: ray `i` does.
    pub(crate) mask: u32,
    pub(crate) t: [f32; RAYS],
    pub(crate) u: [f32; RAYS],
    pub(crate) v: [f32; RAYS],
}

/// A triangle as 16 rays see it, and what f32 is certain of.
struct Seen<S: Simd> {
    /// Rays that may hit it.
    mask: u32,
    /// Rays for which all three signs are the same, and certain.
    certain: u32,
    /// The corners, moved and sheared.
    a: [S::F16; 3],
    b: [S::F16; 3],
    c: [S::F16; 3],
    /// Where the rays are in the triangle's own box.
    entry: S::F16,
    exit: S::F16,
}

impl Bundle<'_> {
    /// Which of the rays in `mask` hit the triangle up to `t_max`, and where.
    #[inline(always)]
    pub(crate) fn hit<S: Simd>(
        &self,
        simd: S,
        corners: &[[f32; 3]; 3],
        mask: u32,
        t_max: &Lanes,
    ) -> Option<Meetings> {
        let seen = self.see(simd, corners, mask, t_max)?;
        self.settled(simd, &seen, seen.mask, t_max)
    }

    /// Which of the rays in `mask` hit the triangle up to `t_max`, if it does not matter where.
    ///
    /// `tame` says that no ray of the bundle can make `t` or a sheared corner infinite. Where f32 is
    /// certain of all signs, the determinant is not zero; and where all of the triangle's own
    /// box counts, so does the `t` that is clamped into it, whatever it is.
    #[inline(always)]
    pub(crate) fn any<S: Simd>(
        &self,
        simd: S,
        corners: &[[f32; 3]; 3],
        mask: u32,
        t_max: &Lanes,
        tame: bool,
    ) -> u32 {
        let Some(seen) = self.see(simd, corners, mask, t_max) else { return 0 };
        let (t_min, end) = (S::F16::load(simd, self.t_min), S::F16::load(simd, t_max));
        let within = t_min.le(seen.entry) & seen.exit.le(end);
        let certain = if tame { seen.mask & seen.certain & within } else { 0 };
        let open = seen.mask & !certain;
        if open == 0 {
            return certain;
        }
        certain | self.settled(simd, &seen, open, t_max).map_or(0, |met| met.mask)
    }

    /// What f32 has to say.
    #[inline(always)]
    fn see<S: Simd>(
        &self,
        simd: S,
        corners: &[[f32; 3]; 3],
        mask: u32,
        t_max: &Lanes,
    ) -> Option<Seen<S>> {
        // Move to the origin and shear.
        let a = self.sheared(simd, &corners[0]);
        let b = self.sheared(simd, &corners[1]);
        let c = self.sheared(simd, &corners[2]);

        // Strictly mixed signs are certain even in f32.
        let zero = S::F16::splat(simd, 0.0);
        let u = c[0].mul(b[1]).sub(c[1].mul(b[0]));
        let v = a[0].mul(c[1]).sub(a[1].mul(c[0]));
        let w = b[0].mul(a[1]).sub(b[1].mul(a[0]));
        let [up, vp, wp] = [zero.lt(u), zero.lt(v), zero.lt(w)];
        let [un, vn, wn] = [u.lt(zero), v.lt(zero), w.lt(zero)];
        let mask = mask & !((un | vn | wn) & (up | vp | wp));
        if mask == 0 {
            return None;
        }

        // `t` is clamped to where each ray is in the triangle's own box.
        let (entry, exit) = self.inside(simd, &around(corners));
        let (t_min, t_max) = (S::F16::load(simd, self.t_min), S::F16::load(simd, t_max));
        let mask = mask & entry.max(t_min).le(exit.min(t_max));
        if mask == 0 {
            return None;
        }
        let certain = (un & vn & wn) | (up & vp & wp);
        Some(Seen { mask, certain, a, b, c, entry, exit })
    }

    /// Exact signs, weights and `t` of the rays in `mask`, four rays at a time.
    #[inline(always)]
    fn settled<S: Simd>(
        &self,
        simd: S,
        seen: &Seen<S>,
        mask: u32,
        t_max: &Lanes,
    ) -> Option<Meetings> {
        let mut met = Meetings { mask: 0, t: [0.0; RAYS], u: [0.0; RAYS], v: [0.0; RAYS] };
        let (a, b, c) = (lanes::<S>(seen.a), lanes::<S>(seen.b), lanes::<S>(seen.c));
        for first in (0..RAYS).step_by(QUAD) {
            if mask >> first & 0xF != 0 {
                self.settle(simd, &a, &b, &c, first, &mut met);
            }
        }
        met.mask &= mask;
        if met.mask == 0 {
            return None;
        }

        // The culling lemma: `t` lies where the triangle's own box is.
        let splat = |x: f32| S::F16::splat(simd, x);
        let t = S::F16::load(simd, &met.t);
        let finite = t.lt(splat(f32::INFINITY)) & splat(f32::NEG_INFINITY).lt(t);
        let t = seen.exit.min(seen.entry.max(t));
        let wanted = S::F16::load(simd, self.t_min).le(t) & t.le(S::F16::load(simd, t_max));
        met.mask &= seen.entry.le(seen.exit) & finite & wanted;
        met.t = t.lanes();
        Some(met)
    }

    /// A corner, moved to each ray's origin and sheared.
    #[inline(always)]
    fn sheared<S: Simd>(&self, simd: S, corner: &[f32; 3]) -> [S::F16; 3] {
        let [x, y, z] = self.axes;
        let [x, y, z] = [usize::from(x.min(2)), usize::from(y.min(2)), usize::from(z.min(2))];
        let splat = |axis: usize| S::F16::splat(simd, corner[axis]);
        let load = |lanes: &Lanes| S::F16::load(simd, lanes);
        let depth = splat(z).sub(load(self.origin[2]));
        [
            splat(x).sub(load(self.origin[0])).sub(load(self.shear[0]).mul(depth)),
            splat(y).sub(load(self.origin[1])).sub(load(self.shear[1]).mul(depth)),
            depth,
        ]
    }

    /// The exact stage for the four rays from `first` on.
    #[inline(always)]
    fn settle<S: Simd>(
        &self,
        simd: S,
        a: &[[f32; RAYS]; 3],
        b: &[[f32; RAYS]; 3],
        c: &[[f32; RAYS]; 3],
        first: usize,
        met: &mut Meetings,
    ) {
        let a = quad(simd, a, first);
        let b = quad(simd, b, first);
        let c = quad(simd, c, first);
        let zero = S::D4::splat(simd, 0.0);
        let u = c[0].mul(b[1]).sub(c[1].mul(b[0]));
        let v = a[0].mul(c[1]).sub(a[1].mul(c[0]));
        let w = b[0].mul(a[1]).sub(b[1].mul(a[0]));
        let mixed = u.min(v).min(w).lt(zero) & zero.lt(u.max(v).max(w));
        let det = u.add(v).add(w);
        let infinite = S::D4::splat(simd, f64::INFINITY);
        let sized = (zero.lt(det) & det.lt(infinite))
            | (det.lt(zero) & S::D4::splat(simd, f64::NEG_INFINITY).lt(det));
        let share = S::D4::splat(simd, 1.0).div(det);
        let (v, w) = (v.mul(share), w.mul(share));
        let depth = a[2].add(v.mul(b[2].sub(a[2])).add(w.mul(c[2].sub(a[2]))));
        let reciprocal = S::D4::splat(simd, 1.0).div(quad_of(simd, self.along, first));
        let t = depth.mul(reciprocal).narrow();
        met.mask |= (!mixed & sized & 0xF) << first;
        let places = first..first + QUAD;
        met.t[places.clone()].copy_from_slice(&t.lanes());
        met.u[places.clone()].copy_from_slice(&v.narrow().lanes());
        met.v[places].copy_from_slice(&w.narrow().lanes());
    }

    /// Which rays are in the box somewhere between `t_min` and `t_max`.
    #[inline(always)]
    pub(crate) fn meets<S: Simd>(&self, simd: S, bounds: &Aabb, t_max: &Lanes) -> u32 {
        let (entry, exit) = self.inside(simd, bounds);
        let (t_min, t_max) = (S::F16::load(simd, self.t_min), S::F16::load(simd, t_max));
        entry.max(t_min).le(exit.min(t_max))
    }

    /// Where the rays are in the box: the steps of `SlabRay::interval`.
    #[inline(always)]
    fn inside<S: Simd>(&self, simd: S, bounds: &Aabb) -> (S::F16, S::F16) {
        let splat = |x: f32| S::F16::splat(simd, x);
        let load = |lanes: &Lanes| S::F16::load(simd, lanes);
        let (mut entry, mut exit) = (splat(f32::NEG_INFINITY), splat(f32::INFINITY));
        for axis in 0..3 {
            let planes = [bounds.lo[axis], bounds.hi[axis]];
            let backward = usize::from(self.backward[axis] & 1);
            let (first, last) = (splat(planes[backward]), splat(planes[backward ^ 1]));
            let reciprocal = load(self.reciprocal[axis]);
            entry = first.sub(load(self.near[axis])).mul(reciprocal).max(entry);
            exit = last.sub(load(self.far[axis])).mul(reciprocal).min(exit);
        }
        (entry, exit)
    }
}

/// [`Aabb::of_points`] without a closure that might end up outside of the kernel.
#[inline(always)]
fn around([a, b, c]: &[[f32; 3]; 3]) -> Aabb {
    let mut bounds = Aabb { lo: *a, hi: *a };
    for axis in 0..3 {
        for corner in [b[axis], c[axis]] {
            let (lo, hi) = (bounds.lo[axis], bounds.hi[axis]);
            bounds.lo[axis] = if corner < lo { corner } else { lo };
            bounds.hi[axis] = if corner > hi { corner } else { hi };
        }
    }
    bounds
}

/// Vectors as they are stored.
#[inline(always)]
fn lanes<S: Simd>([x, y, z]: [S::F16; 3]) -> [[f32; RAYS]; 3] {
    [x.lanes(), y.lanes(), z.lanes()]
}

/// Four lanes of a point, as f64.
#[inline(always)]
fn quad<S: Simd>(simd: S, point: &[[f32; RAYS]; 3], first: usize) -> [S::D4; 3] {
    [
        quad_of(simd, &point[0], first),
        quad_of(simd, &point[1], first),
        quad_of(simd, &point[2], first),
    ]
}

#[inline(always)]
fn quad_of<S: Simd>(simd: S, lanes: &[f32; RAYS], first: usize) -> S::D4 {
    let quad = lanes.get(first..).and_then(<[f32]>::first_chunk);
    S::D4::widen(S::F4::load(simd, quad.unwrap_or(&[0.0; QUAD])))
}

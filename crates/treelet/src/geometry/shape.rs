//! What a scene holds under one `geom`: a triangle mesh, or primitives of another kind.
//!
//! Triangles are what walks are made for: packed side by side, tested four at a time. Every other kind is
//! a leaf of its own and tested out of line, one primitive a call, by `Shape::meet`: the same function that brute
//! force asks.
//!
//! # The culling lemma
//!
//! As for triangles ([`super::triangle`]): what is accepted at `t` lies, after clamping, in the interval in which the ray is
//! inside the primitive's own box ([`Shape::bounds`]) and inside those of the instances on the way. So no box of a
//! tree can cull it. Only what a caller's own code says ([`super::user`]) is not clamped but discarded if it lies
//! elsewhere.
//!
//! # Precision
//!
//! Spheres, discs and curves are solved in f64 from f32 input, so that `t` is good to a rounding of f32 but where
//! the ray grazes. There are no neighbours that edges could leak between; quads are two triangles, whose
//! edges are as watertight as a mesh's.

use super::curves::Curves;
use super::discs::Discs;
use super::mesh::{COORDINATE_MAX, Defect, Mesh};
use super::quads::Quads;
use super::spheres::Spheres;
use super::triangle::{Meeting, TriangleRay};
use super::user::User;
use crate::bounds::{Aabb, Interval, SlabRay};
use crate::math::{Ray, rounding};

/// Primitives of one kind: what a scene numbers as one `geom`.
///
/// Cheap to clone: arrays are shared.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Shape {
    /// Triangles.
    Mesh(Mesh),
    /// Pairs of triangles that share a diagonal.
    Quads(Quads),
    /// Spheres.
    Spheres(Spheres),
    /// Flat discs.
    Discs(Discs),
    /// Segments of round curves, their radius linear between two points.
    Curves(Curves),
    /// Whatever the caller's own code says, inside boxes.
    User(User),
}

macro_rules! from {
    ($($kind:ident)*) => {
        $(impl From<$kind> for Shape {
            fn from(shape: $kind) -> Self {
                Self::$kind(shape)
            }
        })*
    };
}

from! { Mesh Quads Spheres Discs Curves User }

/// A ray as a level sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local<'a> {
    /// In the level's space.
    pub(crate) ray: Ray,
    pub(crate) triangle: &'a TriangleRay,
    pub(crate) slab: &'a SlabRay,
    /// Where the instances on the way to the level allow a hit.
    pub(crate) clip: &'a Interval,
}

impl Local<'_> {
    /// The `t` that count.
    pub(super) fn range(&self) -> Interval {
        Interval { entry: self.ray.t_min, exit: self.ray.t_max }
    }

    /// Where the ray is in a box and in those of the instances; `None` if nowhere.
    fn inside(&self, bounds: &Aabb) -> Option<Interval> {
        let inside = self.slab.interval(bounds).intersection(self.clip);
        (!inside.is_empty()).then_some(inside)
    }

    /// The first of some meetings, in the order of `t`, that counts once it is clamped into the box.
    pub(super) fn first(&self, met: &[Met], bounds: &Aabb) -> Option<Meeting> {
        let (inside, range) = (self.inside(bounds)?, self.range());
        met.iter().find_map(|&Met { t, u }| {
            // Not finite: beyond f32, as of a ray that is parallel to what it should meet.
            let t = Some(t as f32).filter(|t| t.is_finite())?;
            let t = inside.clamp(t);
            (range.entry <= t && t <= range.exit).then_some(Meeting { t, u, v: 0.0 })
        })
    }

    /// Where a meeting lies, if it is inside a box and counts.
    pub(super) fn accept(&self, meeting: Meeting, bounds: &Aabb) -> Option<Meeting> {
        let (inside, range, t) = (self.inside(bounds)?, self.range(), meeting.t);
        let within = |of: &Interval| of.entry <= t && t <= of.exit;
        (within(&inside) && within(&range)).then_some(meeting)
    }
}

/// A meeting before it is rounded: where, and the surface's first parameter there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub(super) t: f64,
    pub(super) u: f32,
}

impl Shape {
    /// How many primitives.
    pub fn len(&self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.triangles().len(),
            Self::Quads(quads) => quads.quads().len(),
            Self::Spheres(spheres) => spheres.spheres().len(),
            Self::Discs(discs) => discs.discs().len(),
            Self::Curves(curves) => curves.segments().len(),
            Self::User(user) => user.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What its primitives are called.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Mesh(_) => "triangle",
            Self::Quads(_) => "quad",
            Self::Spheres(_) => "sphere",
            Self::Discs(_) => "disc",
            Self::Curves(_) => "curve segment",
            Self::User(_) => "user primitive",
        }
    }

    /// The triangles, if it is made of them.
    pub fn mesh(&self) -> Option<&Mesh> {
        if let Self::Mesh(mesh) = self { Some(mesh) } else { None }
    }

    /// What is wrong with primitive `prim`, if anything. It must be there.
    pub fn defect(&self, prim: usize) -> Option<Defect> {
        let own = match self {
            Self::Mesh(mesh) => return mesh.defect(prim),
            Self::Quads(quads) => quads.defect(prim),
            Self::Spheres(spheres) => spheres.defect(prim),
            Self::Discs(discs) => discs.defect(prim),
            Self::Curves(curves) => curves.defect(prim),
            Self::User(_) => None,
        };
        own.or_else(|| {
            let Aabb { lo, hi } = self.bounds(prim);
            let near = lo.iter().chain(&hi).all(|x| x.abs() <= COORDINATE_MAX);
            let ordered = lo.iter().zip(&hi).all(|(lo, hi)| lo <= hi);
            (!near || !ordered).then_some(Defect::BadBox { lo, hi })
        })
    }

    /// The box around primitive `prim`, rounded outward; empty if it, or a vertex of it, is not there.
    pub fn bounds(&self, prim: usize) -> Aabb {
        let bounds = match self {
            Self::Mesh(mesh) => mesh.corners(prim).map(|corners| Aabb::of_points(&corners)),
            Self::Quads(quads) => quads.corners(prim).map(|corners| Aabb::of_points(&corners)),
            Self::Spheres(spheres) => spheres.bounds(prim),
            Self::Discs(discs) => discs.bounds(prim),
            Self::Curves(curves) => curves.bounds(prim),
            Self::User(user) => user.bounds(prim),
        };
        bounds.unwrap_or(Aabb::EMPTY)
    }

    /// Where the ray meets primitive `prim` first, which has no defect, at its time. Only the ray itself and the
    /// primitive decide, not what has been found so far.
    pub(crate) fn meet(&self, prim: usize, local: &Local<'_>) -> Option<Meeting> {
        match self {
            Self::Mesh(mesh) => {
                let corners = mesh.corners_at(prim, local.ray.time)?;
                local.triangle.hit(&corners, local.slab, local.clip, &local.range())
            }
            Self::Quads(quads) => quads.meet(prim, local),
            Self::Spheres(spheres) => spheres.meet(prim, local),
            Self::Discs(discs) => discs.meet(prim, local),
            Self::Curves(curves) => curves.meet(prim, local),
            Self::User(user) => user.meet(prim, local),
        }
    }

    /// A vector that stands on primitive `prim` of no certain length, where a ray met it with `u` and `v`, at a time: `point`, in the
    /// same space. `None` if there is none, or it is nobody's.
    pub(crate) fn upright(
        &self,
        prim: usize,
        [u, v]: [f32; 2],
        point: [f64; 3],
        time: f32,
    ) -> Option<[f64; 3]> {
        match self {
            Self::Mesh(mesh) => Some(across(&mesh.corners_at(prim, time)?)),
            Self::Quads(quads) => quads.upright(prim, [u, v]),
            Self::Spheres(spheres) => spheres.upright(prim, point),
            Self::Discs(discs) => discs.upright(prim),
            Self::Curves(curves) => curves.upright(prim, u, point),
            Self::User(user) => user.upright(prim, point),
        }
    }

    /// Whether both are the same arrays in memory, not merely equal.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Mesh(a), Self::Mesh(b)) => a.is_same(b),
            (Self::Quads(a), Self::Quads(b)) => a.is_same(b),
            (Self::Spheres(a), Self::Spheres(b)) => a.is_same(b),
            (Self::Discs(a), Self::Discs(b)) => a.is_same(b),
            (Self::Curves(a), Self::Curves(b)) => a.is_same(b),
            (Self::User(a), Self::User(b)) => a.is_same(b),
            _ => false,
        }
    }
}

/// The box from `center - reach` to `center + reach`, rounded outward.
pub(super) fn box_around(center: [f32; 3], reach: [f64; 3]) -> Aabb {
    let side = |axis: usize, reach: f64| f64::from(center[axis]) + reach;
    Aabb {
        lo: [0, 1, 2].map(|axis: usize| rounding::down(side(axis, -reach[axis]))),
        hi: [0, 1, 2].map(|axis: usize| rounding::up(side(axis, reach[axis]))),
    }
}

/// A vector across the triangle, to the side from which its corners run counter-clockwise; zero if it has no area.
pub(super) fn across(corners: &[[f32; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    cross(minus(b, a), minus(c, a))
}

#[inline(always)]
pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + t b`.
#[inline(always)]
pub(crate) fn along(a: [f64; 3], t: f64, b: [f64; 3]) -> [f64; 3] {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

#[inline(always)]
pub(crate) fn wide([x, y, z]: [f32; 3]) -> [f64; 3] {
    [f64::from(x), f64::from(y), f64::from(z)]
}

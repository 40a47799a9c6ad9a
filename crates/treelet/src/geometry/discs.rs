//! Flat discs.

use super::mesh::Defect;
use super::shape::{Local, Met, along, box_around, dot, minus, wide};
use super::spheres::bad_radius;
use super::triangle::Meeting;
use crate::bounds::Aabb;
use crate::memory::Array;

/// A flat disc.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Disc {
    /// Its middle.
    pub center: [f32; 3],
    /// Its radius; the rim belongs to it.
    pub radius: f32,
    /// Stands on it; of any length but zero.
    pub normal: [f32; 3],
}

/// Discs: the points within the radius of a center, on the plane that the normal stands on. A ray within the plane misses it.
/// `u` and `v` of hits are 0.
#[derive(Clone, Debug, Default)]
pub struct Discs(Array<Disc>);

impl Discs {
    /// Over the given array: a `Vec` moves in without a copy, an [`Array`] is shared. Building a scene checks it.
    pub fn new(discs: impl Into<Array<Disc>>) -> Self {
        Self(discs.into())
    }

    /// All of them.
    pub fn discs(&self) -> &[Disc] {
        &self.0
    }

    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.0.same(&other.0)
    }

    pub(super) fn defect(&self, prim: usize) -> Option<Defect> {
        let &Disc { center, radius, normal } = self.0.get(prim)?;
        let stands = normal.iter().all(|x| x.is_finite()) && normal != [0.0; 3];
        let bad = (!stands).then_some(Defect::BadNormal { normal });
        bad_radius(center, radius).or(bad)
    }

    /// Along an axis, a disc reaches as far as the sine of the angle between that axis and its normal says.
    pub(super) fn bounds(&self, prim: usize) -> Option<Aabb> {
        let &Disc { center, radius, normal } = self.0.get(prim)?;
        // A part in 2^40 more than f64 loses.
        const MORE: f64 = 1.0 + 1.0 / (1_u64 << 40) as f64;
        let normal = wide(normal);
        let square = dot(normal, normal);
        let reach = [0, 1, 2].map(|axis: usize| {
            let [a, b] = [normal[(axis + 1) % 3], normal[(axis + 2) % 3]];
            f64::from(radius) * libm::sqrt((a * a + b * b) / square) * MORE
        });
        Some(box_around(center, reach))
    }

    pub(super) fn meet(&self, prim: usize, local: &Local<'_>) -> Option<Meeting> {
        let &Disc { center, radius, normal } = self.0.get(prim)?;
        let (direction, normal) = (wide(local.ray.direction), wide(normal));
        let origin = minus(wide(local.ray.origin), wide(center));
        // Parallel: not a number, or infinite, and then not a hit.
        let t = -dot(origin, normal) / dot(direction, normal);
        let point = along(origin, t, direction);
        let radius = f64::from(radius);
        if dot(point, point) > radius * radius {
            return None;
        }
        local.first(&[Met { t, u: 0.0 }], &self.bounds(prim)?)
    }

    pub(super) fn upright(&self, prim: usize) -> Option<[f64; 3]> {
        self.0.get(prim).map(|disc| wide(disc.normal))
    }
}

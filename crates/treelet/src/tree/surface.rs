//! What measuring a tree asks of the geometry below it.

use crate::bounds::Aabb;
use crate::geometry::Mesh;
use crate::geometry::area::{area, area_inside};

/// Primitives with a surface, named as in [`super::Tree::prims`].
pub trait Surface: Sync {
    /// The area of a primitive.
    fn area(&self, prim: u32) -> f64;

    /// The area of the part of a primitive inside the closed `region`.
    fn area_inside(&self, prim: u32, region: &Aabb) -> f64;

    /// The point of a primitive that two numbers in `0 .. 1` stand for: numbers that are spread
    /// evenly give points that are. Coordinates that all of a primitive shares are exact.
    fn point(&self, prim: u32, at: [f64; 2]) -> [f64; 3];
}

/// Primitive `i` is the mesh's triangle `i`; one that is not there has no area.
impl Surface for Mesh {
    fn area(&self, prim: u32) -> f64 {
        self.corners(prim as usize).map_or(0.0, |corners| area(&corners))
    }

    fn area_inside(&self, prim: u32, region: &Aabb) -> f64 {
        self.corners(prim as usize).map_or(0.0, |corners| area_inside(&corners, region))
    }

    fn point(&self, prim: u32, [u, v]: [f64; 2]) -> [f64; 3] {
        let corners = self.corners(prim as usize).unwrap_or_default();
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        // The half of the unit square beyond the diagonal is folded onto the other.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        [0, 1, 2].map(|i: usize| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]))
    }
}

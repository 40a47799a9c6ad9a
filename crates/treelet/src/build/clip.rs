//! What a builder may ask of the geometry beyond boxes: to cut a primitive, and where it belongs.

use crate::bounds::Aabb;

/// Primitives that can be cut, and that somebody put into groups.
pub trait Clip: Sync {
    /// The box around the part of a primitive inside `region`, itself inside `region`; empty if
    /// there is certainly no such part. Regions that cover a primitive give boxes that do.
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb;

    /// The half area that boxes around ever smaller parts of a primitive come to together: cutting
    /// saves no more than the rest of its own box. `None` if it is not to be cut at all.
    fn least_half_area(&self, _prim: u32) -> Option<f64> {
        Some(0.0)
    }

    /// The group of the modelling hierarchy that a primitive is in, such as the number of its mesh.
    /// Numbers never fall from a primitive to the next.
    fn group(&self, _prim: u32) -> u32 {
        0
    }
}

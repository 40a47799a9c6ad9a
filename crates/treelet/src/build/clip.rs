//! What a builder that splits primitives asks of the geometry.

use crate::bounds::Aabb;

/// Primitives that can be cut.
pub trait Clip: Sync {
    /// The box around the part of a primitive inside `region`, itself inside `region`; empty if
    /// there is certainly no such part. Regions that cover a primitive give boxes that do.
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb;
}

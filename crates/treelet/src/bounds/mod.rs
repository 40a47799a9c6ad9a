//! Conservative volumes: what is inside is certainly inside.

pub mod aabb;
pub mod slab;

pub use aabb::Aabb;
pub use slab::{Interval, SlabRay};

//! Conservative volumes: what is inside is certainly inside.

pub mod aabb;
mod cover;
mod double;
pub mod kdop;
pub mod obb;
pub mod slab;
pub mod sphere;
pub mod volume;

pub use aabb::Aabb;
pub(crate) use cover::Cover;
pub use kdop::{Dop14, Dop18, Dop26, KDop};
pub use obb::Obb;
pub use slab::{Interval, SlabRay};
pub use sphere::Sphere;
pub use volume::Volume;

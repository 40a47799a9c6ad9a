//! What a ray can hit, and what it answers.

pub mod area;
pub(crate) mod block;
pub(crate) mod bundle;
pub mod clip;
pub mod hit;
pub mod mesh;
pub mod triangle;

pub use hit::Hit;
pub use mesh::{Defect, Mesh};
pub use triangle::{Meeting, TriangleRay};

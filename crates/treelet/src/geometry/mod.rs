//! What a ray can hit.

pub mod hit;
pub mod mesh;
pub mod triangle;

pub use hit::Hit;
pub use mesh::Mesh;

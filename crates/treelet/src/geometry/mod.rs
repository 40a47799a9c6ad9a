//! What a ray can hit, and what it answers.

pub mod area;
pub(crate) mod block;
pub(crate) mod bundle;
pub mod clip;
pub mod curves;
pub mod discs;
pub mod hit;
pub mod mesh;
pub mod quads;
pub mod shape;
pub mod spheres;
pub mod triangle;
pub mod user;

pub use curves::Curves;
pub use discs::{Disc, Discs};
pub use hit::Hit;
pub use mesh::{Defect, Mesh};
pub use quads::Quads;
pub use shape::Shape;
pub use spheres::Spheres;
pub use triangle::{Meeting, TriangleRay};
pub use user::{Primitives, User};

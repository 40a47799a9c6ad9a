#![doc = "stub"]
#![cfg_attr(not(feature = "std"), no_std)]
extern crate alloc;
pub mod math;
pub mod memory;
pub mod bounds {
    pub mod aabb;
    pub use aabb::Aabb;
}
pub mod geometry {
    pub mod hit;
    pub mod mesh;
    pub mod triangle {
        pub fn is_degenerate(_: &[[f32; 3]; 3]) -> bool {
            false
        }
    }
    pub use hit::Hit;
    pub use mesh::Mesh;
}
pub use geometry::{Hit, Mesh};
pub use math::Ray;

//! Vectors, affine maps, rays and outward rounding: plain arrays and free functions, nothing fused.
//!
//! Everything here that decides a `t`, an order or a tree is written with separate multiplications
//! and additions in one fixed order, so that every machine rounds alike.

pub mod affine;
#[cfg(feature = "glam")]
mod glam;
pub mod morton;
pub(crate) mod pose;
pub mod ray;
pub mod rounding;
pub mod vec3;

pub use affine::Affine;
pub use ray::Ray;

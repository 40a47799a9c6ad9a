//! Ray queries on geometry, from one triangle to a billion.
//!
//! A [`Mesh`] borrows or owns vertex and index arrays; a [`Scene`] is built over meshes, other shapes
//! ([`geometry::Shape`]: quads, spheres, discs, curves, primitives of the caller's own) and
//! instances of other scenes, and answers [`Ray`]s:
//!
//! - [`Scene::closest`]: the first hit;
//! - [`Scene::any`]: whether there is one;
//! - [`Scene::count`], [`Scene::all`]: every hit, each once, in order;
//! - the same for slices of rays on all cores: [`Scene::closest_many`] and its sisters.
//!
//! Two promises hold for all of them. *The answer belongs to the geometry*: no builder, layout,
//! batch size or number of threads changes a bit of it. *No ray slips through* a closed mesh,
//! wherever it is placed: the triangle test is watertight and no box culls what it accepts
//! ([`geometry::triangle`] says why).
//!
//! # Features
//!
//! - `std` (default): the clock for build reports, `std::error::Error` conveniences.
//! - `rayon` (default): parallel builds and slices on the caller's pool.
//! - `glam`: conversions between `glam` types and the plain arrays of this interface.
//!
//! Without default features the library is `no_std` and needs `alloc`.

#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

pub mod bounds;
pub mod build;
pub mod context;
pub mod geometry;
pub mod layout;
pub mod math;
pub mod memory;
pub mod optimize;
mod query;
pub mod scene;
pub mod simd;
pub mod trace;
pub mod tree;
pub mod verify;

pub use bounds::Aabb;
pub use build::BuildError;
pub use context::{Cancel, Cancelled, Context};
pub use geometry::{Hit, Mesh};
pub use math::{Affine, Ray};
pub use scene::{
    BuildOptions, BuildReport, Candidate, Choice, HitLists, Invalid, Pilot, Quality, Scene,
    SceneBuilder, SceneError, WrongLength,
};
pub use trace::Counters;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

//! The builder from how many rays are coming: [`Quality::for_rays`](super::Quality::for_rays).
//!
//! A tree costs its build and then every ray that walks it, so the best builder depends on their number:
//! T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies",
//! HPG 2013, figure 1, draw that for any builder. Nobody who builds a scene should have to read that figure.

pub(super) mod model;
pub(super) mod pilot;
pub(super) mod search;
pub(super) mod table;
mod words;

pub(super) use search::{build, recipe, told};
pub(super) use table::RAY_NS;

#[cfg(doc)]
use super::Recipe;
use crate::math::Ray;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

/// Some of the rays to come, for [`Quality::Rays`](super::Quality::Rays) and
/// [`Quality::Auto`](super::Quality::Auto) to try trees with. No other quality looks at them.
///
/// The rays to come are taken to be like these: as many of them ask [`closest`](crate::Scene::closest) and
/// [`any`](crate::Scene::any) as there are rays in the one slice and the other, in this order. So give
/// stretches of rays that are asked one after the other rather than every thousandth ray: neighbours
/// find each other's nodes in the cache. Some 4,096 tell builders apart, 65,536 tell times to a few percent.
///
/// Where both are empty, the library makes its own: from points all over the surfaces, by cosine, asked for the
/// closest hit, as diffuse light would.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pilot<'a> {
    /// Asked for the closest hit.
    pub closest: &'a [Ray],
    /// Asked whether there is any hit.
    pub any: &'a [Ray],
}

impl Pilot<'_> {
    /// Whether there is no ray at all.
    pub fn is_empty(&self) -> bool {
        self.closest.is_empty() && self.any.is_empty()
    }
}

/// What was chosen, and why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// For how many rays. [`Quality::Auto`](super::Quality::Auto) expects as many as were asked before.
    pub rays: u64,
    /// What the scene was built with: the name of a [`Recipe`].
    pub variant: String,
    /// The time that build and rays take together, all choosing included, as it was expected when choosing ended.
    pub predicted: Duration,
    /// Time that went into the choice: trees that were tried and left, and the rays that tried them. It is part of
    /// the report's `total_time`.
    pub choosing: Duration,
    /// Why this one, in a sentence.
    pub reason: String,
    /// All that could have been chosen; what is usually built sooner comes first.
    pub candidates: Vec<Candidate>,
}

/// A way to build, and what it was expected, or found, to cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The name of a [`Recipe`].
    pub variant: String,
    /// Time to build the tree and pack it.
    pub build: Duration,
    /// Time of a ray, in nanoseconds, all threads of the pool tracing, one ray a call.
    pub ray_ns: f64,
    /// Whether it was built here and its rays traced; otherwise both numbers are expected ones.
    pub measured: bool,
}

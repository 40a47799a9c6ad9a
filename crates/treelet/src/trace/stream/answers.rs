//! What streams and packets tell about hits.

use crate::trace::walk::{Found, Visitor};
use core::ops::Range;

/// What a stream tells about its rays' hits, and keeps of them between lists.
pub(crate) trait Answers<'a> {
    /// Sees the hits of one ray in one part of the tree.
    type Visitor: Visitor<'a>;

    /// Whether finding near hits early saves work. If not, large boxes come first.
    const NEAREST_FIRST: bool;

    /// For the ray in `slot`, which wants hits up to `t_max`.
    fn visitor(&self, slot: usize, t_max: f32) -> Self::Visitor;

    /// Keeps what the visitor, made for `t_max`, saw; the greatest `t` that still matters to that ray.
    fn settle(&mut self, slot: usize, t_max: f32, visitor: Self::Visitor) -> f32;

    /// Keeps a hit of the ray in `slot` if it comes before what is kept.
    fn keep(&mut self, slot: usize, found: Found<'a>);

    /// The answer for the ray in `slot`, whatever was kept.
    fn put(&mut self, slot: usize, found: Option<Found<'a>>);

    /// Forgets what is kept of these rays.
    fn clear(&mut self, slots: Range<usize>);

    /// The best of what a visitor saw, if it is to be known before it settles.
    fn best(visitor: &Self::Visitor) -> Option<Found<'a>>;
}

//! Questions, one a file: what a visitor makes of the hits of a walk.

pub(crate) mod all;
pub(crate) mod any;
pub(crate) mod closest;
pub(crate) mod count;

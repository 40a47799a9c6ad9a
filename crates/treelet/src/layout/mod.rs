//! Layouts: the packed forms of a tree that a walk reads.

pub(crate) mod collapse;
pub(crate) mod lower;
mod select;
pub mod wide;
mod write;

use crate::build::Info;

/// Every layout, in the order of the documentation.
pub static ALL: &[Info] = &[wide::INFO_8, wide::INFO_16];

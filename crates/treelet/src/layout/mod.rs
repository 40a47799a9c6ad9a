//! Layouts: the packed forms of a tree that a walk reads.

pub(crate) mod collapse;
pub mod compact;
pub(crate) mod lower;
pub(crate) mod packing;
mod select;
pub mod wide;
mod write;

use crate::build::Info;

/// Every layout, in the order of the documentation.
pub static ALL: &[Info] = &[wide::INFO_8, wide::INFO_16, compact::INFO_8, compact::INFO_16];

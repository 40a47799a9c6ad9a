//! Layouts: the packed forms of a tree that a walk reads.

pub mod binary;

use crate::build::Info;

/// Every layout, in the order of the documentation.
pub static ALL: &[Info] = &[binary::INFO];

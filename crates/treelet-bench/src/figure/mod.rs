//! The figure of the field: rays a second against how many rays are traced, construction included.
//!
//! `data` is what is measured, `envelope` who wins where.

pub mod data;
pub mod envelope;

//! The engines: treelet, and those that it is measured against, one a file.

pub mod embree;
pub mod treelet;

use crate::engine::{Engine, EngineError};

/// Every rival's name, as `--against` takes it.
pub const NAMES: [&str; 5] = ["embree", "obvhs", "bvh", "parry", "tinybvh"];

/// The rival of that name.
///
/// # Errors
///
/// It is not there, and what would bring it.
pub fn rival(name: &str, wishes: &embree::Wishes) -> Result<Box<dyn Engine>, EngineError> {
    match name {
        embree::NAME => Ok(Box::new(embree::Embree::load(wishes)?)),
        _ => Err(EngineError::Missing(format!(
            "{name} is not in this program; build it with `--features rivals`"
        ))),
    }
}

//! The engines: treelet, and those that it is measured against, one a file.

#[cfg(feature = "rivals")]
mod bvh;
pub mod embree;
#[cfg(feature = "rivals")]
mod obvhs;
#[cfg(feature = "rivals")]
mod parry;
#[cfg(feature = "rivals")]
mod singles;
#[cfg(feature = "rivals")]
mod tinybvh;
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
        #[cfg(feature = "rivals")]
        obvhs::NAME => Ok(Box::new(obvhs::Obvhs)),
        #[cfg(feature = "rivals")]
        bvh::NAME => Ok(Box::new(bvh::BvhCrate)),
        #[cfg(feature = "rivals")]
        parry::NAME => Ok(Box::new(parry::Parry)),
        #[cfg(feature = "rivals")]
        tinybvh::NAME => Ok(Box::new(tinybvh::TinyBvh)),
        _ => Err(EngineError::Missing(format!(
            "{name} is not in this program; build it with `--features rivals`"
        ))),
    }
}

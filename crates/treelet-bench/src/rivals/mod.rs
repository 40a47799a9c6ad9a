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
        // The handles of tinybvh-rs 0.1.0-beta.3 may not leave the thread that made them, and its
        // 8-wide layout is there only in programs compiled for AVX2 throughout.
        "tinybvh" => Err(EngineError::Missing(
            "the bench cannot drive it: tinybvh-rs keeps its trees to one thread".into(),
        )),
        _ => Err(EngineError::Missing(format!(
            "{name} is not in this program; build it with `--features rivals`"
        ))),
    }
}

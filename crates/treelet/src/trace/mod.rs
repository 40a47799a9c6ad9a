//! Walks: how a ray finds the few triangles worth testing, and what that costs.

pub mod counters;
mod descent;
mod instance;
mod leaf;
pub(crate) mod motion;
pub(crate) mod moving;
pub(crate) mod packet;
pub(crate) mod pending;
pub(crate) mod placements;
pub(crate) mod prepared;
pub(crate) mod record;
pub(crate) mod slack;
pub(crate) mod stream;
pub(crate) mod structure;
pub(crate) mod walk;

pub use counters::Counters;

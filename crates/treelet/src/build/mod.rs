//! Builders: boxes in, a binary tree out. One builder a file, and the catalogue of them all.
//!
//! A builder sees boxes, never triangles. Whatever it does, answers to rays do not change: only
//! their price does. Named builders give the same tree for any number of threads.

mod bins;
mod bottom_up;
pub mod clip;
mod curve_leaves;
mod curve_order;
mod fill_leaves;
mod groups;
mod lanes;
pub mod presplit;
mod prim_ref;
mod radix_sort;
pub(crate) mod restructure;
#[cfg(test)]
mod samples;
pub(crate) mod top_down;

pub use clip::Clip;
pub use presplit::Presplit;

use crate::bounds::Aabb;
use crate::context::{Cancelled, Context};
use crate::memory::OutOfMemory;
use crate::tree::Tree;

/// What a catalogue says about an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Info {
    /// As users write it.
    pub name: &'static str,
    /// What it does, in a line.
    pub summary: &'static str,
    /// Where it comes from.
    pub source: &'static str,
}

/// Makes trees.
pub trait Builder: Sync {
    /// Name, summary and source.
    fn info(&self) -> Info;

    /// A tree over the primitives with these boxes, none of them empty, NaN or infinite.
    ///
    /// # Errors
    ///
    /// An option out of range, too many primitives, cancellation, memory.
    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError>;

    /// The same for primitives that can be cut. A builder that cuts may put a primitive into several
    /// leaves, whose boxes then contain a part of it each, and all of it together; all others do
    /// not look at `clip`.
    ///
    /// # Errors
    ///
    /// As [`Builder::build`].
    fn build_clipped(
        &self,
        bounds: &[Aabb],
        _clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        self.build(bounds, context)
    }

    /// The builder that this one hands its work to, if it only prepares it.
    fn inner(&self) -> Option<&dyn Builder> {
        None
    }
}

/// Why there is no tree.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A builder's option is out of range.
    #[error("{option} is {value}; it must be in {allowed}")]
    Option {
        /// Its name.
        option: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// More primitives than indices.
    #[error(
        "{prims} primitives in one tree; the limit is 2^29 - 8: split the scene into instances"
    )]
    TooManyPrims {
        /// How many.
        prims: u64,
    },
    /// More leaves than a compact layout's words can address.
    #[error(
        "{bytes} bytes of leaves; compact layouts hold at most 2 GiB a tree: choose a wide layout, \
         or split the scene into instances"
    )]
    TooManyBytes {
        /// How many.
        bytes: u64,
    },
    /// The caller's `Context` was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Memory for arrays as large as the input was refused.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
}

macro_rules! catalogue {
    ($($module:ident::$builder:ident),* $(,)?) => {
        $(pub mod $module; pub use $module::$builder;)*

        /// Every builder with its default options, in the order of the documentation.
        pub static ALL: &[&dyn Builder] = &[$(&$module::$builder::DEFAULT),*];

        /// The same in the same order, each after [`Presplit`].
        pub static PRESPLIT: &[Presplit<'static>] =
            &[$(Presplit::before(&$module::$builder::DEFAULT)),*];
    };
}

catalogue! {
    scene_graph::SceneGraph,
    spatial_median::SpatialMedian,
    object_median::ObjectMedian,
    sweep_sah::SweepSah,
    binned_sah::BinnedSah,
    lbvh::Lbvh,
    hlbvh::Hlbvh,
    ploc::Ploc,
    hploc::Hploc,
    aac::Aac,
    agglomerative::Agglomerative,
    trbvh::Trbvh,
    sbvh::Sbvh,
}

/// The builder of that name, with its default options; `presplit+NAME` is the one after
/// [`Presplit`].
pub fn by_name(name: &str) -> Option<&'static dyn Builder> {
    if let Some((Presplit::NAME, name)) = name.split_once('+') {
        let named = |each: &&Presplit<'_>| each.builder.info().name == name;
        return PRESPLIT.iter().find(named).map(|each| each as &dyn Builder);
    }
    ALL.iter().copied().find(|builder| builder.info().name == name)
}

/// Leaves hold at most this many primitives, whatever a builder is asked for.
pub const LEAF_MAX: u32 = 64;

/// Checks the option that all builders share.
fn check_leaf_max(leaf_max: u32) -> Result<(), BuildError> {
    check_option("leaf_max", f64::from(leaf_max), 1.0..=f64::from(LEAF_MAX), "1..=64")
}

/// Checks an option against what is allowed; NaN is not.
pub(crate) fn check_option(
    option: &'static str,
    value: f64,
    range: core::ops::RangeInclusive<f64>,
    allowed: &'static str,
) -> Result<(), BuildError> {
    let ok = range.contains(&value);
    if ok { Ok(()) } else { Err(BuildError::Option { option, value, allowed }) }
}

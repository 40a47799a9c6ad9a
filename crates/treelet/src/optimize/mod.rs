//! Optimisers: a binary tree in, a better one out. One optimiser a file, and the catalogue of them
//! all.
//!
//! An optimiser sees boxes, never triangles. It never raises the cost that it optimises, and like
//! builders it gives the same tree for any number of threads.

mod pairs;
mod search;

use crate::build::{BuildError, Info, check_option};
use crate::context::Context;
use crate::tree::Tree;

/// Improves trees.
pub trait Optimizer: Sync {
    /// Name, summary and source.
    fn info(&self) -> Info;

    /// A tree over the same entries that is no dearer, from a valid one. Leaves end up in the
    /// order of [`Tree::prims`], so that every subtree is a range of it.
    ///
    /// # Errors
    ///
    /// An option out of range, cancellation, memory.
    fn optimize(&self, tree: Tree, context: &Context<'_>) -> Result<Tree, BuildError>;
}

macro_rules! catalogue {
    ($($module:ident::$optimizer:ident),* $(,)?) => {
        $(pub mod $module; pub use $module::$optimizer;)*

        /// Every optimiser with its default options, in the order of the documentation.
        pub static ALL: &[&dyn Optimizer] = &[$(&$module::$optimizer::DEFAULT),*];
    };
}

catalogue! {
    reinsertion::Reinsertion,
    top_reinsertion::TopReinsertion,
    treelets::Treelets,
    rotations::Rotations,
    insertion::Insertion,
}

/// Checks the options that several optimisers have: a share of nodes, and the share of the cost that a
/// round must save for another to follow.
fn check_shares(share: f32, gain_min: f32) -> Result<(), BuildError> {
    check_option("share", f64::from(share), 0.0..=1.0, "0..=1")?;
    check_option("gain_min", f64::from(gain_min), 0.0..=1.0, "0..=1")
}

/// The optimiser of that name, with its default options.
pub fn by_name(name: &str) -> Option<&'static dyn Optimizer> {
    ALL.iter().copied().find(|optimizer| optimizer.info().name == name)
}

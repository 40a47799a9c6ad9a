//! Treelet restructuring: the few nodes at the top of every subtree arranged in the best way there is,
//! in rounds.
//!
//! Source: T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", HPG 2013. How it is done, and where it differs: `build/restructure/`, which
//! [`crate::build::Trbvh`] is made of too.
//!
//! What this does may be covered by US 2014/0365532 and US 2014/0365529 (NVIDIA); their legal state is
//! unknown to us. No quality level uses it.

use super::Optimizer;
use crate::build::restructure::{LEAVES, Rounds, restructure};
use crate::build::{BuildError, Info, check_option};
use crate::context::Context;
use crate::tree::Tree;

/// Arranges treelets in the best way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Treelets {
    /// Rounds over the tree, in `0..=32`; round `i` looks at subtrees of at least `leaves_min * 2^i`
    /// leaves.
    pub rounds: u32,
    /// In `7..=1000000`; a tree of fewer leaves is one treelet.
    pub leaves_min: u32,
}

impl Treelets {
    /// Three rounds.
    pub const DEFAULT: Self = Self { rounds: 3, leaves_min: LEAVES as u32 };
}

impl Optimizer for Treelets {
    fn info(&self) -> Info {
        Info {
            name: "treelets",
            summary: "arranges seven subtrees at a time in the best way",
            source: "Karras and Aila 2013",
        }
    }

    fn optimize(&self, tree: Tree, context: &Context<'_>) -> Result<Tree, BuildError> {
        check_option("rounds", f64::from(self.rounds), 0.0..=32.0, "0..=32")?;
        check_option("leaves_min", f64::from(self.leaves_min), 7.0..=1e6, "7..=1000000")?;
        let Self { rounds: count, leaves_min } = *self;
        restructure(tree, Rounds { count, leaves_min, block: 0 }, context)
    }
}

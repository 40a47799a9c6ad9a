//! Treelet restructuring: the few nodes at the top of every subtree arranged in the best way there is,
//! in rounds.
//!
//! Source: T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", HPG 2013. How it is done, and where it differs: `build/restructure/`, which
//! [`crate::build::Trbvh`] is made of too.
//!
//! The cost is the sum of the inner nodes' surface areas: leaves move as they are.
//!
//! Measured after `lbvh` (SAH at one a visit and one a triangle): 13.1 falls to 11.5 in a coffee maker of
//! 0.2 M triangles, 78.0 to 68.0 in a car of 0.8 M, 47.9 to 33.5 in a kitchen of 1.4 M; single rays are 1.10
//! (coffee maker) and 1.22 (kitchen) times as many a second. After `binned-sah` in the coffee maker: 12.2 to
//! 11.1. Three rounds more gained 1 to 2 %, which is noise.
//!
//! Cost: 40 ms of one core for three rounds over 82,000 leaves.
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

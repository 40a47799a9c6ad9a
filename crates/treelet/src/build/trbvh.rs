//! TRBVH: the hierarchy of the Morton curve, its treelets then arranged in the best way there is, in
//! rounds.
//!
//! Source: T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", HPG 2013: leaves of one primitive by Morton codes of 63 bits ([`super::lbvh`]), three
//! rounds over treelets of seven leaves (`restructure`, which says where it differs).
//!
//! Leaves: subtrees of up to `leaf_max` primitives cost one area in the dynamic programming (the paper's
//! second term, at the price of the blocks of four that layouts test at once), and become leaves.
//!
//! Measured: single rays a second, one thread, as a share of `sbvh`'s, geometric mean over primary, occlusion
//! and diffuse rays and twelve scenes of 0.08 to 1.6 million triangles: 0.92 (`lbvh` 0.84, `hlbvh` 0.92,
//! `sweep-sah` 0.99); a turbine blade 1.02, a car 1.03, a kitchen and a house 0.87, arches 0.71. Paper: over 0.90,
//! with its triangles split before. Here that loses: 0.83 after [`super::presplit`], between 0.72 (a building)
//! and 0.95 (fur), and it helps in fur and the arches only (0.93 and 0.71 become 0.95 and 0.77). SAH: the car's falls from `lbvh`'s 78.0 to
//! 67.8, the coffee maker's from 13.1 to 11.6. About 1.5 M triangles a second and core.
//!
//! Leaves of one primitive and no price for blocks lost: 0.87 of `sbvh` where blocks have 0.96 (random
//! rays in the coffee maker). `lbvh+treelets`, whose leaves are the curve's runs of up to four, is built
//! at 2.5 times the rate and traces at 1.01, 0.99 and 0.91 (coffee maker, kitchen, car).
//!
//! What this does may be covered by US 2014/0365532 and US 2014/0365529 (NVIDIA); their legal state is
//! unknown to us. No quality level uses it.

use super::restructure::{LEAVES, Rounds, restructure};
use super::{BuildError, Builder, Info, Lbvh, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::Context;
use crate::tree::Tree;

/// Restructures the hierarchy of the Morton curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trbvh {
    /// Most primitives in a leaf, in `1..=64`: so many cost what one does.
    pub leaf_max: u32,
    /// Rounds over the tree, in `0..=32`.
    pub rounds: u32,
}

impl Trbvh {
    /// Leaves of up to four, three rounds.
    pub const DEFAULT: Self = Self { leaf_max: 4, rounds: 3 };
}

impl Builder for Trbvh {
    fn info(&self) -> Info {
        Info {
            name: "trbvh",
            summary: "rearranges the Morton curve's tree, seven subtrees at a time, in the best way",
            source: "Karras and Aila 2013",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_option("rounds", f64::from(self.rounds), 0.0..=32.0, "0..=32")?;
        check_leaf_max(self.leaf_max)?;
        let tree = Lbvh { leaf_max: 1, ..Lbvh::DEFAULT }.build(bounds, context)?;
        let block = if self.leaf_max > 1 { self.leaf_max } else { 0 };
        let rounds = Rounds { count: self.rounds, leaves_min: LEAVES as u32, block };
        restructure(tree, rounds, context)
    }
}

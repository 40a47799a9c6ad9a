//! AAC: greedy clustering of a few clusters at a time, range by range of the Morton curve.
//!
//! Source: Y. Gu, Y. He, K. Fatahalian and G. Blelloch, "Efficient BVH Construction via Approximate
//! Agglomerative Clustering", HPG 2013: a range of `n` primitives hands `f(n) = c n^(1/2 - epsilon)`
//! clusters upward, with `c` such that ranges of `delta` hand up half as many. Differs from it: areas
//! are computed when they are needed, eight at a time, instead of being kept in a matrix; of equal
//! areas the lower pair wins, so that equal boxes become a balanced tree; by default clustering starts
//! from leaves that the curve cut, which is 2.5 to 3.2 times as fast.
//!
//! O(n) time, for any `epsilon > 0`. From leaves, a tree too deep is given up for that of `lbvh`.
//!
//! Measured as in `lbvh`, M triangles/s and cost (which is not the order of tracing speeds between
//! families of builders):
//!
//! | | coffee | kitchen | car | fur |
//! |---|---|---|---|---|
//! | default: HQ from leaves | 12, 11.8 | 11, 33.3 | 9.7, 73.0 | 10, 162 |
//! | the same, `delta` 10 | 14, 11.6 | 13, 33.1 | 12, 73.1 | 12, 164 |
//! | HQ from primitives | 4.4, 11.3 | 3.6, 31.6 | 3.4, 71.9 | 3.7, 156 |
//! | Fast from primitives | 6.0, 11.7 | 4.4, 32.1 | 4.3, 70.1 | 4.7, 160 |
//! | `agglomerative` | 0.40, 11.5 | 0.32, 32.3 | 0.40, 74.1 | 0.31, 151 |
//! | `binned-sah` | 8.0, 12.2 | 9.3, 39.4 | 8.0, 70.2 | 8.6, 146 |
//!
//! So it is as good as exact clustering within 3.2 % from primitives, and within 3.1 % from leaves, but
//! for fur (7.6 %), whose triangles are long and thin.
//!
//! Tried and lost: looking at once, not when it matters, for new partners of those who lost theirs:
//! 2 to 6 % more time; the same loops on two registers of the baseline: 2.6 times the time (a kitchen, from primitives).

mod table;

use super::bottom_up::{self, Below, Cluster, Cut, Join, Part};
use super::fill_leaves::fill_leaves;
use super::lbvh::Lbvh;
use super::{BuildError, Builder, Info, LEAF_MAX, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::{Context, Stage};
use crate::math::morton::CODE_BITS;
use crate::simd::{Checked, Level};
use crate::tree::{DEPTH_MAX, Tree};
use alloc::vec::Vec;
use core::sync::atomic::AtomicU64;
use table::{Reduce, Table};

/// Joins the pair with the smallest box among the clusters of a range of the Morton curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aac {
    /// Most primitives in a leaf, in `1..=64`.
    pub leaf_max: u32,
    /// Whether clustering starts from ranges of the curve that fill a leaf, not, as in the paper, from
    /// primitives, of which subtrees become leaves in the end.
    pub from_leaves: bool,
    /// Ranges of up to so many of those, in `2..=64`, are clustered as one. More make better trees and
    /// cost time.
    pub delta: u32,
    /// How fast lists shrink, in `0..=0.5`: ranges hand up `n^(0.5 - epsilon)` clusters, times a
    /// constant. Less makes better trees and costs time.
    pub epsilon: f32,
}

impl Aac {
    /// The paper's AAC-HQ over leaves of up to four.
    pub const DEFAULT: Self = Self { leaf_max: 4, from_leaves: true, delta: 20, epsilon: 0.1 };
    /// The paper's AAC-HQ.
    pub const HQ: Self = Self { from_leaves: false, ..Self::DEFAULT };
    /// The paper's AAC-Fast.
    pub const FAST: Self = Self { delta: 4, epsilon: 0.2, ..Self::HQ };
}

impl Builder for Aac {
    fn info(&self) -> Info {
        Info {
            name: "aac",
            summary: "joins the pair with the smallest box, range by range of the Morton curve",
            source: "Gu et al. 2013",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        check_option("delta", f64::from(self.delta), 2.0..=f64::from(LEAF_MAX), "2..=64")?;
        check_option("epsilon", f64::from(self.epsilon), 0.0..=0.5, "0..=0.5")?;
        let leaf_max = if self.from_leaves { self.leaf_max } else { 1 };
        let cut = Cut { leaf_max, code_bits: CODE_BITS };
        let (tree, depth) = bottom_up::build(&Handing::new(self), cut, bounds, context)?;
        if !self.from_leaves {
            let quiet = Context { cancel: context.cancel.clone(), progress: None };
            return fill_leaves(&tree, self.leaf_max, &Stage::new(&quiet, "build", 0));
        }
        if depth > DEPTH_MAX {
            return Lbvh { leaf_max: self.leaf_max, ..Lbvh::DEFAULT }.build(bounds, context);
        }
        Ok(tree)
    }
}

/// Ranges up to this size find what they hand up in a list.
const LISTED: usize = 1024;

/// How many clusters ranges hand up.
struct Handing {
    delta: usize,
    factor: f64,
    exponent: f64,
    /// By the size of the range.
    listed: Vec<usize>,
    /// The tree is the same at every level.
    level: Checked,
}

impl Handing {
    fn new(aac: &Aac) -> Self {
        let (delta, epsilon) = (f64::from(aac.delta), f64::from(aac.epsilon));
        let factor = 0.5 * libm::pow(delta, 0.5 + epsilon);
        let exponent = 0.5 - epsilon;
        let level = Level::best().checked().unwrap_or(Checked::SCALAR);
        let delta = aac.delta as usize;
        let mut handing = Self { delta, factor, exponent, listed: Vec::new(), level };
        handing.listed = (0..=LISTED).map(|leaves| handing.compute(leaves)).collect();
        handing
    }

    /// `f(n)`; ranges of less than `delta` hand up as many as those of `delta`.
    fn compute(&self, leaves: usize) -> usize {
        let most = self.factor * libm::pow(leaves.max(self.delta) as f64, self.exponent);
        (most as usize).max(1)
    }

    fn most(&self, leaves: usize) -> usize {
        self.listed.get(leaves).copied().unwrap_or_else(|| self.compute(leaves))
    }
}

/// Ranges that wait for their right sibling.
#[derive(Default)]
struct Open {
    /// The lists of all ranges, one after the other.
    clusters: Vec<Cluster>,
    ranges: Vec<Range>,
    table: Table,
}

/// A range of the curve.
struct Range {
    /// Where its list begins.
    begin: usize,
    leaves: usize,
    /// Where it parts from the next; rises from range to range.
    level: u8,
}

impl Join for Handing {
    type Open = Open;

    fn push(&self, open: &mut Open, part: &Part<'_>, below: &mut Below<'_>) {
        let mut range =
            Range { begin: open.clusters.len(), leaves: part.leaves, level: part.level };
        open.clusters.extend_from_slice(part.clusters);
        self.reduce(open, &range, self.most(range.leaves), below);
        while let Some(left) = open.ranges.pop_if(|left| left.level > part.level) {
            range = Range { begin: left.begin, leaves: left.leaves + range.leaves, ..range };
            self.reduce(open, &range, self.most(range.leaves), below);
        }
        open.ranges.push(range);
    }

    fn finish(&self, open: &mut Open, count: usize, below: &mut Below<'_>) -> Vec<Cluster> {
        // Level 0 ended every range.
        let all = Range { begin: 0, leaves: 0, level: 0 };
        self.reduce(open, &all, count, below);
        open.ranges.clear();
        core::mem::take(&mut open.clusters)
    }

    fn keep(&self, leaves: &mut [AtomicU64]) -> usize {
        leaves.len().min(self.most(leaves.len()))
    }
}

impl Handing {
    /// Joins clusters of a range, the last one, until at most `most` are left.
    fn reduce(&self, open: &mut Open, range: &Range, most: usize, below: &mut Below<'_>) {
        let clusters = &mut open.clusters[range.begin..];
        if clusters.len() > most {
            let left = self.level.run(Reduce { table: &mut open.table, clusters, most, below });
            open.clusters.truncate(range.begin + left);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build(aac: &Aac, bounds: &[Aabb]) -> Tree {
        aac.build(bounds, &Context::default()).unwrap()
    }

    #[test]
    fn ranges_of_delta_hand_up_half_as_many_and_larger_ones_a_power() {
        let handing = Handing::new(&Aac::HQ);
        assert_eq!([1, 20].map(|leaves| handing.most(leaves)), [10, 10]);
        // 20 times as many hand up 20^0.4 = 3.31 times as many.
        assert_eq!(handing.most(400), 33);
        assert_eq!(handing.most(160_000), 10 * 36 + 4);
        assert_eq!(Handing::new(&Aac::FAST).most(4), 2);
        // A piece finds in its list what it is to hand up.
        for aac in [Aac::HQ, Aac::FAST, Aac { delta: 2, epsilon: 0.5, ..Aac::HQ }] {
            let handing = Handing::new(&aac);
            let most = |leaves: usize| leaves.min(handing.most(leaves));
            for all in 2..2000 {
                for part in [1, 2, all / 3, all / 2] {
                    assert!(most(part) + most(all - part) >= most(all), "{part} of {all}");
                }
            }
        }
    }

    #[test]
    fn equal_boxes_do_not_become_chains() {
        let bounds = alloc::vec![Aabb { lo: [0.0; 3], hi: [1.0; 3] }; 1 << 14];
        for aac in [Aac { leaf_max: 1, ..Aac::HQ }, Aac { leaf_max: 1, ..Aac::FAST }] {
            let depth = build(&aac, &bounds).stats().depth;
            assert!(depth <= 18, "15 would be perfect, {aac:?} has {depth}");
        }
    }

    #[test]
    fn what_would_be_too_deep_is_mended() {
        let around = |i: i32| {
            let half = 1.01_f32.powi(i - 2500);
            Aabb { lo: [-half; 3], hi: [half; 3] }
        };
        let bounds: Vec<Aabb> = (0..5000).map(around).collect();
        for aac in [Aac::DEFAULT, Aac::HQ, Aac { leaf_max: 1, ..Aac::DEFAULT }] {
            let tree = build(&aac, &bounds);
            tree.validate(&bounds).unwrap_or_else(|error| panic!("{aac:?}: {error}"));
        }
    }

    #[test]
    fn options_out_of_range_are_named() {
        let check = |aac: Aac, option: &str| {
            let error = aac.build(&[], &Context::default()).unwrap_err();
            assert!(matches!(error, BuildError::Option { option: bad, .. } if bad == option));
        };
        for delta in [0, 1, 65] {
            check(Aac { delta, ..Aac::DEFAULT }, "delta");
        }
        for epsilon in [-0.1, 0.51, f32::NAN] {
            check(Aac { epsilon, ..Aac::DEFAULT }, "epsilon");
        }
        check(Aac { leaf_max: 65, ..Aac::DEFAULT }, "leaf_max");
    }
}

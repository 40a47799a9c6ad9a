//! AAC: greedy clustering of a few clusters at a time, range by range of the Morton curve.
//!
//! Source: Y. Gu, Y. He, K. Fatahalian and G. Blelloch, "Efficient BVH Construction via Approximate
//! Agglomerative Clustering", HPG 2013: a range of `n` primitives hands `f(n) = c n^(1/2 - epsilon)`
//! clusters upward, with `c` such that ranges of `delta` hand up half as many. Differs from it: areas
//! are computed when they are needed, eight at a time, instead of being kept in a matrix; of equal
//! areas the lower pair wins, so that equal boxes become a balanced tree; subtrees that fit become
//! leaves.
//!
//! O(n) time, for any `epsilon > 0`.

mod table;

use super::bottom_up::{self, Below, Cluster, Cut, Join, Part};
use super::fill_leaves::fill_leaves;
use super::{BuildError, Builder, Info, LEAF_MAX, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::{Context, Stage};
use crate::math::morton::CODE_BITS;
use crate::simd::{Checked, Level};
use crate::tree::Tree;
use alloc::vec::Vec;
use core::sync::atomic::AtomicU64;
use table::{Reduce, Table};

/// Joins the pair with the smallest box among the clusters of a range of the Morton curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aac {
    /// Most primitives in a leaf, in `1..=64`. Subtrees up to this size become leaves.
    pub leaf_max: u32,
    /// Ranges of the curve up to this size, in `2..=64`, are clustered as one. More make better trees
    /// and cost time.
    pub delta: u32,
    /// How fast lists shrink, in `0..=0.5`: ranges hand up `n^(0.5 - epsilon)` clusters, times a
    /// constant. Less makes better trees and costs time.
    pub epsilon: f32,
}

impl Aac {
    /// The paper's AAC-HQ.
    pub const DEFAULT: Self = Self { leaf_max: 4, delta: 20, epsilon: 0.1 };
    /// The paper's AAC-Fast.
    pub const FAST: Self = Self { leaf_max: 4, delta: 4, epsilon: 0.2 };
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
        let cut = Cut { leaf_max: self.delta, code_bits: CODE_BITS };
        let (tree, _) = bottom_up::build(&Handing::new(self), cut, bounds, context)?;
        let quiet = Context { cancel: context.cancel.clone(), progress: None };
        fill_leaves(&tree, self.leaf_max, &Stage::new(&quiet, "build", 0))
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
        handing.listed = (0..=LISTED).map(|prims| handing.compute(prims)).collect();
        handing
    }

    /// `f(n)`; ranges of less than `delta` hand up as many as those of `delta`.
    fn compute(&self, prims: usize) -> usize {
        let most = self.factor * libm::pow(prims.max(self.delta) as f64, self.exponent);
        (most as usize).max(1)
    }

    fn most(&self, prims: usize) -> usize {
        self.listed.get(prims).copied().unwrap_or_else(|| self.compute(prims))
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
    prims: usize,
    /// Where it parts from the next; rises from range to range.
    level: u8,
}

impl Join for Handing {
    type Open = Open;
    const SINGLES: bool = true;

    fn push(&self, open: &mut Open, part: &Part<'_>, below: &mut Below<'_>) {
        let mut range = Range { begin: open.clusters.len(), prims: part.prims, level: part.level };
        open.clusters.extend_from_slice(part.clusters);
        self.reduce(open, &range, self.most(range.prims), below);
        while let Some(left) = open.ranges.pop_if(|left| left.level > part.level) {
            range = Range { begin: left.begin, prims: left.prims + range.prims, ..range };
            self.reduce(open, &range, self.most(range.prims), below);
        }
        open.ranges.push(range);
    }

    fn finish(&self, open: &mut Open, count: usize, below: &mut Below<'_>) -> Vec<Cluster> {
        // Level 0 ended every range.
        let all = Range { begin: 0, prims: 0, level: 0 };
        self.reduce(open, &all, count, below);
        open.ranges.clear();
        core::mem::take(&mut open.clusters)
    }

    fn keep(&self, clusters: usize, _marks: &mut [AtomicU64]) -> usize {
        clusters.min(self.most(clusters))
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

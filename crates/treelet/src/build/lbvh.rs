//! LBVH: the hierarchy that Morton codes make by themselves. The fastest builder; poor trees.
//!
//! Sources: C. Lauterbach, M. Garland, S. Sengupta, D. Luebke and D. Manocha, "Fast BVH Construction
//! on GPUs", Computer Graphics Forum 28(2), 2009; T. Karras, "Maximizing Parallelism in the
//! Construction of BVHs, Octrees, and k-d Trees", HPG 2012, whose topology this is: every range is
//! cut at the highest bit in which its codes differ, equal codes by their places. Differs from it: all
//! pieces of the curve are made at once, not all nodes: in a piece, one sweep with a stack makes
//! topology and boxes, so that no node searches for its ends and none is waited for; small ranges
//! become leaves.
//!
//! O(n) time. Measured on one thread of a 2-core Xeon, boxes to tree, M triangles/s, with the cost by
//! the surface area heuristic (1 a node, 1 a triangle; between families of builders it is not the
//! order of tracing speeds):
//!
//! | | coffee | kitchen | car | fur |
//! |---|---|---|---|---|
//! | 63 bits | 28, 13.1 | 29, 47.9 | 32, 78.0 | 29, 170 |
//! | 30 bits | 35, 13.1 | 37, 48.0 | 34, 78.1 | 30, 170 |
//! | 63 bits, leaves of one | 17, 13.3 | 11, 51.4 | 12, 81.6 | 15, 185 |
//! | 30 bits, leaves of one | 25, 13.4 | 17, 51.4 | 16, 81.7 | 14, 185 |
//!
//! 63 bits are the default all the same: where all that is interesting lies in a few cells of 30 bits,
//! those cut it without looking.

use super::bottom_up::{self, Below, Cluster, Cut, Join, Part};
use super::curve_order::BUCKET_BITS_MAX;
use super::{BuildError, Builder, Info, check_leaf_max, check_option};
use crate::bounds::Aabb;
use crate::context::Context;
use crate::math::morton::CODE_BITS;
use crate::tree::Tree;
use alloc::vec::Vec;
use core::sync::atomic::AtomicU64;

/// Cuts ranges of the Morton curve at the highest bit that differs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lbvh {
    /// Most primitives in a leaf, in `1..=64`. Ranges up to this size are not cut.
    pub leaf_max: u32,
    /// Bits of a code, in `11..=63`. 30 are sorted in less time, and enough where cells of about a
    /// 1024th of the scene's length hold few primitives; 63 tell apart almost all that f32 does.
    pub code_bits: u32,
}

impl Lbvh {
    /// Leaves of up to four, codes of 63 bits.
    pub const DEFAULT: Self = Self { leaf_max: 4, code_bits: CODE_BITS };
}

impl Builder for Lbvh {
    fn info(&self) -> Info {
        Info {
            name: "lbvh",
            summary: "cuts the Morton curve where the highest bit of its codes differs",
            source: "Lauterbach et al. 2009; Karras 2012",
        }
    }

    fn build(&self, bounds: &[Aabb], context: &Context<'_>) -> Result<Tree, BuildError> {
        check_leaf_max(self.leaf_max)?;
        let allowed = f64::from(BUCKET_BITS_MAX)..=f64::from(CODE_BITS);
        check_option("code_bits", f64::from(self.code_bits), allowed, "11..=63")?;
        let cut = Cut { leaf_max: self.leaf_max, code_bits: self.code_bits };
        bottom_up::build(self, cut, bounds, context).map(|(tree, _)| tree)
    }
}

impl Join for Lbvh {
    /// Clusters that wait for a right sibling, each with the level at which it parts from the next;
    /// levels rise.
    type Open = Vec<(Cluster, u8)>;

    #[inline(always)]
    fn push(&self, open: &mut Self::Open, part: &Part<'_>, below: &mut Below<'_>) {
        let mut last = part.clusters[0];
        while let Some((left, parts)) = open.last()
            && *parts > part.level
        {
            last = below.join(left, &last);
            open.pop();
        }
        open.push((last, part.level));
    }

    fn finish(&self, open: &mut Self::Open, _count: usize, _below: &mut Below<'_>) -> Vec<Cluster> {
        // Level 0 ended every range.
        open.drain(..).map(|(cluster, _)| cluster).collect()
    }

    fn keep(&self, _leaves: &mut [AtomicU64]) -> usize {
        1
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve_order::Split;
    use super::*;
    use crate::math::morton::Curve;
    use crate::tree::{Kind, PRIMS_MAX};
    use core::ops::Range;

    /// The definition: cut at the highest bit in which codes differ, equal codes by place.
    struct Naive {
        /// In order.
        codes: Vec<(u64, u32)>,
        leaf_max: usize,
    }

    impl Naive {
        fn new(bounds: &[Aabb], leaf_max: usize, code_bits: u32) -> Self {
            let points = bounds.iter().map(Aabb::center);
            let centers = points.fold(Aabb::EMPTY, |all, p| all.union(&Aabb { lo: p, hi: p }));
            let split = Split::new(bounds.len(), code_bits);
            let curve = Curve::new(centers.lo, centers.hi, split.coarse_bits);
            let code = |bounds: &Aabb| {
                let cell = curve.cell(bounds.center());
                let all = curve.coarse(cell) << (CODE_BITS - split.coarse_bits) | curve.fine(cell);
                all >> (CODE_BITS - code_bits)
            };
            let mut codes: Vec<_> = bounds.iter().map(code).zip(0..).collect();
            codes.sort_unstable();
            Self { codes, leaf_max }
        }

        /// The sides of a range, or `None` for a leaf.
        fn cut(&self, range: &Range<usize>) -> Option<[Range<usize>; 2]> {
            if range.len() <= self.leaf_max {
                return None;
            }
            let [first, last] = [range.start, range.end - 1].map(|at| self.codes[at].0);
            let middle = if first == last {
                range.start + (1 << (range.len() - 1).ilog2())
            } else {
                let bit = (first ^ last).ilog2();
                let codes = &self.codes[range.clone()];
                range.start + codes.partition_point(|&(code, _)| code >> bit == first >> bit)
            };
            Some([range.start..middle, middle..range.end])
        }
    }

    fn check(name: &str, bounds: &[Aabb], leaf_max: u32, code_bits: u32) {
        let name = &alloc::format!("{name}, codes of {code_bits} bits");
        let tree = Lbvh { leaf_max, code_bits }.build(bounds, &Context::default()).unwrap();
        tree.validate(bounds).unwrap_or_else(|error| panic!("{name}: {error}"));
        let naive = Naive::new(bounds, leaf_max as usize, code_bits);
        let sorted = |mut prims: Vec<u32>| {
            prims.sort_unstable();
            prims
        };
        let mut open = alloc::vec![(0, 0..bounds.len())];
        let mut leaves = 0;
        while let Some((node, range)) = open.pop() {
            match (tree.nodes[node].kind(), naive.cut(&range)) {
                (Kind::Inner { left }, Some([a, b])) => open.extend([(left, a), (left + 1, b)]),
                (Kind::Leaf { first, count }, None) => {
                    leaves += 1;
                    let expected = naive.codes[range].iter().map(|&(_, prim)| prim).collect();
                    let prims = sorted(tree.prims[first..first + count].to_vec());
                    assert_eq!(prims, sorted(expected), "{name}, leaves of {leaf_max}");
                }
                (kind, cut) => panic!("{name}, leaves of {leaf_max}: {kind:?} for {cut:?}"),
            }
        }
        assert_eq!(tree.nodes.len(), 2 * leaves - 1, "{name}");
    }

    #[test]
    fn every_range_is_cut_at_the_highest_bit_that_differs() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let at = |p: [f32; 3]| Aabb { lo: p, hi: p };
        let mut scenes: Vec<(&str, Vec<Aabb>)> = Vec::new();
        for count in [1, 2, 3, 5, 64, 65, 3000, 30_000] {
            let mut point = || at([random(), random(), random()]);
            scenes.push(("random", (0..count).map(|_| point()).collect()));
        }
        let steps = |x: f32, n: f32| (x * n) as u32 as f32;
        let coarse = |random: &mut dyn FnMut() -> f32| at([(); 3].map(|()| steps(random(), 9.0)));
        scenes.push(("duplicates", (0..20_000).map(|_| coarse(&mut random)).collect()));
        scenes.push(("all equal", alloc::vec![at([0.5, 0.25, 8.0]); 9_001]));
        let speck = |x: f32| 1.0 + steps(x, 100.0) * f32::EPSILON;
        let mut specks: Vec<_> =
            (0..20_000).map(|_| at([speck(random()), speck(random()), 1.0])).collect();
        specks.push(at([9.0e5, -2.0e5, 3.0e5]));
        scenes.push(("a speck far from another", specks));
        // They differ in no bit that buckets are sorted by, but in the first word.
        let mut crowd: Vec<_> =
            (0..20_000).map(|_| at([(); 3].map(|()| random() * 1.0e-4))).collect();
        crowd.push(at([1.0; 3]));
        scenes.push(("a crowd in a corner", crowd));
        let line = |i: u32| at([1.5_f32.powi((i % 150) as i32 - 70), 0.0, 0.0]);
        scenes.push(("lopsided", (0..20_000).map(line).collect()));
        scenes.push((
            "huge",
            (0..3000).map(|_| at([(); 3].map(|()| (random() - 0.5) * f32::MAX))).collect(),
        ));
        scenes
            .push(("tiny", (0..3000).map(|_| at([(); 3].map(|()| random() * 1.0e-38))).collect()));
        scenes.push(("flat", (0..9000).map(|_| at([random(), 3.0, random() * 1.0e-3])).collect()));
        for (name, bounds) in &scenes {
            for (leaf_max, code_bits) in
                [(1, 63), (1, 30), (1, 57), (4, 63), (4, 30), (5, 11), (64, 63)]
            {
                check(name, bounds, leaf_max, code_bits);
            }
        }
    }

    /// The level in which the code's bits and the places among equals run out is the last one.
    #[test]
    fn no_code_makes_too_deep_a_tree() {
        let places = PRIMS_MAX.ilog2();
        assert!(CODE_BITS + places < crate::tree::DEPTH_MAX);
    }
}

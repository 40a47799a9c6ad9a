//! Treelet restructuring: the few nodes at the top of every subtree arranged in the best way there is.
//!
//! Source: T. Karras and T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", HPG 2013. A treelet is a node and its largest descendants, seven of them at its
//! edge; dynamic programming over the 2^7 sets of those ([`best`]) finds the cheapest of the 10,395
//! binary trees over them. Every node's treelet is arranged once a round, from below to above; every
//! round looks at fewer and larger subtrees.
//!
//! Differs from the paper: where a warp works on one treelet, vectors work on eight at once, one a
//! lane, all of the same height; a treelet changes only if its areas fall in f64, so the cost never
//! rises; and the price of a leaf is one area for a block of primitives, which layouts test at once
//! (`layout/collapse.rs`), or leaves stay as they are.
//!
//! What this does may be covered by US 2014/0365532 and US 2014/0365529 (NVIDIA); their legal state is
//! unknown to us. No quality level uses it; reinsertion (`optimize/reinsertion.rs`) does that work.
//!
//! Cost: three rounds over the curve's tree of 235,000 triangles with leaves of up to four, 82,000 of them:
//! 0.04 s of one core, with leaves of one 0.14 s.

mod best;
mod treelet;

pub(crate) use treelet::LEAVES;

use super::BuildError;
use crate::context::{Context, Stage};
use crate::simd::{Checked, Level};
use crate::tree::Tree;
use crate::tree::sweep::{Below, Rearrange, Root, Stopped, Sweep};
use best::{LANES, Sets, Solve};
use treelet::Treelet;

/// How a tree is restructured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounds {
    pub(crate) count: u32,
    /// Round `i` looks at subtrees of at least `leaves_min * 2^i` leaves.
    pub(crate) leaves_min: u32,
    /// Subtrees of up to so many leaves cost what one block of primitives does, and become leaves: for
    /// trees whose leaves have one primitive each. 0 for leaves that stay as they are.
    pub(crate) block: u32,
}

/// Rounds of restructuring over a tree.
pub(crate) fn restructure(
    tree: Tree,
    Rounds { count, leaves_min, block }: Rounds,
    context: &Context<'_>,
) -> Result<Tree, BuildError> {
    // Three leaves can be arranged in more than one way; two cannot.
    if tree.nodes.len() < 5 && block == 0 || tree.nodes.is_empty() {
        return Ok(tree);
    }
    let stage = Stage::new(context, "restructuring", u64::from(count));
    // The tree is the same at every level.
    let level = Level::best().checked().unwrap_or(Checked::SCALAR);
    let mut sweep = Sweep::new(tree, &context.cancel)?;
    // Every node's treelet counts, then those of half as many nodes, and half as many again.
    let first = leaves_min.min(sweep.leaves());
    for round in 0..count {
        let leaves_min = first.checked_shl(round).filter(|least| *least <= sweep.leaves());
        if let Some(leaves_min) = leaves_min {
            sweep.run(&Restructure { block, level }, leaves_min, &context.cancel)?;
        }
        stage.advance(1);
    }
    Ok(sweep.into_tree(block.max(1), &context.cancel)?)
}

/// Arranges treelets in the best way.
struct Restructure {
    block: u32,
    level: Checked,
}

impl Rearrange for Restructure {
    fn rearrange(&self, below: &mut Below<'_>, roots: &[Root]) -> f64 {
        let mut sets = Sets::new(self.block);
        let mut gain = 0.0;
        for roots in roots.chunks(LANES) {
            let mut treelets = [Treelet::NONE; LANES];
            for (lane, root) in roots.iter().enumerate() {
                treelets[lane] = Treelet::form(below, root, self.block);
                treelets[lane].load(root, &mut sets, lane);
            }
            self.level.run(Solve(&mut sets));
            for (lane, root) in roots.iter().enumerate() {
                gain += treelets[lane].rebuild(below, root, &sets, lane);
            }
        }
        gain
    }
}

impl From<Stopped> for BuildError {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::Cancelled => Self::Cancelled(crate::Cancelled),
            Stopped::OutOfMemory(error) => Self::OutOfMemory(error),
        }
    }
}

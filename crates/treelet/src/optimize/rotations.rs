//! Tree rotations: a node's child changes places with a grandchild, wherever that lowers the cost.
//!
//! Source: A. Kensler, "Tree Rotations for Improving Bounding Volume Hierarchies", IEEE Symposium on
//! Interactive Ray Tracing 2008. Below a node there are four ways to exchange a child with one of its
//! sibling's children, and two to exchange grandchildren; the best of them is made, for every node
//! from below to above, again and again until nothing falls much more.
//!
//! Differs from the paper: hill climbing only, which ends in the nearest valley; annealing, which climbs
//! out of it, the paper itself found to be slow. Subtrees side by side (`tree/sweep.rs`).
//!
//! The cost is the sum of the inner nodes' surface areas: leaves move as they are.
//!
//! Measured after `lbvh` (SAH at one a visit and one a triangle): 13.1 falls to 11.7 in a coffee maker of
//! 0.2 M triangles, 78.0 to 69.5 in a car of 0.8 M, 47.9 to 36.3 in a kitchen of 1.4 M; the coffee maker is
//! traced 1.08 times as fast.
//!
//! Cost: 35 ms of one core for 82,000 leaves.

use super::Optimizer;
use crate::build::{BuildError, Info, check_option};
use crate::context::{Context, Stage};
use crate::tree::Tree;
use crate::tree::sweep::{Below, Rearrange, Root, Slot, Sweep};

/// Exchanges children with grandchildren.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotations {
    /// Sweeps over the tree at most, in `0..=10000`.
    pub rounds: u32,
    /// Stops after a sweep that lowers the cost by less than this share of what all sweeps did, in
    /// `0..=1`.
    pub gain_min: f32,
}

impl Rotations {
    /// Until a sweep gains a hundredth of all.
    pub const DEFAULT: Self = Self { rounds: 32, gain_min: 0.01 };
}

impl Optimizer for Rotations {
    fn info(&self) -> Info {
        Info {
            name: "rotations",
            summary: "exchanges children with grandchildren",
            source: "Kensler 2008",
        }
    }

    fn optimize(&self, tree: Tree, context: &Context<'_>) -> Result<Tree, BuildError> {
        check_option("rounds", f64::from(self.rounds), 0.0..=10_000.0, "0..=10000")?;
        check_option("gain_min", f64::from(self.gain_min), 0.0..=1.0, "0..=1")?;
        // Three leaves can be arranged in more than one way; two cannot.
        if tree.nodes.len() < 5 {
            return Ok(tree);
        }
        let stage = Stage::new(context, "rotations", u64::from(self.rounds));
        let mut sweep = Sweep::new(tree, &context.cancel)?;
        let mut all = 0.0;
        let mut round = 0;
        while round < self.rounds {
            let gain = sweep.run(&Rotate, LEAVES_MIN, &context.cancel)?;
            round += 1;
            stage.advance(1);
            all += gain;
            if gain <= f64::from(self.gain_min) * all {
                break;
            }
        }
        stage.advance(u64::from(self.rounds - round));
        Ok(sweep.into_tree(1, &context.cancel)?)
    }
}

/// Below a node of fewer leaves there is nothing to exchange.
const LEAVES_MIN: u32 = 3;

/// Gains below this share of the area at hand are rounding.
const NOISE: f64 = 1e-9;

struct Rotate;

impl Rearrange for Rotate {
    fn rearrange(&self, below: &mut Below<'_>, roots: &[Root]) -> f64 {
        roots.iter().map(|root| rotate(below, root)).sum()
    }
}

/// Two nodes that change places, and what that saves.
#[derive(Clone, Copy)]
struct Rotation {
    gain: f64,
    nodes: [usize; 2],
}

/// Makes the best rotation below a node; returns what it saves.
fn rotate(below: &mut Below<'_>, root: &Root) -> f64 {
    let children = [root.left, root.left + 1];
    let mut best = Rotation { gain: NOISE * root.bounds.half_area(), nodes: [0; 2] };
    let nothing = best.gain;
    let mut offer = |gain, nodes| {
        if gain > best.gain {
            best = Rotation { gain, nodes };
        }
    };
    let bounds = |at: usize| &below.at(at).node.bounds;
    let merged = |a: usize, b: usize| bounds(a).union(bounds(b)).half_area();

    // A child and one of its sibling's children.
    for (child, sibling) in [(children[0], children[1]), (children[1], children[0])] {
        let Some(left) = below.at(sibling).left() else { continue };
        for moved in [left, left + 1] {
            let stays = if moved == left { left + 1 } else { left };
            // The sibling holds the child instead of `moved`; one level further down.
            if root.has_room(2, below.at(child)) {
                let area = bounds(sibling).half_area();
                offer(area - merged(child, stays), [child, moved]);
            }
        }
    }

    // Two grandchildren.
    if let [Some(a), Some(b)] = children.map(|child| below.at(child).left()) {
        let area = bounds(children[0]).half_area() + bounds(children[1]).half_area();
        for [x, y] in [[b, b + 1], [b + 1, b]] {
            offer(area - merged(a, y) - merged(a + 1, x), [a + 1, y]);
        }
    }

    if best.gain <= nothing {
        return 0.0;
    }
    let [a, b] = best.nodes.map(|at| *below.at(at));
    below.set(best.nodes[0], b);
    below.set(best.nodes[1], a);
    for child in children {
        refresh(below, child);
    }
    best.gain
}

/// Makes a node right after its children changed.
fn refresh(below: &mut Below<'_>, at: usize) {
    if let Some(left) = below.at(at).left() {
        let slot = Slot::around(left, [below.at(left), below.at(left + 1)]);
        below.set(at, slot);
    }
}

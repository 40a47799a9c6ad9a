//! Rotations: what they are worth, and that none is left in the end.

use treelet::Context;
use treelet::bounds::Aabb;
use treelet::build::{Builder, Lbvh, ObjectMedian};
use treelet::optimize::{Optimizer, Rotations};
use treelet::tree::{DEPTH_MAX, Kind, Tree};
use treelet::verify::Random;

fn random_boxes(count: usize, seed: u64) -> Vec<Aabb> {
    let mut random = Random::new(seed);
    let mut one = || {
        let size = if random.between(0.0, 1.0) < 0.1 { 5.0 } else { 0.5 };
        let lo = [(); 3].map(|()| random.between(0.0, 10.0));
        Aabb { lo, hi: lo.map(|x| x + random.between(0.0, size)) }
    };
    (0..count).map(|_| one()).collect()
}

/// The box of a subtree in which two nodes have changed places, and the areas of its inner nodes.
fn measure(tree: &Tree, at: usize, [a, b]: [usize; 2]) -> (Aabb, f64) {
    let at = if at == a {
        b
    } else if at == b {
        a
    } else {
        at
    };
    match tree.nodes[at].kind() {
        Kind::Leaf { .. } => (tree.nodes[at].bounds, 0.0),
        Kind::Inner { left } => {
            let [left, right] = [left, left + 1].map(|child| measure(tree, child, [a, b]));
            let bounds = left.0.union(&right.0);
            (bounds, left.1 + right.1 + bounds.half_area())
        }
    }
}

/// The nodes that a rotation at `root` may exchange.
fn rotations(tree: &Tree, root: usize) -> Vec<[usize; 2]> {
    let left = |node: usize| match tree.nodes[node].kind() {
        Kind::Inner { left } => Some(left),
        Kind::Leaf { .. } => None,
    };
    let Some(l) = left(root) else { return Vec::new() };
    let (r, below_l, below_r) = (l + 1, left(l), left(l + 1));
    let mut pairs = Vec::new();
    pairs.extend(below_r.into_iter().flat_map(|x| [[l, x], [l, x + 1]]));
    pairs.extend(below_l.into_iter().flat_map(|x| [[r, x], [r, x + 1]]));
    if let (Some(a), Some(b)) = (below_l, below_r) {
        pairs.extend([[a, b], [a, b + 1]]);
    }
    pairs
}

const ALL: Rotations = Rotations { rounds: 1000, gain_min: 0.0 };

#[test]
fn in_the_end_no_rotation_pays() {
    for (count, seed) in [(3, 1), (4, 2), (5, 3), (17, 4), (60, 5), (60, 6)] {
        let bounds = random_boxes(count, seed);
        let tree = ObjectMedian { leaf_max: 1 }.build(&bounds, &Context::default()).unwrap();
        let before = measure(&tree, 0, [0, 0]).1;
        let tree = ALL.optimize(tree, &Context::default()).unwrap();
        tree.validate(&bounds).unwrap();
        let now = measure(&tree, 0, [0, 0]).1;
        assert!(count < 17 || now < 0.95 * before, "{count} boxes: {before}, then {now}");
        for root in 0..tree.nodes.len() {
            for nodes in rotations(&tree, root) {
                let then = measure(&tree, 0, nodes).1;
                assert!(then > now * (1.0 - 1e-8), "{count} boxes: {nodes:?} saves {}", now - then);
            }
        }
    }
}

#[test]
fn a_sweep_never_raises_the_cost_and_more_lower_it() {
    let bounds = random_boxes(20_000, 9);
    let mut tree =
        Lbvh { leaf_max: 1, ..Lbvh::DEFAULT }.build(&bounds, &Context::default()).unwrap();
    let mut costs = vec![measure(&tree, 0, [0, 0]).1];
    for _ in 0..6 {
        let once = Rotations { rounds: 1, gain_min: 0.0 };
        tree = once.optimize(tree, &Context::default()).unwrap();
        tree.validate(&bounds).unwrap();
        costs.push(measure(&tree, 0, [0, 0]).1);
    }
    assert!(costs.is_sorted_by(|a, b| a >= b), "{costs:?}");
    assert!(costs[1] < 0.95 * costs[0] && costs[6] < 0.99 * costs[1], "{costs:?}");
}

#[test]
fn depth_stays_bounded() {
    // Each is as far again as the one before: every rotation leads deeper.
    let one = |i: usize| {
        let x = 2.0_f32.powi((i % 180) as i32 - 120);
        Aabb { lo: [x, 0.0, 0.0], hi: [x * 1.25, x, x * 0.5] }
    };
    for count in [180, 3_000] {
        let bounds: Vec<_> = (0..count).map(one).collect();
        let tree = ObjectMedian { leaf_max: 1 }.build(&bounds, &Context::default()).unwrap();
        let shallow = tree.stats().depth;
        let tree = ALL.optimize(tree, &Context::default()).unwrap();
        tree.validate(&bounds).unwrap();
        let depth = tree.stats().depth;
        assert!(2 * shallow < depth && depth <= DEPTH_MAX, "{shallow}, then {depth}");
    }
}

#[test]
fn options_out_of_range_are_named() {
    let bounds = random_boxes(20, 1);
    let tree = ObjectMedian::DEFAULT.build(&bounds, &Context::default()).unwrap();
    for (bad, named) in [
        (Rotations { rounds: 10_001, gain_min: 0.0 }, "rounds is 10001"),
        (Rotations { rounds: 1, gain_min: -0.5 }, "gain_min is -0.5"),
    ] {
        let error = bad.optimize(tree.clone(), &Context::default()).unwrap_err().to_string();
        assert!(error.starts_with(named), "{error}");
    }
}

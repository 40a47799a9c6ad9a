//! Treelet restructuring against every tree that there is.

use treelet::Context;
use treelet::bounds::Aabb;
use treelet::build::{Builder, Lbvh, ObjectMedian, SweepSah, Trbvh};
use treelet::optimize::{Optimizer, Treelets};
use treelet::tree::{DEPTH_MAX, Kind, SahConstants, Tree};
use treelet::verify::Random;

/// A rooted binary tree over numbered leaves.
#[derive(Clone)]
enum Shape {
    Leaf(usize),
    Node(Box<Shape>, Box<Shape>),
}

impl Shape {
    /// Every tree that one more leaf makes of this one: it hangs beside any node.
    fn with(&self, leaf: usize) -> Vec<Self> {
        let beside = Self::Node(Box::new(self.clone()), Box::new(Self::Leaf(leaf)));
        let mut all = vec![beside];
        if let Self::Node(a, b) = self {
            all.extend(a.with(leaf).into_iter().map(|a| Self::Node(Box::new(a), b.clone())));
            all.extend(b.with(leaf).into_iter().map(|b| Self::Node(a.clone(), Box::new(b))));
        }
        all
    }

    /// Every tree over `count` leaves.
    fn all(count: usize) -> Vec<Self> {
        let start = vec![Self::Leaf(0)];
        (1..count).fold(start, |trees, leaf| trees.iter().flat_map(|t| t.with(leaf)).collect())
    }

    /// The box, how many leaves, and the areas of the inner nodes; or, where up to `block` leaves are
    /// one block of primitives, of the inner nodes and the blocks.
    fn measure(&self, leaves: &[Aabb], block: usize) -> (Aabb, usize, f64) {
        let (bounds, count, below) = match self {
            Self::Leaf(leaf) => (leaves[*leaf], 1, None),
            Self::Node(a, b) => {
                let (a, b) = (a.measure(leaves, block), b.measure(leaves, block));
                (a.0.union(&b.0), a.1 + b.1, Some(a.2 + b.2))
            }
        };
        let cost = match below {
            _ if count <= block => bounds.half_area(),
            None => 0.0,
            Some(below) => below + bounds.half_area(),
        };
        (bounds, count, cost)
    }
}

fn least(trees: &[Shape], leaves: &[Aabb], block: usize) -> f64 {
    trees.iter().map(|tree| tree.measure(leaves, block).2).fold(f64::INFINITY, f64::min)
}

fn area(tree: &Tree) -> f64 {
    tree.nodes.iter().map(|node| node.bounds.half_area()).sum()
}

fn inner_area(tree: &Tree) -> f64 {
    let inner = tree.nodes.iter().filter(|node| matches!(node.kind(), Kind::Inner { .. }));
    inner.map(|node| node.bounds.half_area()).sum()
}

fn random_boxes(random: &mut Random, count: usize, scale: [f32; 3]) -> Vec<Aabb> {
    let mut one = || {
        let large = if random.between(0.0, 1.0) < 0.2 { 5.0 } else { 1.0 };
        let lo = scale.map(|scale| scale * random.between(-10.0, 10.0));
        let size = scale.map(|scale| scale * random.between(0.0, large));
        Aabb { lo, hi: std::array::from_fn(|axis| lo[axis] + size[axis]) }
    };
    (0..count).map(|_| one()).collect()
}

fn optimized(optimizer: &dyn Optimizer, tree: &Tree) -> Tree {
    optimizer.optimize(tree.clone(), &Context::default()).unwrap()
}

const LEAF_OF_ONE: ObjectMedian = ObjectMedian { leaf_max: 1 };

#[test]
fn of_seven_leaves_the_best_of_all_trees() {
    let trees: Vec<_> = (0..=7).map(|count| Shape::all(count.max(1))).collect();
    assert_eq!(trees[3..].iter().map(Vec::len).collect::<Vec<_>>(), [3, 15, 105, 945, 10_395]);
    let mut random = Random::new(7);
    let scales = [[1.0; 3], [1.0, 1e-3, 0.0], [1e-30; 3], [1e30; 3], [1e12, 1.0, 1e-12]];
    let mut better = 0;
    for round in 0..3 {
        for scale in scales {
            for count in [7, 6, 5, 4, 3] {
                let bounds = random_boxes(&mut random, count, scale);
                let who = format!("round {round}, {count} leaves, scale {scale:?}");
                let check = |tree: &Tree, cost: f64, block: usize| {
                    tree.validate(&bounds).unwrap();
                    let least = least(&trees[count], &bounds, block);
                    // Areas are compared in f32.
                    assert!(cost <= least * (1.0 + 1e-5), "{who}, {block}: {cost}, not {least}");
                    least
                };
                let plain = LEAF_OF_ONE.build(&bounds, &Context::default()).unwrap();
                let tree = optimized(&Treelets::DEFAULT, &plain);
                let least = check(&tree, inner_area(&tree), 0);
                better += usize::from(inner_area(&plain) > 1.01 * least);
                for leaf_max in [1, 2, 4] {
                    let trbvh = Trbvh { leaf_max, ..Trbvh::DEFAULT };
                    let tree = trbvh.build(&bounds, &Context::default()).unwrap();
                    assert!(tree.stats().leaf_max <= leaf_max);
                    // Every leaf is a block, and costs its area; leaves of one alone cost nothing.
                    match leaf_max {
                        1 => check(&tree, inner_area(&tree), 0),
                        _ => check(&tree, area(&tree), leaf_max as usize),
                    };
                }
            }
        }
    }
    assert!(better > 30, "only {better} trees were not the best before");
}

/// The leaves of a node's treelet: the largest node is opened until there are seven.
fn treelet(tree: &Tree, root: usize) -> Option<Vec<usize>> {
    let mut leaves = vec![root];
    while leaves.len() < 7 {
        let left = |&node: &usize| match tree.nodes[node].kind() {
            Kind::Inner { left } => Some(left),
            Kind::Leaf { .. } => None,
        };
        let area = |node: usize| tree.nodes[node].bounds.half_area();
        let inner = (0..leaves.len()).filter(|&at| left(&leaves[at]).is_some());
        let largest = inner.max_by(|&a, &b| area(leaves[a]).total_cmp(&area(leaves[b])))?;
        let left = left(&leaves[largest])?;
        leaves[largest] = left;
        leaves.push(left + 1);
    }
    Some(leaves)
}

#[test]
fn in_the_end_no_treelet_has_a_better_tree() {
    let trees = Shape::all(7);
    let mut random = Random::new(3);
    let bounds = random_boxes(&mut random, 60, [1.0; 3]);
    let mut tree = LEAF_OF_ONE.build(&bounds, &Context::default()).unwrap();
    let before = inner_area(&tree);
    let once = Treelets { rounds: 1, ..Treelets::DEFAULT };
    for rounds in 0.. {
        assert!(rounds < 100, "no end in sight");
        let next = optimized(&once, &tree);
        let (old, new) = (inner_area(&tree), inner_area(&next));
        assert!(new <= old, "{old} rises to {new}");
        tree = next;
        if new == old {
            break;
        }
    }
    let mut seen = 0;
    for root in 0..tree.nodes.len() {
        let Some(leaves) = treelet(&tree, root) else { continue };
        let boxes: Vec<_> = leaves.iter().map(|&node| tree.nodes[node].bounds).collect();
        // What is between the root and the leaves now.
        let mut area = 0.0;
        let mut open = vec![root];
        while let Some(node) = open.pop() {
            let Kind::Inner { left } = tree.nodes[node].kind() else { continue };
            if !leaves.contains(&node) {
                area += tree.nodes[node].bounds.half_area();
                open.extend([left, left + 1]);
            }
        }
        let least = least(&trees, &boxes, 0);
        assert!(area <= least * (1.0 + 1e-5), "node {root}: {area}, not {least}");
        seen += 1;
    }
    assert!(seen > 10 && inner_area(&tree) < 0.95 * before, "{seen} treelets");
}

/// Boxes that make deep trees: each is as far again as the one before.
fn lopsided(count: usize) -> Vec<Aabb> {
    let one = |i: usize| {
        let x = 2.0_f32.powi((i % 180) as i32 - 120);
        Aabb { lo: [x, 0.0, 0.0], hi: [x * 1.25, x, x * 0.5] }
    };
    (0..count).map(one).collect()
}

#[test]
fn depth_stays_bounded() {
    let mut deepest = 0;
    for count in [180, 3_000, 30_000] {
        let bounds = lopsided(count);
        let sweep = SweepSah { leaf_max: 1, visit_cost: 0.0 };
        let sweep = sweep.build(&bounds, &Context::default()).unwrap();
        let mut median = LEAF_OF_ONE.build(&bounds, &Context::default()).unwrap();
        for _ in 0..5 {
            median = optimized(&Treelets { rounds: 1, ..Treelets::DEFAULT }, &median);
        }
        for tree in [optimized(&Treelets::DEFAULT, &sweep), median] {
            tree.validate(&bounds).unwrap();
            deepest = deepest.max(tree.stats().depth);
        }
        let trbvh = Trbvh::DEFAULT.build(&bounds, &Context::default()).unwrap();
        trbvh.validate(&bounds).unwrap();
    }
    assert!(60 < deepest && deepest <= DEPTH_MAX, "the deepest has {deepest}");
}

#[test]
fn rounds_lower_the_cost_of_the_curves_tree_a_lot() {
    let mut random = Random::new(1);
    let bounds = random_boxes(&mut random, 20_000, [1.0, 0.3, 2.0]);
    let sah = |tree: &Tree| tree.sah(&SahConstants::default());
    let plain = Lbvh { leaf_max: 1, ..Lbvh::DEFAULT }.build(&bounds, &Context::default()).unwrap();
    let mut costs = vec![sah(&plain)];
    for rounds in 1..=3 {
        let tree = Trbvh { rounds, leaf_max: 1 };
        costs.push(sah(&tree.build(&bounds, &Context::default()).unwrap()));
    }
    // Each round is worth something, the first one most.
    assert!(costs.is_sorted_by(|a, b| a > b), "{costs:?}");
    assert!(costs[1] < 0.8 * costs[0] && costs[3] < 0.99 * costs[1], "{costs:?}");
    let sweep = sah(&SweepSah { leaf_max: 1, visit_cost: 1.0 }
        .build(&bounds, &Context::default())
        .unwrap());
    assert!(costs[3] < 1.1 * sweep, "{costs:?} against {sweep} by sweep-sah");
}

#[test]
fn options_out_of_range_are_named() {
    let bounds = lopsided(20);
    let context = Context::default();
    let tree = LEAF_OF_ONE.build(&bounds, &context).unwrap();
    let errors = [
        Treelets { rounds: 33, ..Treelets::DEFAULT }.optimize(tree.clone(), &context),
        Treelets { leaves_min: 6, ..Treelets::DEFAULT }.optimize(tree.clone(), &context),
        Trbvh { rounds: 33, ..Trbvh::DEFAULT }.build(&bounds, &context),
        Trbvh { leaf_max: 0, ..Trbvh::DEFAULT }.build(&bounds, &context),
    ];
    let named = ["rounds is 33", "leaves_min is 6", "rounds is 33", "leaf_max is 0"];
    for (error, named) in errors.into_iter().zip(named) {
        let error = error.unwrap_err().to_string();
        assert!(error.starts_with(named), "{error}");
    }
    // Rounds beyond the size of the tree find nothing to do.
    let all = optimized(&Treelets { rounds: 32, ..Treelets::DEFAULT }, &tree);
    all.validate(&bounds).unwrap();
}

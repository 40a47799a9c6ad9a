//! The plan against every collapse of small trees.

use super::*;
use crate::bounds::Aabb;
use alloc::collections::BTreeMap;

const W: usize = 8;

/// Numbers without a pattern (`verify`, which has better ones, stands below this folder).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
        self.0 >> 33
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.next() as f32 / (1_u64 << 31) as f32)
    }
}

/// A tree of `leaves` leaves of one to four primitives, cut at random, with random boxes.
fn random_tree(leaves: usize, random: &mut Random) -> Tree {
    let mut tree = Tree::default();
    let boxed = |random: &mut Random| {
        let hi = [random.between(0.0, 1.0), random.between(0.0, 1.0), random.between(0.0, 1.0)];
        Aabb { lo: [0.0; 3], hi }
    };
    let mut counts = alloc::vec![leaves];
    tree.nodes.push(tree::Node::leaf(boxed(random), 0, 1));
    let mut at = 0;
    while at < tree.nodes.len() {
        let bounds = boxed(random);
        if counts[at] > 1 {
            let left = 1 + random.below(counts[at] as u64 - 1) as usize;
            counts.extend([left, counts[at] - left]);
            tree.nodes[at] = tree::Node::inner(bounds, tree.nodes.len());
            let unwritten = tree::Node::leaf(bounds, 0, 1);
            tree.nodes.extend([unwritten, unwritten]);
        } else {
            let count = 1 + random.below(4) as usize;
            tree.nodes[at] = tree::Node::leaf(bounds, tree.prims.len(), count);
            // Every third is an instance.
            let prim = if random.below(3) == 0 { FIRST_INSTANCE } else { 0 };
            tree.prims.extend(core::iter::repeat_n(prim, count));
        }
        at += 1;
    }
    tree
}

const FIRST_INSTANCE: u32 = 7;

/// Entries below, and whether there are triangles and instances.
fn inside(tree: &Tree, node: usize) -> (usize, [bool; 2]) {
    match tree.nodes[node].kind() {
        Kind::Leaf { first, count } => {
            let is_instance = tree.prims[first] >= FIRST_INSTANCE;
            (count, [!is_instance, is_instance])
        }
        Kind::Inner { left } => {
            let (a, b) = (inside(tree, left), inside(tree, left + 1));
            (a.0 + b.0, [a.1[0] || b.1[0], a.1[1] || b.1[1]])
        }
    }
}

fn fits(tree: &Tree, node: usize) -> bool {
    let (entries, kinds) = inside(tree, node);
    let is_leaf = matches!(tree.nodes[node].kind(), Kind::Leaf { .. });
    entries <= LEAF_MAX && (is_leaf || kinds == [true, false])
}

/// The cheapest single node or leaf, from every way to cut the subtree into up to `W` parts.
fn cheapest(tree: &Tree, node: usize, known: &mut BTreeMap<usize, f64>) -> f64 {
    if let Some(&cost) = known.get(&node) {
        return cost;
    }
    let area = tree.nodes[node].bounds.half_area();
    let mut best = if fits(tree, node) { area * f64::from(BLOCK) } else { f64::INFINITY };
    if let Kind::Inner { left } = tree.nodes[node].kind() {
        for parts in cuts(tree, &[left, left + 1]) {
            let below: f64 = parts.iter().map(|&part| cheapest(tree, part, known)).sum();
            best = best.min(area * f64::from(VISIT) + below);
        }
    }
    known.insert(node, best);
    best
}

/// Every set of at most `W` nodes that comes of opening some nodes of `parts`, and theirs.
fn cuts(tree: &Tree, parts: &[usize]) -> Vec<Vec<usize>> {
    let Some((&first, rest)) = parts.split_first() else { return alloc::vec![Vec::new()] };
    let mut firsts = alloc::vec![alloc::vec![first]];
    if let Kind::Inner { left } = tree.nodes[first].kind() {
        firsts.extend(cuts(tree, &[left, left + 1]));
    }
    let mut all = Vec::new();
    for rest in cuts(tree, rest) {
        let joined = firsts.iter().map(|first| [first.as_slice(), &rest].concat());
        all.extend(joined.filter(|parts| parts.len() <= W));
    }
    all
}

/// What the wide nodes that the plan says cost.
fn planned_cost(priced: &Priced<'_>, plan: &Plan<W>, below: Below) -> f64 {
    let area = |node: u32| priced.tree.nodes[node as usize].bounds.half_area();
    let leaf = |node: u32| {
        assert!(fits(priced.tree, node as usize));
        area(node) * f64::from(BLOCK)
    };
    let at = match below {
        Below::Tree(node) => return leaf(node),
        Below::Planned(at) if plan.nodes[at as usize].leaf => {
            return leaf(plan.nodes[at as usize].node);
        }
        Below::Planned(at) => at,
    };
    let mut parts = Vec::new();
    plan.spend(at, W, true, &mut parts);
    assert!(parts.len() <= W);
    let inside: f64 = parts.iter().map(|part| planned_cost(priced, plan, part.0)).sum();
    area(plan.nodes[at as usize].node) * f64::from(VISIT) + inside
}

#[test]
fn no_collapse_of_a_small_tree_is_cheaper() {
    for seed in 0..300 {
        let mut random = Random(seed);
        let tree = random_tree(2 + random.below(13) as usize, &mut random);
        let priced = Priced { tree: &tree, first_instance: FIRST_INSTANCE, scale: 1.0 };
        let plan = Plan::<W>::new(&priced, 0, |_| None);
        let best = cheapest(&tree, 0, &mut BTreeMap::new());
        let found = planned_cost(&priced, &plan, Below::Planned(0));
        let told = f64::from(plan.cost.single());
        assert!((found - best).abs() < 1e-5 * best, "seed {seed}: {found}, best {best}");
        assert!((told - best).abs() < 1e-5 * best, "seed {seed}: told {told}, best {best}");
        assert_eq!(plan.entries.iter().sum::<usize>(), tree.prims.len());
    }
}

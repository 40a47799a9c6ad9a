//! Insertion: a node whose box is much too large is taken out, and the two subtrees below it are put
//! back where each costs least.
//!
//! Source: J. Bittner, M. Hapala and V. Havran, "Fast Insertion-Based Optimization of Bounding Volume
//! Hierarchies", Computer Graphics Forum 32(1), 2013. Nodes come in the order of the paper's combined
//! measure: the area, times the area over the children's mean area, times the area over the smaller
//! child's. A place is found by best-first search from the root: what the nodes on the way grow by
//! bounds from below what lies beneath them can cost.
//!
//! Differs from the paper: the measure orders all nodes once a pass, and none is left to chance. The
//! places of a batch are searched in parallel, for each node in the tree without that node; then the
//! nodes are moved one after the other, the largest gain first, and whatever does not lower the cost of
//! the tree as it then is, is undone. So the cost never rises, and the tree depends on no thread.
//! Where the second subtree goes beside the first one is tried too: together they may move.
//!
//! The cost is the sum of the inner nodes' surface areas: leaves move as they are.
//!
//! Measured after `lbvh` (SAH at one a visit and one a triangle): 13.1 falls to 12.1 in a coffee maker of
//! 0.2 M triangles, 78.0 to 68.8 in a car of 0.8 M, 47.9 to 34.9 in a kitchen of 1.4 M, in 1, 3.5 and 9 s of one
//! core; the coffee maker is traced 1.10 times as fast, and 1.03 times after `binned-sah`. Reinsertion takes a
//! tenth of the time and ends lower in the kitchen, at 31.7.
//!
//! Cost: 68 bytes a leaf; two searches a node.

use super::pairs::{Id, Pairs, ROOT};
use super::{Optimizer, check_shares};
use crate::bounds::Aabb;
use crate::build::{BuildError, Info, check_option};
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::tree::Tree;
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Ordering;

/// Takes nodes out and puts their children where they cost least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Insertion {
    /// Share of all nodes in a batch, in `0..=1`; at least one node.
    pub share: f32,
    /// Passes over the inner nodes at most, in `0..=1000`.
    pub passes: u32,
    /// Stops after a batch that lowers the cost by less than this share of it, in `0..=1`.
    pub gain_min: f32,
}

impl Insertion {
    /// Batches of a hundredth, as in the paper, and one pass.
    pub const DEFAULT: Self = Self { share: 0.01, passes: 1, gain_min: 0.0 };
}

impl Optimizer for Insertion {
    fn info(&self) -> Info {
        Info {
            name: "insertion",
            summary: "takes the most wasteful nodes out and puts what is below them elsewhere",
            source: "Bittner, Hapala and Havran 2013",
        }
    }

    fn optimize(&self, tree: Tree, context: &Context<'_>) -> Result<Tree, BuildError> {
        check_shares(self.share, self.gain_min)?;
        check_option("passes", f64::from(self.passes), 0.0..=1000.0, "0..=1000")?;
        // Three leaves can be arranged in more than one way; two cannot.
        if tree.nodes.len() < 5 {
            return Ok(tree);
        }
        let mut pairs = Pairs::new(tree, &context.cancel)?;
        self.run(&mut pairs, context)?;
        pairs.into_tree(&context.cancel)
    }
}

/// Searches are handed out this many at a time: about a tenth of a millisecond.
const CHUNK: usize = 16;

/// Pairs are looked through this many at a time.
const PAIRS_CHUNK: usize = 16_384;

/// Gains below this share of the area at hand are rounding.
const NOISE: f64 = 1e-9;

/// A child counts as at least this share of its parent's area: boxes without area are not worth more
/// than all others.
const CHILD_MIN: f64 = 1e-3;

impl Insertion {
    fn run(&self, pairs: &mut Pairs, context: &Context<'_>) -> Result<(), BuildError> {
        let inner = pairs.nodes() as u64 / 2;
        let total = u64::from(self.passes) * inner.saturating_sub(1);
        let stage = Stage::new(context, "insertion", total);
        let size = libm::ceil(f64::from(self.share) * pairs.nodes() as f64).max(1.0) as usize;
        let mut done = 0;
        'all: for _ in 0..self.passes {
            let (order, mut cost) = wasteful(pairs, &stage)?;
            for batch in order.chunks(size) {
                let moves = search(pairs, batch, &stage)?;
                let gain = apply(pairs, moves, &stage)?;
                stage.advance(batch.len() as u64);
                done += batch.len() as u64;
                cost -= gain;
                if gain < f64::from(self.gain_min) * cost {
                    break 'all;
                }
            }
        }
        stage.advance(total - done);
        Ok(())
    }
}

/// The inner nodes but the root, the most wasteful first, ties by id; and the sum of their areas.
fn wasteful(pairs: &Pairs, stage: &Stage<'_>) -> Result<(Vec<Id>, f64), Cancelled> {
    let parts = parallel::map_chunks(pairs.pairs(), PAIRS_CHUNK, |first, chunk| {
        stage.check()?;
        let places = (2 * first as Id..).zip(chunk.iter().flat_map(|pair| &pair.0));
        let mut found = Vec::new();
        let mut sum = 0.0;
        for (id, place) in places.filter(|&(id, _)| id > ROOT) {
            let Some(left) = place.left() else { continue };
            let area = place.bounds.half_area();
            let [a, b] = [left, left + 1].map(|child| pairs.at(child).bounds.half_area());
            let least = a.min(b).max(CHILD_MIN * area);
            let mean = (0.5 * (a + b)).max(CHILD_MIN * area);
            let waste = if area > 0.0 { area * (area / mean) * (area / least) } else { 0.0 };
            found.push((waste, id));
            sum += area;
        }
        Ok((found, sum))
    });
    let mut all = Vec::new();
    let mut sum = 0.0;
    for part in parts {
        let part: Result<_, Cancelled> = part;
        let (found, area) = part?;
        all.extend(found);
        sum += area;
    }
    all.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    Ok((all.into_iter().map(|(_, id)| id).collect(), sum))
}

/// A node, where what is below it goes, and what that saves if nothing else moves.
struct Move {
    gain: f64,
    node: Id,
    targets: [Id; 2],
}

/// Searches the places of a batch, all in the same tree.
fn search(pairs: &Pairs, nodes: &[Id], stage: &Stage<'_>) -> Result<Vec<Move>, Cancelled> {
    let parts = parallel::map_chunks(nodes, CHUNK, |_, nodes| {
        stage.check()?;
        let mut search = Search { pairs, without: Vec::new(), open: BinaryHeap::new() };
        Ok(nodes.iter().filter_map(|&node| search.best_move(node)).collect::<Vec<_>>())
    });
    let mut moves = Vec::new();
    for part in parts {
        let part: Result<_, Cancelled> = part;
        moves.extend(part?);
    }
    Ok(moves)
}

/// A node to be looked at, and what the nodes above it grow by.
struct Open {
    growth: f64,
    id: Id,
    /// Where it is in [`Search::without`], if it is.
    above: Option<usize>,
}

/// A tree in which one node's place is searched anew.
struct Search<'a> {
    pairs: &'a Pairs,
    /// The nodes above the one that is taken out, from its parent to the root, and their boxes without
    /// it. The parent then is what the sibling was.
    without: Vec<(Id, Aabb)>,
    open: BinaryHeap<Open>,
}

impl Search<'_> {
    fn best_move(&mut self, node: Id) -> Option<Move> {
        let pairs = self.pairs;
        let left = pairs.at(node).left()?;
        let mut saved = pairs.at(node).bounds.half_area();

        // The boxes above without it.
        self.without.clear();
        let (mut below, mut rest) = (node, Aabb::EMPTY);
        while below != ROOT {
            let above = pairs.parent(below);
            rest = rest.union(&pairs.at(below ^ 1).bounds);
            saved += pairs.at(above).bounds.half_area();
            // The parent itself goes.
            saved -= if self.without.is_empty() { 0.0 } else { rest.half_area() };
            self.without.push((above, rest));
            below = above;
        }

        let [a, b] = [left, left + 1].map(|child| self.best_place(&pairs.at(child).bounds, node));
        Some(Move { gain: saved - a.0 - b.0, node, targets: [a.1, b.1] })
    }

    /// The cheapest place without `node`, and what it costs.
    fn best_place(&mut self, bounds: &Aabb, node: Id) -> (f64, Id) {
        // Beside the sibling, for a start.
        let area = bounds.half_area();
        let grown = |around: &Aabb| around.union(bounds).half_area();
        let above = self.without[1..].iter();
        let growth: f64 = above.map(|(_, around)| grown(around) - around.half_area()).sum();
        let mut best = (growth + grown(&self.without[0].1), self.without[0].0);

        self.open.clear();
        self.open.push(Open { growth: 0.0, id: ROOT, above: Some(self.without.len() - 1) });
        while let Some(Open { growth, id, above }) = self.open.pop() {
            // Wherever it goes, its new parent is at least as large as itself.
            if growth + area >= best.0 {
                break;
            }
            let place = self.pairs.at(if above == Some(0) { node ^ 1 } else { id });
            let around = above.map_or(place.bounds, |at| self.without[at].1);
            let merged = grown(&around);
            if growth + merged < best.0 {
                best = (growth + merged, id);
            }
            let growth = growth + (merged - around.half_area());
            if growth + area >= best.0 {
                continue;
            }
            let Some(left) = place.left() else { continue };
            for id in [left, left + 1] {
                let nearer = above.and_then(|at| at.checked_sub(1));
                let above = nearer.filter(|&at| self.without[at].0 == id);
                self.open.push(Open { growth, id, above });
            }
        }
        best
    }
}

impl Ord for Open {
    /// The least growth is the greatest; of equal ones the least id.
    fn cmp(&self, other: &Self) -> Ordering {
        other.growth.total_cmp(&self.growth).then(other.id.cmp(&self.id))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

/// Makes the moves that pay, the one of largest gain first; returns what they save together.
fn apply(pairs: &mut Pairs, mut moves: Vec<Move>, stage: &Stage<'_>) -> Result<f64, Cancelled> {
    moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
    let mut saved = 0.0;
    for chunk in moves.chunks(CHUNK) {
        stage.check()?;
        saved += chunk.iter().map(|one| make(pairs, one)).sum::<f64>();
    }
    Ok(saved)
}

/// Makes a move if it pays in the tree as it is now; returns what it saves.
fn make(pairs: &mut Pairs, one: &Move) -> f64 {
    let Move { node, targets, .. } = *one;
    // Others moved meanwhile, perhaps what it is about.
    if targets.iter().any(|&target| pairs.is_below(target, node)) {
        return 0.0;
    }
    let noise = NOISE * pairs.at(pairs.parent(node)).bounds.half_area();
    let Some(apart) = pairs.take_apart(node) else { return 0.0 };
    let targets = targets.map(|target| if target == node ^ 1 { apart.parent } else { target });
    let [first, second] = apart.free();

    // The larger one has less choice.
    let [a, b] = apart.children;
    let swap = b.bounds.half_area() > a.bounds.half_area();
    let (a, b) =
        if swap { ((b, targets[1]), (a, targets[0])) } else { ((a, targets[0]), (b, targets[1])) };
    let Some(cost) = pairs.insert(a.0, first, a.1) else {
        pairs.put_back(&apart);
        return 0.0;
    };
    // Where it was to go, or beside the first one.
    let beside = 2 * first + 1;
    let bounds = &b.0.bounds;
    let apart_costs = pairs.cost_beside(bounds, b.1);
    let target = if pairs.cost_beside(bounds, beside) < apart_costs { beside } else { b.1 };
    let gain = pairs.insert(b.0, second, target).map(|more| apart.saved - cost - more);
    if let Some(gain) = gain.filter(|&gain| gain > noise) {
        return gain;
    }
    if gain.is_some() {
        pairs.remove(second);
    }
    pairs.remove(first);
    pairs.put_back(&apart);
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::{Builder, ObjectMedian};
    use crate::verify::Random;
    use alloc::string::ToString;

    fn boxes(count: usize, seed: u64) -> Vec<Aabb> {
        let mut random = Random::new(seed);
        let mut number = |most: f32| random.between(0.0, most);
        let mut one = || {
            let lo = [number(10.0), number(10.0), number(10.0)];
            let size = if number(1.0) < 0.1 { 5.0 } else { 0.5 };
            Aabb { lo, hi: lo.map(|x| x + number(size)) }
        };
        (0..count).map(|_| one()).collect()
    }

    fn plain(bounds: &[Aabb]) -> Tree {
        ObjectMedian { leaf_max: 1 }.build(bounds, &Context::default()).unwrap()
    }

    fn taken_apart(tree: Tree) -> Pairs {
        Pairs::new(tree, &crate::Cancel::new()).unwrap()
    }

    fn inner_area(pairs: &Pairs) -> f64 {
        let places = pairs.pairs().iter().flat_map(|pair| &pair.0);
        places.filter(|place| place.left().is_some()).map(|place| place.bounds.half_area()).sum()
    }

    fn places(pairs: &Pairs) -> Vec<(Aabb, Option<Id>, Id)> {
        let ids = ROOT..=pairs.nodes() as Id;
        ids.map(|id| (pairs.at(id).bounds, pairs.at(id).left(), pairs.parent(id))).collect()
    }

    #[test]
    fn what_is_taken_apart_and_put_back_is_as_it_was() {
        let bounds = boxes(60, 1);
        let mut pairs = taken_apart(plain(&bounds));
        let before = places(&pairs);
        let mut inner = 0;
        for node in ROOT..=pairs.nodes() as Id {
            let Some(apart) = pairs.take_apart(node) else { continue };
            inner += 1;
            // Wherever the two go meanwhile.
            let target = apart.parent;
            let [first, second] = apart.free();
            pairs.insert(apart.children[1], first, target).unwrap();
            pairs.insert(apart.children[0], second, ROOT).unwrap();
            pairs.remove(second);
            pairs.remove(first);
            pairs.put_back(&apart);
            assert_eq!(places(&pairs), before, "{node}");
        }
        assert_eq!(inner, 58);
    }

    #[test]
    fn what_a_move_is_said_to_save_it_saves() {
        for seed in 0..4 {
            let bounds = boxes(80, seed);
            let mut pairs = taken_apart(plain(&bounds));
            let before = inner_area(&pairs);
            let mut now = before;
            let (order, cost) = wasteful(&pairs, &Stage::new(&Context::default(), "", 0)).unwrap();
            let root = pairs.at(ROOT).bounds.half_area();
            assert!((cost + root - before).abs() < 1e-9 * before, "{cost} {before}");
            let mut made = 0;
            for node in order {
                let mut search =
                    Search { pairs: &pairs, without: Vec::new(), open: BinaryHeap::new() };
                let Some(best) = search.best_move(node) else { continue };
                let saved = make(&mut pairs, &best);
                let then = inner_area(&pairs);
                assert!((now - then - saved).abs() < before * 1e-12, "{node}: {saved}");
                assert!(saved >= 0.0);
                made += usize::from(saved > 0.0);
                now = then;
            }
            assert!(made > 10 && now < 0.95 * before, "{made} moves, {before} falls to {now}");
            pairs.into_tree(&crate::Cancel::new()).unwrap().validate(&bounds).unwrap();
        }
    }

    #[test]
    fn the_search_finds_the_cheapest_place() {
        for seed in 0..4 {
            let pairs = taken_apart(plain(&boxes(100, seed)));
            for node in ROOT + 1..=pairs.nodes() as Id {
                let mut search =
                    Search { pairs: &pairs, without: Vec::new(), open: BinaryHeap::new() };
                let Some(best) = search.best_move(node) else { continue };
                // Without it, try all places; the pairs that are free hold none.
                let mut without = taken_apart(plain(&boxes(100, seed)));
                let apart = without.take_apart(node).unwrap();
                let is_there = |&id: &Id| id != node ^ 1 && !pairs.is_below(id, node);
                for (side, target) in best.targets.into_iter().enumerate() {
                    let bounds = apart.children[side].bounds;
                    let cost = |id| without.cost_beside(&bounds, id);
                    let ids = (ROOT..=without.nodes() as Id).filter(is_there);
                    let least = ids.map(cost).fold(f64::INFINITY, f64::min);
                    let found = cost(target);
                    assert!(found <= least * (1.0 + 1e-9), "{node}, {side}: {found}, not {least}");
                }
            }
        }
    }

    #[test]
    fn the_most_wasteful_come_first() {
        let at = |x: f32, size: f32| Aabb { lo: [x, 0.0, 0.0], hi: [x + size, size, size] };
        // The median puts what is far away beside what is near.
        let bounds = [at(0.0, 1.0), at(1.0, 1.0), at(2.0, 1.0), at(100.0, 1.0), at(101.0, 1.0)];
        let pairs = taken_apart(plain(&bounds));
        let (order, _) = wasteful(&pairs, &Stage::new(&Context::default(), "", 0)).unwrap();
        assert!(pairs.at(order[0]).bounds.hi[0] > 100.0 && pairs.at(order[0]).bounds.lo[0] < 3.0);
    }

    #[test]
    fn passes_end_and_options_are_checked() {
        let bounds = boxes(300, 8);
        let tree = plain(&bounds);
        let pass = |passes| Insertion { passes, ..Insertion::DEFAULT };
        let cost = |tree: Tree| inner_area(&taken_apart(tree));
        let improved = |passes| pass(passes).optimize(tree.clone(), &Context::default()).unwrap();
        let costs = [0, 1, 5].map(|passes| cost(improved(passes)));
        assert!(
            costs[0] == cost(tree.clone()) && costs[1] < 0.9 * costs[0] && costs[2] <= costs[1]
        );
        let bad = Insertion { share: f32::NAN, ..Insertion::DEFAULT };
        let error = bad.optimize(tree.clone(), &Context::default()).unwrap_err().to_string();
        assert!(error.starts_with("share is NaN"), "{error}");
        let error = pass(1001).optimize(tree, &Context::default()).unwrap_err().to_string();
        assert!(error.starts_with("passes is 1001"), "{error}");
    }
}

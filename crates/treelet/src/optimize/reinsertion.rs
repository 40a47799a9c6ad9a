//! Reinsertion: take a subtree out and put it back where it costs least, many times.
//!
//! Source: D. Meister and J. Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy
//! Optimization", Computer Graphics Forum 37(2), 2018, after J. Bittner, M. Hapala and V. Havran,
//! "Fast Insertion-Based Optimization of Bounding Volume Hierarchies", CGF 32(1), 2013. A round
//! searches the best place for each of the largest nodes, all in parallel on the same tree, then
//! moves them in the order of their gains.
//!
//! Differs from the paper: nothing is locked and no move is dropped because another one came near.
//! Each move's gain is computed again, exactly, on the tree as it then is, and the move is made if
//! there still is one. So the cost falls with every move, and the result depends on no thread.
//! Places beside a node's own ancestors are tried as well: a large thing found deep in the tree
//! belongs near the root.
//!
//! The cost is the sum of the inner nodes' surface areas: leaves move as they are, so theirs stays
//! the same. Single-primitive leaves give it the most to do.
//!
//! Measured on 1.4 M triangles of an interior, binned SAH before, one core: the cost falls by 22 % in
//! 0.33 s with a share of 0.01, by 23 % in 0.44 s with 0.05, by 23.1 % in 3.5 s with 1; two-wide
//! nodes a diffuse ray fall from 20.5 to 14.0. On hair and terrain, where boxes have few better
//! places, a share of 0.05 gives 0.5 %, of 1 4.4 % (hair). Tried without gain: more rounds of smaller
//! shares (0.02 and 32 rounds).
//!
//! Cost: 68 bytes a leaf; a search visits some tens of nodes.

use super::pairs::{Id, Pairs, Place, ROOT};
use super::search::Search;
use super::{Optimizer, check_shares};
use crate::build::{BuildError, Info, check_option};
use crate::context::{Cancelled, Context, Stage, parallel};
use crate::memory;
use crate::tree::Tree;
use alloc::vec::Vec;

/// Moves subtrees to where they cost least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reinsertion {
    /// Share of all nodes whose best place the first round searches, the largest ones, in `0..=1`.
    /// Round `i` searches `1 / (2 i + 1)` of that.
    pub share: f32,
    /// Rounds at most, in `0..=10000`.
    pub rounds: u32,
    /// Stops after a round that lowers the cost by less than this share of it, in `0..=1`.
    pub gain_min: f32,
}

impl Reinsertion {
    /// A twentieth of all nodes, in rounds of falling size.
    pub const DEFAULT: Self = Self { share: 0.05, rounds: 16, gain_min: 0.0 };
}

impl Optimizer for Reinsertion {
    fn info(&self) -> Info {
        Info {
            name: "reinsertion",
            summary: "moves subtrees to where they cost least",
            source: "Meister and Bittner 2018",
        }
    }

    fn optimize(&self, tree: Tree, context: &Context<'_>) -> Result<Tree, BuildError> {
        check_shares(self.share, self.gain_min)?;
        check_option("rounds", f64::from(self.rounds), 0.0..=10_000.0, "0..=10000")?;
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
const CHUNK: usize = 64;

/// Pairs are looked through this many at a time.
const PAIRS_CHUNK: usize = 16_384;

/// Gains below this share of the area at hand are rounding.
const NOISE: f64 = 1e-9;

/// A node, where to put it, and what that saves.
struct Move {
    gain: f64,
    node: Id,
    target: Id,
}

impl Reinsertion {
    pub(super) fn run(&self, pairs: &mut Pairs, context: &Context<'_>) -> Result<(), BuildError> {
        let size = |round: u32| {
            let first = f64::from(self.share) * pairs.nodes() as f64;
            libm::ceil(first / f64::from(2 * round + 1)) as usize
        };
        let sizes: Vec<usize> = (0..self.rounds).map(size).collect();
        let total: usize = sizes.iter().sum();
        let stage = Stage::new(context, "reinsertion", total as u64);
        let mut done = 0;
        for size in sizes {
            let candidates = largest(pairs, size, &stage)?;
            let moves = search(pairs, &candidates, &stage)?;
            let gain = apply(pairs, moves, &stage)?;
            stage.advance(size as u64);
            done += size;
            if gain <= f64::from(self.gain_min) * cost(pairs, &stage)? {
                break;
            }
        }
        stage.advance((total - done) as u64);
        Ok(())
    }
}

/// The sum of the inner nodes' half areas.
fn cost(pairs: &Pairs, stage: &Stage<'_>) -> Result<f64, Cancelled> {
    let parts = parallel::map_chunks(pairs.pairs(), PAIRS_CHUNK, |_, pairs| {
        let inner = pairs.iter().flat_map(|pair| &pair.0).filter(|place| place.left().is_some());
        stage.check().map(|()| inner.map(|place| place.bounds.half_area()).sum::<f64>())
    });
    parts.into_iter().sum()
}

/// The `count` nodes of largest area, the root left out, in the order of their ids; ties go to the
/// lower id.
fn largest(pairs: &Pairs, count: usize, stage: &Stage<'_>) -> Result<Vec<Id>, BuildError> {
    // Areas as f32 bits, turned around so that the largest comes first; their upper bits tell apart
    // eight sizes to a factor of two.
    let key = |place: &Place| !(place.bounds.half_area() as f32).to_bits();
    let counts = parallel::map_chunks(pairs.pairs(), PAIRS_CHUNK, |_, pairs| {
        stage.check()?;
        let mut counts = alloc::vec![0_usize; 1 << (32 - FINE_BITS)];
        let places = pairs.iter().flat_map(|pair| &pair.0);
        places.for_each(|place| counts[(key(place) >> FINE_BITS) as usize] += 1);
        Ok(counts)
    });
    let mut sums = alloc::vec![0_usize; 1 << (32 - FINE_BITS)];
    for counts in counts {
        let counts: Result<Vec<usize>, Cancelled> = counts;
        sums.iter_mut().zip(counts?).for_each(|(sum, count)| *sum += count);
    }

    // The size at which there are enough, one more for the root: larger ones are in, equal ones may be.
    let mut enough = 0;
    let last = sums.iter().position(|sum| {
        enough += sum;
        enough > count
    });
    let last = last.map_or(u32::MAX, |size| size as u32);
    let chosen = parallel::map_chunks(pairs.pairs(), PAIRS_CHUNK, |first, pairs| {
        stage.check()?;
        let places = (2 * first as Id..).zip(pairs.iter().flat_map(|pair| &pair.0));
        let keyed = places.filter(|&(id, _)| id > ROOT).map(|(id, place)| (key(place), id));
        Ok(keyed.filter(|keyed| keyed.0 >> FINE_BITS <= last).collect::<Vec<_>>())
    });
    let mut all = memory::try_with_capacity(enough, "nodes by area")?;
    for part in chosen {
        let part: Result<Vec<(u32, Id)>, Cancelled> = part;
        all.extend(part?);
    }
    if count < all.len() {
        all.select_nth_unstable(count);
        all.truncate(count);
    }
    let mut ids: Vec<Id> = all.into_iter().map(|(_, id)| id).collect();
    ids.sort_unstable();
    Ok(ids)
}

/// Lower bits of an area that the first look at all areas leaves out.
const FINE_BITS: u32 = 20;

/// The best place of each node that has a better one.
fn search(pairs: &Pairs, nodes: &[Id], stage: &Stage<'_>) -> Result<Vec<Move>, Cancelled> {
    let parts = parallel::map_chunks(nodes, CHUNK, |_, nodes| {
        stage.check()?;
        let mut search = Search::new(pairs);
        Ok(nodes.iter().filter_map(|&node| best_place(&mut search, node)).collect::<Vec<_>>())
    });
    let mut moves = Vec::new();
    for part in parts {
        moves.extend(part?);
    }
    Ok(moves)
}

/// Makes the moves that still pay, the largest gain first; returns what they save together.
fn apply(pairs: &mut Pairs, mut moves: Vec<Move>, stage: &Stage<'_>) -> Result<f64, Cancelled> {
    moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
    let mut saved = 0.0;
    for chunk in moves.chunks(1024) {
        stage.check()?;
        for &Move { node, target, .. } in chunk {
            let Some(gain) = pairs.gain(node, target) else { continue };
            if gain > noise(pairs.at(node), pairs.at(target)) {
                pairs.reinsert(node, target);
                saved += gain;
            }
        }
    }
    Ok(saved)
}

/// The best place of a node, if it is better than where it is.
fn best_place(search: &mut Search<'_>, node: Id) -> Option<Move> {
    let best = search.best_place(&search.pairs.loosen(node), node ^ 1);
    let noise = noise(search.pairs.at(node), search.pairs.at(best.target));
    (best.gain > noise).then_some(Move { gain: best.gain, node, target: best.target })
}

fn noise(node: &Place, target: &Place) -> f64 {
    NOISE * (node.bounds.half_area() + target.bounds.half_area())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Aabb;
    use crate::build::{Builder, ObjectMedian, SweepSah};
    use crate::verify::Random;

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

    fn taken_apart(tree: Tree) -> Pairs {
        Pairs::new(tree, &crate::Cancel::new()).unwrap()
    }

    fn inner_area(pairs: &Pairs) -> f64 {
        cost(pairs, &Stage::new(&Context::default(), "", 0)).unwrap()
    }

    fn all_moves(pairs: &Pairs) -> impl Iterator<Item = (Id, Id, f64)> {
        let ids = ROOT..=pairs.nodes() as Id;
        let both = ids.clone().skip(1).flat_map(move |node| ids.clone().map(move |to| (node, to)));
        both.filter_map(|(node, to)| pairs.gain(node, to).map(|gain| (node, to, gain)))
    }

    #[test]
    fn what_a_move_is_said_to_save_it_saves() {
        for seed in 0..4 {
            let bounds = boxes(24, seed);
            let tree = ObjectMedian { leaf_max: 1 }.build(&bounds, &Context::default()).unwrap();
            let pairs = taken_apart(tree.clone());
            let before = inner_area(&pairs);
            let mut moves = 0;
            for (node, target, gain) in all_moves(&pairs) {
                let mut moved = taken_apart(tree.clone());
                moved.reinsert(node, target);
                let saved = before - inner_area(&moved);
                assert!(
                    (saved - gain).abs() < before * 1e-12,
                    "{node} to {target}: {saved} {gain}"
                );
                let tree = moved.into_tree(&crate::Cancel::new()).unwrap();
                tree.validate(&bounds).unwrap_or_else(|e| panic!("{node} to {target}: {e}"));
                moves += 1;
            }
            assert!(moves > 24 * 24, "only {moves} moves");
        }
    }

    #[test]
    fn the_search_finds_the_best_place_of_each_node() {
        for seed in 0..4 {
            let bounds = boxes(100, seed);
            let tree = ObjectMedian { leaf_max: 1 }.build(&bounds, &Context::default()).unwrap();
            let pairs = taken_apart(tree);
            let mut search = Search::new(&pairs);
            let mut movable = 0;
            for node in ROOT + 1..=pairs.nodes() as Id {
                let of_node = (ROOT..=pairs.nodes() as Id).filter_map(|to| pairs.gain(node, to));
                let best = of_node.fold(0.0, f64::max);
                let found = best_place(&mut search, node).map_or(0.0, |found| found.gain);
                assert!((best - found).abs() <= best * 1e-9 + 1e-6, "{node}: {best}, {found}");
                movable += usize::from(best > 0.0);
            }
            assert!(movable > 50, "only {movable} nodes can be moved for the better");
        }
    }

    #[test]
    fn in_the_end_no_single_move_pays() {
        for count in [3, 4, 10, 60, 200] {
            let bounds = boxes(count, count as u64);
            let tree = SweepSah { leaf_max: 1, ..SweepSah::DEFAULT };
            let tree = tree.build(&bounds, &Context::default()).unwrap();
            let before = inner_area(&taken_apart(tree.clone()));
            // The sizes of rounds fall, so each is run as a first one.
            let round = Reinsertion { share: 1.0, rounds: 1, gain_min: 0.0 };
            let mut costs = alloc::vec![before];
            let mut best = tree;
            loop {
                best = round.optimize(best, &Context::default()).unwrap();
                let now = inner_area(&taken_apart(best.clone()));
                let last = costs[costs.len() - 1];
                assert!(now <= last, "{count} boxes: {last} rises to {now}");
                if now == last {
                    break;
                }
                costs.push(now);
                assert!(costs.len() < 100, "{count} boxes: no end in sight");
            }
            best.validate(&bounds).unwrap();
            let pairs = taken_apart(best);
            for (node, target, gain) in all_moves(&pairs) {
                let noise = 2.0 * noise(pairs.at(node), pairs.at(target));
                assert!(gain <= noise, "{count} boxes: {node} to {target} saves {gain}");
            }
            assert!(count < 60 || costs.len() > 2, "{count} boxes: nothing was moved");
        }
    }

    #[test]
    fn the_largest_nodes_are_the_largest() {
        let bounds = boxes(500, 1);
        let tree = ObjectMedian::DEFAULT.build(&bounds, &Context::default()).unwrap();
        let pairs = taken_apart(tree);
        let stage_of = Context::default();
        let stage = Stage::new(&stage_of, "", 0);
        let chosen = largest(&pairs, 40, &stage).unwrap();
        assert_eq!(chosen.len(), 40);
        let area = |id: Id| pairs.at(id).bounds.half_area();
        let least = chosen.iter().map(|&id| area(id)).fold(f64::INFINITY, f64::min);
        for id in ROOT + 1..=pairs.nodes() as Id {
            assert!(chosen.contains(&id) || area(id) <= least * 1.000_001, "{id} is left out");
        }
        assert_eq!(largest(&pairs, usize::MAX, &stage).unwrap().len(), pairs.nodes() - 1);
    }
}

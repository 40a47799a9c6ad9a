//! Repair: small subtrees that are still good stay, everything else is built anew around them.
//!
//! Source: S.-E. Yoon, S. Curtis, D. Manocha, "Ray Tracing Dynamic Scenes using Selective Restructuring",
//! Eurographics Symposium on Rendering, 2007. It restructures pairs of nodes that came to overlap, top-down. Here the
//! tree is cut: a subtree of few triangles whose boxes cost what they cost when they were built is one primitive of a
//! new tree; where they cost more, the triangles themselves are. What flies apart loses its upper
//! levels, and their share of all nodes is small; what is stirred loses its leaves.
//!
//! Nodes and leaves of what stays are copied as they are, but for their numbers.
//!
//! Cost: reads and writes every byte of the layout once; builds over one primitive for some tens of triangles
//! where most of the tree is good.

use super::Collapse;
use super::lower::{Numbered, Packed, lower, split_leaves};
use super::packing::Packing;
use super::refit::{Areas, Part, Refitted, around, half_area, survey, triangles_of, used};
use super::wide::{BLOCK_WORDS, Child, ChildKind, Node, Plain, TRIANGLE_WORDS, Wide};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancel, parallel};
use crate::memory::{self, Pages};
use crate::tree::Tree;
use alloc::vec::Vec;
use core::cmp::Reverse;

/// The most triangles of a subtree that stays whole.
const KEEP_MAX: u32 = 256;
/// A subtree whose boxes cost this many times what they cost when they were built does not stay.
const DECAYED: f32 = 1.15;
/// Where more than this share of all triangles does not stay in its subtree, nothing is saved.
const LOOSE_MAX: f64 = 0.5;
/// Subtrees that one task copies.
const CHUNK: usize = 64;

/// A layout that was repaired.
pub(crate) struct Repaired<const W: usize> {
    pub(crate) refitted: Refitted<W>,
    /// What each node cost when it was built, see [`Part::price`].
    pub(crate) prices: Vec<f32>,
    /// Subtrees, and instances, that stayed as they were.
    pub(crate) kept: usize,
    /// Triangles that were built over one by one.
    pub(crate) loose: usize,
}

/// What the new tree is built over.
struct Cut {
    /// Triangles that are in no subtree that stays, in the order of their ids.
    loose: Vec<Packed>,
    kept: Vec<Kept>,
}

/// A subtree, a leaf or an instance that stays.
#[derive(Clone, Copy)]
struct Kept {
    child: Child,
    bounds: Aabb,
    part: Part,
}

/// A tree with new upper levels and new bad parts; `None` where too little could stay. `prices` are what the nodes cost when
/// they were built, `build` makes a tree over boxes.
pub(crate) fn repair<const W: usize>(
    old: &Refitted<W>,
    prices: &[f32],
    build: impl FnOnce(&[Aabb]) -> Result<Tree, BuildError>,
    cancel: &Cancel,
) -> Result<Option<Repaired<W>>, BuildError> {
    let parts = survey(&old.wide, &old.triangles);
    let cut = cut(&old.wide, &parts, prices);
    if cut.loose.len() as f64 > LOOSE_MAX * old.wide.triangles as f64 || old.wide.nodes.is_empty() {
        return Ok(None);
    }

    // Build the new tree, subtrees standing where instances would.
    let of_loose = cut.loose.iter().map(|packed| Aabb::of_points(&packed.corners));
    let boxes: Vec<_> = of_loose.chain(cut.kept.iter().map(|kept| kept.bounds)).collect();
    let tree = split_leaves(build(&boxes)?, &boxes, cut.loose.len())?;
    let numbers: Vec<_> = (0..cut.kept.len() as u32).collect();
    let numbered = Numbered { first: cut.loose.len() as u32, numbers: &numbers };
    let fetch = |prims: &[u32], packed: &mut [Packed]| {
        for (&prim, packed) in prims.iter().zip(packed) {
            *packed = cut.loose[prim as usize];
        }
    };
    let top: Wide<W> = lower(&tree, numbered, &fetch, Collapse::Optimal, cancel)?;
    drop(tree);

    let Joined { wide, prices, triangles, boxes } = join(old, prices, &top, &cut.kept, cancel)?;
    let areas = Areas { boxes, prims: old.areas.prims };
    let refitted = Refitted { wide, bounds: old.bounds, areas, triangles };
    Ok(Some(Repaired { refitted, prices, kept: cut.kept.len(), loose: cut.loose.len() }))
}

/// Finds what stays, from the root down.
fn cut<const W: usize>(wide: &Wide<W>, parts: &[Part], prices: &[f32]) -> Cut {
    let mut cut = Cut { loose: Vec::new(), kept: Vec::new() };
    let mut open = Vec::new();
    if let ChildKind::Inner { node } = wide.root.kind() {
        open.push(node);
    }
    while let Some(at) = open.pop() {
        let node = &wide.nodes[at];
        for slot in 0..used(&node.children) {
            let (child, bounds) = (node.children[slot], <Plain as Packing<W>>::bounds(node, slot));
            // An instance that went.
            if bounds.is_empty() {
                continue;
            }
            match child.kind() {
                ChildKind::Inner { node: below } => {
                    let part = parts[below];
                    if part.triangles <= KEEP_MAX
                        && part.nodes <= KEEP_MAX
                        && part.price() <= DECAYED * prices[below]
                    {
                        cut.kept.push(Kept { child, bounds, part });
                    } else {
                        open.push(below);
                    }
                }
                ChildKind::Leaf { first, count } if triangles_of(wide, child).is_some() => {
                    let first_loose = cut.loose.len();
                    (0..count).for_each(|at| cut.loose.push(unpack(wide, first, count, at)));
                    let (_, prims) = around(&cut.loose[first_loose..]);
                    if count > 1 && half_area(&bounds) <= prims {
                        cut.loose.truncate(first_loose);
                        let part = Part { prims, triangles: count as u32, ..Part::default() };
                        cut.kept.push(Kept { child, bounds, part });
                    }
                }
                ChildKind::Leaf { .. } => {
                    let part = Part { prims: half_area(&bounds), ..Part::default() };
                    cut.kept.push(Kept { child, bounds, part });
                }
            }
        }
    }
    // A triangle that was in several leaves need not be any more.
    cut.loose.sort_unstable_by_key(|packed| packed.id);
    cut.loose.dedup_by_key(|packed| packed.id);
    cut
}

/// A triangle of a leaf.
fn unpack<const W: usize>(wide: &Wide<W>, first: usize, count: usize, at: usize) -> Packed {
    let leaf = <Plain as Packing<W>>::leaf(&wide.words, first);
    let corner = |corner: usize| {
        let word = |axis: usize| leaf[(3 * corner + axis) * count + at];
        [word(0), word(1), word(2)]
    };
    let id = <Plain as Packing<W>>::id(leaf, count, at);
    Packed { corners: [corner(0), corner(1), corner(2)], id }
}

/// Where a subtree goes.
struct Place<'a, const W: usize> {
    kept: Kept,
    /// The number of its first node, and of its first triangle.
    node: usize,
    triangle: usize,
    nodes: &'a mut [Node<W>],
    prices: &'a mut [f32],
    areas: &'a mut [f32],
    words: &'a mut [f32],
}

/// A tree that was put together.
struct Joined<const W: usize> {
    wide: Wide<W>,
    /// What each node cost when it was built.
    prices: Vec<f32>,
    /// Half areas of the boxes of the triangles in the leaves of each node.
    triangles: Vec<f32>,
    /// Half areas of all boxes together.
    boxes: f64,
}

/// The new upper levels, and behind them, in their order, what stays.
fn join<const W: usize>(
    refitted: &Refitted<W>,
    old_prices: &[f32],
    top: &Wide<W>,
    kept: &[Kept],
    cancel: &Cancel,
) -> Result<Joined<W>, BuildError> {
    let old = &refitted.wide;
    // Number what stays in the order in which the new nodes name it.
    let mut places = alloc::vec![(0, 0); kept.len()];
    let mut order = Vec::with_capacity(kept.len());
    let (mut nodes_end, mut triangles_end) = (top.nodes.len(), top.triangles);
    let root = core::iter::once(&top.root);
    for child in root.chain(top.nodes.iter().flat_map(|node| &node.children)) {
        if let Some(at) = kept_at(top, *child) {
            places[at] = (nodes_end, triangles_end);
            order.push(at);
            nodes_end += kept[at].part.nodes as usize;
            triangles_end += kept[at].part.triangles as usize;
        }
    }
    let placed = |child: Child| match kept_at(top, child) {
        Some(at) => match kept[at].child.kind() {
            ChildKind::Inner { .. } => Child::inner(places[at].0 as u32),
            ChildKind::Leaf { count, .. } if kept[at].part.triangles > 0 => {
                Child::leaf(places[at].1, count)
            }
            ChildKind::Leaf { first, count } => {
                Child::leaf(first - old.triangles + triangles_end, count)
            }
        },
        None => child,
    };

    // Write the upper levels.
    let mut nodes = Pages::zeroed(nodes_end, "wide nodes")?;
    let mut words = Pages::zeroed(triangles_end * TRIANGLE_WORDS + BLOCK_WORDS, "leaf blocks")?;
    let mut prices = memory::try_filled(0.0, nodes_end, "prices of nodes")?;
    let mut areas = memory::try_filled(0.0, nodes_end, "areas of nodes")?;
    let (of_top, mut nodes_left) = nodes.split_at_mut(top.nodes.len());
    let of_loose = top.triangles * TRIANGLE_WORDS;
    let (loose_words, mut words_left) = words.split_at_mut(of_loose);
    loose_words.copy_from_slice(&top.words[..of_loose]);
    for (node, from) in of_top.iter_mut().zip(&*top.nodes) {
        *node = *from;
        node.children.iter_mut().for_each(|child| *child = placed(*child));
    }
    let (top_prices, mut prices_left) = prices.split_at_mut(of_top.len());
    let (top_areas, mut areas_left) = areas.split_at_mut(of_top.len());
    let boxes = price_top(top, kept, top_prices, top_areas);

    // Copy what stays.
    let mut jobs = Vec::new();
    for chunk in order.chunks(CHUNK) {
        let mut job = Vec::with_capacity(chunk.len());
        for &at in chunk {
            let Kept { part, .. } = kept[at];
            let (count, triangles) = (part.nodes as usize, part.triangles as usize);
            let nodes;
            (nodes, nodes_left) = nodes_left.split_at_mut(count);
            let prices;
            (prices, prices_left) = prices_left.split_at_mut(count);
            let areas;
            (areas, areas_left) = areas_left.split_at_mut(count);
            let words;
            (words, words_left) = words_left.split_at_mut(triangles * TRIANGLE_WORDS);
            let (node, triangle) = places[at];
            job.push(Place { kept: kept[at], node, triangle, nodes, prices, areas, words });
        }
        jobs.push(job);
    }
    parallel::map(jobs, |job| {
        let mut stack = Vec::new();
        job.into_iter().for_each(|it| it.copy(refitted, old_prices, triangles_end, &mut stack));
        cancel.check()
    })
    .into_iter()
    .collect::<Result<(), _>>()?;
    let root = placed(top.root);
    let wide = Wide { nodes, root, words, triangles: triangles_end };
    Ok(Joined { wide, prices, triangles: areas, boxes })
}

/// The number of what stays that stands in the place of an instance.
fn kept_at<const W: usize>(top: &Wide<W>, child: Child) -> Option<usize> {
    match child.kind() {
        ChildKind::Leaf { first, .. } if child != Child::END => first.checked_sub(top.triangles),
        _ => None,
    }
}

/// What each new node costs, as it is built; returns the half areas of all boxes, of what stays included.
fn price_top<const W: usize>(
    top: &Wide<W>,
    kept: &[Kept],
    prices: &mut [f32],
    areas: &mut [f32],
) -> f64 {
    let mut sums = alloc::vec![Part::default(); top.nodes.len()];
    for (at, node) in top.nodes.iter().enumerate().rev() {
        let (mut part, mut loose) = (Part::default(), 0.0);
        let mut all = Aabb::EMPTY;
        for slot in 0..used(&node.children) {
            let bounds = <Plain as Packing<W>>::bounds(node, slot);
            all = all.union(&bounds);
            part.boxes += half_area(&bounds);
            let below = match (node.children[slot].kind(), kept_at(top, node.children[slot])) {
                (ChildKind::Inner { node }, _) => sums[node],
                (_, Some(at)) => kept[at].part,
                (ChildKind::Leaf { first, count }, None) => {
                    let area =
                        |at| half_area(&Aabb::of_points(&unpack(top, first, count, at).corners));
                    let prims = (0..count).map(area).sum();
                    loose += prims;
                    Part { prims, ..Part::default() }
                }
            };
            part.boxes += below.boxes;
            part.prims += below.prims;
        }
        part.own = half_area(&all);
        (sums[at], prices[at], areas[at]) = (part, part.price(), loose as f32);
    }
    match (top.root.kind(), kept_at(top, top.root)) {
        (ChildKind::Inner { node }, _) => sums[node].boxes,
        (_, Some(at)) => kept[at].part.boxes,
        _ => 0.0,
    }
}

impl<const W: usize> Place<'_, W> {
    /// Copies the subtree, nodes and leaves in the order in which they were.
    fn copy(
        self,
        refitted: &Refitted<W>,
        old_prices: &[f32],
        triangles: usize,
        stack: &mut Vec<(usize, usize, usize)>,
    ) {
        let Self { kept, node, triangle, nodes, prices, areas, mut words } = self;
        let old = &refitted.wide;
        let root = match kept.child.kind() {
            ChildKind::Inner { node } => node,
            ChildKind::Leaf { first, .. } => {
                // The words of a leaf of triangles; of an instance there are none.
                if !words.is_empty() {
                    let from = first * TRIANGLE_WORDS;
                    words.copy_from_slice(&old.words[from..from + words.len()]);
                }
                return;
            }
        };
        let (mut next, mut next_triangle) = (0, triangle);
        stack.push((root, usize::MAX, 0));
        while let Some((from, parent, slot)) = stack.pop() {
            let at = next;
            next += 1;
            nodes[at] = old.nodes[from];
            prices[at] = old_prices[from];
            areas[at] = refitted.triangles[from];
            if let Some(parent) = nodes.get_mut(parent) {
                parent.children[slot] = Child::inner((node + at) as u32);
            }
            let below = stack.len();
            for slot in 0..used(&nodes[at].children) {
                let child = nodes[at].children[slot];
                match child.kind() {
                    ChildKind::Inner { node } => stack.push((node, at, slot)),
                    ChildKind::Leaf { first, count } if first < old.triangles => {
                        let block;
                        (block, words) = words.split_at_mut(count * TRIANGLE_WORDS);
                        let from = first * TRIANGLE_WORDS;
                        block.copy_from_slice(&old.words[from..from + block.len()]);
                        nodes[at].children[slot] = Child::leaf(next_triangle, count);
                        next_triangle += count;
                    }
                    ChildKind::Leaf { first, count } => {
                        let instance = first - old.triangles;
                        nodes[at].children[slot] = Child::leaf(triangles + instance, count);
                    }
                }
            }
            // What was first is popped first.
            stack[below..].sort_unstable_by_key(|&(node, ..)| Reverse(node));
        }
    }
}

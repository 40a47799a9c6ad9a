//! Lowering: a binary tree becomes wide nodes, its triangles blocks of words.
//!
//! The tree is cut below its top into many subtrees. Each is planned by itself, then the top over
//! them ([`super::collapse`]), then each is written by itself, straight to where it stays. What is
//! written depends on the tree alone, not on the number of threads.
//!
//! Cost: O(n) time; beyond the result about 36 bytes an inner node of the tree for the plans, and
//! the wide nodes twice.

use super::collapse::{Below, Cost, Plan};
use super::wide::{BLOCK_WORDS, Child, ENTRIES_MAX, LEAF_MAX, Node, TRIANGLE_WORDS, Wide};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::{self, Pages};
use crate::tree::{self, Kind, Tree};
use alloc::borrow::Cow;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Trees with fewer nodes are one piece.
const CUT_MIN: usize = 8192;
/// Levels of the tree above the cut: up to 256 pieces.
const CUT_LEVELS: usize = 8;

/// A triangle as leaves store it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packed {
    pub(crate) corners: [[f32; 3]; 3],
    pub(crate) id: u32,
}

/// A lowered tree, and the instances in the order of its leaves.
pub(crate) struct Lowered<const W: usize> {
    pub(crate) wide: Wide<W>,
    pub(crate) instances: Vec<u32>,
}

/// Lowers a tree over boxes `bounds`: of `triangles` triangles, numbered first, and of instances,
/// numbered after them. `source` gives the triangle of a number.
pub(crate) fn lower<const W: usize>(
    tree: &Tree,
    bounds: &[Aabb],
    triangles: usize,
    source: &(impl Fn(u32) -> Packed + Sync),
    cancel: &Cancel,
) -> Result<Lowered<W>, BuildError> {
    if tree.prims.len() > ENTRIES_MAX {
        return Err(BuildError::TooManyPrims { prims: tree.prims.len() as u64 });
    }
    let tree = &*split_leaves(tree, bounds, triangles);
    let lowering = Lowering { tree, source, first_instance: triangles as u32, cancel };
    lowering.run()
}

/// What a leaf of the wide tree may hold: few entries, all of one kind. Other leaves of the tree are
/// cut in halves until they do.
fn split_leaves<'a>(tree: &'a Tree, bounds: &[Aabb], triangles: usize) -> Cow<'a, Tree> {
    let fits = |prims: &[u32]| {
        let instances = prims.iter().filter(|&&prim| prim as usize >= triangles).count();
        prims.len() <= LEAF_MAX && (instances == 0 || instances == prims.len())
    };
    let fit = |node: &tree::Node| match node.kind() {
        Kind::Leaf { first, count } => fits(&tree.prims[first..first + count]),
        Kind::Inner { .. } => true,
    };
    if tree.nodes.iter().all(fit) {
        return Cow::Borrowed(tree);
    }
    let mut tree = tree.clone();
    let mut at = 0;
    while at < tree.nodes.len() {
        if let Kind::Leaf { first, count } = tree.nodes[at].kind()
            && !fits(&tree.prims[first..first + count])
        {
            let prims = &mut tree.prims[first..first + count];
            // Triangles go before instances; a leaf of one kind is halved.
            prims.sort_unstable();
            let of_triangles = prims.partition_point(|&prim| (prim as usize) < triangles);
            let left = if of_triangles % count == 0 { count / 2 } else { of_triangles };
            let around = |prims: &[u32]| {
                prims.iter().fold(Aabb::EMPTY, |all, &prim| all.union(&bounds[prim as usize]))
            };
            let boxes = [around(&prims[..left]), around(&prims[left..])];
            let below = tree.nodes.len();
            tree.nodes[at] = tree::Node::inner(tree.nodes[at].bounds, below);
            tree.nodes.push(tree::Node::leaf(boxes[0], first, left));
            tree.nodes.push(tree::Node::leaf(boxes[1], first + left, count - left));
        }
        at += 1;
    }
    Cow::Owned(tree)
}

struct Lowering<'a, F> {
    tree: &'a Tree,
    source: &'a F,
    first_instance: u32,
    cancel: &'a Cancel,
}

/// A part of the tree that is planned and written by itself.
struct Piece<const W: usize> {
    root: u32,
    plan: Plan<W>,
    /// Triangles and instances below, counted once for each leaf.
    entries: [usize; 2],
}

/// Where a part writes.
struct Output<'a, const W: usize> {
    nodes: Vec<Node<W>>,
    /// Room for its triangles, in words, and the number of the first one.
    words: &'a mut [f32],
    triangle: usize,
    instances: Vec<u32>,
    /// The number of its first instance, as an entry.
    instance: usize,
}

impl<F: Fn(u32) -> Packed + Sync> Lowering<'_, F> {
    fn run<const W: usize>(&self) -> Result<Lowered<W>, BuildError> {
        if self.tree.nodes.is_empty() {
            let words = Pages::zeroed(BLOCK_WORDS, "leaf blocks")?;
            let nodes = Pages::zeroed(0, "wide nodes")?;
            let wide = Wide { nodes, root: Child::END, words, triangles: 0 };
            return Ok(Lowered { wide, instances: Vec::new() });
        }

        // Plan the pieces, then the top over them.
        let root_area = self.tree.bounds().half_area();
        let scale = if root_area > 0.0 { 1.0 / root_area } else { 0.0 };
        let pieces = parallel::map(self.cut(), |root| self.piece::<W>(root, scale));
        let pieces = pieces.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
        let by_root: BTreeMap<u32, usize> =
            pieces.iter().enumerate().map(|(index, piece)| (piece.root, index)).collect();
        let top = Plan::new(self.tree, 0, scale, |node| {
            Some(pieces[*by_root.get(&node)?].plan.cost.opaque())
        });

        // Write the top, with the places in its nodes that the pieces are to fill.
        let (mut nodes, mut root, filled) = self.write_top(&top, &pieces, &by_root);

        // Write the pieces.
        let triangles = pieces.iter().map(|piece| piece.entries[0]).sum::<usize>();
        let mut words = Pages::zeroed(triangles * TRIANGLE_WORDS + BLOCK_WORDS, "leaf blocks")?;
        let mut rest = &mut *words;
        let mut jobs = Vec::with_capacity(pieces.len());
        let (mut triangle, mut instance) = (0, triangles);
        for (piece, entries) in pieces.iter().zip(&filled) {
            let (words, after) = rest.split_at_mut(piece.entries[0] * TRIANGLE_WORDS);
            rest = after;
            let (nodes, instances) = (Vec::new(), Vec::new());
            jobs.push((piece, entries, Output { nodes, words, triangle, instances, instance }));
            triangle += piece.entries[0];
            instance += piece.entries[1];
        }
        let written = parallel::map(jobs, |(piece, entries, mut output)| {
            let children = self.write_piece(&piece.plan, entries, &mut output)?;
            Ok((output.nodes, output.instances, children))
        });
        let mut parts = Vec::with_capacity(written.len());
        for part in written {
            parts.push(part.map_err(|error: Cancelled| error)?);
        }
        drop(pieces);

        // Put the nodes together.
        let mut base = nodes.len() as u32;
        let mut bases = Vec::with_capacity(parts.len());
        for ((part, _, children), entries) in parts.iter().zip(&filled) {
            for (child, entry) in children.iter().zip(entries) {
                let child = moved(*child, base);
                match entry.place {
                    Some((node, slot)) => nodes[node].children[slot] = child,
                    None => root = child,
                }
            }
            bases.push(base);
            base += part.len() as u32;
        }
        let mut all = Pages::zeroed(base as usize, "wide nodes")?;
        let (own, mut rest) = all.split_at_mut(nodes.len());
        own.copy_from_slice(&nodes);
        let mut instances = memory::try_with_capacity(instance - triangles, "leaf instances")?;
        let mut copies = Vec::with_capacity(parts.len());
        for ((nodes, of_part, _), base) in parts.into_iter().zip(bases) {
            let (room, after) = rest.split_at_mut(nodes.len());
            rest = after;
            instances.extend(of_part);
            copies.push((nodes, room, base));
        }
        parallel::map(copies, |(nodes, room, base)| {
            for (node, place) in nodes.iter().zip(room) {
                *place = *node;
                place.children.iter_mut().for_each(|child| *child = moved(*child, base));
            }
        });
        let wide = Wide { nodes: all, root, words, triangles };
        Ok(Lowered { wide, instances })
    }

    /// The roots of the pieces: everything at some depth, and leaves above it.
    fn cut(&self) -> Vec<u32> {
        let mut cut = alloc::vec![0];
        if self.tree.nodes.len() < CUT_MIN {
            return cut;
        }
        for _ in 0..CUT_LEVELS {
            let opened = cut.iter().flat_map(|&node| match self.tree.nodes[node as usize].kind() {
                Kind::Inner { left } => [Some(left as u32), Some(left as u32 + 1)],
                Kind::Leaf { .. } => [Some(node), None],
            });
            cut = opened.flatten().collect();
        }
        cut
    }

    fn piece<const W: usize>(&self, root: u32, scale: f64) -> Result<Piece<W>, Cancelled> {
        self.cancel.check()?;
        let leaf = |node: u32| match self.tree.nodes[node as usize].kind() {
            Kind::Inner { .. } => None,
            Kind::Leaf { first, count } => {
                let node = &self.tree.nodes[node as usize];
                let is_instance = self.tree.prims[first] >= self.first_instance;
                let area = (node.bounds.half_area() * scale) as f32;
                Some((Cost::leaf(area, count, [!is_instance, is_instance]), is_instance, count))
            }
        };
        let mut plan = Plan::new(self.tree, root, scale, |node| leaf(node).map(|leaf| leaf.0));
        let mut entries = [0; 2];
        let below = plan.nodes.iter().flat_map(|planned| planned.below);
        for below in below.chain((plan.nodes.is_empty()).then_some(Below::Tree(root))) {
            if let Below::Tree(node) = below
                && let Some((cost, is_instance, count)) = leaf(node)
            {
                entries[usize::from(is_instance)] += count;
                if plan.nodes.is_empty() {
                    plan.cost = cost;
                }
            }
        }
        Ok(Piece { root, plan, entries })
    }

    /// The nodes above the pieces, the first of them if there is one, and for each piece what of it
    /// fills which slots.
    fn write_top<const W: usize>(
        &self,
        top: &Plan<W>,
        pieces: &[Piece<W>],
        by_root: &BTreeMap<u32, usize>,
    ) -> (Vec<Node<W>>, Child, Vec<Vec<Entry>>) {
        let mut filled = alloc::vec![Vec::new(); pieces.len()];
        let mut nodes: Vec<Node<W>> = Vec::new();
        if top.nodes.is_empty() {
            filled[0].push(Entry { below: whole(&pieces[0]), place: None });
            return (nodes, Child::END, filled);
        }
        let (mut slots, mut pending) = (Vec::new(), Vec::new());
        let mut open = alloc::vec![(0_u32, None)];
        while let Some((at, place)) = open.pop() {
            let here = nodes.len();
            nodes.push(Node::EMPTY);
            if let Some((node, slot)) = place {
                let parent: &mut Node<W> = &mut nodes[node];
                parent.children[slot] = Child::inner(here as u32);
            }

            // Spend the slots on nodes of the top, and what reaches pieces on nodes of these.
            top.spend(at, W, true, &mut slots, &mut pending);
            let mut children = Vec::with_capacity(W);
            for (below, share) in slots.drain(..) {
                let piece = match below {
                    Below::Planned(index) => {
                        children.push((self.bounds(top.nodes[index as usize].node), None, below));
                        continue;
                    }
                    Below::Tree(node) => by_root[&node],
                };
                let plan = &pieces[piece].plan;
                let mut inside = Vec::new();
                match whole(&pieces[piece]) {
                    Below::Planned(at) => plan.spend(at, share, false, &mut inside, &mut pending),
                    leaf @ Below::Tree(_) => inside.push((leaf, 1)),
                }
                children.extend(
                    inside
                        .into_iter()
                        .map(|(below, _)| (self.bounds(node_of(plan, below)), Some(piece), below)),
                );
            }
            children.sort_by(|a, b| a.0.half_area().total_cmp(&b.0.half_area()));
            for (slot, (bounds, piece, below)) in children.into_iter().enumerate() {
                nodes[here].set(slot, &bounds, Child::END);
                match (piece, below) {
                    (Some(piece), below) => {
                        filled[piece].push(Entry { below, place: Some((here, slot)) });
                    }
                    (None, Below::Planned(index)) => open.push((index, Some((here, slot)))),
                    // Every end of the top is a piece.
                    (None, Below::Tree(_)) => {}
                }
            }
        }
        (nodes, Child::inner(0), filled)
    }

    fn bounds(&self, node: u32) -> Aabb {
        self.tree.nodes[node as usize].bounds
    }

    /// Writes what fills the top's slots; returns their words, with nodes counted from the piece's
    /// first one.
    fn write_piece<const W: usize>(
        &self,
        plan: &Plan<W>,
        entries: &[Entry],
        output: &mut Output<'_, W>,
    ) -> Result<Vec<Child>, Cancelled> {
        let mut children = Vec::with_capacity(entries.len());
        let (mut slots, mut pending, mut open) = (Vec::new(), Vec::new(), Vec::new());
        for entry in entries {
            let child = match self.is_leaf(plan, entry.below) {
                Some(node) => self.write_leaf(node, output),
                None => {
                    open.push((entry.below, None));
                    Child::inner(output.nodes.len() as u32)
                }
            };
            children.push(child);
            while let Some((below, place)) = open.pop() {
                self.cancel.check()?;
                let Below::Planned(at) = below else { continue };
                let here = output.nodes.len();
                if let Some((node, slot)) = place {
                    let parent: &mut Node<W> = &mut output.nodes[node];
                    parent.children[slot] = Child::inner(here as u32);
                }
                plan.spend(at, W, true, &mut slots, &mut pending);
                let mut node = Node::EMPTY;
                // Largest last: any-hit walks go there first, and its subtree follows the node.
                let area = |below: &Below| self.bounds(node_of(plan, *below)).half_area();
                slots.sort_by(|a, b| area(&a.0).total_cmp(&area(&b.0)));
                for (slot, (below, _)) in slots.drain(..).enumerate() {
                    let child = match self.is_leaf(plan, below) {
                        Some(leaf) => self.write_leaf(leaf, output),
                        None => {
                            open.push((below, Some((here, slot))));
                            Child::END
                        }
                    };
                    node.set(slot, &self.bounds(node_of(plan, below)), child);
                }
                output.nodes.push(node);
            }
        }
        Ok(children)
    }

    /// The tree's node of which a leaf is made, if one is.
    fn is_leaf<const W: usize>(&self, plan: &Plan<W>, below: Below) -> Option<u32> {
        match below {
            Below::Planned(index) => {
                let planned = &plan.nodes[index as usize];
                planned.leaf.then_some(planned.node)
            }
            Below::Tree(node) => Some(node),
        }
    }

    /// Packs everything below `node`: at most `LEAF_MAX` entries of one kind.
    fn write_leaf<const W: usize>(&self, node: u32, output: &mut Output<'_, W>) -> Child {
        // Gather; a primitive that was split may be there more than once.
        let mut prims = [u32::MAX; LEAF_MAX];
        let mut count = 0;
        let mut open = [node; 2 * LEAF_MAX];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            match self.tree.nodes[open[len] as usize].kind() {
                Kind::Inner { left } => {
                    open[len..len + 2].copy_from_slice(&[left as u32 + 1, left as u32]);
                    len += 2;
                }
                Kind::Leaf { first, count: entries } => {
                    for &prim in &self.tree.prims[first..first + entries] {
                        if !prims[..count].contains(&prim) {
                            prims[count] = prim;
                            count += 1;
                        }
                    }
                }
            }
        }
        let prims = &prims[..count];
        if prims[0] >= self.first_instance {
            let first = output.instance + output.instances.len();
            output.instances.extend(prims.iter().map(|prim| prim - self.first_instance));
            return Child::leaf(first, count);
        }

        // Rows as long as the leaf has triangles.
        let words = core::mem::take(&mut output.words);
        let (block, rest) = words.split_at_mut(count * TRIANGLE_WORDS);
        output.words = rest;
        for (lane, &prim) in prims.iter().enumerate() {
            let Packed { corners, id } = (self.source)(prim);
            for corner in 0..3 {
                for axis in 0..3 {
                    block[(3 * corner + axis) * count + lane] = corners[corner][axis];
                }
            }
            block[9 * count + lane] = f32::from_bits(id);
        }
        let first = output.triangle;
        output.triangle += count;
        Child::leaf(first, count)
    }
}

/// What fills one slot of the top: a node of a piece.
#[derive(Clone, Copy, Debug)]
struct Entry {
    below: Below,
    /// Node and slot; none if it is the root of all.
    place: Option<(usize, usize)>,
}

/// The tree's node.
fn node_of<const W: usize>(plan: &Plan<W>, below: Below) -> u32 {
    match below {
        Below::Planned(index) => plan.nodes[index as usize].node,
        Below::Tree(node) => node,
    }
}

/// All of a piece.
fn whole<const W: usize>(piece: &Piece<W>) -> Below {
    if piece.plan.nodes.is_empty() { Below::Tree(piece.root) } else { Below::Planned(0) }
}

/// A child whose nodes were counted from `base` on.
fn moved(child: Child, base: u32) -> Child {
    if child.is_inner() { Child::inner(child.0 + base) } else { child }
}

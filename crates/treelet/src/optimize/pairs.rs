//! A binary tree that can be rearranged: siblings share a cache line, and know their parent.
//!
//! A subtree moves by rewriting three places and the parents of two pairs; nothing is allocated and
//! nothing is freed. Boxes are tight throughout: an inner node's is the union of its children's.
//!
//! Cost: 68 bytes a leaf, and the list of primitives, kept from the tree.

use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::Cancel;
use crate::memory;
use crate::tree::{DEPTH_MAX, Kind, Node, Tree};
use alloc::vec::Vec;

/// A node: its pair times two, plus its side.
pub(super) type Id = u32;

/// The root shares its pair with a node that is not there.
pub(super) const ROOT: Id = 1;

/// Passes over nodes are interrupted at most this many steps apart.
const CHUNK: usize = 4096;

/// Marks inner nodes in [`Place::word`].
const INNER: u32 = 1 << 31;

/// What stands at an id, 32 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) bounds: Aabb,
    /// Inner: the pair of the children. Leaf: start in the list of primitives.
    first: u32,
    /// Inner: [`INNER`] plus the levels below. Leaf: how many primitives.
    word: u32,
}

impl Place {
    const NOTHING: Self = Self { bounds: Aabb::EMPTY, first: 0, word: 0 };

    /// The left child of an inner node; the right one is the next id.
    #[inline(always)]
    pub(super) fn left(&self) -> Option<Id> {
        (self.word & INNER != 0).then_some(2 * self.first)
    }

    /// Levels below: 0 for a leaf.
    fn height(&self) -> u32 {
        if self.word & INNER != 0 { self.word & !INNER } else { 0 }
    }
}

/// Two siblings.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Pair(pub(super) [Place; 2]);

const _: () = assert!(size_of::<Pair>() == 64, "one visit of two siblings is one cache line");

/// Something that is to be put into the tree, and what taking it from where it is saves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loose {
    /// Its box.
    pub(super) bounds: Aabb,
    /// The node whose place its taking changes.
    pub(super) below: Id,
    /// The box there, once it is gone.
    pub(super) rest: Aabb,
    /// What is saved at that place; nodes above it save what they shrink by.
    pub(super) saved: f64,
    /// Levels below it.
    height: u32,
}

/// Two subtrees that are out of the tree, and what was around them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Apart {
    node: Id,
    /// Where its sibling is now.
    pub(super) parent: Id,
    /// Their pair's.
    left: Id,
    pub(super) children: [Place; 2],
    /// By how much the cost fell.
    pub(super) saved: f64,
}

impl Apart {
    /// The pairs that are free.
    pub(super) fn free(&self) -> [u32; 2] {
        [self.node / 2, self.left / 2]
    }
}

/// The path from a node to the root, both included.
pub(super) struct Path {
    ids: [Id; DEPTH_MAX as usize],
    len: usize,
}

impl Path {
    fn ids(&self) -> &[Id] {
        &self.ids[..self.len]
    }
}

/// A tree over at least one primitive.
#[derive(Debug)]
pub(super) struct Pairs {
    pairs: Vec<Pair>,
    /// By pair: the inner node that has it.
    parents: Vec<Id>,
    prims: Vec<u32>,
}

impl Pairs {
    /// Takes a tree of at least one node apart, and makes its inner boxes tight.
    pub(super) fn new(tree: Tree, cancel: &Cancel) -> Result<Self, BuildError> {
        let Tree { nodes, prims } = tree;
        // Nodes but the root come in pairs, so node `i` is id `i + 1`.
        let place = |node: &Node| {
            let (first, word) = match node.kind() {
                Kind::Inner { left } => (left.div_ceil(2) as u32, INNER),
                Kind::Leaf { first, count } => (first as u32, count as u32),
            };
            Place { bounds: node.bounds, first, word }
        };
        let count = nodes.len().div_ceil(2);
        let mut pairs = memory::try_with_capacity(count, "the rearranged tree")?;
        let parents = memory::try_filled(0, count, "parents of the rearranged tree")?;
        pairs.push(Pair([Place::NOTHING, place(&nodes[0])]));
        for chunk in nodes[1..].chunks(CHUNK) {
            cancel.check()?;
            let siblings = chunk.chunks_exact(2);
            pairs.extend(siblings.map(|pair| Pair([place(&pair[0]), place(&pair[1])])));
        }
        let mut out = Self { pairs, parents, prims };
        for id in (ROOT..=nodes.len() as Id).rev() {
            if id % CHUNK as Id == 0 {
                cancel.check()?;
            }
            let place = *out.at(id);
            if place.left().is_some() {
                out.put(id, out.around(place.first));
            }
        }
        Ok(out)
    }

    /// How many nodes there are; their ids are `1..=nodes`.
    pub(super) fn nodes(&self) -> usize {
        2 * self.pairs.len() - 1
    }

    pub(super) fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    #[inline(always)]
    pub(super) fn at(&self, id: Id) -> &Place {
        &self.pairs[id as usize / 2].0[id as usize % 2]
    }

    #[inline(always)]
    fn at_mut(&mut self, id: Id) -> &mut Place {
        &mut self.pairs[id as usize / 2].0[id as usize % 2]
    }

    #[inline(always)]
    pub(super) fn parent(&self, id: Id) -> Id {
        self.parents[id as usize / 2]
    }

    /// An inner node over a pair.
    fn around(&self, pair: u32) -> Place {
        let [left, right] = &self.pairs[pair as usize].0;
        let height = left.height().max(right.height()) + 1;
        Place { bounds: left.bounds.union(&right.bounds), first: pair, word: INNER | height }
    }

    fn path(&self, mut id: Id) -> Path {
        let mut path = Path { ids: [ROOT; DEPTH_MAX as usize], len: 0 };
        loop {
            path.ids[path.len] = id;
            path.len += 1;
            if id == ROOT {
                return path;
            }
            id = self.parent(id);
        }
    }

    /// A subtree, about to be taken away.
    pub(super) fn loosen(&self, node: Id) -> Loose {
        let parent = self.parent(node);
        Loose {
            bounds: self.at(node).bounds,
            below: parent,
            rest: self.at(node ^ 1).bounds,
            saved: self.at(parent).bounds.half_area(),
            height: self.at(node).height(),
        }
    }

    /// By how much the cost falls if `node` becomes the sibling of `target`; `None` if it cannot: the
    /// target is below it, or is where it is already, or the tree would grow too deep.
    pub(super) fn gain(&self, node: Id, target: Id) -> Option<f64> {
        if target == node || target == node ^ 1 || target == self.parent(node) {
            return None;
        }
        let to = self.path(target);
        if to.ids().contains(&node) { None } else { self.gain_beside(&self.loosen(node), &to) }
    }

    fn gain_beside(&self, loose: &Loose, to: &Path) -> Option<f64> {
        let (from, to) = (self.path(loose.below), to.ids());
        let from = from.ids();
        let target = self.at(to[0]);
        // The deepest of them has as many nodes above it as `to` has, and itself, and a new parent.
        if to.len() as u32 + 1 + loose.height.max(target.height()) > DEPTH_MAX {
            return None;
        }
        let common = from.iter().rev().zip(to.iter().rev()).take_while(|(a, b)| a == b).count();
        let bounds = &loose.bounds;

        // Taking it away: what is above shrinks.
        let mut gain = loose.saved;
        let mut below = loose.below;
        let mut rest = loose.rest;
        let shrinking = from.len() - common;
        for &above in from[..shrinking].iter().skip(1) {
            rest = rest.union(&self.at(below ^ 1).bounds);
            gain += self.at(above).bounds.half_area() - rest.half_area();
            below = above;
        }
        // Beside a node above it: that one shrinks below a new parent as large as it was.
        if common == to.len() {
            return Some(gain - rest.union(&self.at(below ^ 1).bounds).half_area());
        }
        // Anywhere else: a new parent, and what is above it grows.
        gain -= target.bounds.union(bounds).half_area();
        for &above in &to[1..to.len() - common] {
            let above = &self.at(above).bounds;
            if above.contains(bounds) {
                break;
            }
            gain -= above.union(bounds).half_area() - above.half_area();
        }
        Some(gain)
    }

    /// Makes `node` the sibling of `target`, where [`Pairs::gain`] says that it can be.
    pub(super) fn reinsert(&mut self, node: Id, target: Id) {
        let (sibling, parent) = (node ^ 1, self.parent(node));
        // The sibling takes its parent's place, the target the sibling's, the pair the target's.
        self.put(parent, *self.at(sibling));
        self.put(sibling, *self.at(target));
        self.put(target, self.around(node / 2));
        if parent != ROOT {
            self.refit(self.parent(parent));
        }
        if target != ROOT {
            self.refit(self.parent(target));
        }
    }

    fn put(&mut self, id: Id, place: Place) {
        *self.at_mut(id) = place;
        if place.left().is_some() {
            self.parents[place.first as usize] = id;
        }
    }

    /// Makes the boxes tight from an inner node on upward, as far as something changes; returns by how
    /// much their areas grow.
    fn refit(&mut self, mut id: Id) -> f64 {
        let mut growth = 0.0;
        loop {
            let now = self.around(self.at(id).first);
            let old = core::mem::replace(self.at_mut(id), now);
            growth += now.bounds.half_area() - old.bounds.half_area();
            if id == ROOT || old.bounds == now.bounds && old.word == now.word {
                return growth;
            }
            id = self.parent(id);
        }
    }

    /// The same above a place that changed.
    fn refit_above(&mut self, id: Id) -> f64 {
        if id == ROOT { 0.0 } else { self.refit(self.parent(id)) }
    }

    /// Takes an inner node but the root away, and the two subtrees below it, whose pair and whose
    /// own are then free.
    pub(super) fn take_apart(&mut self, node: Id) -> Option<Apart> {
        let left = self.at(node).left().filter(|_| node != ROOT)?;
        let (sibling, parent) = (node ^ 1, self.parent(node));
        let children = [*self.at(left), *self.at(left + 1)];
        let saved = self.at(node).bounds.half_area() + self.at(parent).bounds.half_area();
        self.put(parent, *self.at(sibling));
        let growth = self.refit_above(parent);
        Some(Apart { node, parent, left, children, saved: saved - growth })
    }

    /// Makes everything as it was before [`Pairs::take_apart`], where nothing else changed.
    pub(super) fn put_back(&mut self, apart: &Apart) {
        let Apart { node, parent, left, children, .. } = *apart;
        self.put(node ^ 1, *self.at(parent));
        self.put(left, children[0]);
        self.put(left + 1, children[1]);
        self.put(node, self.around(left / 2));
        self.put(parent, self.around(node / 2));
        self.refit_above(parent);
    }

    /// Makes something the sibling of `target`, in a free pair; returns what that costs. `None` if the
    /// tree would grow too deep.
    pub(super) fn insert(&mut self, place: Place, pair: u32, target: Id) -> Option<f64> {
        let height = place.height().max(self.at(target).height());
        if self.path(target).len as u32 + 1 + height > DEPTH_MAX {
            return None;
        }
        self.put(2 * pair, *self.at(target));
        self.put(2 * pair + 1, place);
        self.put(target, self.around(pair));
        Some(self.at(target).bounds.half_area() + self.refit_above(target))
    }

    /// Takes away again what was the last to be inserted, in that pair.
    pub(super) fn remove(&mut self, pair: u32) {
        let target = self.parent(2 * pair);
        self.put(target, *self.at(2 * pair));
        self.refit_above(target);
    }

    /// What [`Pairs::insert`] would cost.
    pub(super) fn cost_beside(&self, bounds: &Aabb, target: Id) -> f64 {
        let grown = |id: Id| self.at(id).bounds.union(bounds).half_area();
        let path = self.path(target);
        let above = path.ids()[1..].iter().map(|&id| (id, grown(id)));
        let growth = above.map(|(id, grown)| grown - self.at(id).bounds.half_area());
        grown(target) + growth.sum::<f64>()
    }

    /// Whether a node is `above` or below it.
    pub(super) fn is_below(&self, node: Id, above: Id) -> bool {
        self.path(node).ids().contains(&above)
    }

    /// The tree, depth first: the nodes of a left subtree come before those of the right one, and
    /// so do its primitives.
    pub(super) fn into_tree(self, cancel: &Cancel) -> Result<Tree, BuildError> {
        let mut nodes = memory::try_with_capacity(self.nodes(), "the tree's nodes")?;
        let mut prims = memory::try_with_capacity(self.prims.len(), "the tree's primitives")?;
        let nowhere = Node::leaf(Aabb::EMPTY, 0, 1);
        nodes.push(nowhere);
        let mut open = alloc::vec![(ROOT, 0_usize)];
        while let Some((id, to)) = open.pop() {
            if to % CHUNK == 0 {
                cancel.check()?;
            }
            let place = self.at(id);
            nodes[to] = match place.left() {
                Some(left) => {
                    let children = nodes.len();
                    nodes.extend([nowhere; 2]);
                    open.extend([(left + 1, children + 1), (left, children)]);
                    Node::inner(place.bounds, children)
                }
                None => {
                    let (first, count) = (place.first as usize, place.word as usize);
                    let start = prims.len();
                    prims.extend_from_slice(&self.prims[first..first + count]);
                    Node::leaf(place.bounds, start, count)
                }
            };
        }
        Ok(Tree { nodes, prims })
    }
}

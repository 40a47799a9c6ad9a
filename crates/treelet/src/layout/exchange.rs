//! Exchange: what went leaves a tree, what came is put into it, the rest stays where it is.
//!
//! Three steps. *Thinning* ([`thin`]) writes the leaves anew without the triangles that went and with the names that the others have
//! now, and every box around what is left. *Grafting* ([`graft`]) puts what came, each with a tree of its own, where boxes grow
//! least. Then all nodes are copied once more in the order of a walk, without those that hold nothing any more: children stand
//! after their parents, which a graft beside an inner node would break.
//!
//! Source: J. Bittner, M. Hapala, V. Havran, "Incremental BVH Construction for Ray Tracing", Computers & Graphics 47, 2015. Differs
//! from it: whole subtrees are inserted, not triangles, and a wide node may have room for one as it is.
//!
//! Cost: reads and writes every byte of the layout once, the nodes twice; and what [`graft`] says.

mod graft;
mod thin;

use super::lower::Packed;
use super::packing::Packing;
use super::refit::{Areas, Content, Refitted, of_node, own_box, survey, used};
use super::wide::{Child, ChildKind, ENTRIES_MAX, Wide};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::memory::{self, Pages};
use alloc::vec::Vec;
use core::cmp::Reverse;
use graft::Stock;
use thin::thin;

/// Nodes that one task copies.
const CHUNK: usize = 1024;

/// What became of the entries of leaves: their names now, `None` where they went.
pub(crate) struct Stay<'a> {
    /// Of a triangle, by its id.
    pub(crate) triangle: &'a (dyn Fn(u32) -> Option<u32> + Sync),
    /// Of an instance, or what is numbered after them.
    pub(crate) single: &'a (dyn Fn(usize) -> Option<usize> + Sync),
}

/// What came.
pub(crate) enum Twig<'a, const W: usize> {
    /// One that is alone in its leaf, by its number, and its box.
    Single(usize, Aabb),
    /// A tree over some primitives.
    Tree(Branch<'a, W>),
}

/// A tree that came.
pub(crate) struct Branch<'a, const W: usize> {
    pub(crate) wide: &'a Wide<W>,
    pub(crate) bounds: Aabb,
    /// What its triangles' ids are counted from here.
    pub(crate) first_id: u32,
    /// What the numbers of its other entries are counted from.
    pub(crate) first_number: usize,
    pub(crate) areas: Areas,
    /// What each node cost when it was built.
    pub(crate) prices: &'a [f32],
    /// Half areas of the boxes of the triangles in the leaves of each node.
    pub(crate) triangles: &'a [f32],
}

/// A tree whose content was exchanged.
pub(crate) struct Exchanged<const W: usize> {
    pub(crate) refitted: Refitted<W>,
    /// What each node cost when it was built.
    pub(crate) prices: Vec<f32>,
}

/// Why a tree is not exchanged.
pub(crate) enum Refused {
    /// A triangle is not fit for a scene.
    Unfit,
    /// Nothing of it is left, or it would have too many entries.
    Different,
}

/// The tree without what went and with what came. `content` names everything as it is named now; `prices` are what the nodes cost
/// when they were built, none if nobody will ask; `numbers` is how many instances, parts and ids there are now.
pub(crate) fn exchange<K: Packing<W>, const W: usize>(
    old: &Wide<W, K>,
    stay: &Stay<'_>,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    (twigs, numbers): (&[Twig<'_, W>], usize),
    prices: &[f32],
    cancel: &Cancel,
) -> Result<Result<Exchanged<W>, Refused>, BuildError> {
    // Room for all nodes: each that comes needs at most one more, to stand beside another.
    let branches = || twigs.iter().filter_map(Twig::branch);
    let nodes = branches().map(|it| it.wide.nodes.len()).sum::<usize>() + twigs.len();
    let triangles = branches().map(|it| it.wide.triangles).sum::<usize>();
    let Some(thinned) = thin(old, stay, content, [nodes, triangles], cancel)? else {
        return Ok(Err(Refused::Unfit));
    };
    if thinned.is_empty() || thinned.triangles + triangles + numbers > ENTRIES_MAX {
        return Ok(Err(Refused::Different));
    }

    let mut stock = Stock::new(thinned, triangles, prices)?;
    twigs.iter().for_each(|twig| stock.graft(twig));
    Ok(Ok(stock.arranged(cancel)?))
}

impl<const W: usize> Twig<'_, W> {
    fn branch(&self) -> Option<&Branch<'_, W>> {
        match self {
            Self::Single(..) => None,
            Self::Tree(branch) => Some(branch),
        }
    }
}

impl<const W: usize> Stock<W> {
    /// All nodes that hold something, in the order of a walk.
    fn arranged(self, cancel: &Cancel) -> Result<Exchanged<W>, BuildError> {
        let Self {
            nodes: old,
            len,
            words,
            triangles,
            prices: old_prices,
            areas: old_areas,
            prims,
            ..
        } = self;
        // Number them: what was first stays first.
        let mut order = memory::try_with_capacity(len, "order of nodes")?;
        let mut place = memory::try_filled(0_u32, len, "places of nodes")?;
        let mut open = alloc::vec![0_usize];
        while let Some(at) = open.pop() {
            place[at] = order.len() as u32;
            order.push(at as u32);
            let below = open.len();
            for child in &old[at].children[..used(&old[at].children)] {
                if let ChildKind::Inner { node } = child.kind() {
                    open.push(node);
                }
            }
            open[below..].sort_unstable_by_key(|&node| Reverse(node));
        }

        // Copy them.
        let count = order.len();
        let mut nodes = Pages::zeroed(count, "wide nodes")?;
        let mut prices = memory::try_filled(0.0, count, "prices of nodes")?;
        let mut areas = memory::try_filled(0.0, count, "areas of nodes")?;
        let places = nodes.chunks_mut(CHUNK).zip(prices.chunks_mut(CHUNK));
        let places = places.zip(areas.chunks_mut(CHUNK)).zip(order.chunks(CHUNK)).collect();
        let copied = parallel::map(places, |(((nodes, prices), areas), order)| {
            cancel.check()?;
            let (mut boxes, mut is_new) = (0.0, false);
            for (((node, price), area), &from) in nodes.iter_mut().zip(prices).zip(areas).zip(order)
            {
                let from = from as usize;
                *node = old[from];
                (*price, *area) = (old_prices[from], old_areas[from]);
                is_new |= price.is_nan();
                for child in &mut node.children {
                    if let ChildKind::Inner { node } = child.kind() {
                        *child = Child::inner(place[node]);
                    }
                }
                boxes += of_node(&node.planes).1;
            }
            Ok((boxes, is_new))
        });
        let (mut sum, mut is_new) = (0.0, false);
        for chunk in copied {
            let chunk: Result<_, Cancelled> = chunk;
            let (boxes, new) = chunk?;
            (sum, is_new) = (sum + boxes, is_new | new);
        }
        let bounds = own_box(&nodes[0]);
        let wide = Wide { nodes, root: Child::inner(0), words, triangles };

        // What stands between is worth what it is worth now.
        if is_new {
            let parts = survey(&wide, &areas);
            let known = prices.iter_mut().zip(&parts).filter(|(price, _)| price.is_nan());
            known.for_each(|(price, part)| *price = part.price());
        }
        let refitted =
            Refitted { wide, bounds, areas: Areas { boxes: sum, prims }, triangles: areas };
        Ok(Exchanged { refitted, prices })
    }
}

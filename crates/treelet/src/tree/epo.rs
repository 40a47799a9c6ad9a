//! End-point overlap: what a ray's end costs beyond what the surface area heuristic counts.
//!
//! Source: T. Aila, T. Karras, S. Laine, "On Quality Metrics of Bounding Volume Hierarchies", HPG
//! 2013. Rays end on surfaces. Where a ray ends, it visits every node whose box contains that point,
//! also those that the surface does not belong to: EPO is the price of these, for a point anywhere
//! on the surfaces.
//!
//! `EPO = sum over nodes of price(n) area(S_n) / area(S)`, where `S` are all primitives, and `S_n`
//! the part of them that lies in the box of `n` and belongs to no leaf below it.
//!
//! Two ways to it, which check each other. *Exact*: for each node, walk the tree from its root,
//! skip what is below the node, prune by boxes, cut triangles by the node's box. *Sampled*: draw
//! points of the surfaces, each part as likely as it is large, and find the boxes that contain
//! them; the mean of what those cost is EPO.
//!
//! Differs from the paper: a primitive in several leaves (`sbvh`) belongs to a node as a whole
//! if one of its leaves does, and counts once where it does not.
//!
//! Cost: exact, O(n) nodes times what overlaps each; sampled, a walk for each point, however large
//! the scene.

use super::draws::{Draws, Estimate, Sums};
use super::kinship::Kinship;
use super::surface::Surface;
use super::{Kind, SahConstants, Tree};
use crate::bounds::Aabb;
use crate::context::{Cancel, Cancelled, parallel};
use alloc::vec::Vec;

/// Nodes that are measured together. Those near the root take longest, and come first.
const NODES: usize = 64;

/// Points that are drawn together.
const POINTS: u32 = 4096;

impl Tree {
    /// The end-point overlap, exactly but for the last digits.
    ///
    /// # Errors
    ///
    /// Cancellation.
    pub fn epo(
        &self,
        surface: &dyn Surface,
        constants: &SahConstants,
        cancel: &Cancel,
    ) -> Result<f64, Cancelled> {
        let overlap = Overlap::new(self, surface);
        let sums = parallel::map_chunks(&self.nodes, NODES, |first, nodes| {
            let mut scratch = Scratch::default();
            let mut sum = 0.0;
            for (at, node) in nodes.iter().enumerate() {
                cancel.check()?;
                sum += constants.price(node) * overlap.foreign_area(first + at, &mut scratch);
            }
            Ok(sum)
        });
        let sum = sums.into_iter().sum::<Result<f64, Cancelled>>()?;
        let all = overlap.prims().map(|prim| surface.area(prim)).sum::<f64>();
        Ok(if all > 0.0 { sum / all } else { 0.0 })
    }

    /// The end-point overlap, from `points` points of the surfaces. The same for any number of
    /// threads.
    ///
    /// # Errors
    ///
    /// Cancellation.
    pub fn epo_sampled(
        &self,
        surface: &dyn Surface,
        constants: &SahConstants,
        points: u32,
        cancel: &Cancel,
    ) -> Result<Estimate, Cancelled> {
        let overlap = Overlap::new(self, surface);
        // Let each primitive be as likely as it is large.
        let mut ends = Vec::with_capacity(overlap.kinship.prims() as usize);
        let mut all = 0.0;
        for prim in overlap.prims() {
            all += surface.area(prim);
            ends.push((all, prim));
        }
        let Some(&(_, last)) = ends.last().filter(|_| all > 0.0) else {
            return Ok(Estimate::default());
        };

        let starts: Vec<u32> = (0..points).step_by(POINTS as usize).collect();
        let sums = parallel::map(starts, |start| {
            let mut stack = Vec::new();
            let mut sums = Sums::default();
            for index in start..start.saturating_add(POINTS).min(points) {
                cancel.check()?;
                let mut draws = Draws::new(SEED, u64::from(index));
                let place = all * draws.unit();
                let at = ends.partition_point(|&(end, _)| end <= place);
                let prim = ends.get(at).map_or(last, |&(_, prim)| prim);
                let point = surface.point(prim, [draws.unit(), draws.unit()]);
                sums.add(overlap.price_at(prim, point, constants, &mut stack));
            }
            Ok(sums)
        });
        let sums = sums.into_iter().collect::<Result<Vec<Sums>, Cancelled>>()?;
        Ok(sums.into_iter().fold(Sums::default(), Sums::join).mean())
    }
}

/// Tells this measurement's random numbers from others'.
const SEED: u64 = 0xE90;

/// What both ways look at.
struct Overlap<'a> {
    tree: &'a Tree,
    surface: &'a dyn Surface,
    kinship: Kinship,
    /// By node: the area of all below it. Only where no primitive repeats.
    below: Option<Vec<f64>>,
}

/// Memory that one node leaves to the next.
#[derive(Default)]
struct Scratch {
    stack: Vec<usize>,
    prims: Vec<u32>,
}

impl<'a> Overlap<'a> {
    fn new(tree: &'a Tree, surface: &'a dyn Surface) -> Self {
        let kinship = Kinship::new(tree);
        let below = (!kinship.repeats()).then(|| areas_below(tree, surface));
        Self { tree, surface, kinship, below }
    }

    /// Every primitive that is in a leaf, once.
    fn prims(&self) -> impl Iterator<Item = u32> {
        (0..self.kinship.prims()).filter(|&prim| self.kinship.is_housed(prim))
    }

    /// The area of what is in the node's box and belongs to no leaf below it.
    fn foreign_area(&self, node: usize, scratch: &mut Scratch) -> f64 {
        let region = &self.tree.nodes[node].bounds;
        let mut sum = 0.0;
        scratch.prims.clear();
        scratch.stack.clear();
        scratch.stack.push(0);
        while let Some(at) = scratch.stack.pop() {
            let other = &self.tree.nodes[at];
            if at == node || !overlap(&other.bounds, region) {
                continue;
            }
            // What is inside as a whole need not be looked into.
            if let Some(below) = &self.below
                && region.contains(&other.bounds)
                && !self.kinship.is_below(node, at)
            {
                sum += below[at];
                continue;
            }
            match other.kind() {
                Kind::Inner { left } => scratch.stack.extend([left + 1, left]),
                Kind::Leaf { first, count } => {
                    scratch.prims.extend_from_slice(&self.tree.prims[first..first + count]);
                }
            }
        }
        if self.below.is_none() {
            scratch.prims.retain(|&prim| !self.kinship.belongs(prim, node));
            scratch.prims.sort_unstable();
            scratch.prims.dedup();
        }
        let cut = scratch.prims.iter().map(|&prim| self.surface.area_inside(prim, region));
        sum + cut.sum::<f64>()
    }

    /// What the nodes cost that contain a point of a primitive which does not belong to them.
    fn price_at(
        &self,
        prim: u32,
        point: [f64; 3],
        constants: &SahConstants,
        stack: &mut Vec<usize>,
    ) -> f64 {
        let mut sum = 0.0;
        stack.clear();
        stack.push(0);
        while let Some(at) = stack.pop() {
            let node = &self.tree.nodes[at];
            if !holds(&node.bounds, point) {
                continue;
            }
            if !self.kinship.belongs(prim, at) {
                sum += constants.price(node);
            }
            if let Kind::Inner { left } = node.kind() {
                stack.extend([left, left + 1]);
            }
        }
        sum
    }
}

/// By node: the area of all primitives below it.
fn areas_below(tree: &Tree, surface: &dyn Surface) -> Vec<f64> {
    let mut below = alloc::vec![0.0; tree.nodes.len()];
    for (at, node) in tree.nodes.iter().enumerate().rev() {
        below[at] = match node.kind() {
            Kind::Inner { left } => below[left] + below[left + 1],
            Kind::Leaf { first, count } => {
                tree.prims[first..first + count].iter().map(|&prim| surface.area(prim)).sum()
            }
        };
    }
    below
}

/// Whether two closed boxes, neither of them empty, share a point.
#[inline]
fn overlap(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|axis| a.lo[axis] <= b.hi[axis] && b.lo[axis] <= a.hi[axis])
}

/// Whether a point is in the closed box.
#[inline]
fn holds(bounds: &Aabb, point: [f64; 3]) -> bool {
    (0..3).all(|axis| {
        f64::from(bounds.lo[axis]) <= point[axis] && point[axis] <= f64::from(bounds.hi[axis])
    })
}

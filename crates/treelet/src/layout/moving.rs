//! Trees of triangles that move: boxes that move along lines, over a segment of time.
//!
//! Beside the nodes of a wide tree there are [`Planes`] of deltas, in the order of the nodes and their slots: at `q`
//! steps after the segment's start, a plane lies at `base + q delta`, in f32. The words of the leaves are there
//! once for each time step that the segment touches; the corners of a moment lie between two of them.
//!
//! Sources: P. Christensen et al., "RenderMan: An Advanced Path-Tracing Architecture for Movie Rendering", ACM TOG
//! 37(3), 2018, section 4 (boxes interpolated in time); S. Woop, A. Afra, C. Benthin, "STBVH: A Spatial-Temporal
//! BVH for Efficient Multi-Segment Motion Blur", HPG 2017 (linear bounds over a time range, pushed outward where
//! inner steps leave them). Differs from the second: each segment is a tree of its own, of a power of two of
//! them, and not nodes that split time; so a walk chooses once, and nodes have no times.
//!
//! # The culling lemma, with time
//!
//! *The box of every node above a triangle, evaluated at a moment, contains the box of the triangle's corners,
//! evaluated at that moment, bit for bit.* Then what `geometry::triangle` derives for boxes that stand holds here.
//! Unlike there, it is not shown from node to node, but for each node and each triangle below it:
//!
//! - Between two samples (the steps inside the segment, and its ends) every exact coordinate moves along a line.
//!   The least of some lines is concave, so it is nowhere below its chord: on each axis, the lower planes at the
//!   samples, joined by lines, are below every corner at every moment between. [`line`] joins the first and the
//!   last sample, and lowers the whole by what it exceeds the others by, so it is below those lines.
//! - Roundings, with `u = 2^-24` and `M` the largest coordinate on the axis at any sample, of what is below the
//!   node: the corner `a + along (b - a)` is off by at most `2uM + 2uM + uM` and a little, at a sample as at the moment;
//!   the plane, whose `delta` changes it by at most `2M` over the segment, by `2uM` (delta), `2uM` (product), `uM`
//!   (sum) and `uM` (base). Together less than `17 u M`; [`PAD`] is 24. Underflow takes less than `2^-126`, which
//!   is added. `q` and `along` are exact (`math::pose`).
//!
//! `tests/motion.rs` attacks it through answers, the tests below directly.
//!
//! Cost: a sweep a sample; `12 W` bytes of deltas a node beside its own `28 W`; 40 bytes a triangle and step.

use super::lower::Packed;
use super::packing::Packing;
use super::wide::{BLOCK_WORDS, Child, ChildKind, LEAF_MAX, Node, Plain, TRIANGLE_WORDS, Wide};
use super::write::write_block;
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::Cancel;
use crate::geometry::triangle::UNIT_ROUNDOFF;
use crate::layout::packing::Block;
use crate::math::pose::between;
use crate::math::rounding;
use crate::memory::{self, Pages};
use alloc::vec::Vec;

/// How far planes are pushed outward, in units of `UNIT_ROUNDOFF` times the largest coordinate. Derived above.
const PAD: f64 = 24.0;

/// By axis: what the lower planes change by in a step, then the upper ones.
pub(crate) type Planes<const W: usize> = [[[f32; W]; 2]; 3];

/// A tree over a segment of time.
#[derive(Debug)]
pub(crate) struct Segment<const W: usize> {
    /// With their boxes at the start.
    pub(crate) nodes: Pages<Node<W>>,
    pub(crate) deltas: Pages<Planes<W>>,
    pub(crate) root: Child,
    /// The leaves, at each step from `step` on that is touched, as [`Wide::words`].
    pub(crate) words: Vec<Pages<f32>>,
    /// Where it begins, in steps.
    pub(crate) start: f32,
    /// The last step at or before.
    pub(crate) step: usize,
}

/// Which steps a segment touches, and where its boxes are sampled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// Where it begins and ends, in steps: multiples of a power of two.
    pub(crate) start: f32,
    pub(crate) end: f32,
}

impl Span {
    fn first_step(&self) -> usize {
        self.start as usize
    }

    /// Steps whose corners are needed: the last one bounds the end.
    fn steps(&self) -> usize {
        libm::ceilf(self.end) as usize - self.first_step() + 1
    }

    /// The middle.
    pub(crate) fn middle(&self) -> f32 {
        0.5 * self.start + 0.5 * self.end
    }
}

impl<const W: usize> Segment<W> {
    /// The tree of a span: that of `wide`, whose leaves hold the right ids and any corners. `corners`
    /// gives those of an id at a step.
    pub(crate) fn new(
        wide: Wide<W>,
        span: Span,
        corners: &impl Fn(u32, usize) -> [[f32; 3]; 3],
        cancel: &Cancel,
    ) -> Result<Self, BuildError> {
        let Wide { mut nodes, root, words, .. } = wide;
        let step = span.first_step();
        let mut all = Vec::with_capacity(span.steps());
        for at in step..step + span.steps() {
            cancel.check()?;
            all.push(at_step(&nodes, root, &words, &|id| corners(id, at))?);
        }
        drop(words);

        // The planes at every sample: both ends, and the steps between.
        let inner = (step + 1..step + span.steps()).map(|at| at as f32);
        let samples = [span.start].into_iter().chain(inner.filter(|&at| at < span.end));
        let samples: Vec<f32> = samples.chain([span.end]).collect();
        let mut swept = Vec::with_capacity(samples.len());
        for &at in &samples {
            swept.push(sweep(&nodes, &all, at - step as f32, cancel)?);
        }

        // A line for each plane.
        let mut deltas: Pages<Planes<W>> = Pages::zeroed(nodes.len(), "deltas of wide nodes")?;
        let length = f64::from(span.end - span.start);
        let shares: Vec<f64> =
            samples.iter().map(|at| f64::from(at - span.start) / length).collect();
        let mut way = Vec::with_capacity(samples.len());
        for (at, (node, deltas)) in nodes.iter_mut().zip(&mut *deltas).enumerate() {
            for slot in (0..W).filter(|&slot| node.children[slot] != Child::END) {
                for axis in 0..3 {
                    let of = |side: usize| swept.iter().map(move |it| it[at][axis][side][slot]);
                    let largest = of(0).chain(of(1)).fold(0.0_f32, |most, x| most.max(x.abs()));
                    for side in 0..2 {
                        way.clear();
                        way.extend(of(side).map(f64::from));
                        let (base, change) = line(&way, &shares, side == 1, largest);
                        node.planes[axis][side][slot] = base;
                        deltas[axis][side][slot] = (change / length) as f32;
                    }
                }
            }
        }
        Ok(Self { nodes, deltas, root, words: all, start: span.start, step })
    }

    /// A copy of the tree, with boxes and corners of some moment.
    pub(crate) fn still(&self) -> Result<Wide<W>, BuildError> {
        let mut nodes = Pages::zeroed(self.nodes.len(), "wide nodes")?;
        nodes.copy_from_slice(&self.nodes);
        let from = self.words.first().map_or(&[][..], |words| words);
        let mut words = Pages::zeroed(from.len(), "leaf blocks")?;
        words.copy_from_slice(from);
        // Nothing but triangles is in it.
        Ok(Wide { nodes, root: self.root, words, triangles: usize::MAX })
    }

    /// The nodes' boxes `after` so many steps, in f64, summed up as half areas.
    pub(crate) fn areas(&self, after: f32) -> f64 {
        let mut sum = 0.0;
        for (node, deltas) in self.nodes.iter().zip(&*self.deltas) {
            for slot in (0..W).filter(|&slot| node.children[slot] != Child::END) {
                let plane = |axis: usize, side: usize| {
                    f64::from(node.planes[axis][side][slot])
                        + f64::from(after) * f64::from(deltas[axis][side][slot])
                };
                let [x, y, z] = [0, 1, 2].map(|axis: usize| plane(axis, 1) - plane(axis, 0));
                sum += x * y + y * z + z * x;
            }
        }
        sum
    }

    /// Bytes that walks read.
    pub(crate) fn bytes(&self) -> usize {
        let words = self.words.iter().map(|words| size_of_val(&**words)).sum::<usize>();
        size_of_val(&*self.nodes) + size_of_val(&*self.deltas) + words
    }

    /// A leaf at the step `after` the first and at the next one.
    #[inline(always)]
    pub(crate) fn leaf(&self, first: usize, after: usize) -> [&Block; 2] {
        let words = |after: usize| self.words.get(after).map_or(&[][..], |words| words);
        let next = if after + 1 < self.words.len() { after + 1 } else { after };
        [words(after), words(next)].map(|words| <Plain as Packing<W>>::leaf(words, first))
    }
}

/// The boxes of nodes that stand still, summed up as half areas, in f64.
pub(crate) fn areas<const W: usize>(nodes: &[Node<W>]) -> f64 {
    let children = nodes.iter().flat_map(|node| (0..W).map(move |slot| (node, slot)));
    let used = children.filter(|(node, slot)| node.children[*slot] != Child::END);
    used.map(|(node, slot)| <Plain as Packing<W>>::bounds(node, slot).half_area()).sum()
}

/// A leaf as it is between two steps; its ids mean nothing.
#[inline(always)]
fn mixed<const W: usize>(words: &[Pages<f32>], first: usize, after: usize, along: f32) -> Block {
    let last = words.len() - 1;
    let before = <Plain as Packing<W>>::leaf(&words[after.min(last)], first);
    let then = <Plain as Packing<W>>::leaf(&words[(after + 1).min(last)], first);
    let mut block = [0.0; BLOCK_WORDS];
    for word in 0..BLOCK_WORDS {
        block[word] = between(before[word], then[word], along);
    }
    block
}

/// Where a plane is to begin and what it is to change by, so that it stays on the outer side of all samples.
///
/// `shares` are the parts of the segment that have passed at the samples.
fn line(way: &[f64], shares: &[f64], upper: bool, largest: f32) -> (f32, f64) {
    let sign = if upper { 1.0 } else { -1.0 };
    let [first, .., last] = way else { return (0.0, 0.0) };
    let change = last - first;
    let over = way.iter().zip(shares).map(|(x, share)| sign * (x - (first + share * change)));
    let push = over.fold(0.0_f64, f64::max)
        + PAD * f64::from(UNIT_ROUNDOFF) * f64::from(largest)
        + f64::from(f32::MIN_POSITIVE);
    let base = first + sign * push;
    (if upper { rounding::up(base) } else { rounding::down(base) }, change)
}

/// The leaves of all nodes (or the root) with other corners.
fn at_step<const W: usize>(
    nodes: &[Node<W>],
    root: Child,
    words: &[f32],
    corners: &impl Fn(u32) -> [[f32; 3]; 3],
) -> Result<Pages<f32>, BuildError> {
    let mut moved = Pages::zeroed(words.len(), "leaf blocks")?;
    let mut packed = [Packed::default(); LEAF_MAX];
    for child in nodes.iter().flat_map(|node| node.children).chain([root]) {
        let Some((first, count)) = leaf(child) else { continue };
        let block = <Plain as Packing<W>>::leaf(words, first);
        for (triangle, packed) in packed.iter_mut().enumerate().take(count) {
            let id = <Plain as Packing<W>>::id(block, count, triangle);
            *packed = Packed { corners: corners(id), id };
        }
        let place = first * TRIANGLE_WORDS..(first + count) * TRIANGLE_WORDS;
        write_block(&packed[..count], &mut moved[place]);
    }
    Ok(moved)
}

/// The leaf behind a child, if there is one.
fn leaf(child: Child) -> Option<(usize, usize)> {
    match child.kind() {
        ChildKind::Leaf { first, count } if child != Child::END => Some((first, count)),
        _ => None,
    }
}

/// The planes of all nodes, so many steps after the first of `words`: children stand after their parents.
fn sweep<const W: usize>(
    nodes: &[Node<W>],
    words: &[Pages<f32>],
    after: f32,
    cancel: &Cancel,
) -> Result<Vec<Planes<W>>, BuildError> {
    /// Nodes between two looks at whether the caller has had enough.
    const OFTEN: usize = 1024;
    let nothing = [[[0.0; W]; 2]; 3];
    let mut all = memory::try_filled(nothing, nodes.len(), "boxes of moving nodes")?;
    let mut boxes = memory::try_filled(Aabb::EMPTY, nodes.len(), "boxes of moving nodes")?;
    let step = after as usize;
    let along = after - step as f32;
    for (at, node) in nodes.iter().enumerate().rev() {
        if at % OFTEN == 0 {
            cancel.check()?;
        }
        for slot in 0..W {
            let bounds = match node.children[slot].kind() {
                _ if node.children[slot] == Child::END => continue,
                ChildKind::Inner { node } => boxes[node],
                ChildKind::Leaf { first, count } => {
                    around(&mixed::<W>(words, first, step, along), count)
                }
            };
            for axis in 0..3 {
                all[at][axis][0][slot] = bounds.lo[axis];
                all[at][axis][1][slot] = bounds.hi[axis];
            }
            boxes[at] = boxes[at].union(&bounds);
        }
    }
    Ok(all)
}

/// The box around a leaf's triangles.
fn around(block: &Block, count: usize) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for corner in 0..3 {
        for triangle in 0..count {
            let at = [0, 1, 2].map(|axis: usize| block[(3 * corner + axis) * count + triangle]);
            bounds = bounds.union(&Aabb { lo: at, hi: at });
        }
    }
    bounds
}

/// A coordinate that is nowhere outside what [`between`] gives for some moment of a way through these steps.
pub(crate) fn widened_way(bounds: &Aabb) -> Aabb {
    let pad = |x: f32| PAD * f64::from(UNIT_ROUNDOFF) * f64::from(x.abs());
    let least = f64::from(f32::MIN_POSITIVE);
    let out = |side: f64, lo: f32, hi: f32, of: f32| {
        f64::from(of) + side * (pad(lo).max(pad(hi)) + least)
    };
    let axis = |axis: usize| (bounds.lo[axis], bounds.hi[axis]);
    let each = |side: f64, pick: fn((f32, f32)) -> f32| {
        [0, 1, 2].map(|at: usize| out(side, axis(at).0, axis(at).1, pick(axis(at))))
    };
    if bounds.is_empty() {
        return *bounds;
    }
    Aabb {
        lo: each(-1.0, |it| it.0).map(rounding::down),
        hi: each(1.0, |it| it.1).map(rounding::up),
    }
}

/// A box between two, each plane as [`between`] has it.
#[inline(always)]
pub(crate) fn box_between(a: &Aabb, b: &Aabb, along: f32) -> Aabb {
    let mix = |a: [f32; 3], b: [f32; 3]| {
        [between(a[0], b[0], along), between(a[1], b[1], along), between(a[2], b[2], along)]
    };
    Aabb { lo: mix(a.lo, b.lo), hi: mix(a.hi, b.hi) }
}

#[cfg(test)]
mod tests {
    use super::{Span, line};
    use crate::layout::compact::Random;
    use crate::math::pose::{Moment, between};
    use alloc::vec::Vec;

    /// Planes along lines against the coordinates of vertices, each evaluated as walks and triangles do it.
    #[test]
    fn lines_are_outside_of_every_corner_at_every_moment() {
        let mut random = Random(0x11E5);
        let mut near = 0;
        for round in 0..4000 {
            let (steps, vertices) = (2 + round % 5, 1 + round % 4);
            let size = [1.0, 1e-30, 1e-38, 1e18, 3.0][round % 5];
            let offset = [0.0, 0.0, 1e-38, 4e18, 148_376.0][(round / 5) % 5] * random.unit();
            let way: Vec<Vec<f32>> = (0..steps)
                .map(|_| (0..vertices).map(|_| offset + random.between(-size, size)).collect())
                .collect();
            let last = (steps - 1) as f32;
            // The whole way, a step, a part of a step.
            let start = [0.0, 0.0, last - 0.25][round % 3];
            let span = Span { start, end: [last, 1.0, last][round % 3] };
            let at = |place: f32, vertex: usize| {
                let Moment { step, next, along, .. } = Moment::at(place, steps);
                between(way[step][vertex], way[next][vertex], along)
            };
            let inner = (1..steps).map(|step| step as f32);
            let inner = inner.filter(|&at| span.start < at && at < span.end);
            let samples: Vec<f32> =
                [span.start].into_iter().chain(inner).chain([span.end]).collect();
            let length = f64::from(span.end - span.start);
            let shares: Vec<f64> =
                samples.iter().map(|at| f64::from(at - span.start) / length).collect();
            let values =
                || samples.iter().flat_map(|&place| (0..vertices).map(move |v| (place, v)));
            let largest = values().fold(0.0_f32, |most, (p, v)| most.max(at(p, v).abs()));
            for upper in [false, true] {
                let outer = |place: f32| {
                    let all = (0..vertices).map(|vertex| at(place, vertex));
                    if upper { all.fold(f32::MIN, f32::max) } else { all.fold(f32::MAX, f32::min) }
                };
                let way: Vec<f64> = samples.iter().map(|&place| f64::from(outer(place))).collect();
                let (base, change) = line(&way, &shares, upper, largest);
                let delta = (change / length) as f32;
                for _ in 0..24 {
                    // As walks have it: exact, since the place is rounded before.
                    let place = span.start + random.unit() * (span.end - span.start);
                    let passed = place - span.start;
                    let plane = base + passed * delta;
                    let corner = outer(place);
                    let outside = if upper { plane >= corner } else { plane <= corner };
                    assert!(outside, "{upper} {way:?} {passed}: {plane} {corner}");
                    near += usize::from((plane - corner).abs() <= 1e-5 * largest);
                }
            }
        }
        assert!(near > 10_000, "{near} were near");
    }
}

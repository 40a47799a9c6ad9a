//! Opening: a large instance, whose box is mostly empty, goes into its level's tree as several boxes, each
//! around what is below one child of its own tree.
//!
//! Source: C. Benthin, S. Woop, I. Wald, A. T. Áfra, "Improved Two-Level BVHs using Partial Re-Braiding",
//! HPG 2017. Differs from it: what is opened is chosen before the tree is built, so that any builder
//! can build it, and by what is gained for each box more, where the paper opens what is large beside its
//! node.
//!
//! The answers keep every bit: rays are transformed as without opening, and hits are clamped to the box of
//! the whole instance; only the boxes that cull, and where the walk inside begins, are others. What is
//! below two children of a node is apart, so nothing is seen twice that was seen once.
//!
//! Cost: O(n) for the heap, and a microsecond for each node that is looked at, of which there are few: the
//! largest come first, and looking ends with the budget or where too much of it is in vain.

use super::{BuildOptions, Quality};
use crate::bounds::Aabb;
use crate::layout::wide::Child;
use crate::trace::placements::{Instances, Outside, Part};
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Ordering;

/// Boxes more than there are instances, as in the paper. On 49,847 instances with 784 trees (a courtyard with
/// plants), twice as much makes rays of a camera 0.96 times as fast, shadow rays 0.93, others no faster; a third of it gave 0.92 of the gain
/// for rays of a camera, when parts of an instance were still entered one by one.
const BUDGET: f64 = 1.0;

/// What is opened may have children whose areas sum up to this much of its own: a ray that meets it is spared a
/// visit of the node as well. There, when parts were entered one by one: 1 made rays of a camera 1.7 times as fast as without
/// opening, diffuse ones 1.4; 1.5: 2.3 and 2.15; 2: 2.4 and 2.13; 3: 2.3 and 2.13. Since then 2 makes them 2.7 and 2.1 times as fast,
/// shadow rays 1.1; what entering an instance is taken to cost where children are ordered changes nothing.
const AREAS_MOST: f64 = 2.0;

/// Nodes that may be looked at in vain, and how many more for each that was not.
const VAIN: [usize; 2] = [256, 4];

/// Fewer rays than this to come do not pay for opening.
const RAYS_LEAST: u64 = 1 << 20;

/// How many boxes more there may be for these instances; none where building must be quick.
pub(super) fn budget(instances: usize, options: &BuildOptions<'_>) -> usize {
    let quick = match options.quality {
        Quality::Fastest | Quality::Fast => true,
        Quality::Rays(rays) => rays < RAYS_LEAST,
        _ => false,
    };
    if !options.open_instances || (quick && options.builder.is_none()) {
        return 0;
    }
    (instances as f64 * BUDGET) as usize
}

/// The parts of the instances that are better opened, with their boxes inside: those of one instance side
/// by side, the instances in rising order. They are at most `budget` more than the instances that they are of.
pub(super) fn parts(instances: &Instances, budget: usize) -> Vec<(Part, Aabb)> {
    if budget == 0 {
        return Vec::new();
    }
    let whole = instances.iter().enumerate().filter_map(|(at, instance)| {
        // What moves is not where its boxes are, or has several trees.
        if instance.motion.is_some() || !instance.structure.spans.is_empty() {
            return None;
        }
        let start = instance.structure.layout.root();
        let part = Part { instance: at as u32, start };
        Candidate::unseen(part, None, half_area(&instance.bounds()))
    });
    let mut heap: BinaryHeap<Candidate> = whole.collect();
    let mut parts: Vec<Option<(Part, Aabb)>> = Vec::new();
    let (mut more, mut vain, mut opened) = (0, 0, 0);
    while let Some(best) = heap.pop() {
        // Look closer at what promises most.
        let at = best.part.instance as usize;
        let structure = &instances.at(at).structure;
        let below = structure.layout.below(best.part.start);
        let extra = below.len().saturating_sub(1);
        if !best.seen {
            match best.seen(&below, &instances.outside(at)) {
                Some(seen) => heap.push(seen),
                None => vain += 1,
            }
            if vain > VAIN[0] + VAIN[1] * opened {
                break;
            }
            continue;
        }

        // Open it: its children come in its place.
        if more + extra > budget {
            break;
        }
        more += extra;
        opened += 1;
        if let Some(place) = best.place {
            parts[place] = None;
        }
        let outside = instances.outside(at);
        for (start, bounds) in below {
            let part = Part { instance: best.part.instance, start };
            let area = half_area(&outside.image(&bounds));
            heap.extend(Candidate::unseen(part, Some(parts.len()), area));
            parts.push(Some((part, bounds)));
        }
    }
    let mut parts: Vec<_> = parts.into_iter().flatten().collect();
    parts.sort_unstable_by_key(|(part, _)| (part.instance, part.start.0));
    parts
}

/// An instance, or a part of one, that may be opened.
struct Candidate {
    part: Part,
    /// Among the parts; an instance is none.
    place: Option<usize>,
    /// Of its box.
    area: f64,
    /// What opening gains for each box more: an area. No more than that, as long as it is not `seen`.
    gain: f64,
    seen: bool,
}

impl Candidate {
    /// One that nobody has looked into yet; `None` for a leaf, and for what has no area.
    fn unseen(part: Part, place: Option<usize>, area: f64) -> Option<Self> {
        let gain = AREAS_MOST * area;
        let is_open = part.start.is_inner() && gain > 0.0;
        is_open.then_some(Self { part, place, area, gain, seen: false })
    }

    /// What it really gains with these children; `None` if nothing.
    fn seen(self, below: &[(Child, Aabb)], outside: &Outside) -> Option<Self> {
        let areas: f64 = below.iter().map(|(_, bounds)| half_area(&outside.image(bounds))).sum();
        let gain = AREAS_MOST * self.area - areas;
        let extra = below.len().checked_sub(1).filter(|&extra| extra > 0)?;
        (gain > 0.0).then_some(Self { gain: gain / extra as f64, seen: true, ..self })
    }
}

/// By gain; of the same gain, the first instance is the greatest.
impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let name = |it: &Self| (it.part.instance, it.part.start.0);
        self.gain.total_cmp(&other.gain).then_with(|| name(other).cmp(&name(self)))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// In f64, where no area of a scene is too large; 0 for an empty box.
fn half_area(bounds: &Aabb) -> f64 {
    let edge = |axis: usize| f64::from(bounds.hi[axis]) - f64::from(bounds.lo[axis]);
    let [x, y, z] = [edge(0), edge(1), edge(2)];
    if x >= 0.0 && y >= 0.0 && z >= 0.0 { x * y + y * z + z * x } else { 0.0 }
}

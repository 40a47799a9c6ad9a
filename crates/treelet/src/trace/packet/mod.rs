//! Rays that go together, walked together: groups of up to 256, as 16 packets of 16, a ray a lane.
//!
//! A run of 256 rays is looked at; if few directions and nearby starts are seen among 16 of them, its
//! rays are sorted into bundles of like direction ([`bundles`]), and each bundle is a group. At a
//! node, all children are tested against the whole group at once, by intervals of what the slab test
//! computes for its rays ([`group`]); what is left, against 16 packets at once ([`beam`]). Where four
//! packets or fewer are left, each goes on by itself ([`alone`]): children against the packet, what
//! is left against its 16 rays, and the last two rays one by one. Leaves test 16 rays against a
//! triangle ([`crate::geometry::bundle`]).
//!
//! # The same answers
//!
//! What any ray of a group is admitted to, its group is, bit for bit: see [`group::Spread`]. So
//! every triangle that could be the answer is tested, by the steps of single rays in other lanes, and
//! ties are settled by id. Leaves of instances are left to single rays. Hits at triangles of the
//! outermost level are kept in lanes until the group is done, those in instances where streams keep
//! theirs; of the two, the one that comes first is the answer.
//!
//! # What it costs
//!
//! Primary rays, million a second, 65,536 of them, one thread, streams then packets: a house of 1.6 M
//! triangles, then a kitchen of 1.4 M:
//!
//! | instruction set, width | house    | kitchen    |
//! |------------------------|----------|------------|
//! | AVX-512, 16            | 27, 50   | 17.7, 23.3 |
//! | AVX-512, 8             | 25, 43   | 17.0, 22.9 |
//! | AVX2, 8                | 15, 27   | 10.8, 16.5 |
//! | SSE4.2, 8              | 10, 17   | 7.7, 10.7  |
//! | scalar, 8              | 8.9, 13  | 7.1, 8.4   |
//!
//! In slices of 1,024: 26, 42 and 17, 22. Of the 20 ns in the house, leaves take 41 % (two thirds of
//! it the triangle test), sorting into bundles 21, filling the group 13, writing hits 12, looking
//! whether rays go together 4, nodes 3: a group visits three of them together. In the kitchen leaves
//! take half of 42 ns, a quarter of that waiting for their triangles. What rays pay that do not go
//! together is lost in the noise of 2 %.
//!
//! # What was tried
//!
//! - Shadow rays to four lights at once: bundles of like slope (0.08, of a longest component of 1) are
//!   16 to 64 rays, which start and end in different places: 14.9 M rays/s in the house where streams
//!   reach 16.9, 15.2 against 26 in the kitchen. (At an earlier stage slopes 0.04, 0.08 and 0.24 apart
//!   gave 13.4, 11.5 and 9.6 in the house.) Hence packets for any hit only where a run is one bundle:
//!   with one light, within 4 % of streams.
//! - No limit to the nodes that loose groups visit: 0.14 M shadow rays/s in the house.
//! - Sorting a run ray by ray: 8 ns a ray instead of 4. Clearing the stacks: 10 % of those shadow rays.
//!
//! Sources: I. Wald, P. Slusallek, C. Benthin, M. Wagner, "Interactive Rendering with Coherent Ray
//! Tracing", Eurographics 2001 (packets); A. Reshetov, A. Soupikov, J. Hurley, "Multi-Level Ray
//! Tracing Algorithm", SIGGRAPH 2005, and S. Boulos, I. Wald, P. Shirley, "Geometric and Arithmetic
//! Culling Methods for Entire Ray Packets", 2006 (intervals).

mod alone;
mod beam;
mod bundles;
mod group;
mod leaf;

pub(crate) use alone::Alone;
pub(crate) use group::{GROUP, Group};

use super::record::{Class, RAYS, T_MAX};
use super::stream::{Answers, Tail};
use super::structure::{Get, Layout, Structure};
use super::walk::Found;
use crate::layout::packing::Packing;
use crate::math::Ray;
use crate::simd::{Kernel, Wide};
use alloc::vec::Vec;
use bundles::{LEADERS, seem_coherent};
use group::NONE;

/// Starts of rays that go together are nearer to each other than this part of the scene's diagonal.
const STARTS_NEAR: f32 = 0.06;

/// Bundles of a run that asks for any hit, at most.
const BUNDLES_ANY: usize = 1;

/// The walk of a group.
pub(crate) struct Walk<'a, 'w, A> {
    pub(crate) structure: &'a Structure,
    /// Of all rays of the group.
    pub(crate) class: Class,
    /// The slice.
    pub(crate) rays: &'w [Ray],
    pub(crate) answers: &'w mut A,
    pub(crate) group: &'w mut Group,
}

impl<'a, A: Answers<'a>> Walk<'a, '_, A> {
    /// Writes the hits that are kept in lanes.
    #[inline(always)]
    fn finish(&mut self) {
        let structure = self.structure;
        // Without anything but triangles nothing was written before, not even misses.
        let flat = structure.flat;
        for packet in self.group.packets.iter().take(self.group.count) {
            for lane in 0..packet.len.min(RAYS) {
                let (t, id) = (packet.columns[T_MAX][lane], packet.id[lane]);
                let (u, v) = (packet.u[lane], packet.v[lane]);
                let slot = packet.slots[lane] as usize;
                let found =
                    if id == NONE { None } else { Some(Found { t, u, v, id, inst: 0, structure }) };
                match found {
                    found if flat => self.answers.put(slot, found),
                    Some(found) => self.answers.keep(slot, found),
                    None => {}
                }
            }
        }
    }
}

/// Asks about the rays of a run, those of `rays` from `first` on, [`GROUP`] at most. Those that do not
/// go with others are left in `rest`, with nothing kept for them.
#[inline(always)]
pub(crate) fn run<'a, K, S, A, const W: usize>(
    simd: S,
    structure: &'a Structure,
    rays: &[Ray],
    first: usize,
    answers: &mut A,
    group: &mut Group,
    rest: &mut Vec<u32>,
) where
    K: Packing<W>,
    S: Wide<W>,
    Layout: Get<K, W>,
    A: Answers<'a>,
    for<'x, 'y> Tail<'a, 'x, 'y, K, A::Visitor, W>: Kernel<Output = ()>,
    for<'x, 'y> Alone<'a, 'x, 'y, K, A, W>: Kernel<Output = ()>,
{
    let end = rays.len().min(first + GROUP);
    let run = &rays[first..end];
    let bundles_max = if A::NEAREST_FIRST { LEADERS } else { BUNDLES_ANY };
    if !seem_coherent(run, STARTS_NEAR * structure.diagonal, bundles_max) {
        answers.clear(first..end);
        rest.extend(first as u32..end as u32);
        return;
    }
    group.bundles.sort(simd, run);
    let partly = group.bundles.bundled < run.len();
    if partly || !structure.flat || !A::NEAREST_FIRST {
        answers.clear(first..end);
    }
    if partly {
        rest.extend(group.bundles.rest().map(|place| (first + place) as u32));
    }
    for bundle in 0..group.bundles.len {
        let mut slots = [0; GROUP];
        let places = group.bundles.places(bundle);
        for (slot, place) in slots.iter_mut().zip(places) {
            *slot = first as u32 + place;
        }
        let slots = &slots[..places.len().min(GROUP)];
        let Some(&slot) = slots.first() else { continue };
        let class = Class::of(&rays[slot as usize]);
        group.fill(simd, structure, class, rays, slots, run.len());
        let mut walk = Walk { structure, class, rays, answers: &mut *answers, group: &mut *group };
        beam::beam::<K, S, A, W>(simd, &mut walk);
        if A::NEAREST_FIRST {
            walk.finish();
        }
    }
}

//! Closest and any for slices of rays. Nothing need be told about the rays; what is looked at:
//!
//! | seen                                              | then                                        |
//! |---------------------------------------------------|---------------------------------------------|
//! | fewer than `MANY` rays, or no memory, or motion   | single rays                                 |
//! | 256 rays in a row, of which 16 go together        | packets ([`crate::trace::packet`])          |
//! | of the rest: closest, lists not dealt by          | single rays, in the slice's order           |
//! | instructions, origins differ                      |                                             |
//! | one origin for a batch                            | streams of `TILE` rays, children by entry   |
//! | else                                              | streams of `BATCH` rays, children by corner |
//!
//! Streams are of one class each: the signs of the direction, and the axis along which it is longest.
//!
//! Measured before there were packets, million rays a second, kitchen (1.4 M triangles), 262,144 rays, one thread, AVX-512, 16
//! wide, single rays then slices: primary 9.1, 16.3; occlusion 10.9, 15.5; diffuse 4.7, 5.9; shadow
//! 14.6, 25.7; random 5.7, 7.0. With AVX2, 8 wide: primary 5.8, 7.8; occlusion 8.6, 10.0; shadow 12.3,
//! 15.4. There streams of incoherent closest rays were from 5 % ahead of single rays to 17 % behind
//! (SSE4.2: 7 to 25 % behind), and single rays in the order of the classes 9 to 21 % behind the same in
//! the slice's order: hence the second row.
//!
//! Lost or without effect: pieces of 16,384 to 65,536 rays and batches of 1,024 to 8,192 are alike
//! within 5 %; classes by octant alone (not tried) need a choice of axes in every lane of the triangle test. Where
//! there are about 40 rays a class (1,024 random rays) streams are 5 % behind single rays in the
//! kitchen, and on a terrain of 0.5 M triangles random rays lose 8 % in slices of any length.

use super::{any, closest};
use crate::geometry::Hit;
use crate::layout::compact::Compact;
use crate::layout::packing::Packing;
use crate::layout::wide::Plain;
use crate::math::Ray;
use crate::memory::{OutOfMemory, try_with_capacity};
use crate::simd::{Kernel, Simd};
use crate::trace::packet::{self, GROUP, Group};
use crate::trace::record::{CLASSES, Class};
use crate::trace::stream::{Answers, BATCH, Batch, Order, Room, stream};
use crate::trace::structure::{Get, Layout, Structure};
use alloc::vec::Vec;
use core::marker::PhantomData;

/// Rays that are sorted into classes at once.
const PIECE: usize = 16_384;

/// Rays from one point that are walked together: neighbours in a camera's tile.
const TILE: usize = 256;

/// Slices shorter than this are asked ray by ray.
const MANY: usize = 64;

/// What a task works in.
struct Work {
    room: Room,
    classes: Vec<u8>,
    slots: Vec<u32>,
    /// Rays that go together with none.
    rest: Vec<u32>,
    group: Group,
}

impl Work {
    /// For these rays; `None` where they go one by one: where anything moves, since rays of one packet differ
    /// in time; and where a time is no number, which packets do not look at.
    fn of(structure: &Structure, rays: &[Ray]) -> Option<Self> {
        if structure.moves || rays.iter().any(|ray| ray.time.is_nan()) {
            return None;
        }
        Self::new(rays.len())
    }

    /// For so many rays; `None` where they are too few, or there is no memory for it.
    fn new(len: usize) -> Option<Self> {
        if len < MANY { None } else { Self::try_new(len.min(PIECE)).ok() }
    }

    fn try_new(len: usize) -> Result<Self, OutOfMemory> {
        const WHAT: &str = "the classes of rays";
        let room = Room::new(len)?;
        Ok(Self {
            room,
            group: Group::new()?,
            classes: try_with_capacity(len, WHAT)?,
            slots: try_with_capacity(len, WHAT)?,
            rest: try_with_capacity(len, WHAT)?,
        })
    }
}

/// [`closest::closest`] for each ray.
pub(crate) fn closest_many(structure: &Structure, rays: &[Ray], hits: &mut [Hit]) {
    let mut work = Work::of(structure, rays);
    let deals_well = structure.level.run(DealsWell);
    for (rays, hits) in rays.chunks(PIECE).zip(hits.chunks_mut(PIECE)) {
        let Some(work) = &mut work else {
            for (ray, out) in rays.iter().zip(hits) {
                *out = closest::closest(structure, ray).unwrap_or(Hit::MISS);
            }
            continue;
        };
        together(structure, rays, &mut closest::Many { hits }, work);
        if deals_well || share_origin(rays) {
            streams(structure, rays, &mut closest::Many { hits }, work);
        } else {
            for &slot in &work.rest {
                let slot = slot as usize;
                hits[slot] = closest::closest(structure, &rays[slot]).unwrap_or(Hit::MISS);
            }
        }
    }
}

/// [`any::any`] for each ray.
pub(crate) fn any_many(structure: &Structure, rays: &[Ray], answers: &mut [bool]) {
    let mut work = Work::of(structure, rays);
    for (rays, answers) in rays.chunks(PIECE).zip(answers.chunks_mut(PIECE)) {
        let Some(work) = &mut work else {
            for (ray, out) in rays.iter().zip(answers) {
                *out = any::any(structure, ray);
            }
            continue;
        };
        together(structure, rays, &mut any::Many { answers }, work);
        streams(structure, rays, &mut any::Many { answers }, work);
    }
}

/// Whether lists are dealt out by instructions made for it.
struct DealsWell;

impl Kernel for DealsWell {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> bool {
        S::COMPRESSES
    }
}

/// Whether the rays come from one point: seen at the second ray if not.
fn share_origin(rays: &[Ray]) -> bool {
    let first = rays.first().map(|ray| ray.origin);
    rays.iter().all(|ray| Some(ray.origin) == first)
}

/// Walks rays that go together as packets; the others are left in `work.rest`.
fn together<'a, A: Answers<'a>>(
    structure: &'a Structure,
    rays: &[Ray],
    answers: &mut A,
    work: &mut Work,
) {
    let Work { group, rest, .. } = work;
    rest.clear();
    let level = structure.level;
    match structure.layout {
        Layout::Wide8(_) => level.run(Packs::<A, 8> { structure, rays, answers, group, rest }),
        Layout::Wide16(_) => level.run(Packs::<A, 16> { structure, rays, answers, group, rest }),
        // Where bytes count for more than time, streams will do: a third of what packets compile to.
        Layout::Compact(_) => {
            answers.clear(0..rays.len());
            rest.extend(0..rays.len() as u32);
        }
    }
}

/// Sorts the rest of the rays into classes and walks each class in batches.
fn streams<'a, A: Answers<'a>>(
    structure: &'a Structure,
    rays: &[Ray],
    answers: &mut A,
    work: &mut Work,
) {
    let Work { room, classes, slots, rest, .. } = work;
    if rest.is_empty() {
        return;
    }
    // Count the rays of each class, and put them side by side, in order.
    let mut ends = [0_usize; CLASSES + 1];
    classes.clear();
    for &slot in &*rest {
        let ray = &rays[slot as usize];
        let class = if ray.is_valid() { Class::of(ray).index() } else { CLASSES };
        classes.push(class as u8);
        ends[class] += 1;
    }
    let mut sum = 0;
    for end in &mut ends {
        sum += core::mem::replace(end, sum);
    }
    slots.clear();
    slots.resize(rest.len(), 0);
    for (&slot, &class) in rest.iter().zip(&*classes) {
        let end = &mut ends[usize::from(class)];
        slots[*end] = slot;
        *end += 1;
    }

    let mut start = 0;
    for &end in &ends[..CLASSES] {
        for slots in slots[start..end].chunks(BATCH) {
            let origin = |&slot: &u32| rays[slot as usize].origin;
            let first = slots.first().map(origin);
            let (order, len) = if slots.iter().all(|slot| Some(origin(slot)) == first) {
                (Order::Entry, TILE)
            } else {
                (Order::Corner, BATCH)
            };
            for slots in slots.chunks(len) {
                let Some(&slot) = slots.first() else { continue };
                let class = Class::of(&rays[slot as usize]);
                walk(structure, Batch { class, rays, slots, order }, answers, room);
            }
        }
        start = end;
    }
}

fn walk<'a, A: Answers<'a>>(
    structure: &'a Structure,
    batch: Batch<'_>,
    answers: &mut A,
    room: &mut Room,
) {
    let level = structure.level;
    match structure.layout {
        Layout::Wide8(_) => level.run(Walk::<Plain, A, 8>::new(structure, batch, answers, room)),
        Layout::Wide16(_) => level.run(Walk::<Plain, A, 16>::new(structure, batch, answers, room)),
        Layout::Compact(_) => {
            level.run(Walk::<Compact, A, 16>::new(structure, batch, answers, room));
        }
    }
}

/// A walk of many rays through nodes of `W` children.
struct Walk<'a, 'b, K, A, const W: usize> {
    packing: PhantomData<K>,
    structure: &'a Structure,
    batch: Batch<'b>,
    answers: &'b mut A,
    room: &'b mut Room,
}

impl<'a, 'b, K, A, const W: usize> Walk<'a, 'b, K, A, W> {
    fn new(
        structure: &'a Structure,
        batch: Batch<'b>,
        answers: &'b mut A,
        room: &'b mut Room,
    ) -> Self {
        Self { packing: PhantomData, structure, batch, answers, room }
    }
}

/// Walks of packets through nodes of `W` children.
struct Packs<'a, 'b, A, const W: usize> {
    structure: &'a Structure,
    rays: &'b [Ray],
    answers: &'b mut A,
    group: &'b mut Group,
    rest: &'b mut Vec<u32>,
}

macro_rules! widths {
    ($($width:literal)*) => {
        $(impl<'a, K: Packing<$width>, A: Answers<'a>> Kernel for Walk<'a, '_, K, A, $width>
        where
            Layout: Get<K, $width>,
        {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, batch, answers, room, .. } = self;
                stream::<K, S, A, $width>(simd, structure, batch, answers, room);
            }
        }

        impl<'a, A: Answers<'a>> Kernel for Packs<'a, '_, A, $width> {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, rays, answers, group, rest } = self;
                for first in (0..rays.len()).step_by(GROUP) {
                    packet::run::<Plain, S, A, $width>(
                        simd, structure, rays, first, answers, group, rest,
                    );
                }
            }
        })*
    };
}

widths! { 8 16 }

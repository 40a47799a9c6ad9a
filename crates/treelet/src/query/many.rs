//! Closest and any for slices of rays, as streams of one octant each.

use super::{any, closest};
use crate::geometry::Hit;
use crate::math::Ray;
use crate::simd::{Kernel, Simd};
use crate::trace::stream::{Answers, BATCH, Room, stream};
use crate::trace::structure::{Layout, Structure};
use alloc::vec::Vec;

/// Octants: the signs of three components.
const OCTANTS: usize = 8;

/// Rays that are sorted by octant at once.
const PIECE: usize = 16_384;

/// Slices shorter than this are asked ray by ray.
const MANY: usize = 64;

/// [`closest::closest`] for each ray.
pub(crate) fn closest_many(structure: &Structure, rays: &[Ray], hits: &mut [Hit]) {
    let room = if rays.len() < MANY { None } else { Room::new(rays.len()).ok() };
    let Some(mut room) = room else {
        for (ray, out) in rays.iter().zip(hits) {
            *out = closest::closest(structure, ray).unwrap_or(Hit::MISS);
        }
        return;
    };
    for (rays, hits) in rays.chunks(PIECE).zip(hits.chunks_mut(PIECE)) {
        hits.fill(Hit::MISS);
        streams(structure, rays, &mut closest::Many { hits }, &mut room);
    }
}

/// [`any::any`] for each ray.
pub(crate) fn any_many(structure: &Structure, rays: &[Ray], answers: &mut [bool]) {
    let room = if rays.len() < MANY { None } else { Room::new(rays.len()).ok() };
    let Some(mut room) = room else {
        for (ray, out) in rays.iter().zip(answers) {
            *out = any::any(structure, ray);
        }
        return;
    };
    for (rays, answers) in rays.chunks(PIECE).zip(answers.chunks_mut(PIECE)) {
        answers.fill(false);
        streams(structure, rays, &mut any::Many { answers }, &mut room);
    }
}

/// Sorts the rays by octant and walks each octant in batches.
fn streams<'a, A: Answers<'a>>(
    structure: &'a Structure,
    rays: &[Ray],
    answers: &mut A,
    room: &mut Room,
) {
    let mut octants: [Vec<u32>; OCTANTS] = Default::default();
    for (slot, ray) in rays.iter().enumerate() {
        if ray.is_valid() {
            let [x, y, z] = ray.direction.map(|d| usize::from(d.is_sign_negative()));
            octants[x | y << 1 | z << 2].push(slot as u32);
        }
    }
    for slots in octants.iter().flat_map(|octant| octant.chunks(BATCH)) {
        match structure.layout {
            Layout::Wide8(_) => {
                let batch = Batch::<A, 8> { structure, rays, slots, answers, room };
                structure.level.run(batch);
            }
            Layout::Wide16(_) => {
                let batch = Batch::<A, 16> { structure, rays, slots, answers, room };
                structure.level.run(batch);
            }
        }
    }
}

/// A walk of many rays through nodes of `W` children.
struct Batch<'a, 'b, A, const W: usize> {
    structure: &'a Structure,
    rays: &'b [Ray],
    slots: &'b [u32],
    answers: &'b mut A,
    room: &'b mut Room,
}

macro_rules! widths {
    ($($width:literal)*) => {
        $(impl<'a, A: Answers<'a>> Kernel for Batch<'a, '_, A, $width> {
            type Output = ();

            #[inline(always)]
            fn run<S: Simd>(self, simd: S) {
                let Self { structure, rays, slots, answers, room } = self;
                stream::<S, A, $width>(simd, structure, rays, slots, answers, room);
            }
        })*
    };
}

widths! { 8 16 }

//! Packets at a leaf: one triangle after the other against 16 rays.

use super::super::leaf::Leaf;
use super::super::record::{RAYS, T_MAX, bundle};
use super::super::stream::Answers;
use super::super::structure::Structure;
use super::super::walk::Found;
use super::Walk;
use super::group::{PACKETS, Packet};
use crate::layout::wide::LEAF_MAX;
use crate::math::Ray;
use crate::simd::{Kernel, Simd};

/// Tests the rays of some packets against the triangles of a leaf.
pub(super) struct AtLeaf<'a, 'w, 'x, A> {
    pub(super) walk: &'x mut Walk<'a, 'w, A>,
    pub(super) leaf: Leaf<'x>,
    /// A bit each.
    pub(super) packets: u32,
    /// Of each of them, a bit a ray.
    pub(super) lanes: u32,
}

/// A triangle of a leaf.
#[derive(Clone, Copy)]
struct Triangle {
    corners: [[f32; 3]; 3],
    id: u32,
}

impl<'a, A: Answers<'a>> Kernel for AtLeaf<'a, '_, '_, A> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { walk, leaf, packets, lanes } = self;
        let mut triangles = [Triangle { corners: [[0.0; 3]; 3], id: 0 }; LEAF_MAX];
        let triangles = &mut triangles[..leaf.count.min(LEAF_MAX)];
        for (i, triangle) in triangles.iter_mut().enumerate() {
            *triangle = Triangle { corners: leaf.corners(i), id: leaf.id(i) };
        }
        let mut rest = packets;
        while rest != 0 {
            let number = rest.trailing_zeros() as usize % PACKETS;
            rest &= rest - 1;
            let Some(packet) = walk.group.packets.get(number) else { return };
            // Hits that were found since may hide the whole leaf.
            let bundle = bundle(walk.class, &packet.columns, &packet.along);
            let meets = bundle.meets(simd, &leaf.bounds, &packet.columns[T_MAX]);
            let lanes = lanes & packet.alive & meets;
            if lanes == 0 {
                continue;
            }
            let changed = if A::NEAREST_FIRST {
                nearest(simd, walk, triangles, number, lanes)
            } else {
                any(simd, walk, triangles, number, lanes)
            };
            if changed {
                walk.group.spreads.t_max[number] = walk.group.packets[number].t_max(simd);
            }
        }
    }
}

/// Keeps the nearest hits of a packet's rays; says whether there are new ones.
#[inline(always)]
fn nearest<'a, S: Simd, A: Answers<'a>>(
    simd: S,
    walk: &mut Walk<'a, '_, A>,
    triangles: &[Triangle],
    number: usize,
    lanes: u32,
) -> bool {
    let packet = &mut walk.group.packets[number];
    let mut t_max = packet.columns[T_MAX];
    let mut changed = false;
    for triangle in triangles {
        let bundle = bundle(walk.class, &packet.columns, &packet.along);
        let met = bundle.hit(simd, &triangle.corners, lanes, &t_max);
        let Some(met) = met else { continue };
        let mask = visible(walk.structure, walk.rays, &packet.slots, triangle.id, met.mask);
        changed |= mask != 0;
        let Packet { u, v, id, .. } = &mut *packet;
        for lane in 0..RAYS {
            // Hits beyond `t_max` are none; at the very same `t`, the smallest id is the answer.
            let later = met.t[lane] == t_max[lane] && triangle.id > id[lane];
            if mask >> lane & 1 != 0 && !later {
                t_max[lane] = met.t[lane];
                u[lane] = met.u[lane];
                v[lane] = met.v[lane];
                id[lane] = triangle.id;
            }
        }
    }
    packet.columns[T_MAX] = t_max;
    changed
}

/// Answers for those of a packet's rays that hit anything; says whether some do.
#[inline(always)]
fn any<'a, S: Simd, A: Answers<'a>>(
    simd: S,
    walk: &mut Walk<'a, '_, A>,
    triangles: &[Triangle],
    number: usize,
    mut lanes: u32,
) -> bool {
    let packet = &mut walk.group.packets[number];
    let mut changed = false;
    for &Triangle { ref corners, id } in triangles {
        let bundle = bundle(walk.class, &packet.columns, &packet.along);
        let met = bundle.any(simd, corners, lanes, &packet.columns[T_MAX], walk.group.tame);
        let mut mask = visible(walk.structure, walk.rays, &packet.slots, id, met);
        changed |= mask != 0;
        lanes &= !mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % RAYS;
            mask &= mask - 1;
            // Nothing matters any more to a ray with a hit.
            packet.columns[T_MAX][lane] = f32::NEG_INFINITY;
            let found = Found { t: 0.0, u: 0.0, v: 0.0, id, inst: 0, structure: walk.structure };
            walk.answers.put(packet.slots[lane] as usize, Some(found));
        }
        if lanes == 0 {
            break;
        }
    }
    changed
}

/// Those lanes of `mask` whose rays see a triangle.
#[inline(always)]
fn visible(
    structure: &Structure,
    rays: &[Ray],
    slots: &[u32; RAYS],
    id: u32,
    mut mask: u32,
) -> u32 {
    if structure.unmasked {
        return mask;
    }
    for lane in 0..RAYS {
        let ray = &rays[slots[lane] as usize];
        if mask >> lane & 1 != 0 && !structure.sees(id, ray.mask) {
            mask &= !(1 << lane);
        }
    }
    mask
}

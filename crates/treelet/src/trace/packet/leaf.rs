//! A packet at a leaf.

use super::super::leaf::Leaf;
use super::super::record::{Class, RAYS, T_MAX, bundle};
use super::super::stream::Answers;
use super::super::structure::Structure;
use super::super::walk::Found;
use super::group::{Group, Packet};
use crate::math::Ray;
use crate::simd::{Kernel, Simd};

/// Tests the rays of one packet against the triangles of a leaf.
pub(super) struct AtLeaf<'a, 'w, A> {
    pub(super) structure: &'a Structure,
    pub(super) class: Class,
    pub(super) rays: &'w [Ray],
    pub(super) answers: &'w mut A,
    pub(super) group: &'w mut Group,
    pub(super) leaf: Leaf<'w>,
    pub(super) packet: usize,
    /// The rays of it.
    pub(super) lanes: u32,
}

impl<'a, A: Answers<'a>> Kernel for AtLeaf<'a, '_, A> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { structure, class, rays, answers, group, leaf, packet: number, lanes } = self;
        let tame = group.tame;
        let Some(packet) = group.packets.get_mut(number) else { return };
        let Packet { columns, along, slots, u, v, id, .. } = packet;
        let mut t_max = columns[T_MAX];
        let bundle = bundle(class, columns, along);
        // Hits that were found since may hide the whole leaf.
        let mut lanes = lanes & bundle.meets(simd, &leaf.bounds, &t_max);
        super::add(11,1); if lanes!=0 {super::add(12,1);} let mut changed = false;
        for triangle in 0..leaf.count {
            if lanes == 0 {
                break;
            }
            let corners = leaf.corners(triangle);
            let name = leaf.id(triangle);
            let seen = |mut mask: u32| {
                if !structure.unmasked {
                    for lane in 0..RAYS {
                        let ray = &rays[slots[lane] as usize];
                        if mask >> lane & 1 != 0 && !structure.sees(name, ray.mask) {
                            mask &= !(1 << lane);
                        }
                    }
                }
                mask
            };
            if A::NEAREST_FIRST {
                let Some(met) = bundle.hit(simd, &corners, lanes, &t_max) else { continue }; 
                let mask = seen(met.mask);
                changed |= mask != 0;
                for lane in 0..RAYS {
                    let tie = met.t[lane] == t_max[lane] && name > id[lane];
                    if mask >> lane & 1 != 0 && !tie {
                        t_max[lane] = met.t[lane];
                        u[lane] = met.u[lane];
                        v[lane] = met.v[lane];
                        id[lane] = name;
                    }
                }
            } else {
                let mut mask = seen(bundle.any(simd, &corners, lanes, &t_max, tame));
                changed |= mask != 0;
                lanes &= !mask;
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize % RAYS;
                    mask &= mask - 1;
                    t_max[lane] = f32::NEG_INFINITY;
                    let found = Found { t: 0.0, u: 0.0, v: 0.0, id: name, inst: 0, structure };
                    answers.keep(slots[lane] as usize, found);
                }
            }
        }
        if changed {
            columns[T_MAX] = t_max;
            group.spreads.t_max[number] = packet.t_max();
        }
    }
}

//! Rays in Embree's forms: one, eight or sixteen at a time.
//!
//! A trace writes `t_far` and the ids anew for every ray, then asks Embree: that is what a caller
//! has to do between two queries of the same rays, and it is timed. Lanes of the last packet that
//! have no ray are switched off.

use std::ffi::c_int;
use std::marker::PhantomData;

use super::interface::{
    Arguments, Functions, Handle, Hit1, Hit8, Hit16, INVALID_ID, Ray1, Ray8, Ray16, RayHit1,
    RayHit8, RayHit16,
};
use crate::engine::{Answer, Call, Pass, Question};
use treelet::Ray;

/// The scene, and rays that it is asked about.
struct Batch<'a, P> {
    functions: Functions,
    scene: Handle,
    arguments: Arguments,
    packets: Vec<P>,
    /// The ends of the rays, which a trace overwrites.
    t_max: Vec<f32>,
    /// The scene is borrowed as long as the batch lives.
    borrowed: PhantomData<&'a [Ray]>,
}

// SAFETY: the scene may be traced from every thread, and the arguments hold null pointers only.
unsafe impl<P: Send> Send for Batch<'_, P> {}

/// The pass for a call; a width that Embree is not asked for here is taken for 1.
pub(super) fn pass<'a>(
    functions: Functions,
    scene: Handle,
    call: Call,
    question: Question,
    rays: &'a [Ray],
) -> Box<dyn Pass + 'a> {
    macro_rules! batch {
        ($packet:ty, $width:literal) => {
            Box::new(Batch::<'a, $packet> {
                functions,
                scene,
                arguments: Arguments::new(call.coherent),
                packets: rays.chunks($width).map(<$packet>::new).collect(),
                t_max: rays.iter().map(|ray| ray.t_max).collect(),
                borrowed: PhantomData,
            })
        };
    }
    match (question, call.width) {
        (Question::Closest, 8) => batch!(RayHit8, 8),
        (Question::Closest, 16) => batch!(RayHit16, 16),
        (Question::Closest, _) => batch!(RayHit1, 1),
        (Question::Any, 8) => batch!(Ray8, 8),
        (Question::Any, 16) => batch!(Ray16, 16),
        (Question::Any, _) => batch!(Ray1, 1),
    }
}

/// Which of a packet's lanes are asked about: aligned as Embree wants it for any width.
#[repr(C, align(64))]
struct Valid([c_int; 16]);

impl Valid {
    fn first(count: usize) -> Self {
        let mut lanes = [0; 16];
        lanes[..count.min(16)].fill(-1);
        Self(lanes)
    }
}

/// The passes of one width.
macro_rules! passes {
    ($ray:ident $hit:ident $ray_hit:ident, $width:literal, $intersect:expr, $occluded:expr) => {
        impl $ray {
            /// At most as many rays as the packet is wide; other lanes repeat the first.
            fn new(rays: &[Ray]) -> Self {
                let lane = |lane: usize| rays.get(lane).unwrap_or(&rays[0]);
                let axis = |pick: &dyn Fn(&Ray) -> f32| std::array::from_fn(|l| pick(lane(l)));
                Self {
                    origin: [0, 1, 2].map(|a| axis(&|ray| ray.origin[a])),
                    t_near: axis(&|ray| ray.t_min),
                    direction: [0, 1, 2].map(|a| axis(&|ray| ray.direction[a])),
                    time: axis(&|ray| ray.time),
                    t_far: axis(&|ray| ray.t_max),
                    mask: [u32::MAX; $width],
                    id: [0; $width],
                    flags: [0; $width],
                }
            }
        }

        impl $ray_hit {
            fn new(rays: &[Ray]) -> Self {
                let hit = $hit {
                    normal: [[0.0; $width]; 3],
                    u: [0.0; $width],
                    v: [0.0; $width],
                    prim: [INVALID_ID; $width],
                    geom: [INVALID_ID; $width],
                    inst: [INVALID_ID; $width],
                    inst_prim: [INVALID_ID; $width],
                };
                Self { ray: $ray::new(rays), hit }
            }
        }

        impl Pass for Batch<'_, $ray_hit> {
            fn trace(&mut self) {
                for (packet, t_max) in self.packets.iter_mut().zip(self.t_max.chunks($width)) {
                    packet.ray.t_far[..t_max.len()].copy_from_slice(t_max);
                    packet.hit.geom = [INVALID_ID; $width];
                    packet.hit.prim = [INVALID_ID; $width];
                    $intersect(
                        &self.functions,
                        t_max.len(),
                        self.scene,
                        packet,
                        &mut self.arguments,
                    );
                }
            }

            fn answers(&self, answers: &mut Vec<Answer>) {
                for (packet, t_max) in self.packets.iter().zip(self.t_max.chunks($width)) {
                    answers.extend((0..t_max.len()).map(|lane| {
                        if packet.hit.geom[lane] == INVALID_ID {
                            Answer::MISS
                        } else {
                            Answer {
                                t: packet.ray.t_far[lane],
                                prim: packet.hit.prim[lane],
                                // No instance is the largest number, and becomes 0.
                                inst: packet.hit.inst[lane].wrapping_add(1),
                            }
                        }
                    }));
                }
            }
        }

        impl Pass for Batch<'_, $ray> {
            fn trace(&mut self) {
                for (packet, t_max) in self.packets.iter_mut().zip(self.t_max.chunks($width)) {
                    packet.t_far[..t_max.len()].copy_from_slice(t_max);
                    $occluded(
                        &self.functions,
                        t_max.len(),
                        self.scene,
                        packet,
                        &mut self.arguments,
                    );
                }
            }

            fn answers(&self, answers: &mut Vec<Answer>) {
                for (packet, t_max) in self.packets.iter().zip(self.t_max.chunks($width)) {
                    // Embree sets the end of an occluded ray to minus infinity.
                    let hit = |lane: usize| packet.t_far[lane] == f32::NEG_INFINITY;
                    answers.extend((0..t_max.len()).map(|lane| Answer::any(hit(lane))));
                }
            }
        }
    };
}

/// Calls a function for packets.
macro_rules! packet_call {
    ($function:ident) => {
        |functions: &Functions, count: usize, scene, packet, arguments: &mut Arguments| {
            let valid = Valid::first(count);
            // SAFETY: scene, packet and arguments are live, laid out and aligned as Embree wants
            // them, and nobody else has the packet.
            unsafe { (functions.$function)(valid.0.as_ptr(), scene, packet, arguments) }
        }
    };
}

/// Calls a function for single rays.
macro_rules! single_call {
    ($function:ident) => {
        |functions: &Functions, _: usize, scene, packet, arguments: &mut Arguments| {
            // SAFETY: as for packets.
            unsafe { (functions.$function)(scene, packet, arguments) }
        }
    };
}

passes!(Ray1 Hit1 RayHit1, 1, single_call!(intersect1), single_call!(occluded1));
passes!(Ray8 Hit8 RayHit8, 8, packet_call!(intersect8), packet_call!(occluded8));
passes!(Ray16 Hit16 RayHit16, 16, packet_call!(intersect16), packet_call!(occluded16));

//! What happens where a leaf holds an instance.

use super::counters::Count;
use super::structure::{Get, Layout};
use super::walk::{FRAMES_NEAR, Frame};
use crate::layout::packing::Packing;
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::memory::Stack;
use crate::simd::{Kernel, Simd};

/// A leaf with an instance: the level inside is entered, if the ray has business there.
pub(super) struct InstanceLeaf<'a, 'd, 's, K: Packing<W>, C, const W: usize> {
    /// The level that the leaf is on; the one inside, afterwards.
    pub(super) frame: &'d mut Frame<'a, K, W>,
    /// The levels outside.
    pub(super) frames: &'d mut Stack<'s, Frame<'a, K, W>, FRAMES_NEAR>,
    /// Which instance, or which part of one.
    pub(super) at: usize,
    pub(super) ray: &'d Ray,
    /// The greatest `t` that matters.
    pub(super) t_max: f32,
    pub(super) counters: &'d mut C,
}

impl<K, C, const W: usize> Kernel for InstanceLeaf<'_, '_, '_, K, C, W>
where
    K: Packing<W>,
    C: Count,
    Layout: Get<K, W>,
{
    /// Where the walk inside begins; [`Child::NONE`] if it does not.
    type Output = Child;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Child {
        let Self { frame, frames, at, ray, t_max, counters } = self;
        let (at, start) = frame.structure.instances.entry(at);
        let instance = frame.structure.instances.at(at);
        if instance.mask & ray.mask == 0 {
            return Child::NONE;
        }
        let moved;
        let corners = match &instance.motion {
            None => &instance.corners,
            Some(motion) => {
                moved = motion.corners(ray.time);
                &moved
            }
        };
        let inside = frame.ray.slab.interval_of_lanes(simd, corners);
        let clip = inside.intersection(&frame.ray.clip);
        if clip.is_empty() || clip.entry > t_max || clip.exit < ray.t_min {
            return Child::NONE;
        }
        let structure = &*instance.structure;
        let turned;
        let columns = match &instance.motion {
            None => &instance.columns,
            Some(motion) => {
                let Some(columns) = motion.columns(ray.time) else { return Child::NONE };
                turned = columns;
                &turned
            }
        };
        let Some(inner) = frame.ray.enter(simd, columns, clip, structure) else {
            return Child::NONE;
        };
        // Building refuses instances of another layout.
        let Some(wide) = structure.layout_at(ray.time).get() else { return Child::NONE };
        counters.instance();
        let inst = frame.inst + instance.rank;
        frames.push(*frame);
        *frame = Frame { structure, wide, ray: inner, inst };
        start.unwrap_or(wide.root)
    }
}

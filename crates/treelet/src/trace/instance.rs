//! What happens where a leaf holds an instance.
//!
//! What was tried here, on a courtyard of 49,847 instances, 1.5 to 5 of them entered by a ray: to ask for the record of the
//! instance that waits on top of the stack, and for the lines of the node inside before the ray is transformed. Neither is
//! worth 3 %, but for random rays without opened instances (6 % for the record).

use super::counters::Count;
use super::placements::Instance;
use super::prepared::Prepared;
use super::structure::{Get, Layout};
use super::walk::{FRAMES_NEAR, Frame};
use crate::bounds::Interval;
use crate::layout::packing::Packing;
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::memory::Levels;
use crate::simd::{Function, Simd};
use core::marker::PhantomData;

/// A leaf with an instance, or with a part of one: the level inside is entered, if the ray has business there.
///
/// Its arguments: the levels of the walk, and the depth of the one that the leaf is on; the ray, and the greatest `t` that
/// matters; which instance, or which part; the counters. It gives where the walk inside begins, or [`Child::NONE`]; the level
/// inside then stands at the next depth.
pub(super) struct InstanceLeaf<'a, 'd, K, C, const W: usize>(PhantomData<(&'d &'a K, &'d C)>);

impl<'a: 'd, 'd, K, C, const W: usize> Function for InstanceLeaf<'a, 'd, K, C, W>
where
    K: Packing<W>,
    C: Count,
    Layout: Get<K, W>,
{
    type A = (&'d mut Levels<Frame<'a, K, W>, FRAMES_NEAR>, usize);
    type B = (&'d Ray, f32);
    type C = usize;
    type D = &'d mut C;
    type Output = Child;

    #[inline(always)]
    fn run<S: Simd>(
        simd: S,
        (levels, depth): Self::A,
        (ray, t_max): Self::B,
        number: usize,
        counters: Self::D,
    ) -> Child {
        let Some(outer) = levels.get(depth) else { return Child::NONE };
        let (at, start) = outer.structure.instances.entry(number);
        // Parts of one instance often come one after the other.
        if outer.entered == at
            && let Some(inner) = levels.get(depth + 1)
        {
            return start.unwrap_or(inner.wide.root);
        }
        let instance = outer.structure.instances.at(at);
        if instance.mask & ray.mask == 0 {
            return Child::NONE;
        }
        let Some(prepared) = enter(simd, &outer.ray, instance, ray, t_max) else {
            return Child::NONE;
        };
        let structure = &*instance.structure;
        // Building refuses instances of another layout.
        let Some(wide) = structure.layout_at(ray.time).get() else { return Child::NONE };
        counters.instance();
        let inst = outer.inst + instance.rank;
        levels.set(depth + 1, Frame { structure, wide, ray: prepared, inst, entered: usize::MAX });
        if let Some(outer) = levels.get_mut(depth) {
            outer.entered = at;
        }
        start.unwrap_or(wide.root)
    }
}

/// The ray inside an instance; `None` if it has no business there.
#[inline(always)]
fn enter<S: Simd>(
    simd: S,
    outside: &Prepared,
    instance: &Instance,
    ray: &Ray,
    t_max: f32,
) -> Option<Prepared> {
    let structure = &*instance.structure;
    let Some(motion) = &instance.motion else {
        let mut inside = outside.enter(simd, &instance.columns, structure)?;
        // Nodes asked for the box. What it clamps, where anything may be clamped, is
        // derived in `trace/slack.rs` to be nothing here.
        let clamps = !(outside.triangle.is_ordinary() & inside.triangle.is_ordinary());
        if clamps | !structure.flat {
            inside.clip = clip(simd, outside, &instance.corners, ray, t_max)?;
        }
        return Some(inside);
    };
    let clip = clip(simd, outside, &motion.corners(ray.time), ray, t_max)?;
    let mut inside = outside.enter(simd, &motion.columns(ray.time)?, structure)?;
    inside.clip = clip;
    Some(inside)
}

/// Where the box of an instance, and those outside it, allow a hit.
#[inline(always)]
fn clip<S: Simd>(
    simd: S,
    outside: &Prepared,
    corners: &[[f32; 4]; 2],
    ray: &Ray,
    t_max: f32,
) -> Option<Interval> {
    let inside = outside.slab.interval_of_lanes(simd, corners);
    let clip = inside.intersection(&outside.clip);
    let is_met = !clip.is_empty() && clip.entry <= t_max && clip.exit >= ray.t_min;
    is_met.then_some(clip)
}

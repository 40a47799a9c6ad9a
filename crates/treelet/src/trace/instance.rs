//! What happens where a leaf holds an instance.
//!
//! What was tried here, on a courtyard of 49,847 instances, 1.5 to 5 of them entered by a ray: to ask for the record of the
//! instance that waits on top of the stack, and for the lines of the node inside before the ray is transformed. Neither is
//! worth 3 %, but for random rays without opened instances (6 % for the record).
//!
//! What counts is waiting. A ray prepared in registers and copied to its level waits until the parts have left
//! the store buffer: written where it stays instead, rays of a camera take 102 ns in place of 118, shadow rays 77 in place of 89.
//! Keeping the last level entered for the next part of the same instance, testing a leaf without going a level down, and
//! asking for clamps only where they may do something took them from 177 and 134 ns to 118 and 89. What made no
//! difference: what a ray reads of a level in three cache lines instead of five; planes measured from near and far origins, so that
//! the way into a level need not ask the direction first; no compress instruction for children that are alone.

use super::counters::Count;
use super::placements::Instance;
use super::prepared::Prepared;
use super::structure::{Get, Layout};
use super::walk::{FRAMES_NEAR, Frame, NOBODY};
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
        let blank =
            |&outer: &Frame<'a, K, W>| Frame { ray: Prepared::BLANK, entered: NOBODY, ..outer };
        let Some((outer, inner)) = levels.pair(depth, blank) else { return Child::NONE };
        let (at, start) = outer.structure.instances.entry(number);
        // Parts of one instance often come one after the other.
        if outer.entered == at {
            return start.unwrap_or(inner.wide.root);
        }
        let instance = outer.structure.instances.at(at);
        if instance.mask & ray.mask == 0 {
            return Child::NONE;
        }
        outer.entered = NOBODY;
        if !enter(simd, &outer.ray, instance, ray, t_max, &mut inner.ray) {
            return Child::NONE;
        }
        let structure = &*instance.structure;
        // Building refuses instances of another layout.
        let Some(wide) = structure.layout_at(ray.time).get() else { return Child::NONE };
        counters.instance();
        inner.structure = structure;
        inner.wide = wide;
        inner.inst = outer.inst + instance.rank;
        inner.entered = NOBODY;
        outer.entered = at;
        start.unwrap_or(wide.root)
    }
}

/// Makes `inside` the ray inside an instance; says whether it has business there.
#[inline(always)]
fn enter<S: Simd>(
    simd: S,
    outside: &Prepared,
    instance: &Instance,
    ray: &Ray,
    t_max: f32,
    inside: &mut Prepared,
) -> bool {
    let moved;
    let columns = match &instance.motion {
        None => &instance.columns,
        Some(motion) => {
            let Some(columns) = motion.columns(ray.time) else { return false };
            moved = columns;
            &moved
        }
    };
    let structure = &*instance.structure;
    if !outside.enter(simd, columns, structure, inside) {
        return false;
    }

    // Nodes asked for the box, but for one that moves. What it clamps, where nothing but triangles may be clamped, is
    // derived in `trace/slack.rs` to be nothing.
    let ordinary = outside.triangle.is_ordinary() & inside.triangle.is_ordinary();
    if structure.flat & ordinary & instance.motion.is_none() {
        return true;
    }
    inside.clip = clip(outside, instance, ray.time);
    let Interval { entry, exit } = inside.clip;
    entry <= exit && entry <= t_max && ray.t_min <= exit
}

/// Where the box of an instance, and those outside it, allow a hit. Out of line: it is rarely asked.
#[inline(never)]
fn clip(outside: &Prepared, instance: &Instance, time: f32) -> Interval {
    let bounds = match &instance.motion {
        None => instance.bounds(),
        Some(motion) => motion.bounds(time),
    };
    outside.slab.interval(&bounds).intersection(&outside.clip)
}

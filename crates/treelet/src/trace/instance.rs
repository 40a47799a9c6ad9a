//! What happens where leaves hold instances.

use super::counters::Count;
use super::pending::Pending;
use super::structure::{Get, Layout};
use super::walk::Frame;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, LEAF_MAX};
use crate::math::Ray;
use crate::simd::{Kernel, Simd};
use core::marker::PhantomData;

/// What a leaf of instances makes of the walk.
pub(super) enum Opened<'a, K: Packing<W>, P, const W: usize> {
    /// Leaves of one each, to be stacked.
    Several([P; LEAF_MAX], usize),
    /// The level inside.
    One(Frame<'a, K, W>),
}

/// A leaf of instances: one is entered, several become leaves of one each.
pub(super) struct InstanceLeaf<'a, 'd, K: Packing<W>, P, C, const W: usize> {
    pub(super) frame: &'d Frame<'a, K, W>,
    pub(super) first: usize,
    pub(super) count: usize,
    pub(super) ray: &'d Ray,
    /// The greatest `t` that matters.
    pub(super) t_max: f32,
    pub(super) counters: &'d mut C,
    pub(super) pending: PhantomData<P>,
}

impl<'a, K, P, C, const W: usize> Kernel for InstanceLeaf<'a, '_, K, P, C, W>
where
    K: Packing<W>,
    P: Pending,
    C: Count,
    Layout: Get<K, W>,
{
    type Output = Opened<'a, K, P, W>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Opened<'a, K, P, W> {
        let Self { frame, first, count, ray, t_max, counters, .. } = self;
        let at = first - frame.wide.triangles;
        let mut several = [Pending::new(Child::END, 0); LEAF_MAX];
        let mut len = 0;
        if count == 1 {
            if let Some(inner) = enter(simd, frame, at, ray, t_max) {
                counters.instance();
                return Opened::One(inner);
            }
            return Opened::Several(several, 0);
        }
        counters.leaf(0);
        for at in at..at + count {
            let instance = frame.structure.leaf_instance(at);
            if instance.mask & ray.mask == 0 {
                continue;
            }
            let inside = frame.ray.slab.interval(&instance.bounds);
            if inside.is_empty() {
                counters.box_culls(1);
            } else if inside.entry > t_max || inside.exit < ray.t_min {
                counters.t_culls(1);
            } else if let Some(place) = several.get_mut(len) {
                let child = Child::leaf(frame.wide.triangles + at, 1);
                *place = Pending::new(child, inside.entry.to_bits());
                len += 1;
            }
        }
        Opened::Several(several, len)
    }
}
/// The level inside an instance, if the ray has business there.
#[inline(always)]
fn enter<'a, K: Packing<W>, S: Simd, const W: usize>(
    simd: S,
    frame: &Frame<'a, K, W>,
    at: usize,
    ray: &Ray,
    t_max: f32,
) -> Option<Frame<'a, K, W>>
where
    Layout: Get<K, W>,
{
    let instance = frame.structure.leaf_instance(at);
    if instance.mask & ray.mask == 0 {
        return None;
    }
    let clip = frame.ray.slab.interval(&instance.bounds).intersection(&frame.ray.clip);
    if clip.is_empty() || clip.entry > t_max || clip.exit < ray.t_min {
        return None;
    }
    let inner = &*instance.structure;
    let ray = frame.ray.enter(simd, &instance.object_from_world, clip, inner)?;
    // Building refuses instances of another layout.
    let wide = inner.layout.get()?;
    Some(Frame { structure: inner, wide, ray, inst: frame.inst + instance.rank })
}
